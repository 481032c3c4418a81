"""Sound data sets of many kinds: no error and no warning."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from expectations import Case, Import, Made, NoOther
from signals import Array, Sweeps, digits, even_times, seed_of, sweeps
from writers import FORMATS, lerobot, write

#: Names of materials in the languages of other labs.
LANGUAGES: dict[str, tuple[str, ...]] = {
    "English": ("cork", "felt", "granite"),
    "German": ("Schleifpapier grob", "Filz (weiß)", "Kräuselkrepp"),
    "French": ("liège", "velours côtelé", "céramique émaillée"),
    "Chinese": ("软木", "毛毡", "花岗岩"),
    "Japanese": ("コルク", "フェルト", "花崗岩"),
    "Russian": ("пробка", "войлок", "гранит"),
    "Greek": ("φελλός", "τσόχα", "γρανίτης"),
    "Arabic": ("فلين", "لباد", "غرانيت"),
    "Hindi": ("कॉर्क", "नमदा", "ग्रेनाइट"),
    "numbered": ("cork 1", "cork 2", "cork 10"),
    "codes": ("P120", "P240", "P1200"),
    "sentences": ("pick up the red cup", "pick up the blue cup", "open the drawer"),
}

#: Steps, taxels and rate.
SHAPES = (
    (60, 1, 20.0),
    (128, 3, 50.0),
    (1000, 16, 750.0),
    (400, 24, 1000.0),
    (325, 78, 100.0),
    (100, 60, 25.0),
    (3000, 4, 250.0),
)


def changed(of: Sweeps, kind: str) -> Sweeps:
    """Returns the sweeps as a sensor of some kind shows them."""
    random = np.random.default_rng(seed_of(kind))

    def pressure(values: Array) -> Array:
        """A pressure in Pa on that of the atmosphere."""
        return 101_325.0 + 40.0 * (values - 30.0)

    def clipped(values: Array) -> Array:
        """A skin that is not touched all the time: zero, or the force above a threshold."""
        return np.maximum(values - 28.0, 0.0)

    def drifting(values: Array) -> Array:
        return values + np.linspace(0.0, random.uniform(0.5, 3.0), len(values))[:, None]

    kinds: dict[str, Callable[[Array], Array]] = {
        "pressure": pressure,
        "clipped": clipped,
        "drifting": drifting,
        "volts": lambda values: 0.01 * (values - 30.0),
        "large": lambda values: 1e6 * (values - 30.0),
        "tiny": lambda values: 1e-9 * (values - 30.0),
        "float32": lambda values: values.astype(np.float32),
        "signed": lambda values: np.round(500 * (values - 30.0)).astype(np.int16),
        "counts": lambda values: np.round(2 * np.maximum(values, 0)).astype(np.uint8),
        "two decimals": lambda values: np.round(values, 2),
    }
    return of.mapped(kinds[kind])


def sound(of: Sweeps, format: str, folder: Path) -> Made:
    stamped = even_times(of) if format in ("table", "folder", "parquet") else of
    path = lerobot(of, folder) if format == "lerobot" else write(format, stamped, folder)
    read = of.mapped(lambda values: values.astype(np.float32)) if format == "lerobot" else of
    return Made(path, (NoOther(), Import(read, rate=None if format == "npy" else of.rate)))


def by_language(language: str, format: str, folder: Path) -> Made:
    return sound(sweeps(f"0 {language}", LANGUAGES[language], 6, 80, 5, 50.0), format, folder)


def by_shape(shape: tuple[int, int, float], format: str, folder: Path) -> Made:
    steps, taxels, rate = shape
    return sound(sweeps(f"0 {shape}", 3, 5, steps, taxels, rate), format, folder)


def by_kind(kind: str, format: str, folder: Path) -> Made:
    return sound(changed(sweeps(f"0 {kind}", 3, 6, 150, 6), kind), format, folder)


def by_bits(bits: int, share: float, format: str, folder: Path) -> Made:
    return sound(digits(sweeps(f"0 {bits} bit", 3, 6, 200, 9, noise=0.1), bits, share), format, folder)


def by_seed(seed: int, format: str, folder: Path) -> Made:
    of = sweeps(f"0 seed {seed}", 4, 8, 200, 8, 100.0, offset=(seed % 3) * 10.0, noise=0.02 * (1 + seed % 4))
    return sound(digits(of, 12) if seed % 2 else of, format, folder)


def contacts(bits: int | None, format: str, folder: Path) -> Made:
    """A finger that touches, moves and is lifted: sweeps begin and end at rest."""
    of = sweeps(f"0 contacts {bits}", 3, 6, 300, 8)
    random = np.random.default_rng(seed_of(f"0 contacts {bits}"))
    values = []
    for own in of.values:
        rise, fall = int(random.integers(30, 60)), int(random.integers(240, 270))
        step = np.arange(300)
        force = np.clip(np.minimum((step - rise) / 15.0, (fall - step) / 15.0), 0.0, 1.0)
        values.append(force[:, None] * own + 0.05 * random.standard_normal(own.shape))
    of = replace(of, values=values)
    return sound(digits(of, bits) if bits else of, format, folder)


def twice(format: str, blocks: bool, folder: Path) -> Made:
    """Repeated motions: every block sweeps along the same path with other noise."""
    of = sweeps("0 repeated", 2, 8, 150, 6)
    random = np.random.default_rng(seed_of("0 repeated"))
    for sweep in range(1, 8):
        for first in (0, 8):
            path = 0.6 * of.values[first] + 0.4 * of.values[first + sweep]
            of.values[first + sweep] = path + 0.3 * random.standard_normal(path.shape)
    of.blocks = [sweep % 8 // 2 for sweep in range(16)] if blocks else None
    return sound(of, format, folder)


def cases() -> Iterator[Case]:
    for place, language in enumerate(LANGUAGES):
        for format in ("npz", ("h5", "table", "folder", "npy", "parquet", "lerobot")[place % 6], "table" if place % 6 != 1 else "parquet"):
            yield Case(f"0 sound/{language}/{format}", 0, format, partial(by_language, language, format))
    for place, shape in enumerate(SHAPES):
        steps, taxels, rate = shape
        for format in {"h5", "npz", FORMATS[place % 6], "parquet"}:
            yield Case(f"0 sound/{steps} x {taxels} at {rate:g} Hz/{format}", 0, format, partial(by_shape, shape, format))
    for place, kind in enumerate(("pressure", "clipped", "drifting", "volts", "large", "tiny", "float32", "signed", "counts", "two decimals")):
        for format in {"npz", "parquet", FORMATS[place % 6], FORMATS[(place + 3) % 6]}:
            yield Case(f"0 sound/{kind}/{format}", 0, format, partial(by_kind, kind, format))
    for bits, share in ((8, 0.9), (10, 0.8), (12, 0.5), (14, 0.7), (16, 0.9)):
        for format in FORMATS:
            yield Case(f"0 sound/{bits} bit/{format}", 0, format, partial(by_bits, bits, share, format))
    for seed in range(12):
        format = (*FORMATS, "lerobot")[seed % 7]
        yield Case(f"0 sound/seed {seed}/{format}", 0, format, partial(by_seed, seed, format))
    for of_contacts in (None, 12):
        for format in FORMATS:
            yield Case(
                f"0 sound/contacts{f' of {of_contacts} bit' if of_contacts else ''}/{format}", 0, format, partial(contacts, of_contacts, format)
            )
    for format in ("npz", "h5", "table"):
        for blocks in (True, False):
            yield Case(f"0 sound/repeated motion{' in blocks' if blocks else ''}/{format}", 0, format, partial(twice, format, blocks))
