"""Forests of scikit-learn on a fixed matrix; the Rust test `forests_are_like_scikit_learns` relies on them.

    python -m venv venv && venv/bin/pip install scikit-learn==1.9.1
    venv/bin/python tests/golden/extra_trees_with_sklearn.py

Random choices of two programs differ, so the mean and the standard deviation over forests are compared. The features are whole numbers, some of
few values or constant, and some training rows repeat others under another label. Writes tests/golden/extra_trees_with_sklearn.json.
"""

import json
from pathlib import Path

import numpy as np
import sklearn
from sklearn.ensemble import ExtraTreesClassifier

ROWS, QUERIES, WIDTH, MATERIALS = 100, 150, 30, 4
FORESTS, TREES, FEATURE_SHARE = 200, 20, 0.2


def main():
    rng = np.random.default_rng(57)
    labels = np.arange(ROWS + QUERIES) % MATERIALS
    means = rng.normal(0, 12, (MATERIALS, WIDTH))
    x = np.round(128 + means[labels] + rng.normal(0, 30, (len(labels), WIDTH)))
    x[:, 4:8] = x[:, 4:8] > 128
    x[:, 8:11] = np.round(x[:, 8:11] / 30)
    x[:, 20:23] = 7
    x[ROWS - 10 : ROWS] = x[1:11]
    train, queries = x[:ROWS], x[ROWS:]
    truth = labels[ROWS:]
    measured = []
    for seed in range(FORESTS):
        forest = ExtraTreesClassifier(n_estimators=TREES, max_features=FEATURE_SHARE, criterion="entropy", random_state=seed)
        forest.fit(train, labels[:ROWS])
        p = forest.predict_proba(queries)
        trees = [tree.tree_ for tree in forest.estimators_]
        measured.append({
            "accuracy": (p.argmax(1) == truth).mean(),
            "probability": p[np.arange(QUERIES), truth].mean(),
            "largest_probability": p.max(1).mean(),
            "nodes": np.mean([tree.node_count for tree in trees]),
            "depth": np.mean([tree.max_depth for tree in trees]),
        })
    statistics = {
        name: {"mean": np.mean([m[name] for m in measured]), "deviation": np.std([m[name] for m in measured], ddof=1)}
        for name in measured[0]
    }
    golden = {
        "versions": {"scikit-learn": sklearn.__version__, "numpy": np.__version__},
        "width": WIDTH,
        "materials": MATERIALS,
        "trees": TREES,
        "feature_share": FEATURE_SHARE,
        "forests": FORESTS,
        "train": [int(v) for v in train.ravel()],
        "train_labels": labels[:ROWS].tolist(),
        "queries": [int(v) for v in queries.ravel()],
        "query_labels": truth.tolist(),
        "statistics": statistics,
    }
    Path(__file__).with_suffix(".json").write_text(json.dumps(golden) + "\n")
    print(json.dumps(statistics, indent=1))


if __name__ == "__main__":
    main()
