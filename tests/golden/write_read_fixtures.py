"""Writes the small HDF5 and npz files of tests/fixtures/read that cover what tests/fixtures/h5 leaves out: chunks that
overlap the edge, chunks never written, blocks and test flags, booleans, sample rates, other index and byte orders.

Run from anywhere: python tests/golden/write_read_fixtures.py
Every good file holds the same numbers as tests/fixtures/h5/expected_samples_u8.npy unless its name says otherwise.
"""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet

ROOT = Path(__file__).resolve().parents[1] / "fixtures"
OUT = ROOT / "read"
SAMPLES = np.load(ROOT / "h5" / "expected_samples_u8.npy")
NAMES = json.loads((ROOT / "h5" / "expected_materials.json").read_text())
BLOCKS = np.repeat([[0, 0, 1, 1]], 3, axis=0) + np.array([[0], [2], [4]])
FLAGS = np.repeat([[0, 1, 0, 1]], 3, axis=0).astype("u1")


def h5(name, samples, rate=None, blocks=None, flags=None, names=None, rate_on_samples=False, latest=False, **options):
    with h5py.File(OUT / f"{name}.h5", "w", libver="latest" if latest else None) as file:
        data = file.create_dataset("samples", data=samples, **options)
        file["materials"] = np.array(names or NAMES, "S") if names is None else np.array(names, h5py.string_dtype())
        if blocks is not None:
            file["blocks"] = blocks
        if flags is not None:
            file["test_flag"] = flags
        if rate is not None:
            (data if rate_on_samples else file).attrs["sample_rate_hz"] = rate
    return data


def lerobot(version, frames):
    """A folder of LeRobot: a file per episode in version 2, several episodes per file in version 3."""
    folder = OUT / f"lerobot_v{version}"
    (folder / "data/chunk-000").mkdir(parents=True, exist_ok=True)
    (folder / "meta").mkdir(exist_ok=True)
    names = sorted(set(frames["material"]))
    taxels = frames[[f"taxel{taxel}" for taxel in range(16)]].to_numpy("f4")
    state = [[0.5, float(step)] for step in range(len(frames))]
    table = pyarrow.table(
        {
            "observation.tactile": pyarrow.array(list(taxels), (pyarrow.large_list if version == 3 else pyarrow.list_)(pyarrow.float32())),
            "observation.state": pyarrow.array(state, pyarrow.list_(pyarrow.float64())),
            "timestamp": pyarrow.array((np.arange(720) % 60 / 100).astype("f4")),
            "frame_index": np.arange(720) % 60,
            "episode_index": frames["sweep"].to_numpy(),
            "index": np.arange(720),
            "task_index": np.array([names.index(name) for name in frames["material"]]),
        }
    )
    episodes = 1 if version == 2 else 7
    for number, first in enumerate(range(0, 12, episodes)):
        name = f"episode_{number:06}" if version == 2 else f"file-{number:03}"
        pyarrow.parquet.write_table(table[60 * first : 60 * (first + episodes)], folder / f"data/chunk-000/{name}.parquet", compression="zstd")
    features = {"observation.tactile": {"dtype": "float32", "shape": [16]}, "observation.state": {"dtype": "float64", "shape": [2]}}
    (folder / "meta/info.json").write_text(json.dumps({"codebase_version": f"v{version}.0", "fps": 100, "features": features}) + "\n")
    if version == 2:
        lines = [json.dumps({"task_index": number, "task": name}) for number, name in enumerate(names)]
        (folder / "meta/tasks.jsonl").write_text("\n".join(lines) + "\n")
    else:
        pd.DataFrame({"task_index": range(len(names))}, index=names).to_parquet(folder / "meta/tasks.parquet")


def main():
    OUT.mkdir(exist_ok=True)
    gzip = {"compression": "gzip", "shuffle": True}
    h5("edge_chunks", SAMPLES.astype(">i2"), chunks=(2, 3, 50, 3, 3), rate=100, blocks=BLOCKS.astype("<i8"), flags=FLAGS, **gzip)
    h5("fixed_array", SAMPLES.astype("<u4"), chunks=(1, 3, 32, 4, 1), latest=True, rate=2200.0, flags=FLAGS.astype(bool), **gzip)
    h5("extensible_array", SAMPLES, chunks=(2, 2, 40, 4, 4), maxshape=(None, 4, 60, 4, 4), latest=True, **gzip)
    h5("btree_v2", SAMPLES.astype("f4"), chunks=(2, 2, 40, 4, 4), maxshape=(None, None, 60, 4, 4), latest=True, **gzip)
    h5("implicit_index", SAMPLES, chunks=(2, 2, 40, 4, 4), latest=True)
    h5("big_endian_f4_contiguous", SAMPLES.astype(">f4"), rate=100.0, rate_on_samples=True)
    h5("names_utf8", SAMPLES, names=["Möbelstoff", "denim", "绒布"], compression="gzip")
    h5("scaleoffset", SAMPLES.astype("u2"), scaleoffset=0)
    h5("values_negative_f32", SAMPLES.astype("f8") / 8 - 3, **gzip)
    h5("values_16bit", SAMPLES.astype("i4") * 200, **gzip)
    with h5py.File(OUT / "unwritten_chunks.h5", "w") as file:
        data = file.create_dataset("samples", SAMPLES.shape, "i8", chunks=(1, 2, 60, 4, 4), fillvalue=7, **gzip)
        data[0] = SAMPLES[0]
        data[2, :2] = SAMPLES[2, :2]
        file["materials"] = np.array(NAMES, "S")

    h5("bad_float16", SAMPLES.astype("f2"))
    h5("bad_beyond_f32", np.where(SAMPLES == SAMPLES.max(), 2**24 + 1, SAMPLES.astype("i8")))
    h5("bad_flag_2", SAMPLES, flags=FLAGS * 2)
    h5("bad_blocks_shape", SAMPLES, blocks=BLOCKS[:2])
    h5("bad_rate", SAMPLES, rate=-1.0)
    h5("bad_infinite", np.where(np.arange(SAMPLES.size).reshape(SAMPLES.shape) == 5000, np.inf, SAMPLES))
    h5("bad_same_names", SAMPLES, names=["cork", "denim", "cork"])
    with h5py.File(OUT / "bad_samples_are_text.h5", "w") as file:
        file["samples"] = np.full((3, 4, 2, 1, 1), "a", "S1")
        file["materials"] = np.array(NAMES, "S")
    with h5py.File(OUT / "bad_samples_is_a_group.h5", "w") as file:
        file.create_group("samples")
        file["materials"] = np.array(NAMES, "S")
    with h5py.File(OUT / "materials_are_numbers.h5", "w") as file:
        file["samples"] = SAMPLES
        file["materials"] = np.array([7, 10, 200], "i4")
    with h5py.File(OUT / "bad_materials_are_floats.h5", "w") as file:
        file["samples"] = SAMPLES[:, :1]
        file["materials"] = np.array([0.5, 1.5, 2.5])

    flat = SAMPLES.reshape(12, 60, 4, 4)
    label = np.repeat(np.arange(3), 4)
    save = {"materials": np.array(NAMES), "sample_rate_hz": 100.0}
    np.savez_compressed(OUT / "five_dimensions.npz", samples=SAMPLES, blocks=BLOCKS, test_flag=FLAGS.astype(bool), **save)
    np.savez(OUT / "four_dimensions.npz", samples=flat.astype("f8"), labels=label, materials=np.array(NAMES, "S"))
    np.savez_compressed(OUT / "fortran_order.npz", samples=np.asfortranarray(SAMPLES.astype("i4")), **save)
    np.savez_compressed(OUT / "big_endian.npz", samples=SAMPLES.astype(">u2"), materials=np.array(NAMES).astype(">U11"))
    np.savez_compressed(OUT / "text_labels.npz", samples=flat, labels=np.array(NAMES)[label])
    np.savez_compressed(OUT / "bad_pickled.npz", samples=SAMPLES, materials=np.array(NAMES, dtype=object))
    # Common table formats.
    np.savez_compressed(OUT / "x_y_float16.npz", X=flat.reshape(12, 60, 16).astype("f2"), y=label.astype("f8"))
    np.savez_compressed(OUT / "x_y_names.npz", X=flat, y=np.array(NAMES)[label][:, None], sample_rate_hz=100)
    frames = pd.DataFrame(flat.reshape(720, 16), columns=[f"taxel{taxel}" for taxel in range(16)])
    frames.insert(0, "sweep", np.repeat(np.arange(12), 60))
    frames.insert(1, "material", np.array(NAMES)[np.repeat(label, 60)])
    frames.insert(2, "time", pd.to_datetime(np.arange(720) * 10_000_000))
    frames.to_parquet(OUT / "frames.parquet")
    frames.assign(taxel3=frames["taxel3"].where(frames["taxel3"] < frames["taxel3"].max())).to_parquet(OUT / "bad_missing.parquet")
    lerobot(2, frames)
    lerobot(3, frames)
    np.savez_compressed(OUT / "bad_rank2.npz", samples=flat[0, 0], **save)
    np.savez_compressed(OUT / "bad_no_samples.npz", x=flat[0])
    np.savez_compressed(OUT / "bad_label_range.npz", samples=flat, labels=label + 1, **save)
    np.savez_compressed(OUT / "bad_nan.npz", samples=np.where(SAMPLES == SAMPLES.max(), np.nan, SAMPLES), **save)
    np.savez_compressed(OUT / "bad_complex.npz", samples=SAMPLES.astype("c8"), **save)
    versions = {"h5py": h5py.__version__, "hdf5": h5py.version.hdf5_version, "numpy": np.__version__, "pandas": pd.__version__, "pyarrow": pyarrow.__version__}
    (OUT / "versions.json").write_text(json.dumps(versions, indent=2) + "\n")


if __name__ == "__main__":
    main()
