"""Replacement of the scikit-learn parts that estimators need, for systems without scikit-learn."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np


class BaseEstimator:
    """Access to parameters by name, like in scikit-learn."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        names = inspect.signature(type(self).__init__).parameters
        return {name: getattr(self, name) for name in names if name != "self"}

    def set_params(self, **params: Any) -> BaseEstimator:
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise ValueError(f"unknown parameter {name!r}; expected one of {', '.join(known)}")
            setattr(self, name, value)
        return self

    def __getstate__(self) -> dict[str, Any]:
        return vars(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)


class ClassifierMixin:
    """Mean accuracy as score."""

    def score(self, X: Any, y: Any) -> float:
        return float(np.mean(self.predict(X) == np.asarray(y)))


def check_is_fitted(estimator: Any, attribute: str) -> None:
    """Raises ValueError before ``fit``."""
    if not hasattr(estimator, attribute):
        raise ValueError(f"this {type(estimator).__name__} is not fitted yet: call `fit` first")


def check_classification_targets(y: np.ndarray) -> None:
    """Raises ValueError for targets that are not classes."""
    if y.ndim != 1 or (y.dtype.kind == "f" and (y != np.floor(y)).any()):
        raise ValueError("y: expected one material per sweep, as text or integers")


def validate_data(estimator: Any, X: Any, y: Any = None, **_: Any) -> Any:
    """Returns arrays of finite numbers and equally many labels; raises ValueError otherwise."""
    X = np.asarray(X)
    if X.dtype.kind == "f" and not np.isfinite(X).all():
        raise ValueError("X: expected finite numbers, found NaN or infinity")
    if y is None:
        return X
    y = np.asarray(y)
    if len(y) != len(X):
        raise ValueError(f"y: expected one material for each of {len(X)} sweeps, found {len(y)}")
    return X, y
