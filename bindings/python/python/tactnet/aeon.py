"""Classifiers for aeon collections, ``(cases, channels, timepoints)``. Needs ``pip install aeon``."""

from __future__ import annotations

from typing import Any

import numpy as np
from aeon.classification.base import BaseClassifier

from . import _estimators

__all__ = ["TactnetAeonClassifier"]


class TactnetAeonClassifier(BaseClassifier):
    """An estimator of this package for multivariate series of equal length.

    estimator: for example ``tactnet.TactNetClassifier(rate=750)``; None: ``TactNetClassifier()``.
    """

    _tags = {
        "capability:multivariate": True,
        "capability:unequal_length": False,
        "X_inner_type": "numpy3D",
        "algorithm_type": "deeplearning",
    }

    def __init__(self, estimator: Any = None):
        self.estimator = estimator
        super().__init__()

    def _fit(self, X: np.ndarray, y: np.ndarray) -> TactnetAeonClassifier:
        base = _estimators.TactNetClassifier() if self.estimator is None else self.estimator
        self.estimator_ = type(base)(**base.get_params())
        self.estimator_.fit(np.swapaxes(X, 1, 2), y)
        return self

    def _predict(self, X: np.ndarray) -> np.ndarray:
        return self.estimator_.predict(np.swapaxes(X, 1, 2))

    def _predict_proba(self, X: np.ndarray) -> np.ndarray:
        return self.estimator_.predict_proba(np.swapaxes(X, 1, 2))
