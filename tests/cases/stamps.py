"""Time stamps: rates, gaps, lost frames and the ways of writing a time (items 1 to 3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from expectations import Case, Expectation, Find, Import, Made, NoOther, Rate, Refused
from signals import Array, Sweeps, seed_of, sweeps
from writers import TABLES, file_of, write

#: Unix time of the first frame, in seconds.
NOON = 1_717_156_800.0

Stamping = Callable[[Array, np.random.Generator], Array]


def timed(name: str, rate: float, stamping: Stamping, per_material: int = 5, steps: int = 300, taxels: int = 4, start: float = 0.0) -> Sweeps:
    """Returns sweeps whose times are `stamping(times of the frames, random numbers)`."""
    of = sweeps(name, 2, per_material, steps, taxels, rate)
    random = np.random.default_rng(seed_of(name + " stamps"))
    seconds = []
    for _ in of.values:
        exact = start + np.arange(steps) / rate
        seconds.append(stamping(exact, random))
        start = float(exact[-1]) + 0.5
    return replace(of, seconds=seconds)


def exact(seconds: Array, _: np.random.Generator) -> Array:
    return seconds


def rounded(unit: float) -> Stamping:
    return lambda seconds, _: np.round(seconds / unit) * unit


def bursts(frames: int, inside: float) -> Stamping:
    """Frames arrive together: a buffer of this many, with `inside` seconds between its frames."""

    def stamping(seconds: Array, random: np.random.Generator) -> Array:
        place = np.arange(len(seconds)) + int(random.integers(frames))
        arrival = np.minimum(place // frames * frames + frames - 1, place[-1])
        period = seconds[1] - seconds[0]
        return np.asarray(seconds[0] + (arrival - place[0]) * period - (frames - 1 - place % frames) * inside)

    return stamping


def received(mean: float, share: float) -> Stamping:
    """Stamps at reception: a share of the frames comes late, others catch up."""

    def stamping(seconds: Array, random: np.random.Generator) -> Array:
        delay = np.where(random.random(len(seconds)) < share, random.exponential(mean, len(seconds)), 0.0)
        jitter = 2e-4 * random.random(len(seconds))
        return np.asarray(np.maximum.accumulate(seconds + delay + jitter) + 1e-6 * np.arange(len(seconds)))

    return stamping


#: Rate in Hz, stamps, and true if mean and median interval differ by over 5 %.
KINDS: dict[str, tuple[float, Stamping, bool]] = {
    "750 Hz in ms": (750.0, rounded(1e-3), True),
    "400 Hz in ms": (400.0, rounded(1e-3), True),
    "60 Hz in ms": (60.0, rounded(1e-3), False),
    "300 Hz in ms": (300.0, rounded(1e-3), True),
    "2000 Hz in ms": (2000.0, rounded(1e-3), True),
    "30 Hz in hundredths": (30.0, rounded(1e-2), True),
    "200 Hz in bursts of 10": (200.0, bursts(10, 1e-4), True),
    "1000 Hz in bursts of 32": (1000.0, bursts(32, 2e-5), True),
    "138.8 Hz at reception": (138.8, received(0.02, 0.5), True),
    "90 Hz at reception": (90.0, received(0.03, 0.6), True),
}


def rate(name: str, format: str, folder: Path) -> Made:
    hz, stamping, irregular = KINDS[name]
    of = timed(f"1 {name}", hz, stamping)
    warned: tuple[Any, ...] = (Find("irregular_rate", "warning"),) if irregular else ()
    return Made(write(format, of, folder), (Rate(hz, 0.01), *warned, NoOther(("irregular_rate",))))


def named_rate(own: float, named: float, format: str, folder: Path) -> Made:
    expect = (Find("named_rate", "warning"), Rate(named), NoOther(("named_rate",)))
    return Made(write(format, timed("1 named", own, exact), folder), expect, ("--rate", f"{named:g}"))


def rates() -> Iterator[Case]:
    """Item 1: the rate of stamps that are rounded, buffered or delayed."""
    for name in KINDS:
        for format in TABLES:
            yield Case(f"1 rate/{name}/{format}", 1, format, partial(rate, name, format))
    for own, named in [(100.0, 120.0), (750.0, 1000.0)]:
        for format in ("table", "npz", "parquet", "h5"):
            yield Case(f"1 named rate/{own:g} as {named:g} Hz/{format}", 1, format, partial(named_rate, own, named, format))


def mixed_rates(usual: float, odd: float, many: int, format: str, folder: Path) -> Made:
    of = timed(f"1 mixed {usual} {odd}", usual, exact)
    others = [2, 5, 9][:many]
    for sweep in others:
        of.seconds[sweep] = of.seconds[sweep][0] + np.arange(of.steps) / odd
    places: list[dict[str, Any]] = [{"sweep": sweep, "material": of.materials[sweep]} for sweep in others]
    if format == "folder":
        places = [place | {"file": file_of(of, place["sweep"])} for place in places]
    found = [Find("mixed_rates", "error", place, rf"{odd:g} Hz") for place in places]
    expect: tuple[Expectation, ...] = (*found, Find("mixed_rates", "error", count=many), NoOther(("mixed_rates",)), Rate(usual))
    return Made(write(format, of, folder), expect)


def nearly_equal(format: str, folder: Path) -> Made:
    of = timed("1 nearly equal", 100.0, exact)
    for sweep in range(0, len(of.values), 2):
        of.seconds[sweep] = of.seconds[sweep][0] + np.arange(of.steps) / 100.8
    return Made(write(format, of, folder), (NoOther(), Rate(100.4, 0.01)))


def mixed() -> Iterator[Case]:
    """Item 1: files of different rates."""
    for usual, odd, many in [(100.0, 104.0, 1), (100.0, 50.0, 2), (20.0, 21.0, 3), (750.0, 1000.0, 1)]:
        for format in TABLES:
            yield Case(f"1 mixed rates/{many} of {odd:g} in {usual:g} Hz/{format}", 1, format, partial(mixed_rates, usual, odd, many, format))
    for format in TABLES:
        yield Case(f"0 sound/rates within 1 %/{format}", 0, format, partial(nearly_equal, format))


def at_frame(of: Sweeps, sweep: int, frame: int, format: str) -> dict[str, Any]:
    """Returns the place of a frame in a file with one line of names."""
    at: dict[str, Any] = {"sweep": sweep, "step": frame, "material": of.materials[sweep]}
    if format == "table":
        at["line"] = 2 + sweep * of.steps + frame
    elif format == "folder":
        at |= {"line": 2 + frame, "file": file_of(of, sweep)}
    return at


def gap(length: float, steps: int, severity: str, format: str, folder: Path) -> Made:
    of = timed(f"2 gap {length} {steps}", 50.0, exact, steps=steps, taxels=2)
    sweep, frame = 3, steps // 3
    of.seconds[sweep][frame:] += length
    found = Find("time_gap", severity, at_frame(of, sweep, frame, format), r"no frame for")
    expect = (found, Find("time_gap", severity, count=1), NoOther(("time_gap",)), Rate(50.0))
    return Made(write(format, of, folder), expect)


def from_1970(start: float, set_to: float, format: str, folder: Path) -> Made:
    """A clock that is set during the recording."""
    of = timed("2 from 1970", 100.0, exact, start=set_to)
    of.seconds[0][:60] = start + np.arange(60) / 100.0
    expect = (Find("time_gap", "error", at_frame(of, 0, 60, format), "clock"), NoOther(("time_gap",)), Rate(100.0))
    return Made(write(format, of, folder), expect)


def backwards(back: float, named: float | None, format: str, folder: Path) -> Made:
    """A step back; with a named rate it is only a warning."""
    of = timed("2 backwards", named or 100.0, exact, start=7200.0)
    of.seconds[4][150:] -= back
    at = at_frame(of, 4, 150, format)
    if named is None:
        return Made(write(format, of, folder), (Find("clock_backwards", "error", at), NoOther(("clock_backwards",))))
    expect = (Find("clock_backwards", "warning", at), NoOther(("clock_backwards",)), Rate(named))
    return Made(write(format, of, folder), expect, ("--rate", f"{named:g}"))


def gaps() -> Iterator[Case]:
    """Item 2: gaps, lost frames, clocks that start in 1970 or go backwards."""
    lengths = [
        ("1 h", 3600.0, 200, "error"),
        ("3 s", 3.0, 200, "error"),
        ("3 s in a minute", 3.0, 3000, "warning"),
        ("1 s", 1.0, 400, "error"),
        ("a week", 604_800.0, 400, "error"),
    ]
    for format in TABLES:
        for name, length, steps, severity in lengths:
            yield Case(f"2 gap/{name}/{format}", 2, format, partial(gap, length, steps, severity, format))
        for share, severity, hz in [(0.25, "error", 100.0), (0.05, "error", 100.0), (0.01, "warning", 200.0), (0.25, "error", 750.0)]:
            yield Case(f"2 lost frames/{100 * share:g} % at {hz:g} Hz/{format}", 2, format, partial(lost_frames, share, severity, hz, format))
        for start, set_to in [(0.0, 1.7e9), (1000.0, 1.717e9)]:
            yield Case(f"2 clock from 1970/{start:g} s/{format}", 2, format, partial(from_1970, start, set_to, format))
        for back in (0.5, 3600.0):
            yield Case(f"2 clock backwards/{back:g} s/{format}", 2, format, partial(backwards, back, None, format))
    for hz in (100.0, 750.0):
        yield Case(f"2 clock backwards/named {hz:g} Hz/table", 2, "table", partial(backwards, 10.0, hz, "table"))


def lost_frames(share: float, severity: str, hz: float, format: str, folder: Path) -> Made:
    """Frames of two sweeps are missing at random, at most four at once."""
    name = f"2 lost {share} {hz}"
    of = timed(name, hz, exact, steps=400)
    random = np.random.default_rng(seed_of(name))
    expect: list[Any] = []
    # All recordings lose frames, so that they stay equally long.
    lost = round(share * 400)
    for sweep in range(len(of.values)):
        while True:
            kept = np.sort(random.permutation(np.arange(1, 399))[: 398 - lost])
            kept = np.concatenate([[0], kept, [399]])
            if np.diff(kept).max() <= 4:
                break
        of.values[sweep], of.seconds[sweep] = of.values[sweep][kept], of.seconds[sweep][kept]
        first = int(np.argmax(np.diff(kept) > 1)) + 1
        if sweep in (0, 7):
            at = {"sweep": sweep, "step": first} | ({"line": 2 + sweep * len(kept) + first} if format == "table" else {})
            expect.append(Find("lost_frames", severity, at, rf"\b{lost} of 400 frames"))
    expect += [NoOther(("lost_frames", "irregular_rate")), Rate(hz)]
    return Made(write(format, of, folder), tuple(expect))


def iso(separator: str, ending: str, offset_hours: float = 0.0, digits: int = 6) -> Callable[[float], str]:
    def text(seconds: float) -> str:
        at = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=round((seconds + 3600 * offset_hours) * 1e6))
        fraction = f".{at.microsecond:06}"[: digits + 1] if digits else ""
        return at.strftime(f"%Y-%m-%d{separator}%H:%M:%S") + fraction + ending

    return text


def german(seconds: float) -> str:
    at = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=round(seconds * 1e6))
    return at.strftime("%d.%m.%Y %H:%M:%S") + f".{at.microsecond // 1000:03}"


def time_of_day(seconds: float) -> str:
    at = datetime.fromtimestamp(0, UTC) + timedelta(microseconds=round(seconds * 1e6))
    return at.strftime("%H:%M:%S") + f".{at.microsecond:06}"


#: Ways to write a time: name of the column, text of the seconds since 1970.
WRITTEN: dict[str, tuple[str, Callable[[float], str]]] = {
    "ISO with Z": ("time", iso("T", "Z")),
    "ISO without zone": ("timestamp", iso("T", "")),
    "ISO with +02:00": ("Timestamp", iso("T", "+02:00", 2.0)),
    "ISO with blank": ("datetime", iso(" ", "", digits=3)),
    "ISO with UTC": ("time", iso(" ", " UTC", digits=3)),
    "German date": ("Zeitstempel", german),
    "time of day": ("Uhrzeit", time_of_day),
    "Unix s": ("timestamp", lambda s: f"{s:.6f}"),
    "Unix ms": ("timestamp", lambda s: str(round(s * 1e3))),
    "Unix us": ("timestamp", lambda s: str(round(s * 1e6))),
    "Unix ns": ("timestamp", lambda s: str(round(s * 1e9))),
    "Zeit [ms]": ("Zeit [ms]", lambda s: f"{(s - NOON) * 1e3:.3f}"),
    "t_us": ("t_us", lambda s: str(round((s - NOON) * 1e6))),
    "time (ns)": ("time (ns)", lambda s: str(round((s - NOON) * 1e9))),
    "temps [s]": ("temps [s]", lambda s: f"{s - NOON:.6f}"),
    "header.stamp in s": ("header.stamp", lambda s: f"{s:.6f}"),
}


def one_column(name: str, hz: float, format: str, folder: Path) -> Made:
    column, text = WRITTEN[name]
    of = timed(f"3 {column}", hz, exact, steps=120, start=NOON)
    cells: list[Any] = [[text(float(second)) for second in seconds] for seconds in of.seconds]
    if format == "parquet" and cells[0][0].isdigit():
        cells = [[int(of_frame) for of_frame in of_sweep] for of_sweep in cells]
    of = replace(of, columns={column: cells})
    return Made(write(format, of, folder), (NoOther(), Import(of, rate=hz)))


def two_columns(names: tuple[str, str], format: str, folder: Path) -> Made:
    of = timed(f"3 {names[0]}", 125.0, exact, steps=120, start=NOON)
    per_second = 1e6 if names[1].endswith("usec") else 1e9
    whole = [np.floor(seconds).astype(int) for seconds in of.seconds]
    rest = [np.round((seconds - np.floor(seconds)) * per_second).astype(int) for seconds in of.seconds]
    of = replace(of, columns={names[0]: whole, names[1]: rest})
    return Made(write(format, of, folder), (NoOther(), Import(of, rate=125.0)))


def one(text: str) -> list[str]:
    """Returns stamps of which that of frame 17 is `text`."""
    return [text if frame == 17 else f"{frame / 100:.2f}" for frame in range(50)]


#: Stamps that cannot be read: name of the column, cells, line of the first bad one, and the message.
BAD: dict[str, tuple[str, list[str], int | None, str]] = {
    "words": ("time", one("noon"), 19, r"column `time`.*expected a time.*`noon`.*rename"),
    "one empty": ("time", one(""), 19, r"column `time`.*found nothing"),
    "versions": ("Zeit", [f"1.2.3.{frame}" for frame in range(50)], 2, r"column `Zeit`.*expected a time.*1\.2\.3"),
    "no unit": ("timestamp", [str(120_000_000_000_000 + frame * 10_000_000) for frame in range(50)], None, r"column `timestamp`.*timestamp_(us|ns)"),
}


def unreadable(name: str, format: str, folder: Path) -> Made:
    """The message names the column, the text and the cure."""
    column, cells, line, pattern = BAD[name]
    of = timed(f"3 bad {column}", 100.0, exact, steps=50)
    of = replace(of, columns={column: [cells] * len(of.values)})
    at: dict[str, Any] = {} if line is None else {"column": column, "line": line}
    return Made(write(format, of, folder), (Refused(pattern, at),))


def written() -> Iterator[Case]:
    """Item 3: all usual ways to write a time."""
    for name in WRITTEN:
        for format, hz in (("table", 125.0), ("folder", 40.0), ("parquet", 250.0)):
            yield Case(f"3 stamp/{name}/{format}", 3, format, partial(one_column, name, hz, format))
    for names in (("sec", "nanosec"), ("header.stamp.secs", "header.stamp.nsecs"), ("tv_sec", "tv_usec")):
        for format in TABLES:
            yield Case(f"3 stamp/{names[0]} and {names[1]}/{format}", 3, format, partial(two_columns, names, format))
    for name in BAD:
        for format in ("table", "folder"):
            yield Case(f"3 unreadable stamp/{name}/{format}", 3, format, partial(unreadable, name, format))


def cases() -> Iterator[Case]:
    yield from rates()
    yield from mixed()
    yield from gaps()
    yield from written()
