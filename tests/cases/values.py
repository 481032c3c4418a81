"""Foreign values, padding and values that 32-bit floats do not keep (items 5 to 7)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from expectations import Case, Find, Made, NoOther, Refused
from signals import Array, Sweeps, digits, seed_of, sweeps
from writers import ARRAYS, FORMATS, write

#: Formats of each fault: all, so that no reader loses it.
EVERY = FORMATS


def sensor(name: str, kind: str = "float", steps: int = 200, taxels: int = 8, per_material: int = 6) -> Sweeps:
    """Returns sweeps of a sensor: floats, or digits of 8 to 16 bits."""
    of = sweeps(name, 3, per_material, steps, taxels)
    return of if kind == "float" else digits(of, int(kind.removesuffix(" bit")))


def fill_values() -> Iterator[Case]:
    kinds: list[tuple[str, float, str, tuple[str, ...]]] = [
        ("1e20", 1e20, "float", FORMATS),
        ("-9999", -9999.0, "float", FORMATS),
        ("65535 in 12 bit", 65535, "12 bit", FORMATS),
        ("999.99", 999.99, "float", ("npz", "table")),
        ("9.96921e36", 9.969209968386869e36, "float", ("npz", "h5")),
        ("3.4e38", float(np.finfo(np.float32).max), "float", ("npz", "parquet")),
        ("-999", -999.0, "float", ("folder", "npy")),
        ("32767 in 12 bit", 32767, "12 bit", ("npy", "folder")),
    ]
    for name, value, kind, wanted in kinds:
        for format in wanted:

            def make(folder: Path, name: str = name, value: float = value, kind: str = kind, format: str = format) -> Made:
                of = sensor(f"5 fill {name}", kind)
                of.values[7][31, 5] = value
                of.values[7][90, 5] = value
                at = {"sweep": 7, "step": 31, "taxel": 5}
                expect = (Find("fill_value", "error", at, r"taxel|fill|missing|written"), NoOther(("fill_value",)))
                return Made(write(format, of, folder), expect)

            yield Case(f"5 fill value/{name}/{format}", 5, format, make)


def spikes() -> Iterator[Case]:
    for name, kind, frames in [("one frame", "float", 1), ("two frames", "float", 2), ("three frames of 16 bit", "16 bit", 3)]:
        for format in EVERY:

            def make(folder: Path, name: str = name, kind: str = kind, frames: int = frames, format: str = format) -> Made:
                of = sensor(f"5 spike {name}", kind)
                sweep, step, taxel = 10, 77, 3
                flat = np.concatenate(of.values)[:, taxel].astype(float)
                far = np.median(flat) + (12.0 if kind == "float" else 3.2) * np.abs(flat - np.median(flat)).max()
                if kind != "float":
                    # Digits of 14 bits in a word of 16 leave room for a spike.
                    for index, values in enumerate(of.values):
                        of.values[index] = (values // 8).astype(np.uint16)
                    far = 60_000.0
                for more in range(frames):
                    of.values[sweep][step + more, taxel] = far - more * 7
                at = {"sweep": sweep, "step": step, "taxel": taxel}
                return Made(write(format, of, folder), (Find("spike", "warning", at), NoOther(("spike",))))

            yield Case(f"5 spike/{name}/{format}", 5, format, make)
    for format in ARRAYS:

        def make(folder: Path, format: str = format) -> Made:
            of = sensor("5 many spikes")
            random = np.random.default_rng(seed_of("5 many spikes"))
            for values in of.values:
                for step in random.choice(np.arange(2, 190, 4), 8, replace=False):
                    values[step, random.integers(8)] += 600.0
            return Made(write(format, of, folder), (Find("spike", "error"), NoOther(("spike",))))

        yield Case(f"5 spike/many/{format}", 5, format, make)


def dropouts() -> Iterator[Case]:
    zeros: Callable[[Array, int, int], None]

    def zeros(values: Array, start: int, frames: int) -> None:
        values[start : start + frames] = 0

    def frozen(values: Array, start: int, frames: int) -> None:
        values[start : start + frames] = values[start - 1]

    kinds: list[tuple[str, Any, str, int, str]] = [
        ("5 zero frames", zeros, "float", 5, "warning"),
        ("20 zero frames", zeros, "12 bit", 20, "error"),
        ("10 frozen frames", frozen, "float", 10, "warning"),
        ("40 frozen frames", frozen, "12 bit", 40, "error"),
    ]
    for name, change, kind, frames, severity in kinds:
        for format in EVERY:

            def make(folder: Path, name: str = name, change: Any = change, kind: str = kind, frames: int = frames, severity: str = severity, format: str = format) -> Made:
                of = sensor(f"5 dropout {name}", kind)
                change(of.values[4], 100, frames)
                start = 100 if change is zeros else 99
                at = {"sweep": 4, "step": start}
                expect = (Find("dropout", severity, at, rf"{frames + (change is not zeros)} of 200"), NoOther(("dropout",)))
                return Made(write(format, of, folder), expect)

            yield Case(f"5 dropout/{name}/{format}", 5, format, make)


def dead() -> Iterator[Case]:
    for name, kind, odd in [("odd frames", "float", 3), ("odd frames of 12 bit", "12 bit", 2), ("no odd frame", "float", 0)]:
        for format in EVERY:

            def make(folder: Path, name: str = name, kind: str = kind, odd: int = odd, format: str = format) -> Made:
                of = sensor(f"5 dead {name}", kind)
                usual = of.values[0][0, 2]
                for values in of.values:
                    values[:, 6] = usual
                for place in range(odd):
                    of.values[3 * place][50 + place, 6] = of.values[3 * place][50, 2] + 1
                allowed = ("dead_taxel", "spike")
                return Made(write(format, of, folder), (Find("dead_taxel", "warning", {"taxel": 6}), NoOther(allowed)))

            yield Case(f"5 dead taxel/{name}/{format}", 5, format, make)


def padding() -> Iterator[Case]:
    """Item 6: sweeps that were filled up, by lengths that follow the material or not."""

    def zeros(values: Array, start: int, _: np.random.Generator) -> None:
        values[start:] = 0

    def last(values: Array, start: int, _: np.random.Generator) -> None:
        values[start:] = values[start - 1]

    def noise(values: Array, start: int, random: np.random.Generator) -> None:
        shape = values[start:].shape
        values[start:] = (0.02 * random.standard_normal(shape)).astype(values.dtype)

    def head(values: Array, end: int, _: np.random.Generator) -> None:
        values[: 200 - end] = 0

    kinds: list[tuple[str, Any, str]] = [("zeros", zeros, "float"), ("last frame", last, "float"), ("noise", noise, "float"), ("zeros of 12 bit", zeros, "12 bit")]
    for name, change, kind in kinds:
        for follows in (True, False):
            for format in EVERY if follows else ("npz", "table", "h5"):

                def make(folder: Path, name: str = name, change: Any = change, kind: str = kind, follows: bool = follows, format: str = format) -> Made:
                    return padded(folder, name, change, kind, follows, format)

                yield Case(f"6 padding/{name}, {'by material' if follows else 'by chance'}/{format}", 6, format, make)
    for kind in ("float", "12 bit"):
        for format in ("npz", "folder"):

            def make(folder: Path, kind: str = kind, format: str = format) -> Made:
                return padded(folder, "zeros in front", head, kind, False, format)

            yield Case(f"6 padding/zeros in front of {kind}/{format}", 6, format, make)


def padded(folder: Path, name: str, change: Any, kind: str, follows: bool, format: str) -> Made:
    of = sensor(f"6 {name} {kind}", kind, per_material=8)
    random = np.random.default_rng(seed_of(f"6 {name} {follows}"))
    own = {"cork": 120, "felt": 150, "granite": 175}
    starts = []
    for sweep, values in enumerate(of.values):
        length = own[of.materials[sweep]] + int(random.integers(-6, 7)) if follows else int(random.integers(110, 190))
        change(values, length, random)
        starts.append(length)
    expect: list[Any] = []
    for sweep in (0, 11, 23):
        start = starts[sweep]
        at: dict[str, Any] = {"sweep": sweep}
        if name.startswith("zeros in"):
            at["step"] = 0
        elif name.startswith("zeros"):
            at["step"] = start
        elif name.startswith("last"):
            at["step"] = start - 1
        expect.append(Find("padding", "warning|error", at))
    if follows:
        expect.append(Find("padding", "error", message="separates? the materials"))
    else:
        expect.append(Find("padding", "error", count=0))
    expect.append(NoOther(("padding",)))
    return Made(write(format, of, folder), tuple(expect))


def resolution() -> Iterator[Case]:
    """Item 7: values whose resolution a 32-bit float does not keep are refused with their taxel."""
    kinds: list[tuple[str, float, float, bool, str]] = [
        ("5e7 + 30", 5e7, 30.0, False, "4"),
        ("1.6e9 + digits", 1.6e9, 40.0, True, "128"),
        ("1.6e9 + 20", 1.6e9, 20.0, False, "128"),
        ("-5e7 + digits", -5e7, 200.0, True, "4"),
    ]
    for name, offset, amplitude, whole, kept in kinds:
        for format in EVERY:

            def make(folder: Path, name: str = name, offset: float = offset, amplitude: float = amplitude, whole: bool = whole, kept: str = kept, format: str = format) -> Made:
                of = sweeps(f"7 {name}", 3, 6, 120, 6, offset=0.0, amplitude=amplitude / 4)
                for values in of.values:
                    values[:, 2] += offset
                if whole:
                    of = of.mapped(lambda values: np.round(values).astype(np.int64))
                pattern = rf"taxel \(0, 2\) lies near .*keeps steps of {kept}\b.*(offset|subtract)"
                return Made(write(format, of, folder), (Refused(pattern, {"taxel": 2}),))

            yield Case(f"7 resolution/{name}/{format}", 7, format, make)


def cases() -> Iterator[Case]:
    yield from fill_values()
    yield from spikes()
    yield from dropouts()
    yield from dead()
    yield from padding()
    yield from resolution()
