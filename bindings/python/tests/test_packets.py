"""Comparison of packets with those of Rust, and exchange on real channels.

    TACTNET=target/release/tactnet PACKET_BYTES=target/release/examples/packet_bytes python -m pytest bindings/python/tests
"""

import asyncio
import os
import subprocess
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from tactnet import channel, packets


def known():
    """Returns the packets of bindings/c/examples/packet_bytes.rs."""
    digits = np.zeros(packets.MAX_TAXELS, np.float32)
    digits[[0, 1, -1]] = 1.5, -0.25, 3.0
    # All values are given, including those after the valid ones.
    frame = packets.SkinFrame(sequence=1, sensor_time_ns=0x0102030405060708, digits=digits)
    command = packets.SweepCommand(kind=packets.Command.ENROLL, finger=1, motion=9, sweeps=3, material="grüner Filz")
    fused = np.zeros(packets.MAX_MATERIALS)
    fused[-1] = 1.0
    belief = packets.TactileBelief(
        sweep=1, motion=2, model_version=3, last_frame=4, latency_ns=5, stage=packets.Stage.DROPOUT, finger=6, frames=7, filled_in=8,
        label=1, verdict=packets.Verdict.UNKNOWN, entropy=0.5, strangeness=0.75, threshold=1.25, fused_sweeps=9, fused_label=1,
        fused_entropy=2.5, fused_verdict=packets.Verdict.KNOWN, posterior=[0.0, 1.0], fused=fused,
    )
    counters = packets.Counters(frames=5, worst_delay_ns=6, allocations=7)
    status = packets.TactileStatus(
        event=packets.Event.UNREACHABLE, finger=1, sweep=2, motion=3, model_version=4, counters=counters, text="one line"
    )
    names = packets.ModelNames(version=1, sample_rate_hz=750.0, steps=1000, rows=4, cols=4, mc_samples=50, names=["felt", "cork"])
    return [frame, command, belief, status, names]


def test_bytes_are_those_of_rust():
    program = os.environ["PACKET_BYTES"]
    lines = subprocess.run([program], check=True, capture_output=True, text=True).stdout.splitlines()
    for packet, line in zip(known(), lines, strict=True):
        name, size, content = line.split()
        data = bytearray(packet.to_bytes())
        assert (packet.NAME, packet.DTYPE.itemsize, len(data)) == (name, int(size), int(size))
        if name == "SkinFrame":
            # Rust marks two of the values as valid.
            assert data[16:18] == (1024).to_bytes(2, "little")
            data[16:18] = (2).to_bytes(2, "little")
        assert data.hex() == content, name
        back = type(packet).from_bytes(bytes.fromhex(content))
        if name in ("SweepCommand", "TactileStatus", "ModelNames"):
            packet.materials = getattr(packet, "names", None) and 2
            assert {**vars(back), "materials": None} == {**vars(packet), "materials": None}
        elif name == "SkinFrame":
            assert back.digits.tolist() == [1.5, -0.25] and back.taxels == 2


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="at most 1024 values, found 1025"):
        packets.SkinFrame(digits=np.zeros(1025)).to_bytes()
    with pytest.raises(ValueError, match="at most 56 bytes, found 57"):
        packets.SweepCommand(material="x" * 57).to_bytes()
    with pytest.raises(ValueError, match="sequence: expected 0 to"):
        packets.SkinFrame(sequence=-1).to_bytes()
    with pytest.raises(ValueError, match="expected 80 bytes, found 79"):
        packets.SweepCommand.from_bytes(bytes(79))


@dataclass
class Joint(packets.Packet):
    """A custom packet."""

    NAME: ClassVar[str] = "Joint"
    VERSION: ClassVar[int] = 1
    DTYPE: ClassVar[np.dtype] = np.dtype([("position", "<f8"), ("torque", "<f8")])
    COUNTED_BY: ClassVar[dict] = {}
    position: float = 0.0
    torque: float = 0.0


def test_any_packet_travels_on_a_channel(tmp_path):
    table = tmp_path / "arm.toml"
    table.write_text(
        f'bus = "arm{os.getpid()}"\n[channels.joints]\npacket = "Joint"\nversion = 1\nitem_bytes = 16\nitems = 7\nhistory = 1\n'
        '[channels."sweep/command"]\npacket = "SweepCommand"\nversion = 1\nitem_bytes = 80\n'
    )
    with channel.Hub(table):
        bus = channel.Bus(str(table))
        put, get = bus.put_port("joints", Joint), bus.get_port("joints", Joint)
        assert get.get(timeout=0.01) is None
        assert put.put(Joint(0.5, 2.0), Joint(-0.5, 1.0)) == 1
        assert get.get(timeout=1.0) == Joint(0.5, 2.0) and get.get(timeout=1.0) == Joint(-0.5, 1.0) and get.lost == 0
        put.put(*[Joint(float(n)) for n in range(7)])
        assert [packet.position for _, packet in zip(range(7), get)] == list(range(7))

        async def first():
            async for packet in late:
                return packet

        # A new get-port receives the history with the next put.
        late = bus.get_port("joints", Joint, history=1)
        put.put(Joint(9.0))
        assert asyncio.run(first()) == Joint(0.0)
        with pytest.raises(ValueError, match="at most 7 items in a packet, found 8"):
            put.put(*[Joint()] * 8)
        with pytest.raises(TypeError, match="expected Joint, found SweepCommand"):
            put.put(packets.SweepCommand())
        with pytest.raises(ValueError, match="expected packets of `SweepCommand`"):
            bus.get_port("sweep/command", Joint)


def joint_bus(tmp_path, name, more=""):
    """Returns a hub with a channel of joints."""
    table = tmp_path / f"{name}.toml"
    table.write_text(f'bus = "{name}{os.getpid()}"\n[channels.joints]\npacket = "Joint"\nitem_bytes = 16\ndepth = 4\nput_ports = 2\n{more}')
    return channel.Hub(table)


def taken(port):
    return [packet.position for packet in iter(lambda: port.get(timeout=0.05), None)]


def test_urgent_packets_overtake_waiting_bulk(tmp_path):
    with joint_bus(tmp_path, "urgent", 'priority = "bulk"\n') as hub, channel.Bus(hub.table) as bus:
        get = bus.get_port("joints", Joint)
        # Without a priority, that of the table.
        bulk, urgent = bus.put_port("joints", Joint), bus.put_port("joints", Joint, priority="real-time")
        for number in range(3):
            bulk.put(Joint(float(number)))
        urgent.put(Joint(100.0))
        assert taken(get) == [100.0, 0.0, 1.0, 2.0]
        with pytest.raises(ValueError, match="expected `bulk`, `normal`, `high` or `real-time`, found `urgent`"):
            bus.put_port("joints", Joint, priority="urgent")


def test_a_putter_knows_who_lost_how_many(tmp_path):
    with joint_bus(tmp_path, "losses") as hub, channel.Bus(hub.table) as bus:
        slow, put, fast = bus.get_port("joints", Joint), bus.put_port("joints", Joint), bus.get_port("joints", Joint)
        for number in range(10):
            put.put(Joint(float(number)))
            assert fast.get(timeout=5).position == number
        assert put.losses == {slow.number: slow.lost} and slow.lost > 0 and fast.lost == 0 and slow.number != fast.number
        assert taken(slow) == list(range(slow.lost, 10))


def test_a_channel_is_created_at_run_time(tmp_path):
    with joint_bus(tmp_path, "created") as hub, channel.Bus(hub.table) as bus, channel.Bus(hub.table) as other:
        bus.create_channel("own/reply", Joint, items=2, history=1)
        put = bus.put_port("own/reply", Joint)
        put.put(Joint(1.0), Joint(2.0))
        assert taken(other.get_port("own/reply", Joint, history=1)) == [1.0, 2.0]
        with pytest.raises(ValueError, match="own/reply"):
            other.create_channel("own/reply", Joint)
        with pytest.raises(ValueError, match="expected packets of `Joint`"):
            other.get_port("own/reply", packets.SweepCommand)
