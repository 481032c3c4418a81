"""Recordings."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _tactnet
from ._dataset import Dataset


@dataclass(frozen=True)
class Packet:
    """A packet of a recording that is no frame."""

    channel: str
    time_ns: int
    """When it was put, nanoseconds since 1970."""
    content: dict[str, Any]
    """In words, as ``tactnet channel echo --json`` prints packets; beliefs with their whole posteriors."""


class Recording:
    """An MCAP file of ``tactnet record``, in memory; read as far as it goes."""

    def __init__(self, path: Any):
        self._native = _tactnet.Recording.read(path)

    @property
    def fingers(self) -> list[str]:
        """Channels with skin frames."""
        return self._native.fingers

    def frames(self, finger: str | None = None) -> dict[str, np.ndarray]:
        """Returns the frames of a finger: ``sequence``, ``time_ns``, ``sensor_time_ns`` ``(frames,)`` and ``digits`` ``(frames, taxels)``.

        finger: a channel; None: the first one with frames.
        """
        sequence, time_ns, sensor_time_ns, digits = self._native.frames(finger)
        return {"sequence": sequence, "time_ns": time_ns, "sensor_time_ns": sensor_time_ns, "digits": digits}

    def packets(self) -> list[Packet]:
        """Returns commands, beliefs, events and models, in the order of their times."""
        return [Packet(channel, time_ns, json.loads(text)) for channel, time_ns, text in self._native.packets_json()]

    def beliefs(self) -> list[dict[str, Any]]:
        """Returns the beliefs, each with ``time_ns``, in the order of their times; ``pandas.json_normalize`` makes a table of them."""
        return [
            {"time_ns": packet.time_ns, **packet.content}
            for packet in self.packets()
            if packet.content["type"] == "TactileBelief"
        ]

    def sweeps(self, material: str | None = None, **settings: Any) -> Dataset:
        """Cuts the frames into sweeps as the online classifier does, with the materials of their start commands.

        material: of sweeps whose command names none.
        settings: ``steps``, ``rate_hz``, ``rows_cols`` where the recording does not say.
        """
        return Dataset(self._native.sweeps(material, **settings))

    @property
    def cut(self) -> str | None:
        """Why the rest is missing, or None."""
        return self._native.cut

    def __len__(self) -> int:
        return len(self._native)
