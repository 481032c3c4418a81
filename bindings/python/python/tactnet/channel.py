"""The robot's channels: puts frames and commands, gets beliefs.

>>> with Hub(bus="lab") as hub:                                 # on a robot the hub is a separate program
...     with Bus(hub.table) as bus:
...         skin, beliefs = bus.skin(), bus.beliefs()
...         skin.put(digits)                                    # (taxels,), written in place in shared memory
...         belief = beliefs.get(timeout=1.0)                   # a dict, or None                     # doctest: +SKIP

``with`` closes a bus or a port at the end; otherwise it closes when nothing refers to it. ``get`` raises TactnetError once no hub holds the bus. A
process that is forked from one with a bus opens its own.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from typing import Any, AsyncIterator, Generic, Iterator, TypeVar

import numpy as np

from . import _tactnet
from ._packet import Packet
from ._tactnet import Hub, TactnetError

__all__ = ["BeliefPort", "Bus", "CommandPort", "GetPort", "Hub", "PutPort", "SkinPort"]

P = TypeVar("P", bound=Packet)
C = TypeVar("C", bound="_Closing")


class _Closing:
    """A bus or a port, which can be closed."""

    def __init__(self, native: Any):
        self._open = native

    @property
    def _native(self) -> Any:
        if self._open is None:
            raise TactnetError(f"this {type(self).__name__} is closed")
        return self._open

    def close(self) -> None:
        """Closes it; a second call does nothing. Other threads that wait at a port end their wait first."""
        self._open = None

    def __enter__(self: C) -> C:
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()


class SkinPort(_Closing):
    """Puts the frames of one finger."""

    def put(self, digits: Any, sequence: int | None = None, sensor_time_ns: int | None = None) -> None:
        """Puts a frame.

        digits: taxels in row-major order, at most 1024. If the network expects another number, the classifier rejects the sweep and
            reports it on ``tactile/status``.
        sequence: number of the frame, where a gap counts as lost frames; None: one more than the last.
        sensor_time_ns: time of the measurement by the sensor's clock; None: now.
        """
        digits = np.ascontiguousarray(digits, dtype=np.float32).reshape(-1)
        self._native.put(digits, sequence, sensor_time_ns)


class CommandPort(_Closing):
    """Puts sweep commands, like a motion controller."""

    def start(self, finger: int = 0, motion: int = 0, material: str = "") -> None:
        """Starts a sweep with the next frame.

        material: material under the finger, if known. It is recorded; the classifier ignores it.
        """
        self._native.put("start", finger, motion, 0, material)

    def stop(self, finger: int = 0, motion: int = 0) -> None:
        """Ends the sweep."""
        self._native.put("stop", finger, motion)

    def reset(self, finger: int = 0) -> None:
        """Announces that the next sweep is of another object."""
        self._native.put("reset", finger)

    def enroll(self, material: str, sweeps: int, finger: int = 0) -> None:
        """Learns a material from the newest complete sweeps. Raises TactnetError for a name of more than 56 bytes, as :meth:`start` does."""
        self._native.put("enroll", finger, 0, sweeps, material)

    def adapt(self, sweeps: int, finger: int = 0) -> None:
        """Adapts the model to the newest complete sweeps of all fingers, which must be of mixed materials."""
        self._native.put("adapt", finger, 0, sweeps)


class BeliefPort(_Closing):
    """Gets beliefs; also iterates over them, and asynchronously."""

    def get(self, timeout: float | None = None) -> dict[str, Any] | None:
        """Waits for the next belief; returns None after ``timeout`` seconds.

        A belief is a dict: ``stage`` (``anytime`` during a sweep, ``plain`` after it, ``dropout`` after it as a mean over dropout masks),
        ``provisional`` (true during a sweep, while the result may change), ``frames`` of ``sweep_frames``, ``sweep_says`` and
        ``object_says`` with ``material``, ``probability`` and ``verdict``, ``posterior`` and ``fused`` in the order of ``materials``,
        ``latency_ms``, ``sender`` and ``put_ns`` (put-port and time of the put, as of a packet).

        Raises TactnetError once no hub holds the bus and no belief is left.
        """
        found = self._native.get_json(timeout)
        return None if found is None else json.loads(found)

    async def get_async(self, timeout: float | None = None) -> dict[str, Any] | None:
        """Like ``get``, in a thread, so that the event loop is not blocked."""
        return await asyncio.to_thread(self.get, timeout)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        while True:
            belief = self.get()
            if belief is not None:
                yield belief

    async def __aiter__(self) -> AsyncIterator[dict[str, Any]]:
        while True:
            # Short waits, so that the thread of a cancelled task ends soon.
            belief = await self.get_async(0.1)
            if belief is not None:
                yield belief

    @property
    def lost(self) -> int:
        """Number of lost packets."""
        return self._native.lost


class PutPort(_Closing, Generic[P]):
    """Puts packets of one type into a channel."""

    def __init__(self, native: _tactnet.RawPutPort, packet: type[P]):
        super().__init__(native)
        self._packet = packet

    def put(self, *packets: P) -> int:
        """Puts one or more items as one packet. Returns the number of get-ports that have it."""
        for packet in packets:
            if not isinstance(packet, self._packet):
                raise TypeError(f"expected {self._packet.__name__}, found {type(packet).__name__}")
        return self._native.put(b"".join(packet.to_bytes() for packet in packets))

    @property
    def losses(self) -> dict[int, int]:
        """Packets that get-ports have lost because they took them too slowly, by the ``number`` of the get-port."""
        return self._native.losses()


class GetPort(_Closing, Generic[P]):
    """Gets packets of one type from a channel; also iterates over them, and asynchronously."""

    def __init__(self, native: _tactnet.RawGetPort, packet: type[P]):
        super().__init__(native)
        self._packet = packet
        self._waiting: deque[P] = deque()

    def get(self, timeout: float | None = None) -> P | None:
        """Waits for the next packet, which has ``sender`` and ``put_ns``; returns None after ``timeout`` seconds.

        Raises TactnetError once no hub holds the bus and no packet is left.
        """
        if not self._waiting:
            found = self._native.get(timeout)
            if found is None:
                return None
            items, sender, put_ns = found
            size = self._packet.DTYPE.itemsize
            packets = (self._packet.from_bytes(items[at : at + size]) for at in range(0, len(items), size))
            self._waiting.extend(packet.received(sender, put_ns) for packet in packets)
        return self._waiting.popleft() if self._waiting else None

    async def get_async(self, timeout: float | None = None) -> P | None:
        """Like ``get``, in a thread, so that the event loop is not blocked."""
        return await asyncio.to_thread(self.get, timeout)

    def __iter__(self) -> Iterator[P]:
        while True:
            packet = self.get()
            if packet is not None:
                yield packet

    async def __aiter__(self) -> AsyncIterator[P]:
        while True:
            packet = await self.get_async(0.1)
            if packet is not None:
                yield packet

    @property
    def number(self) -> int:
        """Number of this port in the ``losses`` of put-ports."""
        return self._native.number

    @property
    def lost(self) -> int:
        """Number of packets that were put since the port was opened, and were lost."""
        return self._native.lost


class Bus(_Closing):
    """Access to the channels that a hub holds.

    table: path of the hub's table, or its text as TOML.
    """

    def __init__(self, table: str):
        super().__init__(_tactnet.Bus(str(table)))

    @property
    def fingers(self) -> list[str]:
        """Ids of the channels of skin frames, indexed by finger."""
        return self._native.fingers

    def skin(self, finger: int = 0) -> SkinPort:
        """Returns a port that puts the frames of one finger."""
        return SkinPort(self._native.skin(finger))

    def commands(self) -> CommandPort:
        """Returns a port that puts sweep commands."""
        return CommandPort(self._native.commands())

    def put_port(self, channel: str, packet: type[P], priority: str | None = None) -> PutPort[P]:
        """Returns a port that puts packets of a type of ``tactnet.packets``, or of a custom one, into a channel.

        priority: ``"bulk"``, ``"normal"``, ``"high"`` or ``"real-time"``; urgent packets are delivered before bulk that waits. None: the
            priority of the channel in the table.
        """
        native = self._native.put_port(channel, packet.NAME, packet.VERSION, packet.DTYPE.itemsize, priority)
        return PutPort(native, packet)

    def get_port(self, channel: str, packet: type[P], history: int = 0) -> GetPort[P]:
        """Returns a port that gets packets of a type from a channel.

        history: number of earlier packets to get from every sender, if the channel keeps them.
        """
        native = self._native.get_port(channel, packet.NAME, packet.VERSION, packet.DTYPE.itemsize, history)
        return GetPort(native, packet)

    def create_channel(
        self, channel: str, packet: type[Packet], *, items: int = 1, depth: int = 16, put_ports: int = 1, get_ports: int = 8, history: int = 0
    ) -> None:
        """Creates a channel that is not in the table, for as long as the bus exists; other programs of this host open it by its id.

        The numbers are those of a channel in the table. A channel of this id must not exist.
        """
        kind = packet.NAME, packet.VERSION, packet.DTYPE.itemsize
        self._native.create_channel(channel, *kind, items=items, depth=depth, put_ports=put_ports, get_ports=get_ports, history=history)

    def beliefs(self) -> BeliefPort:
        """Returns a port that gets beliefs."""
        return BeliefPort(self._native.beliefs())
