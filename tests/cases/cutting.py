"""Resampling and windows: continuous recordings become sweeps (item 4)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
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


#: Arguments, length and hop in frames, rate in Hz.
SPANS: dict[str, tuple[tuple[str, ...], int, int, float]] = {
    "128 frames": (("--window", "128"), 128, 128, 20.0),
    "1.28 s by half": (("--window", "1.28s", "--hop", "0.64s"), 128, 64, 100.0),
    "640 ms": (("--window", "640ms", "--hop", "320ms"), 32, 16, 50.0),
}


def by_labels(name: str, gap: float | None, format: str, folder: Path) -> Made:
    arguments, length, hop, rate = SPANS[name]
    of = walk(f"4 {rate} {gap}", rate, gap_after=gap)
    expected = windows(of, length, hop, ("none",))
    return Made(write(of, folder, format), (Import(expected, (*arguments, "--drop-label", "none"), rate, blocks=True),))


def by_intervals(rate: float, unit: str, format: str, folder: Path) -> Made:
    of = walk(f"4 intervals {rate}", rate)
    factor = 1e3 if unit else 1.0
    intervals = [(2.0, 9.0, "grass"), (20.0, 28.5, "gravel"), (30.0, 41.0, "grass"), (45.0, 49.0, "tiles")]
    lines = [f"{start * factor:g},{end * factor:g},{label}" for start, end, label in intervals]
    (folder / "labels.csv").write_text(f"start{unit},end{unit},label\n" + "\n".join(lines) + "\n")
    expected = Sweeps([], [], rate)
    length = round(rate)
    for start, end, label in intervals:
        inside = np.flatnonzero((of.seconds >= start - 1e-9) & (of.seconds < end - 1e-9))
        for first in range(inside[0], inside[-1] + 2 - length, length):
            expected.values.append(of.values[first : first + length])
            expected.materials.append(label)
    path = write(of, folder, format, labels=False)
    return Made(path, (Import(expected, ("--window", "1s", "--intervals", "FOLDER/labels.csv"), rate, blocks=True),))


def tones(seconds: Array, frequencies: tuple[float, ...]) -> Array:
    return np.stack([np.sin(2 * np.pi * frequency * seconds + 0.3 * place) for place, frequency in enumerate(frequencies)], axis=1)


def two_labels(rate: float, steps: int, frequencies: tuple[float, ...], vanished: int = 0) -> Sweeps:
    """Returns the tones of the first and of the next 10 s, without the last `vanished` frequencies."""
    found = Sweeps([], [], rate)
    for name, start in (("grass", 0.0), ("gravel", 10.0)):
        values = tones(start + np.arange(steps) / rate, frequencies)
        values[:, len(frequencies) - vanished :] = 0.0
        found.values.append(values)
        found.materials.append(name)
    return found


def resampled(rate: float, to: float, format: str, folder: Path) -> Made:
    """Frequencies below the new Nyquist frequency stay, those above it vanish."""
    low = min(rate, to)
    outer = (0.77 * low, 0.93 * low) if to < rate else ()
    frequencies = (0.1 * low, 0.23 * low, *outer)
    seconds = np.arange(int(20 * rate)) / rate
    of = Walk(tones(seconds, frequencies), seconds, ["grass" if second < 10.0 else "gravel" for second in seconds], rate)
    steps = int(9.5 * to)
    expected = two_labels(to, steps, frequencies, len(outer))
    arguments = ("--resample", f"{to:g}", "--window", str(steps))
    return Made(write(of, folder, format), (Import(expected, arguments, to, tolerance=5e-3, margin=int(1.5 * to)),))


def lost(share: float, format: str, folder: Path) -> Made:
    """Lost frames are interpolated, by the time stamps."""
    random = np.random.default_rng(seed_of(f"4 lost {share}"))
    rate, to, frequencies = 200.0, 50.0, (1.0, 3.0)
    seconds = np.arange(int(20 * rate)) / rate
    while True:
        kept = np.flatnonzero(random.random(len(seconds)) >= share)
        kept = np.union1d(kept, [0, len(seconds) - 1, len(seconds) // 2 - 1, len(seconds) // 2])
        if np.diff(kept).max() <= 5:
            break
    labels = ["grass" if second < 10.0 else "gravel" for second in seconds[kept]]
    of = Walk(tones(seconds, frequencies)[kept], seconds[kept], labels, rate)
    arguments = ("--resample", f"{to:g}", "--window", "475")
    expected = two_labels(to, 475, frequencies)
    return Made(write(of, folder, format), (Import(expected, arguments, to, tolerance=0.02, margin=75),))


def uncut(rate: float, format: str, folder: Path) -> Made:
    """A recording with labels that is not cut: the message names the cure."""
    path = write(walk(f"4 uncut {rate}", rate), folder, format)
    return Made(path, (Says(("data", "import", "FILE", "--out", "FOLDER/imported.npz"), r"--window", 2),))


def cases() -> Iterator[Case]:
    for format in ("table", "parquet"):
        for name in SPANS:
            for gap in (None, 20.0):
                yield Case(f"4 windows/{name}{' and a gap' if gap else ''}/{format}", 4, format, partial(by_labels, name, gap, format))
        for rate, unit in [(50.0, ""), (100.0, "_ms")]:
            yield Case(f"4 windows/intervals{unit}/{format}", 4, format, partial(by_intervals, rate, unit, format))
        for rate, to in [(200.0, 50.0), (100.0, 40.0), (750.0, 100.0), (50.0, 200.0)]:
            yield Case(f"4 resample/{rate:g} to {to:g} Hz/{format}", 4, format, partial(resampled, rate, to, format))
        for share in (0.1, 0.25):
            yield Case(f"4 resample/{100 * share:g} % lost/{format}", 4, format, partial(lost, share, format))
        for rate in (20.0, 100.0):
            yield Case(f"4 windows/not asked for, {rate:g} Hz/{format}", 4, format, partial(uncut, rate, format))
