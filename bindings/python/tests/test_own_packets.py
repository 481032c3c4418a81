"""Packets of a description file, without Rust: generated for Python, C and C++, and exchanged between programs in all three.

Needs TACTNET, the command beside `libtactnet_c.so`, and compilers for C and C++.
"""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tactnet import TactnetError, channel

REPOSITORY = Path(__file__).resolve().parents[3]
DESCRIPTION = REPOSITORY / "channel/packet/tests/own_packets/arm.toml"
BUILT = Path(os.environ["TACTNET"]).resolve().parent


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Returns a folder with the generated files."""
    folder = tmp_path_factory.mktemp("own")
    for language, name in (("python", "arm_packets.py"), ("c", "arm_packets.h"), ("cpp", "arm_packets.hpp")):
        command = [os.environ["TACTNET"], "channel", "packets", "--from", str(DESCRIPTION), "--language", language]
        (folder / name).write_text(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return folder


@pytest.fixture(scope="module")
def arm(folder):
    """Returns the generated module."""
    sys.path.insert(0, str(folder))
    yield importlib.import_module("arm_packets")
    sys.path.remove(str(folder))


def state(arm):
    points = [[arm.Vector(x=1.0), arm.Vector(y=2.0, z=3.0)]]
    hand = arm.Frame(at=arm.Vector(x=0.5), rotation=np.eye(3))
    joints = [arm.Joint(position=number, torque=-1.5, errors=0xFFFF, temperature=-40) for number in range(arm.JOINTS)]
    grid = np.arange(24).reshape(2, 3, 4) - 12
    return arm.ArmState(2**60, arm.Mode.MOVING, joints=joints, hand=hand, contact_points=points, grid=grid, tool="gripper", tags=["ab", "cdef"])


def test_nested_packets_and_arrays_survive_in_bytes(arm):
    packet = state(arm)
    data = packet.to_bytes()
    back = arm.ArmState.from_bytes(data)
    assert len(data) == arm.ArmState.DTYPE.itemsize == 328 and back.to_bytes() == data
    assert back.joints == packet.joints and back.contact_points == packet.contact_points and back.contacts == 1
    assert (back.grid == packet.grid).all() and (back.hand.rotation == np.eye(3)).all() and back.hand.at == packet.hand.at
    assert (back.time_ns, back.mode, back.tool, back.tags) == (2**60, arm.Mode.MOVING, "gripper", ["ab", "cdef"])
    for wrong, words in ((dict(joints=[arm.Joint()] * 4), "at most 3 values, found 4"), (dict(tags=["abcde"]), "at most 4 bytes, found 5"),
                         (dict(contact_points=[[arm.Vector()] * 3]), "at most 2 values, found 3")):
        with pytest.raises(ValueError, match=words):
            arm.ArmState(**wrong).to_bytes()


def run_ready(program, table):
    environment = {**os.environ, "LD_LIBRARY_PATH": str(program.parent)}
    process = subprocess.Popen([program, table], stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout.readline() == "ready\n"
    return process


def test_a_packet_goes_from_python_through_c_and_cpp_and_back(arm, folder):
    flags = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{REPOSITORY}/bindings/c/include", f"-I{folder}"]
    link = [f"-L{BUILT}", "-ltactnet_c"]
    # By the name under which it is installed.
    (folder / "libtactnet_channel.so.0").symlink_to(BUILT / "libtactnet_c.so")
    for compiler, source in ((["cc", "-std=c11"], "own_packets.c"), (["c++", "-std=c++17"], "own_packets.cpp")):
        program = folder / source.replace(".", "_")
        subprocess.run([*compiler, *flags, str(REPOSITORY / "tests/c" / source), "-o", str(program), *link], check=True)
    table = folder / "arm_table.toml"
    kind = f'packet = "ArmState"\nversion = 2\nitem_bytes = {arm.ArmState.DTYPE.itemsize}\n'
    table.write_text(f'bus = "own{os.getpid()}"\n' + "".join(f"[channels.{name}]\n{kind}" for name in ("in", "middle", "out")))
    with channel.Hub(table), channel.Bus(str(table)) as bus:
        put, get = bus.put_port("in", arm.ArmState), bus.get_port("out", arm.ArmState)
        programs = [run_ready(folder / name, table) for name in ("own_packets_cpp", "own_packets_c")]
        command = [os.environ["TACTNET"], "channel", "echo", "out", "--json", "--count", "1", "--table", str(table), "--packets", str(DESCRIPTION)]
        echo = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        # A port of `echo`, besides this one.
        listed = [os.environ["TACTNET"], "channel", "list", "--table", str(table)]
        while "2/8" not in subprocess.run(listed, check=True, capture_output=True, text=True).stdout:
            assert echo.poll() is None
        sent = state(arm)
        put.put(sent)
        came = get.get(timeout=20)
        assert [program.wait(timeout=20) for program in programs] == [0, 0]
        assert came.time_ns == 2**60 + 2 and came.joints[2].position == 3.0 and came.joints[0].torque == -1.5
        assert came.hand.rotation[2, 1] == 1.0 and came.contact_points[0][1].z == 4.0 and came.grid[1, 2, 3] == 12 and came.tags == ["ab", "C"]
        echoed, _ = echo.communicate(timeout=20)
        assert '"joints":[{"position":1.0,' in echoed and '"tool":"gripper"' in echoed, echoed
        # Name, version and size must agree with the table.
        arm.ArmState.VERSION = 3
        try:
            with pytest.raises(TactnetError, match="expected packets of `ArmState` version 2"):
                bus.get_port("in", arm.ArmState)
        finally:
            arm.ArmState.VERSION = 2
