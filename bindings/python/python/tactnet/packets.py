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
    """The request of a SweepCommand."""

    START = 1
    """The finger begins to move; the next frame is the first of the sweep."""
    STOP = 2
    """The finger has stopped."""
    RESET = 3
    """The next sweep is of another object: forget what was fused."""
    ENROLL = 4
    """Learn a new material from the newest sweeps."""


class Stage(IntEnum):
    """How far a prediction is."""

    ANYTIME = 1
    """Of a sweep that is going on."""
    PLAIN = 2
    """Of a whole sweep, without dropout."""
    DROPOUT = 3
    """Of a whole sweep, by Monte Carlo dropout; this is the one that is fused, where the service has
    masks."""


class Verdict(IntEnum):
    """Known material or not."""

    NOT_TOLD = 0
    """The classifier cannot tell, or not yet."""
    KNOWN = 1
    """It is one of the materials."""
    UNKNOWN = 2
    """It is none of them."""


class Event(IntEnum):
    """An event of the service."""

    ALIVE = 0
    """Nothing; counters only."""
    BEGUN = 1
    """A sweep began."""
    CLASSIFIED = 2
    """A sweep was classified."""
    REJECTED = 3
    """A sweep cannot be used; the text says why."""
    RESET = 4
    """The fused sweeps were forgotten."""
    REFUSED = 5
    """A command cannot be followed; the text says why."""
    SWAPPED = 6
    """Another model serves from now on."""
    MODEL_REJECTED = 7
    """A new model cannot serve; the text says why."""
    ENROLLED = 8
    """A new material was learnt; the text names it."""
    UNREACHABLE = 9
    """A component cannot be reached; the text says why."""


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
    """Time of the measurement by the sensor's clock, nanoseconds."""
    taxels: int = 0
    """Number of taxels that are valid."""
    reserved: int = 0
    """Zero."""
    digits: Any = ()
    """Digits, row by row; the rest is zero."""


@dataclass
class SweepCommand(Packet):
    """A wish of the motion controller or a person."""

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
    """See Command."""
    finger: int = 0
    """Number of the finger, from 0, in the order of the service's table."""
    motion: int = 0
    """Number of the motion; comes back with beliefs."""
    sweeps: int = 0
    """For Command Enroll: number of sweeps to take, the newest that were complete."""
    reserved: int = 0
    """Zero."""
    material: str = ""
    """For Command Enroll: name of the new material; for Command Start: what is swept over, where that is
    known (it is recorded, the classifier does not look)."""


@dataclass
class TactileBelief(Packet):
    """A belief about the material."""

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
    """Number of the motion, as commanded; 0 if nobody commanded."""
    model_version: int = 0
    """Version of the model."""
    last_frame: int = 0
    """Sequence of the newest frame that was used."""
    latency_ns: int = 0
    """From that frame's put to this packet's, nanoseconds."""
    stage: int = 0
    """See Stage."""
    finger: int = 0
    """Number of the finger."""
    frames: int = 0
    """Frames of the window that were used."""
    filled_in: int = 0
    """How many of them were interpolated."""
    materials: int = 0
    """Number of materials that are valid."""
    label: int = 0
    """Most probable material of this sweep."""
    verdict: int = 0
    """See Verdict."""
    entropy: float = 0.0
    """Entropy of posterior, nats."""
    strangeness: float = 0.0
    """How strange the sweep is; meaningless without a verdict."""
    threshold: float = 0.0
    """What it was compared with."""
    fused_sweeps: int = 0
    """Number of sweeps in fused; 0: it is flat."""
    fused_label: int = 0
    """Most probable material of the fused sweeps."""
    fused_entropy: float = 0.0
    """Entropy of fused, nats."""
    fused_verdict: int = 0
    """Whether the object is known, given the mean strangeness of its whole sweeps; see Verdict."""
    posterior: Any = ()
    """Probabilities given this sweep alone; the rest is zero."""
    fused: Any = ()
    """Probabilities given all fused sweeps; the rest is zero."""
    reserved_end: Any = ()
    """Zero."""


@dataclass
class Counters(Packet):
    """Counters of the service."""

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
    """Frames that came."""
    dropped_frames: int = 0
    """Frames that were put and never came."""
    beliefs: int = 0
    """Beliefs that were put."""
    sweeps: int = 0
    """Whole sweeps classified."""
    rejected: int = 0
    """Sweeps that were rejected."""
    unknown: int = 0
    """Whole sweeps of unknown materials."""
    deadline_misses: int = 0
    """Predictions that took longer than promised."""
    worst_delay_ns: int = 0
    """Longest time from a frame's put until the service had dealt with it, nanoseconds."""
    allocations: int = 0
    """Allocations of the thread that follows frames, while it followed them."""


@dataclass
class TactileStatus(Packet):
    """Events and counters of the service."""

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
    """See Event."""
    finger: int = 0
    """Number of the finger."""
    sweep: int = 0
    """Number of the sweep."""
    motion: int = 0
    """Number of the motion."""
    model_version: int = 0
    """Version of the model that serves."""
    counters: Counters = field(default_factory=Counters)
    """Since the service started."""
    text: str = ""
    """For people, one line."""


@dataclass
class ModelNames(Packet):
    """The materials of the model that serves."""

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
    """Frames per second."""
    steps: int = 0
    """Frames of a window."""
    rows: int = 0
    """Rows of taxels."""
    cols: int = 0
    """Columns of taxels."""
    mc_samples: int = 0
    """Monte Carlo dropout masks."""
    materials: int = 0
    """Number of materials that are valid."""
    reserved: int = 0
    """Zero."""
    names: list[str] = field(default_factory=list)
    """Their names."""
