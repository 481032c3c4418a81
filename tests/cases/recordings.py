"""MCAP recordings of other programs: JSON, Protocol Buffers and ROS 2 messages (item 17)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from expectations import Case, Import, Made, Says
from signals import Array, Sweeps, seed_of, smooth

RATE = 100.0
START = 1_717_156_800_000_000_000


@dataclass
class Encoding:
    """Schema of a topic and the bytes of its messages."""

    schema_name: str
    schema_encoding: str
    schema: bytes
    message_encoding: str
    encode: Callable[[Array, int], bytes]
    #: Path of the numbers, and their type and number.
    field: str
    kind: Any = np.float64
    taxels: int = 6


def json_encoding(nested: bool) -> Encoding:
    def encode(frame: Array, nanoseconds: int) -> bytes:
        numbers = [float(value) for value in frame]
        body = {"skin": {"taxels": numbers, "unit": "kPa"}} if nested else {"data": numbers}
        return json.dumps({"stamp": nanoseconds / 1e9, **body}).encode()

    schema = json.dumps({"type": "object", "properties": {"stamp": {"type": "number"}}}).encode()
    return Encoding("lab.Skin", "jsonschema", schema, "json", encode, "skin.taxels" if nested else "data")


def protobuf_encoding(nested: bool) -> Encoding:
    file = descriptor_pb2.FileDescriptorProto(name="skin.proto", package="lab", syntax="proto3")
    frame_type = file.message_type.add(name="Frame")
    kinds = descriptor_pb2.FieldDescriptorProto
    frame_type.field.add(name="unit", number=1, type=kinds.TYPE_STRING, label=kinds.LABEL_OPTIONAL)
    frame_type.field.add(name="taxels", number=2, type=kinds.TYPE_FLOAT, label=kinds.LABEL_REPEATED)
    skin = file.message_type.add(name="Skin")
    skin.field.add(name="nanoseconds", number=1, type=kinds.TYPE_UINT64, label=kinds.LABEL_OPTIONAL)
    skin.field.add(name="frame", number=3, type=kinds.TYPE_MESSAGE, type_name=".lab.Frame", label=kinds.LABEL_OPTIONAL)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    name = "lab.Skin" if nested else "lab.Frame"
    make = message_factory.GetMessageClass(pool.FindMessageTypeByName(name))

    def encode(frame: Array, nanoseconds: int) -> bytes:
        message = make()
        inner = message.frame if nested else message
        inner.unit = "kPa"
        inner.taxels.extend(frame.tolist())
        if nested:
            message.nanoseconds = nanoseconds
        return bytes(message.SerializeToString())

    schema = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
    return Encoding(name, "protobuf", schema, "protobuf", encode, "frame.taxels" if nested else "taxels", np.float32)


def ros_encoding(name: str) -> Encoding:
    store = get_typestore(Stores.ROS2_HUMBLE)
    if name == "lab_msgs/msg/Skin":
        definition = "std_msgs/Header header\nuint8 finger\nuint16[6] taxels\nfloat64 temperature\n"
        store.register(get_types_from_msg(definition, name))
    types = store.types

    def header(nanoseconds: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](nanoseconds // 10**9, nanoseconds % 10**9)
        return types["std_msgs/msg/Header"](stamp, "finger")

    def vector(frame: Array) -> Any:
        return types["geometry_msgs/msg/Vector3"](*map(float, frame))

    def message(frame: Array, nanoseconds: int) -> Any:
        if name.endswith("MultiArray"):
            dimension = types["std_msgs/msg/MultiArrayDimension"]("taxels", len(frame), len(frame))
            return types[name](types["std_msgs/msg/MultiArrayLayout"]([dimension], 0), frame)
        if name.endswith("Imu"):
            rotation = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            none = np.zeros(9)
            return types[name](header(nanoseconds), rotation, none, vector(np.zeros(3)), none, vector(frame), none)
        if name.endswith("WrenchStamped"):
            return types[name](header(nanoseconds), types["geometry_msgs/msg/Wrench"](vector(frame), vector(np.zeros(3))))
        return types[name](header(nanoseconds), 3, frame, 21.5)

    def encode(frame: Array, nanoseconds: int) -> bytes:
        return bytes(store.serialize_cdr(message(frame, nanoseconds), name))

    field, kind, taxels = {
        "std_msgs/msg/Float32MultiArray": ("data", np.float32, 6),
        "std_msgs/msg/Float64MultiArray": ("data", np.float64, 6),
        "std_msgs/msg/Int16MultiArray": ("data", np.int16, 6),
        "std_msgs/msg/UInt16MultiArray": ("data", np.uint16, 6),
        "sensor_msgs/msg/Imu": ("linear_acceleration", np.float64, 3),
        "geometry_msgs/msg/WrenchStamped": ("wrench.force", np.float64, 3),
        "lab_msgs/msg/Skin": ("taxels", np.uint16, 6),
    }[name]
    definition = store.generate_msgdef(name, ros_version=2)[0]
    return Encoding(name, "ros2msg", definition.encode(), "cdr", encode, field, kind, taxels)


ENCODINGS: dict[str, Callable[[], Encoding]] = {
    "JSON": partial(json_encoding, False),
    "JSON nested": partial(json_encoding, True),
    "Protocol Buffers": partial(protobuf_encoding, False),
    "Protocol Buffers nested": partial(protobuf_encoding, True),
    "Float32MultiArray": partial(ros_encoding, "std_msgs/msg/Float32MultiArray"),
    "Float64MultiArray": partial(ros_encoding, "std_msgs/msg/Float64MultiArray"),
    "Int16MultiArray": partial(ros_encoding, "std_msgs/msg/Int16MultiArray"),
    "UInt16MultiArray": partial(ros_encoding, "std_msgs/msg/UInt16MultiArray"),
    "Imu": partial(ros_encoding, "sensor_msgs/msg/Imu"),
    "WrenchStamped": partial(ros_encoding, "geometry_msgs/msg/WrenchStamped"),
    "own message": partial(ros_encoding, "lab_msgs/msg/Skin"),
}
FRAMES = 400


def frames_of(name: str, encoding: Encoding) -> Array:
    random = np.random.default_rng(seed_of(f"17 {name}"))
    values = 20 + 3 * smooth(random, FRAMES, encoding.taxels, 0.2) + 0.1 * random.standard_normal((FRAMES, encoding.taxels))
    if np.issubdtype(encoding.kind, np.integer):
        values = np.round(40 * values)
    return values.astype(encoding.kind)


def record(path: Path, encoding: Encoding, values: Array, compression: CompressionType, chunk: int = 1 << 20) -> None:
    """Writes a recording with the topic `/skin` and one of diagnostics."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, chunk_size=chunk)
        writer.start("ros2" if encoding.message_encoding == "cdr" else "")
        schema = writer.register_schema(encoding.schema_name, encoding.schema_encoding, encoding.schema)
        skin = writer.register_channel("/skin", encoding.message_encoding, schema)
        other = writer.register_schema("lab.Status", "jsonschema", b"{}")
        status = writer.register_channel("/status", "json", other)
        for step, frame in enumerate(values):
            at = START + round(step * 1e9 / RATE)
            writer.add_message(skin, at, encoding.encode(frame, at), at, step)
            if step % 50 == 0:
                writer.add_message(status, at, b'{"ok": true}', at, step)
        writer.finish()  # type: ignore[no-untyped-call]


def windows(values: Array, length: int) -> Sweeps:
    starts = range(0, len(values) - length + 1, length)
    return Sweeps([values[start : start + length] for start in starts], ["felt"] * len(starts), RATE)


def imported(name: str, compression: CompressionType, folder: Path) -> Made:
    encoding = ENCODINGS[name]()
    values = frames_of(name, encoding)
    path = folder / "recording.mcap"
    record(path, encoding, values, compression)
    arguments = ("--topic", "/skin", "--field", encoding.field, "--material", "felt", "--window", "50")
    return Made(path, (Import(windows(values, 50), arguments, RATE),))


def labelled(name: str, folder: Path) -> Made:
    """A text of the message names the material of its frame."""
    encoding = ENCODINGS[name]()
    values = frames_of(name, encoding)
    plain, count = encoding.encode, iter(range(FRAMES))

    def encode(frame: Array, nanoseconds: int) -> bytes:
        body = json.loads(plain(frame, nanoseconds))
        return json.dumps(body | {"surface": "cork" if next(count) < 150 else "felt"}).encode()

    path = folder / "recording.mcap"
    record(path, replace(encoding, encode=encode), values, CompressionType.LZ4)
    expected = windows(values, 50)
    expected.materials = ["cork"] * 3 + ["felt"] * 5
    arguments = ("--topic", "/skin", "--field", encoding.field, "--label-field", "surface", "--window", "50")
    return Made(path, (Import(expected, arguments, RATE),))


def listed(name: str, folder: Path) -> Made:
    """Without `--topic` the topics are listed."""
    encoding = ENCODINGS[name]()
    path = folder / "recording.mcap"
    record(path, encoding, frames_of(name, encoding), CompressionType.ZSTD)
    arguments = ("data", "import", "FILE", "--out", "FOLDER/imported.npz", "--material", "felt")
    return Made(path, (Says(arguments, r"/skin.*--topic|--topic.*/skin", 2),))


def wrong_name(name: str, topic: str, field: str, pattern: str, folder: Path) -> Made:
    encoding = ENCODINGS[name]()
    path = folder / "recording.mcap"
    record(path, encoding, frames_of(name, encoding), CompressionType.LZ4)
    arguments = ("data", "import", "FILE", "--out", "FOLDER/imported.npz", "--topic", topic, "--field", field, "--material", "felt")
    return Made(path, (Says(arguments, pattern, 2),))


def cut(name: str, share: float, folder: Path) -> Made:
    """A recording whose end is missing: what is there is read, and the message says how much is lost."""
    encoding = ENCODINGS[name]()
    values = frames_of(name, encoding)
    path = folder / "recording.mcap"
    record(path, encoding, values, CompressionType.NONE, chunk=2048)
    whole = path.read_bytes()
    path.write_bytes(whole[: round(share * len(whole))])
    arguments = (
        "data",
        "import",
        "FILE",
        "--out",
        "FOLDER/imported.npz",
        "--topic",
        "/skin",
        "--field",
        encoding.field,
        "--material",
        "felt",
        "--window",
        "20",
    )
    return Made(path, (Says(arguments, r"(missing|lost|cut).*\d|\d.*(missing|lost|cut)", 0),))


def cases() -> Iterator[Case]:
    for name in ENCODINGS:
        for compression in (CompressionType.ZSTD, CompressionType.NONE):
            yield Case(f"17 import/{name}, {compression.name.lower()}/mcap", 17, "mcap", partial(imported, name, compression))
    for name in ("JSON", "JSON nested"):
        yield Case(f"17 label field/{name}/mcap", 17, "mcap", partial(labelled, name))
    for name in ("JSON", "Float32MultiArray", "Protocol Buffers"):
        yield Case(f"17 topics listed/{name}/mcap", 17, "mcap", partial(listed, name))
    for name in ("JSON", "own message"):
        yield Case(f"17 wrong topic/{name}/mcap", 17, "mcap", partial(wrong_name, name, "/skn", "taxels", r"/skin"))
        field = "data" if name == "JSON" else "taxels"
        yield Case(f"17 wrong field/{name}/mcap", 17, "mcap", partial(wrong_name, name, "/skin", field + "x", rf"\b{field} \[6\]"))
    for name in ("JSON", "Float32MultiArray"):
        for share in (0.4, 0.8):
            yield Case(f"17 cut/{name} after {100 * share:g} %/mcap", 17, "mcap", partial(cut, name, share))
