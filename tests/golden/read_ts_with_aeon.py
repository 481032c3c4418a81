"""What aeon's own reader finds in a .ts file that tactnet wrote; the Rust test `aeon_reads_what_is_written` relies on it.

    cargo run --release -p tactnet-data --example convert -- tests/fixtures/read/values_negative_f32.h5 FILE.ts
    python tests/golden/read_ts_with_aeon.py FILE.ts

Writes tests/golden/read_ts_with_aeon.json. The file itself is named by its SHA-256, so the test fails as soon as the
writer's bytes change and this script has to be run again.
"""

import hashlib
import json
import sys
from pathlib import Path

import aeon
import numpy as np
from aeon.datasets import load_from_ts_file


def main():
    path = Path(sys.argv[1])
    values, labels, meta = load_from_ts_file(str(path), return_meta_data=True)
    golden = {
        "file_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "read": {
            "shape": list(values.shape),
            # [sweeps][taxels][steps] as 32-bit floats, the type the file was written from.
            "values_sha256": hashlib.sha256(values.astype("<f4").tobytes()).hexdigest(),
            "exact": bool((values.astype("<f4") == values).all()),
            "labels": labels.tolist(),
            "class_values": meta["class_values"],
            "univariate": meta["univariate"],
            "missing": meta["missing"],
        },
        "versions": {"aeon": aeon.__version__, "numpy": np.__version__},
    }
    Path(__file__).with_suffix(".json").write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
