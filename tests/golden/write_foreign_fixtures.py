"""Writes the small HDF5 and MATLAB files of tests/fixtures/foreign: files as other laboratories have them.

Run from anywhere: python tests/golden/write_foreign_fixtures.py
Sweeps are [6][12][4] with the value (37 * sweep + 5 * step + taxel) % 251, so that any exchange of axes changes them.
`matlab_made.mat` was written by MATLAB itself; it is `testhdf5_7.4_GLNX86.mat` of scipy's tests (BSD licence).
"""

import json
import struct
from pathlib import Path

import h5py
import numpy as np
import scipy
import scipy.io

OUT = Path(__file__).resolve().parents[1] / "fixtures" / "foreign"
SWEEP, STEP, TAXEL = np.ogrid[:6, :12, :4]
X = (37 * SWEEP + 5 * STEP + TAXEL) % 251
WORDS = ["cork", "denim", "felt", "cork", "denim", "felt"]
NUMBERS = np.array([1, 2, 3, 1, 2, 3])


def tactmat(file):
    """The layout of TactMat: [3 materials][2 sweeps][12][2][2]."""
    order = [0, 3, 1, 4, 2, 5]
    file.create_dataset("samples", data=X[order].reshape(3, 2, 12, 2, 2).astype("u1"), chunks=(1, 1, 12, 2, 2), compression="gzip")
    file["materials"] = np.array(["cork", "denim", "felt"], "S")
    file["blocks"] = np.array([[0, 1]] * 3, "u4")
    file.attrs["sample_rate_hz"] = 100.0


def user_blocks():
    for size, version in [(512, "earliest"), (2048, "latest")]:
        with h5py.File(OUT / f"user_block_{size}.h5", "w", userblock_size=size, libver=version) as file:
            tactmat(file)
    with h5py.File(OUT / "user_block_contiguous.h5", "w", userblock_size=512) as file:
        file["samples"] = X.reshape(3, 2, 12, 2, 2).astype("f4")
        file["materials"] = np.array(["cork", "denim", "felt"], "S")


def nested():
    with h5py.File(OUT / "groups.h5", "w") as file:
        file.create_dataset("recorded/skin/pressure", data=X.astype("f8"), chunks=(2, 12, 4), compression="gzip")
        file["recorded/skin/pressure"].attrs["fs"] = 250.0
        file["recorded/material"] = WORDS
        file["recorded/number"] = NUMBERS.astype("i4")
        file["recorded/half"] = X.astype("f2")
        file["robot/joints"] = np.zeros((6, 7), "f4")
    with h5py.File(OUT / "x_y.h5", "w") as file:
        file["X"], file["y"], file["fs"] = X.astype("u1"), NUMBERS, 50.0
    with h5py.File(OUT / "episodes.h5", "w") as file:
        for number in range(6):
            demo = file.create_group(f"data/demo_{number}")
            demo["obs/tactile"] = X[number, : 12 if number else 11].astype("f4")
            demo["obs/joints"] = np.zeros((12, 7), "f4")
            demo["material"] = WORDS[number]
            demo.attrs["task"] = WORDS[number]
        file["data"].attrs["fps"] = 20


def unreadable():
    with h5py.File(OUT / "bad_virtual.h5", "w", libver="latest") as file:
        layout = h5py.VirtualLayout((3, 2, 12, 2, 2), "u1")
        layout[:] = h5py.VirtualSource("other.h5", "samples", shape=(3, 2, 12, 2, 2))
        file.create_virtual_dataset("samples", layout)
        file["materials"] = np.array(["cork", "denim", "felt"], "S")
    with h5py.File(OUT / "bad_external_link.h5", "w") as file:
        file["samples"] = h5py.ExternalLink("other.h5", "/samples")
        file["materials"] = np.array(["cork", "denim", "felt"], "S")
    with h5py.File(OUT / "bad_external_raw.h5", "w") as file:
        file.create_dataset("samples", (3, 2, 12, 2, 2), "u1", external=[("other.raw", 0, h5py.h5f.UNLIMITED)])
        file["materials"] = np.array(["cork", "denim", "felt"], "S")


def cell(values):
    cells = np.empty((len(values), 1), object)
    cells[:, 0] = values
    return cells


def matlab_5():
    double = X.astype("f8")
    scipy.io.savemat(OUT / "v5_cell.mat", {"X": double, "y": cell(WORDS), "fs": 100.0})
    scipy.io.savemat(OUT / "v5_compressed.mat", {"samples": X.astype("i2"), "labels": NUMBERS, "sample_rate": 250.0}, do_compression=True)
    scipy.io.savemat(OUT / "v5_char.mat", {"data": X.astype("f4"), "label": np.array(WORDS), "notes": "by hand"}, do_compression=True)
    scipy.io.savemat(OUT / "v5_struct.mat", {"recording": {"skin": double / 4, "material": cell(["Möbelstoff", "绒布"] * 3), "rate": 20.0}}, do_compression=True)
    five = double[[0, 3, 1, 4, 2, 5]].reshape(3, 2, 12, 2, 2)
    scipy.io.savemat(OUT / "v5_five.mat", {"samples": five, "materials": cell(["cork", "denim", "felt"]), "blocks": np.array([[0, 1]] * 3)})
    types = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"]
    signed = {f"X_{kind}": (X - (100 if kind[0] != "u" else 0)).astype(kind) for kind in types}
    scipy.io.savemat(OUT / "v5_types.mat", {**signed, "flags": X > 100, "y": NUMBERS.astype("f8")}, do_compression=True)
    scipy.io.savemat(OUT / "v5_indices.mat", {"X": double, "y": NUMBERS, "materials": cell(WORDS[:3])})
    scipy.io.savemat(OUT / "v5_unlabelled.mat", {"X": double})
    scipy.io.savemat(OUT / "bad_v5_rank2.mat", {"X": double[:, :, 0], "y": NUMBERS})
    scipy.io.savemat(OUT / "bad_v5_axes.mat", {"X": double.transpose(1, 2, 0), "y": NUMBERS})
    scipy.io.savemat(OUT / "bad_v5_complex.mat", {"X": double * 1j, "y": NUMBERS})
    scipy.io.savemat(OUT / "bad_v5_sparse.mat", {"X": scipy.sparse.csc_matrix(double[0]), "y": NUMBERS})
    scipy.io.savemat(OUT / "bad_v5_names.mat", {"skin": double, "joints": double[0], "stuff": cell(WORDS)})
    scipy.io.savemat(OUT / "bad_v4.mat", {"X": double[0], "y": NUMBERS}, format="4")
    big_endian(OUT / "v5_big_endian.mat")
    string_array(OUT / "bad_v5_string.mat")


def string_array(path):
    """`y = string(...)`, which scipy reads as an opaque object, but does not write."""

    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    names = b"".join(element(1, name) for name in (b"y", b"MCOS", b"string"))
    ids = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"") + element(6, struct.pack("<6I", *range(6)))
    scipy.io.savemat(path, {"X": X.astype("f8")})
    with open(path, "ab") as file:
        file.write(element(14, element(6, struct.pack("<II", 17, 0)) + names + element(14, ids)))
    # scipy gives objects no name.
    (read,) = (value for name, value in scipy.io.loadmat(path).items() if name not in ("X", "__header__", "__version__", "__globals__"))
    assert (read["s0"], read["s1"], read["s2"]) == (b"y", b"MCOS", b"string"), read


def big_endian(path):
    """As old SPARC machines write it; scipy reads it, but does not write it."""

    def element(kind, data):
        return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)

    def matrix(name, of_class, shape, *data):
        flags = element(6, struct.pack(">II", of_class, 0))
        dims = element(5, struct.pack(f">{len(shape)}i", *shape))
        return element(14, flags + dims + element(1, name) + b"".join(data))

    words = [matrix(b"", 4, (1, len(word)), element(4, np.array([*map(ord, word)], ">u2").tobytes())) for word in WORDS]
    small = struct.pack(">HHbxxx", 1, 1, 50)
    path.write_bytes(
        b"MATLAB 5.0 MAT-file, Platform: SOL2".ljust(124)
        + b"\x01\x00MI"
        + matrix(b"X", 6, X.shape, element(9, X.astype(">f8").tobytes("F")))
        + matrix(b"y", 1, (6, 1), *words)
        + matrix(b"Fs", 6, (1, 1), small)
    )
    read = scipy.io.loadmat(path)
    assert (read["X"] == X).all() and [str(word[0]) for word in read["y"][:, 0]] == WORDS and read["Fs"] == 50


def matlab_73():
    """Files as MATLAB writes them with -v7.3: a block of 512 bytes in front, axes reversed, cells as references."""

    def start(path):
        return h5py.File(path, "w", userblock_size=512)

    def put(file, name, values, of_class, **attributes):
        data = file.create_dataset(name, data=np.asarray(values).T, **attributes)
        data.attrs["MATLAB_class"] = np.bytes_(of_class)
        return data

    def text(file, name, word):
        put(file, name, np.array([[ord(letter) for letter in word]], "u2"), "char").attrs["MATLAB_int_decode"] = np.int32(2)
        return file[name].ref

    def cells(file, name, words):
        references = np.array([[text(file, f"#refs#/{name}{number}", word)] for number, word in enumerate(words)], h5py.ref_dtype)
        data = file.create_dataset(name, references.T.shape, h5py.ref_dtype)
        data[...] = references.T
        data.attrs["MATLAB_class"] = np.bytes_("cell")

    def finish(path):
        header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Sun Nov 29 2026 HDF5 schema 1.00 .".ljust(116)
        with open(path, "r+b") as file:
            file.write(header + bytes(8) + b"\x00\x02IM")

    with start(OUT / "v73_cell.mat") as file:
        put(file, "X", X.astype("f8"), "double", chunks=(4, 12, 2), compression="gzip")
        cells(file, "y", WORDS)
        put(file, "fs", [[100.0]], "double")
    finish(OUT / "v73_cell.mat")
    with start(OUT / "v73_numbers.mat") as file:
        put(file, "data", X.astype("u1"), "uint8")
        put(file, "labels", NUMBERS[None].astype("f8"), "double")
    finish(OUT / "v73_numbers.mat")
    with start(OUT / "bad_v73_string.mat") as file:
        put(file, "X", X.astype("u1"), "uint8")
        put(file, "y", np.array([[3707764736, 2, 1, 1, 1, 1]], "u4"), "string")
    finish(OUT / "bad_v73_string.mat")
    with start(OUT / "v73_struct.mat") as file:
        group = file.create_group("recording")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        put(file, "recording/skin", X.astype("f4"), "single")
        put(file, "recording/material", np.array([[*map(ord, word.ljust(5))] for word in WORDS], "u2"), "char")
    finish(OUT / "v73_struct.mat")


def main():
    OUT.mkdir(exist_ok=True)
    user_blocks()
    nested()
    unreadable()
    matlab_5()
    matlab_73()
    tests = Path(scipy.io.matlab.__file__).parent / "tests/data"
    (OUT / "matlab_made.mat").write_bytes((tests / "testhdf5_7.4_GLNX86.mat").read_bytes())
    (OUT / "matlab_made_cell.mat").write_bytes((tests / "testcell_7.4_GLNX86.mat").read_bytes())
    versions = {"h5py": h5py.__version__, "hdf5": h5py.version.hdf5_version, "numpy": np.__version__, "scipy": scipy.__version__}
    (OUT / "versions.json").write_text(json.dumps(versions, indent=2) + "\n")


if __name__ == "__main__":
    main()
