"""Features of QUANT from aeon; the Rust test `quantiles_over_intervals_are_aeons` relies on them.

    python -m venv venv && venv/bin/pip install aeon==1.6.0 torch==2.15.0 safetensors
    venv/bin/python tests/golden/quant_with_aeon.py

Reads the sweeps of features.safetensors; their first steps are short sweeps. Writes tests/golden/quant.safetensors; versions stand in its
metadata.
"""

from pathlib import Path

import aeon
import numpy as np
import torch
from aeon.transformations.collection.interval_based import QUANTTransformer
from safetensors.numpy import load_file, save_file

HERE = Path(__file__).parent
SWEEPS = 2


def main():
    known = load_file(HERE / "features.safetensors")
    arrays = {}
    for case in ("digits", "noise", "one_taxel"):
        sweeps = known[f"{case}.sweeps"][:SWEEPS].transpose(0, 2, 1)
        for steps in (3, 4, 17, sweeps.shape[2]):
            features = QUANTTransformer().fit_transform(np.ascontiguousarray(sweeps[:, :, :steps]))
            arrays[f"{case}.{steps}"] = np.ascontiguousarray(features, dtype=np.float32)
    versions = {module.__name__: module.__version__ for module in (aeon, np, torch)}
    save_file(arrays, HERE / "quant.safetensors", metadata=versions)
    print(versions, {name: values.shape for name, values in arrays.items()})


if __name__ == "__main__":
    main()
