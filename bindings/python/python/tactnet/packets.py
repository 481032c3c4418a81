"""Packets of tactnet. Generated from serving/skin/src/packets.rs; do not edit."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, ClassVar

import numpy as np

from tactnet._packet import Packet

__all__ = ["Packet", "MAX_TAXELS", "MAX_MATERIALS", "Command", "Stage", "Verdict", "Event", "SkinFrame", "SweepCommand", "TactileBelief", "Counters", "TactileStatus", "ModelNames"]

MAX_TAXELS = 1024
"""Most taxels of a frame."""

MAX_MATERIALS = 64
"""Most materials of a classifier that serves."""


class Command(IntEnum):
    """Kind of a SweepCommand."""

    START = 1
    """The finger starts to move; the next frame is the first of the sweep."""
    STOP = 2
    """The finger has stopped."""
    RESET = 3
    """The next sweep belongs to another object; the fused sweeps are discarded."""
    ENROLL = 4
    """Enroll a new material from the most recent sweeps."""
    ADAPT = 5
    """Adapt the model to the most recent sweeps of all fingers, which must be of mixed materials."""


class Stage(IntEnum):
    """Stage of a prediction."""

    ANYTIME = 1
    """Prediction during a sweep."""
    PLAIN = 2
    """Prediction of a complete sweep, without dropout."""
    DROPOUT = 3
    """Prediction of a complete sweep with Monte Carlo dropout. If the service has masks, this prediction
    is fused."""


class Verdict(IntEnum):
    """Verdict on whether the material is known."""

    NOT_TOLD = 0
    """The classifier is not calibrated, or has not decided yet."""
    KNOWN = 1
    """The material is one of the trained materials."""
    UNKNOWN = 2
    """The material is none of the trained materials."""


class Event(IntEnum):
    """Kind of event of the service."""

    ALIVE = 0
    """No event; the packet carries counters only."""
    BEGUN = 1
    """A sweep started."""
    CLASSIFIED = 2
    """A sweep was classified."""
    REJECTED = 3
    """A sweep was rejected; the text gives the reason."""
    RESET = 4
    """The fused sweeps were discarded."""
    REFUSED = 5
    """A command was refused; the text gives the reason."""
    SWAPPED = 6
    """Another model serves from now on."""
    MODEL_REJECTED = 7
    """A new model was refused; the text gives the reason."""
    ENROLLED = 8
    """A new material was enrolled; the text names it."""
    UNREACHABLE = 9
    """A component cannot be reached; the text gives the reason."""
    LIKE = 10
    """The sweeps of this object, the newest of which the packet names, are like the training data; the
    text gives p-values."""
    OTHER_BLOCK = 11
    """They differ from the training data no more than its recording blocks differ from one another."""
    UNLIKE = 12
    """They are unlike the training data; the text says what differs."""
    MASKED = 13
    """Other taxels are masked as dead from now on; the text names them."""
    ADAPTED = 14
    """The model was adapted to recent sweeps; the text says by how much."""


@dataclass
class SkinFrame(Packet):
    """One frame of a finger's skin."""

    NAME: ClassVar[str] = "SkinFrame"
    VERSION: ClassVar[int] = 2
    DTYPE: ClassVar[np.dtype] = np.dtype([
        ("sequence", "<u8"),
        ("sensor_time_ns", "<u8"),
        ("taxels", "<u4"),
        ("reserved", "<u4"),
        ("digits", ("<f4", (1024,))),
    ])
    COUNTED_BY: ClassVar[dict[str, str]] = {"digits": "taxels"}

    sequence: int = 0
    """Number of the frame since the sensor started; a gap is a lost frame."""
    sensor_time_ns: int = 0
    """Measurement time by the sensor's clock, in ns."""
    taxels: int = 0
    """Number of valid taxels."""
    reserved: int = 0
    """Always zero."""
    digits: Any = ()
    """Taxel values in digits, row by row; unused entries are zero."""


@dataclass
class SweepCommand(Packet):
    """A command of the motion controller or a person."""

    NAME: ClassVar[str] = "SweepCommand"
    VERSION: ClassVar[int] = 1
    DTYPE: ClassVar[np.dtype] = np.dtype([
        ("kind", "<u4"),
        ("finger", "<u4"),
        ("motion", "<u8"),
        ("sweeps", "<u4"),
        ("reserved", "<u4"),
        ("material", "S56"),
    ])
    COUNTED_BY: ClassVar[dict[str, str]] = {}

    kind: int = 0
    """The command; see Command."""
    finger: int = 0
    """Index of the finger in the service's table, from 0."""
    motion: int = 0
    """Number of the motion, which the beliefs repeat."""
    sweeps: int = 0
    """For Command Enroll and Command Adapt: number of most recent complete sweeps to use."""
    reserved: int = 0
    """Always zero."""
    material: str = ""
    """For Command Enroll: name of the new material. For Command Start: the material under the finger, if
    known. It is recorded; the classifier ignores it."""


@dataclass
class TactileBelief(Packet):
    """A prediction of the material."""

    NAME: ClassVar[str] = "TactileBelief"
    VERSION: ClassVar[int] = 2
    DTYPE: ClassVar[np.dtype] = np.dtype([
        ("sweep", "<u8"),
        ("motion", "<u8"),
        ("model_version", "<u8"),
        ("last_frame", "<u8"),
        ("latency_ns", "<u8"),
        ("stage", "<u4"),
        ("finger", "<u4"),
        ("frames", "<u4"),
        ("filled_in", "<u4"),
        ("materials", "<u4"),
        ("label", "<u4"),
        ("verdict", "<u4"),
        ("entropy", "<f4"),
        ("strangeness", "<f4"),
        ("threshold", "<f4"),
        ("fused_sweeps", "<u4"),
        ("fused_label", "<u4"),
        ("fused_entropy", "<f4"),
        ("fused_verdict", "<u4"),
        ("posterior", ("<f4", (64,))),
        ("fused", ("<f4", (64,))),
        ("reserved_end", ("<u8", (3,))),
    ])
    COUNTED_BY: ClassVar[dict[str, str]] = {"posterior": "materials", "fused": "materials"}

    sweep: int = 0
    """Number of the sweep since the service started, from 1."""
    motion: int = 0
    """Number of the motion from the command; 0 without a command."""
    model_version: int = 0
    """Version of the model."""
    last_frame: int = 0
    """Sequence number of the newest frame used."""
    latency_ns: int = 0
    """Delay between the sending of that frame and the sending of this packet, in ns."""
    stage: int = 0
    """Stage of the prediction; see Stage."""
    finger: int = 0
    """Index of the finger."""
    frames: int = 0
    """Number of frames of the window used."""
    filled_in: int = 0
    """Number of interpolated frames among them."""
    materials: int = 0
    """Number of valid materials."""
    label: int = 0
    """Label of the most probable material of this sweep."""
    verdict: int = 0
    """Verdict of this sweep; see Verdict."""
    entropy: float = 0.0
    """Entropy of posterior, in nats."""
    strangeness: float = 0.0
    """Novelty score of the sweep; undefined without a verdict."""
    threshold: float = 0.0
    """Threshold for the novelty score."""
    fused_sweeps: int = 0
    """Number of sweeps in fused. If 0, fused is uniform."""
    fused_label: int = 0
    """Label of the most probable material of the fused sweeps."""
    fused_entropy: float = 0.0
    """Entropy of fused, in nats."""
    fused_verdict: int = 0
    """Verdict of the object, from the mean novelty score of its complete sweeps; see Verdict."""
    posterior: Any = ()
    """Probabilities given this sweep alone; unused entries are zero."""
    fused: Any = ()
    """Probabilities given all fused sweeps; unused entries are zero."""
    reserved_end: Any = ()
    """Always zero."""


@dataclass
class Counters(Packet):
    """Counters of the service, since its start."""

    NAME: ClassVar[str] = "Counters"
    VERSION: ClassVar[int] = 0
    DTYPE: ClassVar[np.dtype] = np.dtype([
        ("frames", "<u8"),
        ("dropped_frames", "<u8"),
        ("beliefs", "<u8"),
        ("sweeps", "<u8"),
        ("rejected", "<u8"),
        ("unknown", "<u8"),
        ("deadline_misses", "<u8"),
        ("worst_delay_ns", "<u8"),
        ("allocations", "<u8"),
    ])
    COUNTED_BY: ClassVar[dict[str, str]] = {}

    frames: int = 0
    """Number of received frames."""
    dropped_frames: int = 0
    """Number of frames that were sent but not received."""
    beliefs: int = 0
    """Number of beliefs sent."""
    sweeps: int = 0
    """Number of complete sweeps classified."""
    rejected: int = 0
    """Number of rejected sweeps."""
    unknown: int = 0
    """Number of complete sweeps of unknown materials."""
    deadline_misses: int = 0
    """Number of predictions that missed their deadline."""
    worst_delay_ns: int = 0
    """Maximum time from the sending of a frame to the end of its processing, in ns."""
    allocations: int = 0
    """Number of allocations of the frame thread while it processed frames."""


@dataclass
class TactileStatus(Packet):
    """An event of the service, with its counters."""

    NAME: ClassVar[str] = "TactileStatus"
    VERSION: ClassVar[int] = 1
    DTYPE: ClassVar[np.dtype] = np.dtype([
        ("event", "<u4"),
        ("finger", "<u4"),
        ("sweep", "<u8"),
        ("motion", "<u8"),
        ("model_version", "<u8"),
        ("counters", Counters.DTYPE),
        ("text", "S192"),
    ])
    COUNTED_BY: ClassVar[dict[str, str]] = {}

    event: int = 0
    """The event; see Event."""
    finger: int = 0
    """Index of the finger."""
    sweep: int = 0
    """Number of the sweep."""
    motion: int = 0
    """Number of the motion."""
    model_version: int = 0
    """Version of the serving model."""
    counters: Counters = field(default_factory=Counters)
    """Counters since the service started."""
    text: str = ""
    """One line of text for people."""


@dataclass
class ModelNames(Packet):
    """Materials and shape of the serving model."""

    NAME: ClassVar[str] = "ModelNames"
    VERSION: ClassVar[int] = 1
    DTYPE: ClassVar[np.dtype] = np.dtype([
        ("version", "<u8"),
        ("sample_rate_hz", "<f8"),
        ("steps", "<u4"),
        ("rows", "<u4"),
        ("cols", "<u4"),
        ("mc_samples", "<u4"),
        ("materials", "<u4"),
        ("reserved", "<u4"),
        ("names", ("S64", (64,))),
    ])
    COUNTED_BY: ClassVar[dict[str, str]] = {"names": "materials"}

    version: int = 0
    """Version of the model."""
    sample_rate_hz: float = 0.0
    """Sample rate, in frames per second."""
    steps: int = 0
    """Number of frames in a window."""
    rows: int = 0
    """Number of taxel rows."""
    cols: int = 0
    """Number of taxel columns."""
    mc_samples: int = 0
    """Number of Monte Carlo dropout masks."""
    materials: int = 0
    """Number of valid materials."""
    reserved: int = 0
    """Always zero."""
    names: list[str] = field(default_factory=list)
    """Names of the materials, by label."""
