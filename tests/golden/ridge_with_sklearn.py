"""Ridge regression from scikit-learn; the Rust test `ridge_regression_is_scikit_learns` relies on it.

    python -m venv venv && venv/bin/pip install scikit-learn==1.9.1
    venv/bin/python tests/golden/ridge_with_sklearn.py

One case has more rows than features, the other more features than rows and a repeated feature. Features are stored as single precision.
Writes tests/golden/ridge_with_sklearn.json.
"""

import json
from pathlib import Path

import numpy as np
import sklearn
from sklearn.linear_model import RidgeCV

PENALTIES = [10.0 ** (-3 + 6 * i / 9) for i in range(13)]


def main():
    rng = np.random.default_rng(56)
    cases = []
    for rows, width, noise in [(60, 7, 5.0), (20, 40, 15.0)]:
        x = rng.standard_normal((rows + 10, width)).astype(np.float32)
        x[:, 3] = x[:, 2]
        y = 40 + 10 * x[:, :3].astype(np.float64).sum(1) + noise * rng.standard_normal(rows + 10)
        train, queries = x[:rows], x[rows:]
        fit = RidgeCV(alphas=PENALTIES).fit(train.astype(np.float64), y[:rows])
        cases.append({
            "width": width,
            "train": [float(v) for v in train.ravel()],
            "values": y[:rows].tolist(),
            "penalties": PENALTIES,
            "queries": [float(v) for v in queries.ravel()],
            "penalty": fit.alpha_,
            "predictions": fit.predict(queries.astype(np.float64)).tolist(),
        })
    golden = {"versions": {"scikit-learn": sklearn.__version__, "numpy": np.__version__}, "cases": cases}
    Path(__file__).with_suffix(".json").write_text(json.dumps(golden) + "\n")


if __name__ == "__main__":
    main()
