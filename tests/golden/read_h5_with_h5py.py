"""What h5py reads in a TactMat file that tactnet wrote; the Rust test `h5py_reads_what_is_written` relies on it.

    cargo run --release -p tactnet-data --example convert -- tests/fixtures/read/edge_chunks.h5 FILE.h5
    python tests/golden/read_h5_with_h5py.py FILE.h5

Writes tests/golden/read_h5_with_h5py.json. The file itself is named by its SHA-256, so the test fails as soon as the
writer's bytes change and this script has to be run again.
"""

import hashlib
import json
import sys
from pathlib import Path

import h5py
import numpy as np


def main():
    path = Path(sys.argv[1])
    with h5py.File(path) as file:
        samples = file["samples"]
        values = samples[...]
        read = {
            "shape": list(values.shape),
            "type": str(values.dtype),
            "compression": samples.compression,
            "samples_sha256": hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest(),
            "materials": [name.decode() for name in file["materials"][...]],
            "blocks": file["blocks"][...].tolist(),
            "test_flag": file["test_flag"][...].tolist(),
            "sample_rate_hz": float(file.attrs["sample_rate_hz"]),
        }
    golden = {
        "file_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "read": read,
        "versions": {"h5py": h5py.__version__, "hdf5": h5py.version.hdf5_version, "numpy": np.__version__},
    }
    Path(__file__).with_suffix(".json").write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
