"""Bridge to ROS 2 over DDS: publishes beliefs, receives frames and commands.

    python -m tactnet.ros2 --table robot.toml            needs a running hub and classifier, and `pip install cyclonedds`

| topic | type | direction |
|---|---|---|
| `/tactile/material` | `std_msgs/msg/String` | material of a complete sweep, or `unknown` |
| `/tactile/belief` | `std_msgs/msg/String` | every belief as JSON, see `tactnet.channel.BeliefPort.get` |
| `/<channel of a finger>` | `sensor_msgs/msg/Image` | frames of a skin, `32FC1`, `16UC1` or `8UC1`, stamped with the time of the measurement |
| `/sweep/command` | `std_msgs/msg/String` | `start [MOTION [MATERIAL]]`, `stop`, `reset`, `enroll SWEEPS MATERIAL`, `adapt SWEEPS` |
"""

# No `from __future__ import annotations`: Cyclone DDS reads the types of fields at run time.
import argparse
import json
import os
import signal
import sys
import threading
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import TactnetError, channel

try:
    from cyclonedds.idl import IdlStruct
    from cyclonedds.idl.types import int32, sequence, uint8, uint32
except ImportError as missing:  # pragma: no cover
    raise ImportError("tactnet.ros2 needs `pip install cyclonedds`") from missing

LOOPBACK = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces></General>'
    '<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>'
)
"""Cyclone DDS settings that restrict it to this machine."""


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    """``std_msgs/msg/String``"""

    data: str


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """``builtin_interfaces/msg/Time``"""

    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """``std_msgs/msg/Header``"""

    stamp: Time
    frame_id: str


@dataclass
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    """``sensor_msgs/msg/Image``"""

    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


ENCODINGS = {"32FC1": "f4", "16UC1": "u2", "mono16": "u2", "8UC1": "u1", "mono8": "u1"}


def digits_of(image: Image) -> np.ndarray:
    """Returns the taxels of an image, row by row; raises ``ValueError`` for other images."""
    kind = ENCODINGS.get(image.encoding)
    if kind is None:
        raise ValueError(f"encoding: expected one of {', '.join(ENCODINGS)}, found {image.encoding!r}")
    dtype = np.dtype(kind).newbyteorder(">" if image.is_bigendian else "<")
    row = image.width * dtype.itemsize
    data = np.frombuffer(bytes(image.data), np.uint8)
    if image.step < row or len(data) < image.height * image.step:
        raise ValueError(f"data: expected {image.height} rows of at least {row} bytes, found {len(data)} bytes in rows of {image.step}")
    rows = data[: image.height * image.step].reshape(image.height, image.step)[:, :row]
    return np.ascontiguousarray(rows).view(dtype).astype(np.float32).reshape(-1)


def put_command(port: channel.CommandPort, text: str) -> None:
    """Puts the command in ``text``; raises ``ValueError`` for other texts."""
    words = text.split()
    match words:
        case ["start"]:
            port.start()
        case ["start", motion, *material] if motion.isdigit():
            port.start(motion=int(motion), material=" ".join(material))
        case ["stop"]:
            port.stop()
        case ["reset"]:
            port.reset()
        case ["enroll", sweeps, first, *rest] if sweeps.isdigit():
            port.enroll(" ".join([first, *rest]), int(sweeps))
        case ["adapt", sweeps] if sweeps.isdigit():
            port.adapt(int(sweeps))
        case _:
            raise ValueError(f"expected `start [MOTION [MATERIAL]]`, `stop`, `reset`, `enroll SWEEPS MATERIAL` or `adapt SWEEPS`, found {text[:80]!r}")


class Bridge:
    """Forwards packets between a bus and the topics of a DDS domain until stopped."""

    def __init__(self, bus: channel.Bus, domain: int = 0, prefix: str = ""):
        from cyclonedds.core import Policy, Qos
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic
        from cyclonedds.util import duration

        # The defaults of ROS 2; best effort also accepts frames of best-effort drivers.
        reliable = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(10))
        best_effort = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(256))
        self._participant = DomainParticipant(domain)
        topic = lambda name, kind: Topic(self._participant, f"rt{prefix}/{name}", kind)  # noqa: E731
        self._material = DataWriter(self._participant, topic("tactile/material", String), qos=reliable)
        self._belief = DataWriter(self._participant, topic("tactile/belief", String), qos=reliable)
        self._beliefs, self._commands = bus.beliefs(), bus.commands()
        self._command_reader = DataReader(self._participant, topic("sweep/command", String), qos=reliable)
        self._fingers = [
            (bus.skin(number), DataReader(self._participant, topic(name, Image), qos=best_effort))
            for number, name in enumerate(bus.fingers)
        ]
        self._stop = threading.Event()
        self._hub_is_gone = False
        self.frames = self.beliefs = self.refused = 0

    def run(self) -> None:
        """Forwards packets until ``stop``. Refused messages are counted, and the first ten are reported."""
        threads = [threading.Thread(target=self._frames, args=finger, daemon=True) for finger in self._fingers]
        threads.append(threading.Thread(target=self._take_commands, daemon=True))
        for thread in threads:
            thread.start()
        while not self._stop.is_set():
            belief = self._next_belief()
            if belief is None:
                continue
            self.beliefs += 1
            self._belief.write(String(json.dumps(belief)))
            if belief["stage"] != "anytime":
                sweep = belief["sweep_says"]
                self._material.write(String("unknown" if sweep["verdict"] == "unknown" else sweep["material"]))
        for thread in threads:
            thread.join()

    def _next_belief(self) -> dict[str, Any] | None:
        """Returns the next belief; None after a while, and while no hub runs, since a new one takes over."""
        try:
            belief = self._beliefs.get(timeout=0.1)
            self._hub_is_gone = False
            return belief
        except TactnetError as reason:
            if not self._hub_is_gone:
                print(f"warning: {reason}; waiting for a new one", file=sys.stderr, flush=True)
            self._hub_is_gone = True
            self._stop.wait(0.1)
            return None

    def stop(self) -> None:
        """Ends ``run``."""
        self._stop.set()

    def _taken(self, reader: Any) -> Any:
        from cyclonedds.util import duration

        while not self._stop.is_set():
            yield from reader.take_iter(timeout=duration(milliseconds=100))

    def _refuse(self, what: str, reason: Exception) -> None:
        self.refused += 1
        if self.refused <= 10:
            print(f"warning: {what}: {reason}", file=sys.stderr, flush=True)

    def _frames(self, port: channel.SkinPort, reader: Any) -> None:
        for image in self._taken(reader):
            try:
                stamp = image.header.stamp
                port.put(digits_of(image), sensor_time_ns=stamp.sec * 10**9 + stamp.nanosec)
                self.frames += 1
            except (ValueError, TactnetError) as reason:
                self._refuse("frame", reason)

    def _take_commands(self) -> None:
        for command in self._taken(self._command_reader):
            try:
                put_command(self._commands, command.data)
            except (ValueError, TactnetError) as reason:
                self._refuse("command", reason)


def main() -> int:
    """Runs the bridge until Ctrl-C or SIGTERM."""
    parser = argparse.ArgumentParser(
        prog="python -m tactnet.ros2", description=__doc__.split("\n\n")[0], formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="Examples:\n  python -m tactnet.ros2 --table robot.toml\n  ros2 topic echo /tactile/material std_msgs/msg/String",
    )
    parser.add_argument("--table", required=True, metavar="FILE", help="the hub's table of channels")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID") or 0), metavar="N", help="ROS_DOMAIN_ID (default: %(default)s)")
    parser.add_argument("--prefix", default="", metavar="NAME", help="namespace of the topics, like /left_hand")
    parser.add_argument("--network", action="store_true", help="communicate with other machines, which can then put frames and commands")
    arguments = parser.parse_args()
    if not arguments.network:
        os.environ.setdefault("CYCLONEDDS_URI", LOOPBACK)
    try:
        bridge = Bridge(channel.Bus(arguments.table), arguments.domain, "/" + arguments.prefix.strip("/") if arguments.prefix else "")
    except TactnetError as reason:
        print(f"error: {reason}", file=sys.stderr)
        return 1
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: bridge.stop())
    print("ready", flush=True)
    bridge.run()
    print(f"{bridge.frames} frames and {bridge.beliefs} beliefs forwarded, {bridge.refused} messages refused", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
