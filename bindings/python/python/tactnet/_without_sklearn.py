"""What estimators need of scikit-learn, where it is not installed."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np


class BaseEstimator:
    """Parameters by name, as scikit-learn keeps them."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        names = inspect.signature(type(self).__init__).parameters
        return {name: getattr(self, name) for name in names if name != "self"}

    def set_params(self, **params: Any) -> BaseEstimator:
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise ValueError(f"no parameter {name!r}; there are {', '.join(known)}")
            setattr(self, name, value)
        return self

    def __getstate__(self) -> dict[str, Any]:
        return vars(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)


class ClassifierMixin:
    """The mean accuracy as score."""

    def score(self, X: Any, y: Any) -> float:
        return float(np.mean(self.predict(X) == np.asarray(y)))


def check_is_fitted(estimator: Any, attribute: str) -> None:
    """Raises ValueError before ``fit``."""
    if not hasattr(estimator, attribute):
        raise ValueError(f"this {type(estimator).__name__} is not fitted yet: call `fit` first")


def check_classification_targets(y: np.ndarray) -> None:
    """Raises ValueError for numbers that name no classes."""
    if y.ndim != 1 or (y.dtype.kind == "f" and (y != np.floor(y)).any()):
        raise ValueError("y: expected a material for each sweep, by words or whole numbers")


def validate_data(estimator: Any, X: Any, y: Any = None, **_: Any) -> Any:
    """Returns arrays of finite numbers and as many labels."""
    X = np.asarray(X)
    if X.dtype.kind == "f" and not np.isfinite(X).all():
        raise ValueError("X: expected finite numbers, found NaN or infinity")
    if y is None:
        return X
    y = np.asarray(y)
    if len(y) != len(X):
        raise ValueError(f"y: expected a material for each of {len(X)} sweeps, found {len(y)}")
    return X, y
