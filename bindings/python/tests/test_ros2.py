"""Tests of the bridge with Cyclone DDS, and of its message encoding with rosbags.

    pip install cyclonedds rosbags
    TACTNET=target/release/tactnet python -m pytest bindings/python/tests/test_ros2.py
"""

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest
import tactnet
from tactnet import channel

pytest.importorskip("cyclonedds")
os.environ.setdefault("CYCLONEDDS_URI", "")
from tactnet import ros2  # noqa: E402

os.environ["CYCLONEDDS_URI"] = ros2.LOOPBACK
TACTNET = os.environ.get("TACTNET", "tactnet")


def image(digits, number, dtype="<f4", encoding="32FC1"):
    seconds, nanoseconds = divmod(10**18 + number * 10**9 // 750, 10**9)
    header = ros2.Header(ros2.Time(seconds, nanoseconds), "skin")
    data = np.ascontiguousarray(digits, dtype)
    rows, cols = data.shape
    return ros2.Image(header, rows, cols, encoding, dtype.startswith(">"), cols * data.itemsize, list(data.tobytes()))


def test_messages_are_encoded_as_ros_has_them():
    rosbags = pytest.importorskip("rosbags.typesys")
    store = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE)
    theirs = lambda name, *values: store.types[name](*values)  # noqa: E731
    text = theirs("std_msgs/msg/String", "grüner Filz")
    assert ros2.String("grüner Filz").serialize() == bytes(store.serialize_cdr(text, "std_msgs/msg/String"))
    ours = image(np.arange(12.0).reshape(3, 4), 5)
    stamp = theirs("builtin_interfaces/msg/Time", ours.header.stamp.sec, ours.header.stamp.nanosec)
    frame = theirs(
        "sensor_msgs/msg/Image", theirs("std_msgs/msg/Header", stamp, "skin"), 3, 4, "32FC1", 0, 16, np.array(ours.data, np.uint8)
    )
    data = bytes(store.serialize_cdr(frame, "sensor_msgs/msg/Image"))
    assert ours.serialize() == data
    assert ros2.Image.deserialize(data) == ours


def test_images_become_frames():
    digits = np.arange(6.0).reshape(2, 3)
    for dtype, encoding in [("<f4", "32FC1"), (">f4", "32FC1"), ("<u2", "16UC1"), (">u2", "mono16"), ("|u1", "8UC1")]:
        assert ros2.digits_of(image(digits, 0, dtype, encoding)).tolist() == [0, 1, 2, 3, 4, 5]
    padded = image(digits, 0, "|u1", "mono8")
    padded.step, padded.data = 5, [0, 1, 2, 9, 9, 3, 4, 5, 9, 9]
    assert ros2.digits_of(padded).tolist() == [0, 1, 2, 3, 4, 5]
    padded.data = padded.data[:9]
    with pytest.raises(ValueError, match="found 9 bytes in rows of 5"):
        ros2.digits_of(padded)
    with pytest.raises(ValueError, match="found 'rgb8'"):
        ros2.digits_of(image(digits, 0, "|u1", "rgb8"))


def test_a_sweep_from_ros_comes_back_as_a_material(tmp_path):
    from cyclonedds.core import Policy, Qos
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration

    twin = tactnet.Dataset.twin(materials=4, sweeps=15, steps=300)
    network = tactnet.TactNetClassifier(rate=750, epochs=5).fit(twin.X, twin.y)
    network.save(tmp_path / "run")
    table, domain = tmp_path / "robot.toml", 1 + os.getpid() % 100
    with channel.Hub(bus=f"ros{os.getpid()}") as hub:
        table.write_text(hub.table.replace('skip = "333ms"', "skip = 0"))
        commands = [
            [TACTNET, "serve", "--run", tmp_path / "run", "--table", table],
            [sys.executable, "-m", "tactnet.ros2", "--table", table, "--domain", domain, "--prefix", "left"],
        ]
        processes = []
        try:
            for command in commands:
                process = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                processes.append(process)
                assert process.stdout.readline() == "ready\n", process.stderr.read()
            reliable = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(10))
            node = DomainParticipant(domain)
            writer = lambda name, kind: DataWriter(node, Topic(node, name, kind), qos=reliable)  # noqa: E731
            frames, command = writer("rt/left/skin/right", ros2.Image), writer("rt/left/sweep/command", ros2.String)
            materials = DataReader(node, Topic(node, "rt/left/tactile/material", ros2.String), qos=reliable)
            beliefs = DataReader(node, Topic(node, "rt/left/tactile/belief", ros2.String), qos=reliable)
            until = time.monotonic() + 10
            while time.monotonic() < until and not (frames.get_matched_subscriptions() and command.get_matched_subscriptions()):
                time.sleep(0.05)
            sweep = twin.X[0]
            images = [image(frame, number) for number, frame in enumerate(np.concatenate([np.repeat(sweep[:1], 750, axis=0), sweep]))]
            command.write(ros2.String("go"))
            begun = time.monotonic()
            for number, frame in enumerate(images):
                if number == 750:
                    command.write(ros2.String("start 7 cork"))
                    time.sleep(0.05)
                    begun += 0.05
                frames.write(frame)
                time.sleep(max(0.0, begun + (number + 1) / 750 - time.monotonic()))
            said = next(iter(materials.take_iter(timeout=duration(seconds=20))))
            assert said.data == network.predict(sweep[None])[0]
            whole = [json.loads(belief.data) for belief in beliefs.take(100)]
            assert any(belief["motion"] == 7 and belief["stage"] != "anytime" for belief in whole)
            processes[1].terminate()
            _, errors = processes[1].communicate(timeout=20)
            assert "found 'go'" in errors and "1050 frames" in errors and "1 messages refused" in errors
        finally:
            for process in processes:
                process.kill()
                process.wait()


def test_no_hub_is_one_line(tmp_path):
    with channel.Hub(bus=f"gone{os.getpid()}") as hub:
        (tmp_path / "robot.toml").write_text(hub.table)
    ended = subprocess.run(
        [sys.executable, "-m", "tactnet.ros2", "--table", str(tmp_path / "robot.toml")], capture_output=True, text=True, timeout=60
    )
    assert ended.returncode == 1 and ended.stderr.startswith("error: no hub") and ended.stderr.count("\n") == 1
