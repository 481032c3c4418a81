"""Recordings of channels."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _tactnet
from ._dataset import Dataset


@dataclass(frozen=True)
class Packet:
    """A packet of a recording, except frames."""

    channel: str
    time_ns: int
    """Time of the put, in nanoseconds since 1970."""
    content: dict[str, Any]
    """Fields by name; beliefs also have their complete posteriors."""
    sender: int | None = None
    """Number of the put-port that the packet came from, as ``sender`` of received packets; None in recordings that do not tell."""


class Recording:
    """A recording of channels (MCAP file), in memory. Incomplete files are read up to their damage."""

    def __init__(self, path: Any):
        self._native = _tactnet.Recording.read(path)

    @property
    def fingers(self) -> list[str]:
        """Channels with skin frames."""
        return self._native.fingers

    def frames(self, finger: str | None = None) -> dict[str, np.ndarray]:
        """Returns the frames of a finger: ``sequence``, ``time_ns``, ``sensor_time_ns`` ``(frames,)`` and ``digits`` ``(frames, taxels)``.

        finger: id of a channel; None: the first one with frames.
        """
        sequence, time_ns, sensor_time_ns, digits = self._native.frames(finger)
        return {"sequence": sequence, "time_ns": time_ns, "sensor_time_ns": sensor_time_ns, "digits": digits}

    def packets(self) -> list[Packet]:
        """Returns commands, beliefs, events and models, ordered by time."""
        return [
            Packet(channel, time_ns, json.loads(text), sender)
            for channel, time_ns, sender, text in self._native.packets_json()
        ]

    def beliefs(self) -> list[dict[str, Any]]:
        """Returns the beliefs, each with ``time_ns``, ordered by time. ``pandas.json_normalize`` turns them into a table."""
        return [
            {"time_ns": packet.time_ns, **packet.content}
            for packet in self.packets()
            if packet.content["type"] == "TactileBelief"
        ]

    def sweeps(self, material: str | None = None, **settings: Any) -> Dataset:
        """Cuts the frames into sweeps like the online classifier, labelled with the materials of their start commands.

        material: label of sweeps whose command names none.
        settings: ``steps``, ``rate_hz``, ``rows_cols``, for recordings without a model.
        """
        return Dataset(self._native.sweeps(material, **settings))

    @property
    def cut(self) -> str | None:
        """Reason why the end of the recording is missing, or None."""
        return self._native.cut

    def __len__(self) -> int:
        return len(self._native)
