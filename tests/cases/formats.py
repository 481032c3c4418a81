"""HDF5 and MATLAB files, files that only pretend to be data, and arrays of odd types (items 14, 15 and 18)."""

from __future__ import annotations

import gzip
import io
import pickle
import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from expectations import Case, Either, Find, Import, Made, NoOther, Refused
from signals import Array, Sweeps, digits, sweeps
from writers import by_material, h5, npy, npz, write


def sample(name: str, bits: int | None = None) -> Sweeps:
    of = sweeps(f"14 {name}", 3, 6, 80, 6)
    return digits(of, bits) if bits else of


def layout(file: h5py.File, of: Sweeps) -> None:
    """Adds the names and the rate of TactMat's layout."""
    file.create_dataset("materials", data=by_material(of)[0], dtype=h5py.string_dtype())
    file.attrs["sample_rate_hz"] = of.rate


def user_block(size: int, bits: int | None, folder: Path) -> Made:
    of = sample(f"block {size}", bits)
    path = folder / "sweeps.h5"
    with h5py.File(path, "w", userblock_size=size) as file:
        file.create_dataset("samples", data=by_material(of)[1], chunks=bits is not None or None, compression="gzip" if bits else None)
        layout(file, of)
    with path.open("r+b") as raw:
        raw.write(b"written by a logger\n")
    return Made(path, (NoOther(), Import(of, rate=100.0)))


def virtual(parts: int, folder: Path) -> Made:
    of = sample(f"virtual {parts}")
    samples = by_material(of)[1]
    whole = h5py.VirtualLayout(samples.shape, samples.dtype)
    for part, block in enumerate(np.array_split(np.arange(samples.shape[0]), parts)):
        with h5py.File(folder / f"part{part}.h5", "w") as file:
            file.create_dataset("samples", data=samples[block])
        whole[block[0] : block[-1] + 1] = h5py.VirtualSource(f"part{part}.h5", "samples", samples[block].shape)
    path = folder / "sweeps.h5"
    with h5py.File(path, "w") as file:
        file.create_virtual_dataset("samples", whole)
        layout(file, of)
    return Made(path, (Either(Import(of, rate=100.0), Refused(r"virtual.*(h5py|copy|repack|\[\.\.\.\])")),))


def external(kind: str, folder: Path) -> Made:
    of = sample(f"external {kind}")
    samples = by_material(of)[1]
    path = folder / "sweeps.h5"
    with h5py.File(path, "w") as file:
        layout(file, of)
        if kind == "link":
            with h5py.File(folder / "other.h5", "w") as other:
                other.create_dataset("inner/samples", data=samples)
            file["samples"] = h5py.ExternalLink("other.h5", "/inner/samples")
        else:
            raw = folder / "samples.raw"
            raw.write_bytes(samples.tobytes())
            file.create_dataset("samples", samples.shape, samples.dtype, external=[(str(raw), 0, samples.nbytes)])
    return Made(path, (Either(Import(of, rate=100.0), Refused(r"external.*(h5py|copy|repack|\[\.\.\.\]|that file)")),))


def filtered(name: str, options: dict[str, Any], bits: int | None, folder: Path) -> Made:
    of = sample(f"filter {name}", bits)
    return Made(h5(of, folder, **options), (Either(Import(of, rate=100.0), Refused(rf"{name}.*(gzip|h5py|repack)")),))


def half(folder: Path, name: str) -> Made:
    of = sample(f"half {name}").mapped(lambda values: values.astype(np.float16))
    return Made(h5(of, folder), (Either(Import(of, rate=100.0), Refused(r"float16.*float32")),))


def nested(kind: str, folder: Path) -> Made:
    """Data sets in groups, as robomimic and others write them: listed with their paths."""
    of = sample(f"nested {kind}")
    path = folder / "sweeps.hdf5"
    with h5py.File(path, "w") as file:
        for sweep, values in enumerate(of.values):
            group = file.create_group(f"data/demo_{sweep}" if kind == "robomimic" else f"episode_{sweep:03}")
            group.create_dataset("obs/tactile", data=values)
            group.create_dataset("actions", data=np.zeros((len(values), 7)))
    first = r"data/demo_\S+/obs/tactile" if kind == "robomimic" else r"episode_\S+/obs/tactile"
    return Made(path, (Refused(rf"{first}.*--samples"),))


def by_path(paths: tuple[str, str], dimensions: int, folder: Path) -> Made:
    of = sample(f"paths {paths}")
    values = of.stack()
    values = values if dimensions == 3 else values.reshape(*values.shape[:2], 2, 3)
    path = folder / "sweeps.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset(paths[0], data=values)
        file.create_dataset(paths[1], data=of.materials, dtype=h5py.string_dtype())
        file.create_dataset("raw/other", data=np.zeros(3))
    # Some names are read without options.
    listed: Any = Refused(rf"{paths[0]}.*--samples") if "/" in paths[0] else NoOther(("assumed_rate",))
    return Made(path, (listed, Import(of, ("--samples", paths[0], "--labels", paths[1], "--rate", "100"), 100.0)))


def matlab_5(compressed: bool, labels: str, folder: Path) -> Made:
    of = sample(f"matlab {labels}")
    path = folder / "sweeps.mat"
    names = list(of.counts)
    y: Any = np.array(of.materials, dtype=object) if labels == "cells" else np.array([[names.index(name) + 1] for name in of.materials], float)
    if labels == "numbers":
        of = Sweeps(of.values, [str(names.index(name) + 1) for name in of.materials], of.rate)
    scipy.io.savemat(path, {"X": of.stack(), "y": y, "rate": of.rate}, do_compression=compressed)
    return Made(path, (NoOther(), Import(of, rate=100.0)))


def matlab_7(labels: str, rate: str, folder: Path) -> Made:
    """A file as MATLAB's `save -v7.3` writes it: a user block, axes in reverse order, classes as attributes."""
    of = sample(f"matlab 7 {labels}")
    path = folder / "sweeps.mat"
    names = list(of.counts)
    with h5py.File(path, "w", userblock_size=512) as file:
        add(file, "X", of.stack().transpose(), "double")
        if labels == "cells":
            cells = file.create_dataset("y", (1, len(of.materials)), h5py.ref_dtype)
            cells.attrs["MATLAB_class"] = np.bytes_("cell")
            for sweep, name in enumerate(of.materials):
                text = add(file, f"#refs#/n{sweep}", np.array([[ord(letter)] for letter in name], np.uint16), "char")
                text.attrs["MATLAB_int_decode"] = np.int32(2)
                cells[0, sweep] = text.ref
        else:
            add(file, "y", np.array([[names.index(name) + 1.0 for name in of.materials]]), "double")
            of = Sweeps(of.values, [str(names.index(name) + 1) for name in of.materials], of.rate)
        add(file, rate, np.array([[of.rate]]), "double")
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Nov 23 10:00:00 2026 HDF5 schema 1.00 ."
    with path.open("r+b") as raw:
        raw.write(head.ljust(116) + bytes(8) + b"\x00\x02IM")
    return Made(path, (NoOther(), Import(of, rate=100.0)))


def add(file: h5py.File, name: str, values: Array, kind: str) -> h5py.Dataset:
    found = file.create_dataset(name, data=values)
    found.attrs["MATLAB_class"] = np.bytes_(kind)
    return found


def hdf5() -> Iterator[Case]:
    for size in (512, 1024, 4096):
        for bits in (None, 12):
            yield Case(f"14 user block/{size} bytes, {'12 bit gzip' if bits else 'float'}/h5", 14, "h5", partial(user_block, size, bits))
    for parts in (1, 3):
        yield Case(f"14 virtual data set/{parts} parts/h5", 14, "h5", partial(virtual, parts))
    for kind in ("link", "raw data"):
        yield Case(f"14 external/{kind}/h5", 14, "h5", partial(external, kind))
    for bits in (None, 8):
        yield Case(f"14 filter/LZF of {'8 bit' if bits else 'float'}/h5", 14, "h5", partial(filtered, "lzf", {"compression": "lzf"}, bits))
    for name in ("one", "two"):
        yield Case(f"14 half/{name}/h5", 14, "h5", partial(half, name=name))
    for kind in ("robomimic", "episodes"):
        yield Case(f"14 nested/{kind}/h5", 14, "h5", partial(nested, kind))
    for paths, dimensions in ((("data/tactile", "data/material"), 3), (("X", "y"), 4)):
        yield Case(f"14 paths/{paths[0]}/h5", 14, "h5", partial(by_path, paths, dimensions))
    for compressed in (True, False):
        for labels in ("cells", "numbers"):
            yield Case(f"14 MATLAB 5/{labels}{', compressed' if compressed else ''}/mat", 14, "mat", partial(matlab_5, compressed, labels))
    for labels, rate in (("cells", "rate"), ("numbers", "sample_rate_hz")):
        yield Case(f"14 MATLAB 7.3/{labels}/mat", 14, "mat", partial(matlab_7, labels, rate))


def workbook() -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        archive.writestr("xl/workbook.xml", "<workbook/>")
    return out.getvalue()


#: Files that only pretend to be data, and the cure that the message names.
PRETENDED: dict[str, tuple[bytes, str]] = {
    "LFS pointer": (
        b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 12345\n",
        r"git lfs pull",
    ),
    "HTML page": (b"<!DOCTYPE html>\n<html><head><title>Sign in</title></head><body>404</body></html>\n", r"HTML.*download"),
    "HTML after blanks": (b"\n\n  <html lang='de'><head></head></html>", r"HTML.*download"),
    "empty": (b"", r"empty file"),
    "pickle 4": (pickle.dumps({"X": [1.0, 2.0]}, protocol=4), r"pickle.*np\.savez"),
    "pickle 2": (pickle.dumps([[1.0, 2.0]], protocol=2), r"pickle.*np\.savez"),
    "gzip": (gzip.compress(b"t0,t1\n1,2\n"), r"gzip.*gunzip"),
    "Excel": (workbook(), r"Excel.*CSV"),
}
NAMES = ("sweeps.npz", "sweeps.h5", "sweeps.csv", "sweeps.parquet", "sweeps.mcap", "sweeps.mat")


def pretended(kind: str, name: str, folder: Path) -> Made:
    content, cure = PRETENDED[kind]
    path = folder / name
    path.write_bytes(content)
    return Made(path, (Refused(cure, {"file": name}),))


def pretended_in(kind: str, format: str, folder: Path) -> Made:
    """One file in a folder pretends."""
    content, cure = PRETENDED[kind]
    path = write(format, sample(f"pretended {kind}"), folder)
    file = path / "felt" / ("007.npy" if format == "npy" else "007.csv")
    file.write_bytes(content)
    return Made(path, (Refused(cure, {"file": f"felt/{file.name}"}),))


def pretenders() -> Iterator[Case]:
    for kind in PRETENDED:
        for name in NAMES if kind in ("LFS pointer", "HTML page", "empty", "pickle 4") else NAMES[:3]:
            format = Path(name).suffix[1:].replace("csv", "table")
            yield Case(f"15 pretended/{kind}/{format}", 15, format, partial(pretended, kind, name))
        for format in ("npy", "folder"):
            yield Case(f"15 pretended/{kind} in a folder/{format}", 15, format, partial(pretended_in, kind, format))


#: Types that are not read: conversion, and the message.
TYPES: dict[str, tuple[Callable[[Array], Any], str]] = {
    "longdouble": (lambda values: values.astype(np.longdouble), r"longdouble.*(float128|float96).*np\.float64"),
    "complex128": (lambda values: values + 0.5j, r"complex128.*(np\.abs|\.real)"),
    "complex64": (lambda values: (values + 0.5j).astype(np.complex64), r"complex64.*(np\.abs|\.real)"),
    "object": (lambda values: values.astype(object), r"object array.*astype"),
    "datetime64": (lambda values: values.astype(np.int64).view("M8[ns]"), r"datetime64\[ns\].*astype"),
    "structured": (lambda values: values.view([("force", values.dtype)]), r"structured.*X\["),
}


def odd_type(kind: str, format: str, folder: Path) -> Made:
    convert, pattern = TYPES[kind]
    of = sample(f"type {kind}")
    if format == "npz":
        path = folder / "sweeps.npz"
        np.savez(path, X=convert(of.stack()), y=np.array(of.materials), sample_rate_hz=100.0)
    else:
        path = npy(of, folder)
        np.save(path / "felt" / "008.npy", convert(of.values[8]), allow_pickle=True)
    return Made(path, (Refused(pattern),))


def ragged(rate: float, folder: Path) -> Made:
    """A list of sweeps of several lengths, which numpy saves as an object array."""
    of = sweeps(f"18 ragged {rate}", 2, 5, lengths=[90, 80, 100, 90, 90] * 2)
    ragged = np.empty(len(of.values), object)
    ragged[:] = of.values
    path = folder / "sweeps.npz"
    np.savez(path, X=ragged, y=np.array(of.materials), sample_rate_hz=rate)
    return Made(path, (Refused(r"object array.*several lengths"),))


def nan_labels(places: tuple[int, ...], name: str, folder: Path) -> Made:
    of = sample(f"NaN labels {places}")
    labels = np.array([list(of.counts).index(material) for material in of.materials], float)
    labels[list(places)] = np.nan
    path = folder / "sweeps.npz"
    arrays: dict[str, Any] = {"X": of.stack(), name: labels, "sample_rate_hz": 100.0}
    np.savez(path, **arrays)
    return Made(path, (Refused(rf"NaN.*\b{places[0]}\b|\b{places[0]}\b.*NaN"),))


def read_type(kind: str, format: str, folder: Path) -> Made:
    """Types that are read: half precision, big-endian numbers, Fortran order."""
    of = sample(f"read {kind}")
    change: dict[str, Callable[[Array], Array]] = {
        "float16": lambda values: values.astype(np.float16),
        "big-endian": lambda values: values.astype(">f8"),
        "Fortran order": np.asfortranarray,
        "int32": lambda values: np.round(100 * values).astype(np.int32),
    }
    of = of.mapped(change[kind])
    path = npz(of, folder) if format == "npz" else npy(of, folder)
    if format == "npz" and kind == "Fortran order":
        np.savez(path, X=np.asfortranarray(of.stack()), y=np.array(of.materials), sample_rate_hz=100.0)
    return Made(path, (NoOther(), Import(of)))


def labelled_nan(folder: Path, format: str) -> Made:
    """Values that are no numbers, with their place."""
    of = sample(f"NaN {format}")
    of.values[5][33, 4] = np.nan
    of.values[9][0, 0] = np.inf
    at = [{"sweep": 5, "step": 33, "taxel": 4}, {"sweep": 9, "step": 0, "taxel": 0}]
    found = tuple(Find("not_finite", "error", place) for place in at)
    return Made(write(format, of, folder), (*found, NoOther(("not_finite",))))


def types() -> Iterator[Case]:
    for kind in TYPES:
        for format in ("npz", "npy"):
            yield Case(f"18 type/{kind}/{format}", 18, format, partial(odd_type, kind, format))
    for rate in (100.0, 750.0):
        yield Case(f"18 type/ragged at {rate:g} Hz/npz", 18, "npz", partial(ragged, rate))
    for places, name in (((4,), "y"), ((11, 12), "labels")):
        yield Case(f"18 NaN labels/{name} of {len(places)}/npz", 18, "npz", partial(nan_labels, places, name))
    for kind in ("float16", "big-endian", "Fortran order", "int32"):
        for format in ("npz", "npy"):
            yield Case(f"18 read type/{kind}/{format}", 18, format, partial(read_type, kind, format))
    for format in ("npz", "h5", "npy", "parquet"):
        yield Case(f"18 not finite/NaN and infinity/{format}", 18, format, partial(labelled_nan, format=format))


def cases() -> Iterator[Case]:
    yield from hdf5()
    yield from pretenders()
    yield from types()
