"""Writers of sweeps in the formats that tactnet reads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from signals import Array, Sweeps, even_times

#: Formats of arrays, and formats that hold a row per frame.
ARRAYS = ("npz", "h5", "npy")
TABLES = ("table", "folder", "parquet")
FORMATS = ARRAYS + TABLES


def write(kind: str, of: Sweeps, folder: Path, **options: Any) -> Path:
    """Writes sweeps in a format and returns the path to read; tables get times."""
    if kind in TABLES and not of.seconds and not of.columns:
        of = even_times(of)
    return {"npz": npz, "h5": h5, "npy": npy, "table": table, "folder": csv_folder, "parquet": parquet, "lerobot": lerobot}[kind](
        of, folder, **options
    )


def npz(of: Sweeps, folder: Path, **more: Any) -> Path:
    path = folder / "sweeps.npz"
    values = shaped(of, of.stack())
    arrays: dict[str, Any] = {"X": values, "y": np.array(of.materials), "sample_rate_hz": of.rate, **more}
    if of.blocks is not None:
        arrays["blocks"] = np.array(of.blocks)
    np.savez(path, **arrays)
    return path


def shaped(of: Sweeps, values: Array) -> Array:
    """Returns `[sweeps][steps][taxels]` with the grid of the patch, if it is known."""
    return values if of.grid is None else values.reshape(*values.shape[:2], *of.grid)


def by_material(of: Sweeps) -> tuple[list[str], Array]:
    """Returns the names, and the samples `[materials][sweeps][steps][rows][cols]`."""
    names = list(dict.fromkeys(of.materials))
    rows, cols = of.grid or (1, of.taxels)
    stack = of.stack()
    groups = [[index for index, name in enumerate(of.materials) if name == own] for own in names]
    samples = np.stack([stack[group] for group in groups])
    return names, samples.reshape(*samples.shape[:3], rows, cols)


def h5(of: Sweeps, folder: Path, **storage: Any) -> Path:
    """Writes TactMat's layout."""
    path = folder / "sweeps.h5"
    names, samples = by_material(of)
    with h5py.File(path, "w") as file:
        file.create_dataset("samples", data=samples, **storage)
        file.create_dataset("materials", data=names, dtype=h5py.string_dtype())
        file.attrs["sample_rate_hz"] = of.rate
        if of.blocks is not None:
            file.create_dataset("blocks", data=np.array(of.blocks).reshape(samples.shape[:2]))
    return path


def npy(of: Sweeps, folder: Path) -> Path:
    """Writes a folder per material with an array per sweep."""
    path = folder / "sweeps"
    for index, (values, material) in enumerate(zip(of.values, of.materials, strict=True)):
        (path / material).mkdir(parents=True, exist_ok=True)
        np.save(path / material / f"{index:03}.npy", values if of.grid is None else values.reshape(-1, *of.grid))
    return path


def cell(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return str(value)


def rows_of(of: Sweeps, sweep: int) -> list[list[str]]:
    """Returns the cells of the frames of one sweep, the further columns first."""
    columns = [[cell(value) for value in cells[sweep]] for cells in columns_of(of).values()]
    frames = [[cell(value) for value in frame] for frame in of.values[sweep].tolist()]
    return [[column[step] for column in columns] + frame for step, frame in enumerate(frames)]


def columns_of(of: Sweeps) -> dict[str, list[Any]]:
    """Returns the further columns: the named ones, and without any of times the seconds."""
    if of.columns or not of.seconds:
        return of.columns
    return {"time": [[round(float(second), 9) for second in seconds] for seconds in of.seconds]}


def taxel_names(of: Sweeps) -> list[str]:
    return [f"t{taxel}" for taxel in range(of.taxels)]


def table(of: Sweeps, folder: Path, separator: str = ",", name: str = "sweeps.csv") -> Path:
    """Writes one table with a row per frame."""
    path = folder / name
    lines = [["sweep", "material", *columns_of(of), *taxel_names(of)]]
    for sweep, material in enumerate(of.materials):
        block = [] if of.blocks is None else [str(of.blocks[sweep])]
        lines += [[str(sweep), material, *row, *block] for row in rows_of(of, sweep)]
    if of.blocks is not None:
        lines[0].append("block")
    path.write_text("".join(separator.join(line) + "\n" for line in lines), encoding="utf-8")
    return path


def file_of(of: Sweeps, sweep: int) -> str:
    """Returns the name of the file of a sweep in a folder."""
    return f"{of.materials[sweep]}/{sweep:03}.csv"


def csv_folder(of: Sweeps, folder: Path, separator: str = ",", header: bool = True) -> Path:
    """Writes a folder per material with a table per sweep."""
    path = folder / "sweeps"
    names = [*columns_of(of), *taxel_names(of)]
    for sweep in range(len(of.values)):
        file = path / file_of(of, sweep)
        file.parent.mkdir(parents=True, exist_ok=True)
        lines = ([names] if header else []) + rows_of(of, sweep)
        file.write_text("".join(separator.join(line) + "\n" for line in lines), encoding="utf-8")
    return path


def joined(cells: Sequence[Any]) -> Any:
    """Returns the cells of all sweeps as one column."""
    if isinstance(cells[0], (pa.Array, pa.ChunkedArray)):
        return pa.concat_arrays(cells)
    return np.concatenate([np.asarray(of_sweep) for of_sweep in cells])


def frame_table(of: Sweeps) -> dict[str, Any]:
    """Returns the columns of a table with a row per frame."""
    frames = [len(values) for values in of.values]
    columns: dict[str, Any] = {
        "sweep": np.repeat(np.arange(len(frames)), frames),
        "material": np.repeat(np.array(of.materials), frames).tolist(),
    }
    columns |= {name: joined(cells) for name, cells in columns_of(of).items()}
    values = np.concatenate(of.values)
    columns |= {name: values[:, taxel] for taxel, name in enumerate(taxel_names(of))}
    if of.blocks is not None:
        columns["block"] = np.repeat(np.array(of.blocks), frames)
    return columns


def parquet(of: Sweeps, folder: Path, **options: Any) -> Path:
    path = folder / "sweeps.parquet"
    pq.write_table(pa.table(frame_table(of)), path, **options)
    return path


def lerobot(of: Sweeps, folder: Path, version: int = 2, feature: str = "observation.tactile", fixed: bool = False) -> Path:
    """Writes a folder as LeRobot does: a list of taxels per frame, episodes as sweeps, tasks as materials."""
    path = folder / "dataset"
    tasks = list(dict.fromkeys(of.materials))
    (path / "meta").mkdir(parents=True)
    info = {
        "codebase_version": f"v{version}.0",
        "fps": of.rate,
        "total_episodes": len(of.values),
        "features": {feature: {"dtype": "float32", "shape": [of.taxels]}},
    }
    (path / "meta/info.json").write_text(json.dumps(info))
    if version == 2:
        lines = [json.dumps({"task_index": index, "task": task}) for index, task in enumerate(tasks)]
        (path / "meta/tasks.jsonl").write_text("\n".join(lines) + "\n")
    else:
        pq.write_table(pa.table({"task_index": list(range(len(tasks))), "__index_level_0__": tasks}), path / "meta/tasks.parquet")
    parts = []
    first = 0
    for episode, values in enumerate(of.values):
        steps = len(values)
        kind = pa.list_(pa.float32(), of.taxels) if fixed else pa.list_(pa.float32())
        parts.append(
            pa.table(
                {
                    feature: pa.array(list(values.astype(np.float32)), kind),
                    "timestamp": pa.array(np.arange(steps) / of.rate, pa.float32()),
                    "frame_index": np.arange(steps),
                    "episode_index": np.full(steps, episode),
                    "index": first + np.arange(steps),
                    "task_index": np.full(steps, tasks.index(of.materials[episode])),
                }
            )
        )
        first += steps
    data = path / "data/chunk-000"
    data.mkdir(parents=True)
    if version == 2:
        for episode, part in enumerate(parts):
            pq.write_table(part, data / f"episode_{episode:06}.parquet")
    else:
        pq.write_table(pa.concat_tables(parts), data / "file-000.parquet")
    return path
