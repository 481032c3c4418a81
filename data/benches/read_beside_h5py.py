"""Compares the time to read a full-size TactMat file with h5py's. Alternates the two and prints medians.

    cargo build --release -p tactnet-data --example convert
    python data/benches/read_beside_h5py.py target/release/examples/convert [RUNS]

The files (36 materials x 100 sweeps x 1000 steps x 4 x 4) are generated in a temporary folder from a random walk with
the step statistics of the real signal. h5py only fills an array; tactnet-data also narrows the values, checks that they
are finite and computes the SHA-256 of the content. Each read runs in a separate process and is timed without its start.
"""

import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

LAYOUTS = {
    "u8, gzip, h5py's own chunks": ("u1", {"compression": "gzip"}),
    "u8, gzip, chunks of 10 sweeps": ("u1", {"compression": "gzip", "chunks": (1, 10, 1000, 4, 4)}),
    "u8, gzip + shuffle, chunks of 1 sweep": ("u1", {"compression": "gzip", "shuffle": True, "chunks": (1, 1, 1000, 4, 4)}),
    "f64, gzip, h5py's own chunks": ("f8", {"compression": "gzip"}),
    "u8, contiguous": ("u1", {}),
}
READ = "import sys, time, h5py; t = time.perf_counter(); x = h5py.File(sys.argv[1])['samples'][...]; print('read', time.perf_counter() - t)"


def samples():
    rng = np.random.default_rng(1)
    steps = rng.choice([-1, 0, 1], p=[0.12, 0.76, 0.12], size=(36, 100, 1000, 4, 4)).astype("i2")
    walk = rng.integers(0, 60, size=(36, 100, 1, 4, 4), dtype="i2") + np.cumsum(steps, axis=2, dtype="i2")
    digits = np.clip(walk, 0, 154)
    return np.where(digits < 3, 0, digits).astype("u1")


def seconds(command):
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return float(output.split()[1])


def main():
    convert, runs = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 7
    values = samples()
    print(f"{'layout':40} {'MiB':>6} {'ours':>7} {'h5py':>7}   seconds, median of {runs}; h5py {h5py.__version__}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "full.h5"
        for layout, (dtype, options) in LAYOUTS.items():
            with h5py.File(path, "w") as file:
                file["materials"] = np.array([f"material {k}" for k in range(36)], "S")
                file.create_dataset("samples", data=values.astype(dtype), **options)
            ours, theirs = [], []
            for _ in range(runs):
                ours.append(seconds([convert, str(path)]))
                theirs.append(seconds([sys.executable, "-c", READ, str(path)]))
            size = path.stat().st_size / 2**20
            print(f"{layout:40} {size:6.1f} {statistics.median(ours):7.3f} {statistics.median(theirs):7.3f}", flush=True)


if __name__ == "__main__":
    main()
