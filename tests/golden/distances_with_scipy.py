"""Euclidean distance transforms from SciPy; the Rust test `distances_are_those_of_scipy` relies on them.

    python -m venv venv && venv/bin/pip install scipy==1.17.1
    venv/bin/python tests/golden/distances_with_scipy.py

Random cells are solid; `distances` are from the middle of each cell to that of the nearest solid one, in cells. Cells are counted along x,
then y, then z. Writes tests/golden/distances_with_scipy.json.
"""

import json
from pathlib import Path

import numpy as np
import scipy
from scipy.ndimage import distance_transform_edt

# Cells along x, y, z; share of solid ones.
CASES = [((12, 10, 9), 0.01), ((17, 8, 11), 0.2), ((31, 3, 12), 0.003), ((5, 23, 7), 0.6)]


def main():
    rng = np.random.default_rng(14)
    cases = []
    for (nx, ny, nz), share in CASES:
        solid = rng.random((nz, ny, nx)) < share
        solid[nz // 2, ny // 3, nx // 4] = True
        distances = distance_transform_edt(~solid)
        cases.append({
            "cells": [nx, ny, nz],
            "solid": np.flatnonzero(solid).tolist(),
            "distances": [round(float(d), 9) for d in distances.ravel()],
        })
    golden = {"versions": {"scipy": scipy.__version__, "numpy": np.__version__}, "cases": cases}
    Path(__file__).with_suffix(".json").write_text(json.dumps(golden) + "\n")


if __name__ == "__main__":
    main()
