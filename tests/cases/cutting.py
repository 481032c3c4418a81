"""Resampling and windows: continuous recordings become sweeps (item 4)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from expectations import Case, Import, Made, Says
from signals import Array, Sweeps, seed_of, smooth

LABELS = ("grass", "none", "gravel", "tiles", "grass", "gravel")


@dataclass
class Walk:
    """A continuous recording with a label per frame."""

    values: Array
    seconds: Array
    labels: list[str]
    rate: float


def walk(name: str, rate: float, taxels: int = 4, gap_after: float | None = None) -> Walk:
    """Returns stretches of other labels, 9 to 14 s each."""
    random = np.random.default_rng(seed_of(name))
    lengths = [int(rate * random.uniform(9, 14)) for _ in LABELS]
    frames = sum(lengths)
    values = 10 + smooth(random, frames, taxels, 0.2) + 0.05 * random.standard_normal((frames, taxels))
    seconds = np.arange(frames) / rate
    if gap_after is not None:
        seconds[round(gap_after * rate) :] += 30.0
    return Walk(values, seconds, [label for label, length in zip(LABELS, lengths, strict=True) for _ in range(length)], rate)


def windows(of: Walk, length: int, hop: int, drop: tuple[str, ...] = ()) -> Sweeps:
    """Returns the windows within stretches of one label and without a gap."""
    found = Sweeps([], [], of.rate)
    jumps = np.diff(of.seconds) > 1.5 / of.rate
    ends = [at + 1 for at in range(len(of.labels) - 1) if of.labels[at] != of.labels[at + 1] or jumps[at]]
    for start, end in zip([0, *ends], [*ends, len(of.labels)], strict=True):
        if of.labels[start] in drop:
            continue
        for first in range(start, end - length + 1, hop):
            found.values.append(of.values[first : first + length])
            found.materials.append(of.labels[start])
    return found


def write(of: Walk, folder: Path, format: str, labels: bool = True) -> Path:
    names = [f"acc{taxel}" for taxel in range(of.values.shape[1])]
    columns: dict[str, Any] = {"time": np.round(of.seconds, 6)}
    columns |= {name: of.values[:, taxel] for taxel, name in enumerate(names)}
    if labels:
        columns["label"] = of.labels
    if format == "parquet":
        path = folder / "walk.parquet"
        pq.write_table(pa.table(columns), path)
        return path
    path = folder / "walk.csv"
    rows = zip(*(column if isinstance(column, list) else column.tolist() for column in columns.values()), strict=True)
    path.write_text(",".join(columns) + "\n" + "".join(",".join(map(str, row)) + "\n" for row in rows))
    return path


def by_labels() -> Iterator[Case]:
    spans = [
        ("128 frames", ("--window", "128"), 128, 128, 20.0),
        ("1.28 s by half", ("--window", "1.28s", "--hop", "0.64s"), 128, 64, 100.0),
        ("640 ms", ("--window", "640ms", "--hop", "320ms"), 32, 16, 50.0),
    ]
    for name, arguments, length, hop, rate in spans:
        for format in ("table", "parquet"):
            for gap in (None, 20.0):

                def make(folder: Path, arguments: tuple[str, ...] = arguments, length: int = length, hop: int = hop, rate: float = rate, format: str = format, gap: float | None = gap) -> Made:
                    of = walk(f"4 {rate} {gap}", rate, gap_after=gap)
                    expected = windows(of, length, hop, ("none",))
                    path = write(of, folder, format)
                    return Made(path, (Import(expected, (*arguments, "--drop-label", "none"), rate, blocks=True),))

                yield Case(f"4 windows/{name}{' and a gap' if gap else ''}/{format}", 4, format, make)


def by_intervals() -> Iterator[Case]:
    for rate, unit in [(50.0, ""), (100.0, "_ms")]:
        for format in ("table", "parquet"):

            def make(folder: Path, rate: float = rate, unit: str = unit, format: str = format) -> Made:
                of = walk(f"4 intervals {rate}", rate)
                factor = 1e3 if unit else 1.0
                intervals = [(2.0, 9.0, "grass"), (20.0, 28.5, "gravel"), (30.0, 41.0, "grass"), (45.0, 49.0, "tiles")]
                lines = [f"{start * factor:g},{end * factor:g},{label}" for start, end, label in intervals]
                (folder / "labels.csv").write_text(f"start{unit},end{unit},label\n" + "\n".join(lines) + "\n")
                expected = Sweeps([], [], rate)
                for start, end, label in intervals:
                    inside = np.flatnonzero((of.seconds >= start - 1e-9) & (of.seconds < end - 1e-9))
                    for first in range(inside[0], inside[-1] + 2 - round(rate), round(rate)):
                        expected.values.append(of.values[first : first + round(rate)])
                        expected.materials.append(label)
                path = write(of, folder, format, labels=False)
                return Made(path, (Import(expected, ("--window", "1s", "--intervals", "FOLDER/labels.csv"), rate, blocks=True),))

            yield Case(f"4 windows/intervals{unit}/{format}", 4, format, make)


def tones(seconds: Array, frequencies: tuple[float, ...]) -> Array:
    return np.stack([np.sin(2 * np.pi * frequency * seconds + 0.3 * place) for place, frequency in enumerate(frequencies)], axis=1)


def resampled() -> Iterator[Case]:
    """Frequencies below the new Nyquist frequency stay, those above it vanish."""
    for rate, to in [(200.0, 50.0), (100.0, 40.0), (750.0, 100.0), (50.0, 200.0)]:
        for format in ("table", "parquet"):

            def make(folder: Path, rate: float = rate, to: float = to, format: str = format) -> Made:
                low = min(rate, to)
                inner, outer = (0.1 * low, 0.23 * low), (0.77 * low, 0.93 * low)
                frequencies = inner + (outer if to < rate else ())
                seconds = np.arange(int(20 * rate)) / rate
                values = tones(seconds, frequencies)
                label = ["grass"] * (len(seconds) // 2) + ["gravel"] * (len(seconds) - len(seconds) // 2)
                of = Walk(values, seconds, label, rate)
                new = np.arange(int(10 * to)) / to
                expected = Sweeps([], [], to)
                for name, start in (("grass", 0.0), ("gravel", 10.0)):
                    kept = tones(new + start, frequencies)
                    kept[:, len(inner) :] = 0.0
                    steps = int(9.5 * to)
                    expected.values.append(kept[:steps])
                    expected.materials.append(name)
                arguments = ("--resample", f"{to:g}", "--window", str(int(9.5 * to)))
                path = write(of, folder, format)
                return Made(path, (Import(expected, arguments, to, tolerance=5e-3, margin=int(1.5 * to)),))

            yield Case(f"4 resample/{rate:g} to {to:g} Hz/{format}", 4, format, make)


def lost() -> Iterator[Case]:
    """Lost frames are interpolated, by the time stamps."""
    for share in (0.1, 0.25):
        for format in ("table", "parquet"):

            def make(folder: Path, share: float = share, format: str = format) -> Made:
                random = np.random.default_rng(seed_of(f"4 lost {share}"))
                rate, to = 200.0, 50.0
                seconds = np.arange(int(20 * rate)) / rate
                while True:
                    kept = np.flatnonzero(random.random(len(seconds)) >= share)
                    kept = np.union1d(kept, [0, len(seconds) - 1, len(seconds) // 2 - 1, len(seconds) // 2])
                    if np.diff(kept).max() <= 5:
                        break
                frequencies = (1.0, 3.0)
                label = np.where(seconds < 10.0, "grass", "gravel")
                of = Walk(tones(seconds, frequencies)[kept], seconds[kept], [str(name) for name in label[kept]], rate)
                expected = Sweeps([], [], to)
                for name, start in (("grass", 0.0), ("gravel", 10.0)):
                    expected.values.append(tones(start + np.arange(475) / to, frequencies))
                    expected.materials.append(name)
                path = write(of, folder, format)
                arguments = ("--resample", f"{to:g}", "--window", "475")
                return Made(path, (Import(expected, arguments, to, tolerance=0.02, margin=75),))

            yield Case(f"4 resample/{100 * share:g} % lost/{format}", 4, format, make)


def unlabelled() -> Iterator[Case]:
    """A recording with labels that is not cut: the message names the cure."""
    for rate in (20.0, 100.0):
        for format in ("table", "parquet"):

            def make(folder: Path, rate: float = rate, format: str = format) -> Made:
                path = write(walk(f"4 uncut {rate}", rate), folder, format)
                arguments = ("data", "import", "FILE", "--out", "FOLDER/imported.npz")
                return Made(path, (Says(arguments, r"--window", 2),))

            yield Case(f"4 windows/not asked for, {rate:g} Hz/{format}", 4, format, make)


def cases() -> Iterator[Case]:
    yield from by_labels()
    yield from by_intervals()
    yield from resampled()
    yield from lost()
    yield from unlabelled()
