"""Parquet: LeRobot folders, and the types and codecs of other writers (item 16)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from expectations import Case, Either, Find, Import, Made, NoOther, Refused
from signals import Sweeps, even_times, sweeps
from writers import frame_table, lerobot, parquet


def sample(name: str, taxels: int = 6) -> Sweeps:
    return even_times(sweeps(f"16 {name}", 3, 6, 80, taxels, 50.0))


def robot(version: int, fixed: bool, taxels: int, feature: str, folder: Path) -> Made:
    of = sweeps(f"16 lerobot {version} {fixed} {taxels}", 3, 6, 80, taxels, 50.0)
    path = lerobot(of, folder, version, feature, fixed)
    as_read = of.mapped(lambda values: values.astype(np.float32))
    return Made(path, (NoOther(), Import(as_read, rate=50.0)))


def several_features(tactile: tuple[str, ...], folder: Path) -> Made:
    """Several features: the tactile one is taken by its name, otherwise the message lists them."""
    of = sweeps(f"16 features {tactile}", 2, 5, 60, 4, 50.0)
    path = lerobot(of, folder, 2, "observation.state")
    for file, values in zip(sorted(path.glob("data/*/*.parquet")), of.values, strict=True):
        part = pq.read_table(file)
        for name in tactile:
            part = part.append_column(name, pa.array(list(values.astype(np.float32)), pa.list_(pa.float32())))
        part = part.set_column(0, "observation.state", pa.array([[0.5, 1.5]] * len(values), pa.list_(pa.float32())))
        pq.write_table(part, file)
    as_read = of.mapped(lambda values: values.astype(np.float32))
    named = Import(as_read, ("--samples", tactile[0]), 50.0)
    if len(tactile) == 1:
        return Made(path, (NoOther(), Import(as_read, rate=50.0, says="observation.state"), named))
    return Made(path, (Refused(rf"{tactile[0]}.*--samples"), named))


def words(kind: str, column: str, folder: Path) -> Made:
    """Names as dictionary or large strings."""
    of = sample(f"{kind} {column}")
    columns = frame_table(of)
    texts = [str(value) for value in columns[column]]
    of_kind = {
        "dictionary": lambda: pa.array(texts).dictionary_encode(),
        "large string": lambda: pa.array(texts, pa.large_string()),
        "dictionary of large strings": lambda: pa.array(texts, pa.large_string()).dictionary_encode(),
        "string view": lambda: pa.array(texts, pa.string_view()),
    }
    columns[column] = of_kind[kind]()
    path = folder / "sweeps.parquet"
    pq.write_table(pa.table(columns), path)
    return Made(path, (NoOther(), Import(of, rate=50.0)))


def nulls(column: str, row: int, folder: Path) -> Made:
    of = sample(f"nulls {column}")
    columns = frame_table(of)
    values = columns[column].tolist() if isinstance(columns[column], np.ndarray) else list(columns[column])
    values[row] = None
    columns[column] = pa.array(values)
    path = folder / "sweeps.parquet"
    pq.write_table(pa.table(columns), path)
    refused = Refused(rf"column `{column}`.*row {row + 1}")
    at: dict[str, Any] = {"sweep": row // 80, "step": row % 80, "taxel": 2}
    return Made(path, (Either(refused, Find("not_finite", "error", at)) if column == "t2" else refused,))


def stamped(unit: str, zone: str | None, folder: Path) -> Made:
    of = sample(f"zone {unit} {zone}")
    start = 1_717_156_800.0
    per_second = {"ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    cells = [pa.array([round((start + float(second)) * per_second) for second in seconds], pa.timestamp(unit, zone)) for seconds in of.seconds]
    of.columns = {"timestamp": cells}
    return Made(parquet(of, folder), (NoOther(), Import(of, rate=50.0)))


def packed(codec: str, options: dict[str, Any], folder: Path) -> Made:
    of = sample(f"codec {codec}")
    path = parquet(of, folder, compression=codec, **options)
    # Codecs that the program was built without are named with the cure.
    return Made(path, (Either(Import(of, rate=50.0), Refused(rf"{codec}.*(zstd|snappy)")),))


def numbers(kind: str, folder: Path) -> Made:
    of = sample(f"numbers {kind}")
    if kind == "float16":
        of = of.mapped(lambda values: values.astype(np.float16))
        return Made(parquet(of, folder), (Either(Import(of, rate=50.0), Refused("float16.*float32")),))
    if kind == "decimal128":
        columns = frame_table(of)
        columns["t1"] = pa.array(np.round(columns["t1"], 4)).cast(pa.decimal128(12, 4), safe=False)
        path = folder / "sweeps.parquet"
        pq.write_table(pa.table(columns), path)
        of = Sweeps([np.column_stack([v[:, 0], np.round(v[:, 1], 4), v[:, 2:]]) for v in of.values], of.materials, of.rate)
        return Made(path, (Either(Import(of, rate=50.0, tolerance=1e-5), Refused(r"column `t1`.*(decimal|numbers)")),))
    dtype = {"int16": np.int16, "uint32": np.uint32, "float32": np.float32}[kind]
    of = of.mapped(lambda values: np.round(10 * values + 400).astype(dtype) if kind != "float32" else values.astype(dtype))
    return Made(parquet(of, folder), (NoOther(), Import(of, rate=50.0)))


def lists(fixed: bool, taxels: int, folder: Path) -> Made:
    """A column of lists of one length holds the taxels."""
    of = sample(f"lists {fixed}", taxels)
    columns = frame_table(of)
    for taxel in range(taxels):
        del columns[f"t{taxel}"]
    kind = pa.list_(pa.float64(), taxels) if fixed else pa.list_(pa.float64())
    columns["tactile"] = pa.array([frame.tolist() for frame in np.concatenate(of.values)], kind)
    path = folder / "sweeps.parquet"
    pq.write_table(pa.table(columns), path)
    return Made(path, (NoOther(), Import(of, rate=50.0)))


def odd_list(row: int, length: int, folder: Path) -> Made:
    of = sample(f"odd list {row}")
    columns = frame_table(of)
    for taxel in range(of.taxels):
        del columns[f"t{taxel}"]
    frames = [frame.tolist() for frame in np.concatenate(of.values)]
    frames[row] = frames[row][:length]
    columns["tactile"] = pa.array(frames, pa.list_(pa.float64()))
    path = folder / "sweeps.parquet"
    pq.write_table(pa.table(columns), path)
    return Made(path, (Refused(rf"column `tactile`.*row {row + 1}"),))


def without_tasks(version: int, folder: Path) -> Made:
    """An episode of a task that the folder does not name."""
    of = sweeps(f"16 tasks {version}", 2, 5, 60, 4, 50.0)
    path = lerobot(of, folder, version)
    if version == 2:
        (path / "meta/tasks.jsonl").write_text(json.dumps({"task_index": 0, "task": "cork"}) + "\n")
    else:
        pq.write_table(pa.table({"task_index": [0], "__index_level_0__": ["cork"]}), path / "meta/tasks.parquet")
    return Made(path, (Refused(r"task.*\b1\b"),))


def cases() -> Iterator[Case]:
    robots = [
        (2, False, 6, "observation.tactile"),
        (2, True, 16, "observation.touch"),
        (3, False, 6, "observation.tactile"),
        (3, True, 16, "observation.tactile_left"),
    ]
    for version, fixed, taxels, feature in robots:
        yield Case(f"16 LeRobot/version {version}, {taxels} taxels/parquet", 16, "parquet", partial(robot, version, fixed, taxels, feature))
    for tactile in (("observation.tactile",), ("observation.tactile_left", "observation.tactile_right")):
        yield Case(f"16 LeRobot/{len(tactile)} tactile features/parquet", 16, "parquet", partial(several_features, tactile))
    for version in (2, 3):
        yield Case(f"16 LeRobot/version {version} without a task/parquet", 16, "parquet", partial(without_tasks, version))
    for kind in ("dictionary", "large string", "dictionary of large strings", "string view"):
        for column in ("material", "sweep"):
            yield Case(f"16 words/{kind} in {column}/parquet", 16, "parquet", partial(words, kind, column))
    for column, row in (("t2", 17), ("t2", 333), ("material", 5), ("time", 100)):
        yield Case(f"16 nulls/{column} in row {row}/parquet", 16, "parquet", partial(nulls, column, row))
    for unit, zone in (("ms", "UTC"), ("us", "Europe/Berlin"), ("ns", None), ("us", "+05:30")):
        yield Case(f"16 time zone/{unit} {zone}/parquet", 16, "parquet", partial(stamped, unit, zone))
    codecs: list[tuple[str, dict[str, Any]]] = [
        ("zstd", {"compression_level": 19}),
        ("gzip", {}),
        ("brotli", {}),
        ("lz4", {}),
        ("snappy", {"data_page_version": "2.0"}),
        ("none", {"use_dictionary": False, "row_group_size": 100}),
    ]
    for codec, options in codecs:
        yield Case(f"16 codec/{codec}/parquet", 16, "parquet", partial(packed, codec, options))
    for kind in ("float16", "decimal128", "int16", "uint32", "float32"):
        yield Case(f"16 numbers/{kind}/parquet", 16, "parquet", partial(numbers, kind))
    for fixed, taxels in ((True, 6), (False, 16)):
        yield Case(f"16 lists/{taxels} taxels{', fixed' if fixed else ''}/parquet", 16, "parquet", partial(lists, fixed, taxels))
    for row, length in ((7, 5), (400, 0)):
        yield Case(f"16 lists/{length} values in row {row}/parquet", 16, "parquet", partial(odd_list, row, length))
