#!/usr/bin/env python3
"""Trains on the synthetic twin, predicts, and runs scikit-learn's checks of estimators.

    python -m venv v && v/bin/pip install ./bindings/python scikit-learn aeon && v/bin/python bindings/python/tests/quickstart.py

Prints the accuracy of a small network and of a baseline, and the counts of scikit-learn's own checks. Exit code 1 if a check fails that
EXPECTED_FAILURES does not name.
"""

import collections
import sys
import warnings

import numpy as np
import tactnet

# Checks that cannot pass, with reasons.
EXPECTED_FAILURES = {}


class Flat(tactnet.SweepClassifier):
    """A nearest-neighbour classifier of tables: each row becomes a sweep of sixteen equal frames.

    scikit-learn's checks support tables only; this class passes them through the code that all classifiers of sweeps share."""

    def _recipe(self):
        return "means"

    def _sweeps(self, X):
        return np.repeat(np.asarray(X, dtype=float)[:, None, :], 16, axis=1)

    def _check_sweeps(self, data):
        """Skips the checks of sweeps: no taxel changes in equal frames, and the tables have equal rows."""

    def _takes_tables(self):
        return True

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = False
        return tags


def check(estimator):
    """Returns the numbers of passed, skipped and failed checks, and prints unexpected failures."""
    from sklearn.utils.estimator_checks import check_estimator

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        results = check_estimator(estimator, expected_failed_checks=EXPECTED_FAILURES, on_fail=None)
    for result in results:
        if result["status"] == "failed":
            print(f"  {result['check_name']}: {result['exception']!r}"[:300])
    return collections.Counter(result["status"] for result in results)


def main():
    data = tactnet.Dataset.twin(materials=6, sweeps=30, steps=400)
    X, y = data.X, data.y
    train, test = data.folds()[0]
    network = tactnet.TactNetClassifier(rate=data.rate).fit(X[train], y[train])
    rocket = tactnet.MiniRocketClassifier(rate=data.rate).fit(X[train], y[train])
    print(f"twin, 6 materials: network {network.score(X[test], y[test]):.3f}, MiniRocket {rocket.score(X[test], y[test]):.3f}")
    three = X[test][y[test] == y[test][0]][:3]
    posterior = tactnet.fuse(network.predict_log_proba(three))
    print(f"three sweeps of {y[test][0]}: {network.classes_[posterior.argmax()]} with {posterior.max():.3f}")

    failed = 0
    for estimator in (Flat(), tactnet.TactNetClassifier()):
        counts = check(estimator)
        failed += counts["failed"]
        print(f"check_estimator({type(estimator).__name__}): " + ", ".join(f"{n} {status}" for status, n in sorted(counts.items())))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
