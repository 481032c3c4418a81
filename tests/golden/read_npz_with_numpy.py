"""What numpy reads, without pickle, in an .npz that tactnet wrote; the Rust test `numpy_reads_what_is_written` relies on it.

    cargo run --release -p tactnet-data --example convert -- tests/fixtures/read/edge_chunks.h5 FILE.npz
    python tests/golden/read_npz_with_numpy.py FILE.npz

Writes tests/golden/read_npz_with_numpy.json. The file itself is named by its SHA-256, so the test fails as soon as the
writer's bytes change and this script has to be run again.
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np


def main():
    path = Path(sys.argv[1])
    with np.load(path, allow_pickle=False) as arrays:
        samples = arrays["samples"]
        read = {
            "shape": list(samples.shape),
            "type": str(samples.dtype),
            "samples_sha256": hashlib.sha256(samples.tobytes()).hexdigest(),
            "materials": arrays["materials"].tolist(),
            "blocks": arrays["blocks"].tolist(),
            "test_flag": arrays["test_flag"].astype(int).tolist(),
            "sample_rate_hz": float(arrays["sample_rate_hz"]),
        }
    golden = {
        "file_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "read": read,
        "versions": {"numpy": np.__version__},
    }
    Path(__file__).with_suffix(".json").write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
