"""Realistic sweeps: smooth random motion with noise, other for every sweep, taxel and material."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

MATERIALS = ("cork", "felt", "granite", "oak")


def seed_of(name: str) -> int:
    """Returns the seed that belongs to a name."""
    return zlib.crc32(name.encode())


@dataclass
class Sweeps:
    """Sweeps of a data set; `values[i]` is `[steps][taxels]`."""

    values: list[Array]
    materials: list[str]
    rate: float = 100.0
    #: Times of the frames in seconds, an array per sweep; empty without stamps.
    seconds: list[Array] = field(default_factory=list)
    #: Cells of further columns of a table: `[sweeps][frames]`.
    columns: dict[str, list[Any]] = field(default_factory=dict)
    blocks: list[int] | None = None
    #: Rows and columns of the patch, if the format can state them.
    grid: tuple[int, int] | None = None

    @property
    def steps(self) -> int:
        return len(self.values[0])

    @property
    def taxels(self) -> int:
        return int(self.values[0].shape[1])

    @property
    def counts(self) -> dict[str, int]:
        return {name: self.materials.count(name) for name in self.materials}

    def mapped(self, change: Any) -> Sweeps:
        """Returns sweeps with `change(values)` for every sweep."""
        return replace(self, values=[change(values) for values in self.values])

    def copy(self) -> Sweeps:
        return replace(self, values=[values.copy() for values in self.values], materials=list(self.materials))

    def stack(self) -> Array:
        return np.stack(self.values)


def smooth(random: np.random.Generator, steps: int, columns: int, corner: float) -> Array:
    """Returns random signals of unit variance whose spectrum falls above `corner`, a share of the Nyquist frequency."""
    length = 2 * steps + 64
    spectrum = np.fft.rfft(random.standard_normal((length, columns)), axis=0)
    frequency = np.linspace(0.0, 1.0, len(spectrum))
    spectrum /= (1.0 + (frequency / corner) ** 4)[:, None]
    spectrum[0] = 0.0
    signal = np.fft.irfft(spectrum, length, axis=0)
    return np.asarray(signal / signal.std(axis=0))[32 : 32 + steps]


def sweeps(
    seed: str,
    materials: tuple[str, ...] | int = 3,
    per_material: int = 6,
    steps: int = 200,
    taxels: int = 8,
    rate: float = 100.0,
    offset: float = 30.0,
    amplitude: float = 4.0,
    noise: float = 0.05,
    lengths: list[int] | None = None,
) -> Sweeps:
    """Returns sweeps in the order of their materials.

    - `noise`: standard deviation of the sensor's noise, as a share of `amplitude`
    - `lengths`: number of frames of each sweep in place of `steps`
    """
    random = np.random.default_rng(seed_of(seed))
    names = MATERIALS[:materials] if isinstance(materials, int) else materials
    gains = random.uniform(0.6, 1.4, taxels)
    found = Sweeps([], [], rate)
    for place, name in enumerate(names):
        corner = 0.05 + 0.3 * (place + 1) / len(names)
        pattern = random.uniform(-1.0, 1.0, taxels)
        for _ in range(per_material):
            frames = steps if lengths is None else lengths[len(found.values)]
            motion = smooth(random, frames, 1, 0.02)
            texture = smooth(random, frames, taxels, corner)
            values = 0.7 * motion * gains + 0.5 * texture + pattern + 0.3 * random.standard_normal()
            values = values + noise * random.standard_normal((frames, taxels))
            found.values.append(offset + amplitude * values)
            found.materials.append(name)
    return found


def digits(of: Sweeps, bits: int, share: float = 0.5) -> Sweeps:
    """Returns the sweeps as an analogue-to-digital converter of `bits` shows them, in the middle of its range."""
    full = 2**bits - 1
    stack = np.concatenate(of.values)
    low, high = stack.min(), stack.max()
    kind = np.uint8 if bits <= 8 else np.uint16

    def convert(values: Array) -> Array:
        unit = (values - low) / (high - low)
        return np.asarray(np.round(full * (0.5 + share * (unit - 0.5))).astype(kind))

    return of.mapped(convert)


def even_times(of: Sweeps, start: float = 0.0) -> Sweeps:
    """Returns the sweeps with exact time stamps, one second between sweeps."""
    seconds = []
    for values in of.values:
        seconds.append(start + np.arange(len(values)) / of.rate)
        start = float(seconds[-1][-1]) + 1.0
    return replace(of, seconds=seconds)
