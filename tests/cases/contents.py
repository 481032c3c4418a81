"""What is in a data set: shared frames, leaks, names, folders and lengths (items 8 to 12)."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from expectations import Case, Either, Find, Import, Made, NoOther, Refused, Says
from signals import Array, Sweeps, digits, seed_of, sweeps
from writers import FORMATS, cell, write


def cut(name: str, hop: int, per_material: int = 8, steps: int = 200, bits: int | None = None) -> Sweeps:
    """Returns windows of one long recording per material."""
    long = sweeps(name, 3, 1, steps + hop * (per_material - 1), 8)
    if bits:
        long = digits(long, bits)
    found = Sweeps([], [], long.rate, blocks=None)
    for values, material in zip(long.values, long.materials, strict=True):
        for window in range(per_material):
            found.values.append(values[hop * window : hop * window + steps])
            found.materials.append(material)
    return found


def overlapping(hop: int, bits: int | None, format: str, folder: Path) -> Made:
    of = cut(f"8 overlap {hop} {bits}", hop, bits=bits)
    shared = 200 - hop
    expect = (Find("overlap", "error", {"sweep": 1}, rf"\b0\b.*\b1\b.*share {shared} of 200 frames"), NoOther(("overlap",)))
    return Made(write(format, of, folder), expect)


def in_blocks(hop: int, format: str, folder: Path) -> Made:
    """Windows of one recording that share a block are no error: `leave-block-out` keeps them together."""
    of = cut(f"8 blocks {hop}", hop)
    # Two recordings per material.
    of = replace(of, blocks=[sweep % 8 // 4 for sweep in range(len(of.values))])
    for sweep in range(len(of.values)):
        if sweep % 8 >= 4:
            of.values[sweep] = of.values[sweep][::-1].copy()
    return Made(write(format, of, folder), (Find("overlap", "error", count=0), NoOther(("overlap",))))


def trained(hop: int, blocks: bool, format: str, folder: Path) -> Made:
    """`train` refuses windows that share frames, unless the split leaves whole blocks out."""
    of = cut(f"8 trained {hop}", hop)
    if blocks:
        of = replace(of, blocks=[sweep % 8 // 4 for sweep in range(len(of.values))])
        for sweep in range(len(of.values)):
            if sweep % 8 >= 4:
                of.values[sweep] = of.values[sweep][::-1].copy()
    arguments = ("train", "--data", "FILE", "--model", "knn-h", "--out", "FOLDER/run")
    if not blocks:
        return Made(write(format, of, folder), (Says(arguments, rf"share {200 - hop} of 200 frames", 2),))
    refused = Says((*arguments, "--split", "k-fold"), r"leave-block-out", 2)
    return Made(write(format, of, folder), (refused, Says((*arguments, "--split", "leave-block-out"), "accuracy", 0)))


def shuffled(hop: int, format: str, folder: Path) -> Made:
    """Windows in another order than that of the recording."""
    of = cut(f"8 shuffled {hop}", hop)
    order = [3, 6, 0, 1, 7, 5, 2, 4]
    for first in (0, 8, 16):
        of.values[first : first + 8] = [of.values[first + place] for place in order]
    expect = (Find("overlap", "error", message=rf"share {200 - hop} of 200 frames"), NoOther(("overlap",)))
    return Made(write(format, of, folder), expect)


def duplicate(change: Callable[[Array], Array], name: str, format: str, folder: Path) -> Made:
    of = sweeps(f"8 duplicate {name}", 3, 6)
    of.values[9] = change(of.values[7])
    near = Find("near_duplicate", "error|warning", message=r"\b7\b.*\b9\b|\b9\b.*\b7\b")
    placed = Either(replace(near, at={"sweep": 9}), replace(near, at={"sweep": 7}))
    return Made(write(format, of, folder), (placed, NoOther(("near_duplicate",))))


def shared_frames() -> Iterator[Case]:
    for hop, share in ((20, "90 %"), (100, "50 %")):
        for bits in (None, 12):
            for format in FORMATS:
                name = f"8 overlap/{share}{' of 12 bit' if bits else ''}/{format}"
                yield Case(name, 8, format, partial(overlapping, hop, bits, format))
        for format in ("npz", "h5", "table", "parquet"):
            yield Case(f"8 overlap/{share} in blocks/{format}", 8, format, partial(in_blocks, hop, format))
        for format in ("npz", "npy", "folder"):
            yield Case(f"8 overlap/{share} shuffled/{format}", 8, format, partial(shuffled, hop, format))
        for format in ("npz", "table"):
            for blocks in (False, True):
                yield Case(f"8 training/{share}{' in blocks' if blocks else ''}/{format}", 8, format, partial(trained, hop, blocks, format))
    noise = np.random.default_rng(seed_of("8 noise"))
    copies: dict[str, Callable[[Array], Array]] = {
        "rounded to 2 digits": lambda values: np.round(values, 2),
        "32-bit noise": lambda values: values + 1e-5 * noise.standard_normal(values.shape),
        "gain of 1.05": lambda values: 1.05 * values,
        "gain of 0.5": lambda values: 0.5 * values,
        "gain and offset": lambda values: 1.2 * values + 3.0,
    }
    for name, change in copies.items():
        for format in FORMATS:
            yield Case(f"8 near duplicate/{name}/{format}", 8, format, partial(duplicate, change, name, format))


def leaking(taxel: int, code: Callable[[str], float], name: str, format: str, folder: Path) -> Made:
    of = sweeps(f"9 {name}", 3, 6, taxels=6)
    for sweep, material in enumerate(of.materials):
        of.values[sweep][:, taxel] = code(material)
    at = {"taxel": taxel}
    return Made(write(format, of, folder), (Find("leaking_column", "error|warning", at), NoOther(("leaking_column", "constant_taxel"))))


def table_with(of: Sweeps, names: list[str], more: dict[str, Callable[[int, int], str]], folder: Path) -> Path:
    """Writes a table with these names of taxels and further columns after them."""
    lines = [",".join(["sweep", "material", *names, *more])]
    for sweep, values in enumerate(of.values):
        for step, frame in enumerate(values.tolist()):
            cells = [str(sweep), of.materials[sweep], *map(cell, frame), *(text(sweep, step) for text in more.values())]
            lines.append(",".join(cells))
    path = folder / "sweeps.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def leaking_names(column: str, folder: Path) -> Made:
    """A column of classes among taxels with names of their own."""
    of = sweeps(f"9 {column}", 3, 6, taxels=4)
    number = {name: str(place) for place, name in enumerate(of.counts)}
    path = table_with(of, ["force", "shear", "heat", "touch"], {column: lambda sweep, _: number[of.materials[sweep]]}, folder)
    leak = Find("leaking_column", "error|warning", {"taxel": 4})
    return Made(path, (Either(leak, Find("not_read", "note", message=column)), NoOther(("leaking_column", "constant_taxel", "assumed_rate"))))


def noted(column: str, text: Callable[[int, int], str], folder: Path) -> Made:
    """A column that is no taxel is never dropped without a note."""
    of = sweeps(f"9 noted {column}", 3, 6, taxels=6)
    path = table_with(of, [f"t{taxel}" for taxel in range(6)], {column: text}, folder)
    word = column or "unnamed|without a name"
    return Made(path, (Either(Find("not_read", "note", message=word), Refused(word)),))


def leaks() -> Iterator[Case]:
    codes: dict[str, Callable[[str], float]] = {
        "class number": lambda name: float(("cork", "felt", "granite").index(name)),
        "hardness": lambda name: {"cork": 17.5, "felt": 3.25, "granite": 91.0}[name],
    }
    for name, code in codes.items():
        for taxel, format in zip((0, 5, 2, 3, 1, 4), FORMATS, strict=True):
            yield Case(f"9 leaking column/{name}/{format}", 9, format, partial(leaking, taxel, code, name, format))
    for column in ("kind", "surface_id"):
        yield Case(f"9 leaking column/named {column}/table", 9, "table", partial(leaking_names, column))
    yield Case("9 noted column/words/table", 9, "table", partial(noted, "operator", lambda sweep, _: "Ada" if sweep % 2 else "Emmy"))
    yield Case("9 noted column/file names/table", 9, "table", partial(noted, "source", lambda sweep, _: f"run_{sweep}.bag"))
    yield Case("9 noted column/unnamed/table", 9, "table", partial(noted, "", lambda _, step: str(step)))
    yield Case("9 noted column/force/table", 9, "table", partial(noted, "force", lambda _, step: f"{step / 7:.3f}"))


def renamed(of: Sweeps, names: list[str]) -> Sweeps:
    """Returns the sweeps of each material with these names in turn."""
    return replace(
        of, materials=[names[sweep % len(names)] if of.materials[sweep] == "felt" else of.materials[sweep] for sweep in range(len(of.values))]
    )


def composed(name: str, format: str, folder: Path) -> Made:
    """One name, composed and decomposed, is one material."""
    parts = [unicodedata.normalize("NFC", name), unicodedata.normalize("NFD", name)]
    of = renamed(sweeps(f"10 {name}", 3, 6), parts)
    expected = replace(of, materials=[unicodedata.normalize("NFC", material) for material in of.materials])
    return Made(write(format, of, folder), (NoOther(), Import(expected)))


def alike(names: list[str], severity: str, format: str, folder: Path) -> Made:
    of = renamed(sweeps(f"10 {names}", 3, 12), names)
    return Made(write(format, of, folder), (Find("alike_names", severity), NoOther(("alike_names", "unbalanced_materials"))))


def formula(name: str, format: str, folder: Path) -> Made:
    """A name that a spreadsheet would compute is escaped in tables that are written for one."""
    of = renamed(sweeps(f"10 formula {name}", 3, 6), [name])
    train = Says(("train", "--data", "FILE", "--model", "knn-h", "--out", "FOLDER/run"), "accuracy", 0)
    # Quoted or not, with an apostrophe or a tab before the name.
    escaped = rf"(^|[,\n])\"?['\t]{re.escape(name)}"
    predict = Says(("predict", "FOLDER/run", "--data", "FILE", "--out", "FOLDER/found.csv"), escaped, 0, "found.csv")
    return Made(write(format, of, folder), (NoOther(), train, predict))


def names() -> Iterator[Case]:
    for name in ("=1+2", "+49 leather", "-soft", "@home"):
        for format in ("npz", "table"):
            yield Case(f"10 formula/{name}/{format}", 10, format, partial(formula, name, format))
    for name in ("Kräuselkrepp", "velouté", "각목"):
        for format in ("npz", "table", "folder", "npy", "parquet"):
            yield Case(f"10 composed name/{name}/{format}", 10, format, partial(composed, name, format))
    pairs = {
        "zero-width space": ["felt", "fe\u200blt"],
        "byte order mark": ["felt", "\ufefffelt"],
        "soft hyphen": ["felt", "fe\u00adlt"],
        "Cyrillic o": ["foam", "f\u043eam"],
        "Greek omicron": ["foam", "f\u03bfam"],
        "Cyrillic word": ["coca", "\u0441\u043e\u0441\u0430"],
        "capital letter": ["felt", "Felt"],
        "full width": ["felt", "\uff46\uff45\uff4c\uff54"],
    }
    for name, pair in pairs.items():
        for format in ("npz", "table", "folder", "parquet"):
            yield Case(f"10 alike names/{name}/{format}", 10, format, partial(alike, pair, "warning|error", format))


def split(order: tuple[str, ...], words: tuple[str, ...], format: str, folder: Path) -> Made:
    """Folders `train` and `test` above or below those of the materials."""
    of = sweeps(f"11 {order} {words}", 3, 8)
    test = 0
    for sweep, (values, material) in enumerate(zip(of.values, of.materials, strict=True)):
        part = words[1] if sweep % 4 == 3 else words[0]
        test += part == words[1]
        parts = {"split": part, "material": material}
        into = folder / "sweeps" / Path(*(parts[level] for level in order))
        into.mkdir(parents=True, exist_ok=True)
        if format == "npy":
            np.save(into / f"{sweep}.npy", values)
        else:
            lines = [",".join(map(cell, frame)) for frame in values.tolist()]
            (into / f"{sweep}.csv").write_text("t0,t1,t2,t3,t4,t5,t6,t7\n" + "\n".join(lines) + "\n")
    no_rate = () if format == "npy" else ("assumed_rate",)
    # Validation sweeps are no test sweeps.
    read = Import(of, test=test if words[1].lower() == "test" else None)
    if order[0] == "split":
        return Made(folder / "sweeps", (read, NoOther(no_rate)))
    # With materials above the split, the message may name the pattern of the files instead.
    return Made(folder / "sweeps", (Either(read, Refused(r"two levels below.*pattern")),))


def levels(levels: tuple[str, str], format: str, folder: Path) -> Made:
    """Two levels of folders that are no split: the program says which one names the material, or asks."""
    of = sweeps(f"11 {levels}", 2, 8)
    for sweep, (values, material) in enumerate(zip(of.values, of.materials, strict=True)):
        session = levels[sweep % 2]
        into = folder / "sweeps" / material / session
        into.mkdir(parents=True, exist_ok=True)
        if format == "npy":
            np.save(into / f"{sweep}.npy", values)
        else:
            (into / f"{sweep}.csv").write_text("\n".join(",".join(map(cell, frame)) for frame in values.tolist()) + "\n")
    level = r"(level|folder).*(material|--names)"
    read = Import(of, says=level)
    return Made(folder / "sweeps", (Either(read, Refused(level)),))


def folders() -> Iterator[Case]:
    for order in (("split", "material"), ("material", "split")):
        for words in (("train", "test"), ("training", "validation"), ("Train", "Test")):
            for format in ("folder", "npy"):
                yield Case(
                    f"11 split folders/{'/'.join(order)}, {words[0]} and {words[1]}/{format}", 11, format, partial(split, order, words, format)
                )
    for sessions in (("monday", "tuesday"), ("finger1", "finger2")):
        for format in ("folder", "npy"):
            yield Case(f"11 levels/{sessions[0]}/{format}", 11, format, partial(levels, sessions, format))


def unequal(kind: str, format: str, folder: Path) -> Made:
    random = np.random.default_rng(seed_of(f"12 {kind}"))
    lengths = [200] * 18
    if kind == "one odd":
        lengths[4] = 187
    elif kind == "all other":
        lengths = [int(of) for of in random.integers(150, 260, 18)]
    else:
        lengths[2], lengths[13] = 120, 333
    of = sweeps(f"12 {kind}", 3, 6, lengths=lengths, rate=750.0)
    shortest, longest = min(lengths), max(lengths)
    kept = of.mapped(lambda values: values[:shortest])
    fewer = of.mapped(lambda values: values[:100])
    arguments = ("data", "import", "FILE", "--out", "FOLDER/imported.npz")
    expect: tuple[Any, ...] = (
        Find("unequal_lengths", "error"),
        NoOther(("unequal_lengths", "few_sweeps", "unbalanced_materials")),
        Says(arguments, rf"shortest has {shortest}.*longest {longest}.*most|--steps", 2),
        Import(kept, ("--steps", "shortest")),
        Import(fewer, ("--steps", "100")),
    )
    return Made(write(format, of, folder), expect)


def cases() -> Iterator[Case]:
    yield from shared_frames()
    yield from leaks()
    yield from names()
    yield from folders()
    for kind in ("one odd", "two odd", "all other"):
        for format in ("npy", "table", "folder", "parquet"):
            yield Case(f"12 unequal lengths/{kind}/{format}", 12, format, partial(unequal, kind, format))
