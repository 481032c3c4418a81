"""CSV as the world writes it (item 13)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from expectations import Case, Find, Import, Made, NoOther, Refused
from signals import Sweeps, even_times, sweeps
from writers import write

#: Changes the lines of a file, its first line of names included, and returns its bytes.
Dialect = Callable[[list[str]], bytes]


def small(name: str, taxels: int = 5) -> Sweeps:
    """Returns sweeps whose values have four decimals, with times."""
    of = sweeps(f"13 {name}", 2, 5, 60, taxels, 50.0)
    return even_times(of.mapped(lambda values: np.round(values, 4)))


def rewrite(path: Path, dialect: Dialect) -> None:
    for file in [path] if path.is_file() else sorted(path.glob("*/*.csv")):
        file.write_bytes(dialect(file.read_text(encoding="utf-8").splitlines()))


def text(lines: list[str], end: str = "\n") -> bytes:
    return "".join(line + end for line in lines).encode()


def with_separator(separator: str, decimal: str = ".") -> Dialect:
    def dialect(lines: list[str]) -> bytes:
        return text([separator.join(cell.replace(".", decimal) if index else cell for cell in line.split(",")) for index, line in enumerate(lines)])

    return dialect


def padded(lines: list[str]) -> bytes:
    """Columns of equal width, as Fortran and many loggers write them."""
    return text([" ".join(cell.rjust(12) for cell in line.split(",")) for line in lines])


def quoted(decimal: str) -> Dialect:
    def dialect(lines: list[str]) -> bytes:
        return text(
            [",".join('"' + cell.replace(".", decimal) + '"' if index else cell for cell in line.split(",")) for index, line in enumerate(lines)]
        )

    return dialect


def commented(lines: list[str]) -> bytes:
    return text(["# recorded on Monday, with the old finger", *lines[:20], "# the finger was wiped", *lines[20:]])


def units(lines: list[str]) -> bytes:
    """Names with units: `time [s]`, `t0 [N]`."""
    names = [f"{name} [s]" if name == "time" else f"{name} [N]" if re.fullmatch(r"t\d+", name) else name for name in lines[0].split(",")]
    return text([",".join(names), *lines[1:]])


def line_of_units(lines: list[str]) -> bytes:
    of = ["s" if name == "time" else "N" if re.fullmatch(r"t\d+", name) else "" for name in lines[0].split(",")]
    return text([lines[0], ",".join(of), *lines[1:]])


DIALECTS: dict[str, Dialect] = {
    "CRLF": lambda lines: text(lines, "\r\n"),
    "CR": lambda lines: text(lines, "\r"),
    "separator at line's end": lambda lines: text([line + "," for line in lines]),
    "separator at values' end": lambda lines: text([lines[0], *(line + "," for line in lines[1:])]),
    "semicolons": with_separator(";"),
    "tabs": with_separator("\t"),
    "bars": with_separator("|"),
    "columns of blanks": padded,
    "semicolons, decimal comma": with_separator(";", ","),
    "tabs, decimal comma": with_separator("\t", ","),
    "blank after comma": lambda lines: text([line.replace(",", ", ") for line in lines]),
    "comments": commented,
    "units in names": units,
    "line of units": line_of_units,
    "quoted numbers": quoted("."),
    "quoted decimal comma": quoted(","),
    "byte order mark": lambda lines: b"\xef\xbb\xbf" + text(lines, "\r\n"),
    "UTF-16": lambda lines: ("\ufeff" + "".join(line + "\r\n" for line in lines)).encode("utf-16-le"),
    "sep=; of Excel": lambda lines: b"sep=;\r\n" + with_separator(";", ",")(lines),
    "lines before the table": lambda lines: text(["Device: finger 3", "Operator: Ada", "", *lines]),
    "empty lines at the end": lambda lines: text([*lines, "", "", ""]),
    "no end of the last line": lambda lines: text(lines)[:-1],
}


def read_right(name: str, format: str, folder: Path) -> Made:
    of = small(name)
    path = write(format, of, folder)
    rewrite(path, DIALECTS[name])
    return Made(path, (NoOther(), Import(of, rate=50.0)))


def latin(format: str, folder: Path) -> Made:
    """Names in Latin-1, which is no UTF-8."""
    of = small("latin")
    of = replace(of, materials=[{"cork": "Ger\u00f6ll", "felt": "Stra\u00dfe"}[name] for name in of.materials])
    path = write("table", of, folder)
    separator = ";" if format == "semicolons" else ","
    path.write_bytes(path.read_text(encoding="utf-8").replace(",", separator).encode("latin-1"))
    return Made(path, (NoOther(), Import(of, rate=50.0)))


def headerless(suffix: str, digits: int, folder: Path) -> Made:
    """One column `60,476` without a name: a decimal comma or two numbers."""
    of = sweeps(f"13 headerless {digits}", 2, 5, 60, 1, offset=60.0)
    for sweep, (values, material) in enumerate(zip(of.values, of.materials, strict=True)):
        file = folder / "sweeps" / material / f"{sweep}{suffix}"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("".join(f"{value:.{digits}f}".replace(".", ",") + "\n" for value in values[:, 0]))
    return Made(folder / "sweeps", (Refused(r"decimal comma.*name the columns"),))


def change_cell(path: Path, line: int, column: int, cell: str, end: str = "\n", separator: str = ",") -> None:
    """Replaces a cell; line and column count from 1."""
    lines = path.read_text(encoding="utf-8").splitlines()
    cells = lines[line - 1].split(separator)
    cells[column - 1] = cell
    lines[line - 1] = separator.join(cells)
    path.write_bytes(text(lines, end))


def unreadable(bad: list[tuple[int, int, int, str]], end: str, format: str, folder: Path) -> Made:
    """Cells that are no numbers: all are listed with file, line, column and text.

    - `bad`: sweep, frame, taxel, text
    """
    of = small(f"13 unreadable {len(bad)}")
    path = write(format, of, folder)
    found: list[Any] = []
    for sweep, frame, taxel, cell in bad:
        if format == "table":
            line, column, file = 2 + 60 * sweep + frame, 4 + taxel, path
        else:
            line, column, file = 2 + frame, 2 + taxel, path / of.materials[sweep] / f"{sweep:03}.csv"
        change_cell(file, line, column, cell, end)
        at = {"file": str(file.relative_to(folder)), "line": line, "column": str(column)}
        found.append(Find("unreadable", "error", at, re.escape(cell)))
    return Made(path, (*found, Refused(r"expected a number"), Find("unreadable", "error", count=len(bad))))


def missing(cell: str, format: str, folder: Path) -> Made:
    """A missing value is no number, at its place."""
    of = small(f"13 missing {cell}")
    path = write(format, of, folder)
    if format == "table":
        change_cell(path, 2 + 60 * 3 + 20, 4 + 2, cell)
    else:
        change_cell(path / of.materials[3] / "003.csv", 2 + 20, 2 + 2, cell)
    at = {"sweep": 3, "step": 20, "taxel": 2}
    return Made(path, (Find("not_finite", "error", at), NoOther(("not_finite",))))


def short_row(format: str, cells: int, folder: Path) -> Made:
    of = small(f"13 short {cells}")
    path = write(format, of, folder)
    file, line = (path, 2 + 60 * 2 + 9) if format == "table" else (path / of.materials[2] / "002.csv", 2 + 9)
    lines = file.read_text().splitlines()
    row = lines[line - 1].split(",")
    lines[line - 1] = ",".join(row[:cells] if cells < len(row) else [*row, "1.5"])
    file.write_bytes(text(lines))
    return Made(path, (Refused(rf"line {line}.*expected {len(row)} values", {"line": line}),))


def thousands(format: str, cell: str, folder: Path) -> Made:
    of = small(f"13 thousands {cell}")
    path = write(format, of, folder)
    file, line, column = (path, 30, 5) if format == "table" else (path / of.materials[0] / "000.csv", 30, 3)
    change_cell(file, line, column, f'"{cell}"')
    return Made(path, (Refused(r"thousands separators", {"line": line, "column": str(column)}),))


def cases() -> Iterator[Case]:
    for name in DIALECTS:
        for format in ("table", "folder"):
            yield Case(f"13 dialect/{name}/{format}", 13, format, partial(read_right, name, format))
    for format in ("commas", "semicolons"):
        yield Case(f"13 dialect/Latin-1/table of {format}", 13, "table", partial(latin, format))
    for suffix, digits in ((".csv", 3), (".txt", 3), (".csv", 2), (".dat", 2)):
        yield Case(f"13 decimal comma without names/{digits} digits/folder of {suffix}", 13, "folder", partial(headerless, suffix, digits))
    for bad in ([(0, 3, 1, "x12")], [(1, 5, 0, "n/a?"), (1, 6, 4, "12;5"), (7, 59, 2, "ERR")]):
        for end, name in (("\n", "LF"), ("\r\n", "CRLF")):
            for format in ("table", "folder"):
                yield Case(f"13 unreadable cells/{len(bad)}, {name}/{format}", 13, format, partial(unreadable, bad, end, format))
    for cell in ("", "NA", "nan"):
        for format in ("table", "folder"):
            yield Case(f"13 missing value/{cell or 'empty'}/{format}", 13, format, partial(missing, cell, format))
    for cells in (4, 99):
        for format in ("table", "folder"):
            yield Case(f"13 odd row/{'short' if cells < 9 else 'long'}/{format}", 13, format, partial(short_row, format, cells))
    for cell in ("1,234.5", "12,345.67"):
        for format in ("table", "folder"):
            yield Case(f"13 thousands/{cell}/{format}", 13, format, partial(thousands, format, cell))
