"""Foreign values, padding and values that 32-bit floats do not keep (items 5 to 7)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from expectations import Case, Find, Made, NoOther, Refused
from signals import Array, Sweeps, digits, seed_of, sweeps
from writers import ARRAYS, FORMATS, write


def sensor(name: str, kind: str = "float", steps: int = 200, taxels: int = 8, per_material: int = 6) -> Sweeps:
    """Returns sweeps of a sensor: floats, or digits of 8 to 16 bits."""
    of = sweeps(name, 3, per_material, steps, taxels)
    return of if kind == "float" else digits(of, int(kind.removesuffix(" bit")))


#: Fill value, sensor and formats.
FILLS: dict[str, tuple[float, str, tuple[str, ...]]] = {
    "1e20": (1e20, "float", FORMATS),
    "-9999": (-9999.0, "float", FORMATS),
    "65535 in 12 bit": (65535, "12 bit", FORMATS),
    "999.99": (999.99, "float", ("npz", "table")),
    "9.96921e36": (9.969209968386869e36, "float", ("npz", "h5")),
    "3.4e38": (float(np.finfo(np.float32).max), "float", ("npz", "parquet")),
    "-999": (-999.0, "float", ("folder", "npy")),
    "32767 in 12 bit": (32767, "12 bit", ("npy", "folder")),
}


def fill_value(name: str, format: str, folder: Path) -> Made:
    value, kind, _ = FILLS[name]
    of = sensor(f"5 fill {name}", kind)
    of.values[7][31, 5] = value
    of.values[7][90, 5] = value
    at = {"sweep": 7, "step": 31, "taxel": 5}
    return Made(write(format, of, folder), (Find("fill_value", "error", at), NoOther(("fill_value",))))


def spike(bits: int | None, frames: int, format: str, folder: Path) -> Made:
    of = sensor(f"5 spike {bits} {frames}", f"{bits} bit" if bits else "float")
    sweep, step, taxel = 10, 77, 3
    if bits:
        # Words of 16 bits leave room for a spike.
        of = of.mapped(lambda values: values.astype(np.uint16))
        far = 60_000.0
    else:
        far = 30.0 + 60.0 * np.abs(np.concatenate(of.values)[:, taxel] - 30.0).max()
    for more in range(frames):
        of.values[sweep][step + more, taxel] = far - more * 7
    at = {"sweep": sweep, "step": step, "taxel": taxel}
    return Made(write(format, of, folder), (Find("spike", "warning", at), NoOther(("spike",))))


def many_spikes(format: str, folder: Path) -> Made:
    of = sensor("5 many spikes")
    random = np.random.default_rng(seed_of("5 many spikes"))
    for values in of.values:
        for step in random.choice(np.arange(2, 190, 4), 8, replace=False):
            values[step, random.integers(8)] += 600.0
    return Made(write(format, of, folder), (Find("spike", "error"), NoOther(("spike",))))


#: Zero or frozen frames, sensor, number of frames, severity.
DROPOUTS: dict[str, tuple[bool, str, int, str]] = {
    "5 zero frames": (True, "float", 5, "warning"),
    "20 zero frames": (True, "12 bit", 20, "error"),
    "10 frozen frames": (False, "float", 10, "warning"),
    "40 frozen frames": (False, "12 bit", 40, "error"),
}


def dropout(name: str, format: str, folder: Path) -> Made:
    zero, kind, frames, severity = DROPOUTS[name]
    of = sensor(f"5 dropout {name}", kind)
    of.values[4][100 : 100 + frames] = 0 if zero else of.values[4][99]
    at = {"sweep": 4, "step": 100 if zero else 99}
    found = Find("dropout", severity, at, rf"{frames if zero else frames + 1} of 200")
    return Made(write(format, of, folder), (found, NoOther(("dropout",))))


def dead(kind: str, odd: int, format: str, folder: Path) -> Made:
    """One taxel has the same value in all frames but a few."""
    of = sensor(f"5 dead {kind} {odd}", kind)
    usual = of.values[0][0, 2]
    for values in of.values:
        values[:, 6] = usual
    for place in range(odd):
        of.values[3 * place][50 + place, 6] = of.values[3 * place][50, 2] + 1
    found = Find("dead_taxel", "warning", {"taxel": 6})
    return Made(write(format, of, folder), (found, NoOther(("dead_taxel", "spike"))))


#: Content of the padding, and the sensor.
PADDINGS = {"zeros": "float", "last frame": "float", "noise": "float", "zeros of 12 bit": "12 bit"}


def pad(values: Array, name: str, kept: int, random: np.random.Generator) -> int:
    """Fills up a sweep of `kept` frames; returns the first step of equal frames."""
    steps = len(values)
    if "in front" in name:
        values[: steps - kept] = 0
        return 0
    if name.startswith("zeros"):
        values[kept:] = 0
        return kept
    if name.startswith("last"):
        values[kept:] = values[kept - 1]
        return kept - 1
    values[kept:] = 0.02 * random.standard_normal(values[kept:].shape)
    return kept


def padding(name: str, kind: str, follows: bool, format: str, folder: Path) -> Made:
    """Item 6: sweeps that were filled up, by lengths that follow the material or not."""
    of = sensor(f"6 {name}", kind, per_material=8)
    random = np.random.default_rng(seed_of(f"6 {name} {follows}"))
    own = {"cork": 120, "felt": 150, "granite": 175}
    starts = []
    for material, values in zip(of.materials, of.values, strict=True):
        kept = own[material] + int(random.integers(-6, 7)) if follows else int(random.integers(110, 190))
        starts.append(pad(values, name, kept, random))
    expect: list[Any] = []
    for sweep in (0, 11, 23):
        # Where noise begins is known within some frames only.
        at = {"sweep": sweep} if name == "noise" else {"sweep": sweep, "step": starts[sweep]}
        expect.append(Find("padding", "warning|error", at))
    separates = Find("padding", "error", message="separates? the materials", count=None if follows else 0)
    return Made(write(format, of, folder), (*expect, separates, NoOther(("padding",))))


#: Offset, amplitude, true for whole numbers, steps of a 32-bit float at the offset.
OFFSETS: dict[str, tuple[float, float, bool, str]] = {
    "5e7 + 30": (5e7, 30.0, False, "4"),
    "1.6e9 + digits": (1.6e9, 40.0, True, "128"),
    "1.6e9 + 20": (1.6e9, 20.0, False, "128"),
    "-5e7 + digits": (-5e7, 200.0, True, "4"),
}


def resolution(name: str, format: str, folder: Path) -> Made:
    """Item 7: values whose resolution a 32-bit float does not keep are refused with their taxel."""
    offset, amplitude, whole, kept = OFFSETS[name]
    of = sweeps(f"7 {name}", 3, 6, 120, 6, offset=0.0, amplitude=amplitude / 4)
    for values in of.values:
        values[:, 2] += offset
    if whole:
        of = of.mapped(lambda values: np.round(values).astype(np.int64))
    pattern = rf"taxel \(0, 2\) lies near .*keeps steps of {kept}\b.*(offset|subtract)"
    return Made(write(format, of, folder), (Refused(pattern, {"taxel": 2}),))


def cases() -> Iterator[Case]:
    for name, (_, _, wanted) in FILLS.items():
        for format in wanted:
            yield Case(f"5 fill value/{name}/{format}", 5, format, partial(fill_value, name, format))
    for format in FORMATS:
        for bits, frames in ((None, 1), (None, 2), (12, 3)):
            yield Case(f"5 spike/{frames} of {f'{bits} bit' if bits else 'float'}/{format}", 5, format, partial(spike, bits, frames, format))
        for name in DROPOUTS:
            yield Case(f"5 dropout/{name}/{format}", 5, format, partial(dropout, name, format))
        for kind, odd in (("float", 3), ("12 bit", 2), ("float", 0)):
            yield Case(f"5 dead taxel/{odd} odd frames of {kind}/{format}", 5, format, partial(dead, kind, odd, format))
        for name, kind in PADDINGS.items():
            yield Case(f"6 padding/{name}, by material/{format}", 6, format, partial(padding, name, kind, True, format))
        for name in OFFSETS:
            yield Case(f"7 resolution/{name}/{format}", 7, format, partial(resolution, name, format))
    for format in ARRAYS:
        yield Case(f"5 spike/many/{format}", 5, format, partial(many_spikes, format))
    for format in ("npz", "table", "h5"):
        for name, kind in PADDINGS.items():
            yield Case(f"6 padding/{name}, by chance/{format}", 6, format, partial(padding, name, kind, False, format))
    for kind in ("float", "12 bit"):
        for format in ("npz", "folder"):
            name = f"zeros in front of {kind}"
            yield Case(f"6 padding/{name}/{format}", 6, format, partial(padding, name, kind, False, format))
