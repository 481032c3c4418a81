"""Checks of the values that callers pass."""

from __future__ import annotations

from typing import Any, Sequence

import numpy as np

from ._tactnet import TactnetError


def as_sweeps(X: Any, shape: Sequence[int] | None) -> Any:
    """Returns ``X`` with at least three axes, or as the list that it is. The rows of a table become sweeps of ``shape``.

    Raises TactnetError for a single sweep, and for tables without their shape.
    """
    refuse_masks(X)
    if hasattr(X, "toarray"):
        raise TactnetError("X: expected a dense array, found a sparse one; pass `X.toarray()`")
    is_list = isinstance(X, (list, tuple)) or getattr(X, "dtype", None) == np.object_
    if is_list and len(X) > 0 and all(np.ndim(sweep) > 1 for sweep in X):
        return X
    values = np.asarray(X)
    if shape is not None:
        return reshaped(values, shape)
    if values.ndim in (3, 4):
        return values
    advice = ""
    if values.ndim == 2:
        advice = (
            "; for one sweep use `X[None]` (of a DataFrame `X.to_numpy()[None]`), for a table with a sweep in each row pass"
            " `shape=(steps, taxels)`"
        )
    raise TactnetError(f"X: expected (sweeps, steps, taxels) or (sweeps, steps, rows, cols), found shape {values.shape}{advice}")


def reshaped(values: np.ndarray, shape: Sequence[int]) -> np.ndarray:
    """Returns the rows of a table as sweeps of ``shape``; sweeps of this shape as they are."""
    shape = tuple(int(extent) for extent in shape)
    if len(shape) not in (2, 3) or min(shape) < 1:
        raise TactnetError(f"shape: expected (steps, taxels) or (steps, rows, cols), found {shape}")
    if values.shape[1:] == shape:
        return values
    if values.ndim != 2 or values.shape[1] != np.prod(shape):
        raise TactnetError(f"X: expected rows of {np.prod(shape)} values, sweeps of {shape}, found shape {values.shape}")
    return values.reshape(-1, *shape)


def refuse_mask(name: str, values: Any) -> None:
    """Raises TactnetError for a masked array, whose masked values would count as measured."""
    if isinstance(values, np.ma.MaskedArray):
        raise TactnetError(f"{name}: expected an array without a mask, found a masked array; pass `{name}.filled(...)`, or leave the sweeps out")


def refuse_masks(X: Any) -> None:
    """Raises TactnetError for None, for a masked array, and for a list with one."""
    if X is None:
        raise TactnetError("X: expected sweeps as an array-like, found None")
    refuse_mask("X", X)
    if isinstance(X, (list, tuple)):
        for index, sweep in enumerate(X):
            refuse_mask(f"X[{index}]", sweep)


def refuse_gaps(X: Any) -> None:
    """Raises TactnetError for sweeps with values that are not finite. Other arrays are checked elsewhere."""
    values = np.asarray(X)
    if values.ndim < 3 or values.dtype.kind != "f":
        return
    odd = ~np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
    if odd.any():
        raise TactnetError(f"X: expected finite numbers, found NaN or infinity in {odd.sum()} of {len(values)} sweeps, the first X[{odd.argmax()}]")


def checked_labels(y: Any) -> np.ndarray:
    """Returns materials as an array.

    Raises TactnetError for None, bytes and masked arrays.
    """
    if y is None:
        raise TactnetError("y: expected one material per sweep, found None")
    refuse_mask("y", y)
    array = np.asarray(y)
    if array.dtype.kind == "S" or (array.dtype == np.object_ and any(isinstance(label, bytes) for label in array.flat)):
        raise TactnetError("y: expected text or whole numbers, found bytes; pass `np.char.decode(y)`")
    if array.dtype == np.object_:
        missing = [at for at, label in enumerate(array.flat) if label is None]
        if missing:
            raise TactnetError(f"y[{missing[0]}]: expected a material, found None in {len(missing)} of {array.size} places")
    return array


def block_numbers(blocks: Any) -> list[int]:
    """Returns the blocks as numbers; names are numbered in their order.

    Raises TactnetError for other values.
    """
    array = np.asarray(blocks)
    if array.dtype.kind in "iu":
        return array.tolist()
    if array.dtype.kind == "U" or (array.dtype == np.object_ and all(isinstance(block, str) for block in array.flat)):
        return np.unique(array.astype(str), return_inverse=True)[1].tolist()
    raise TactnetError(f"blocks: expected a name or a whole number for each sweep, found {array.dtype}")


def checked_weights(weights: Any, sweeps: int) -> np.ndarray | None:
    """Returns sample weights ``(sweeps,)``, or None for None.

    Raises TactnetError for another number of weights, negative ones, and ones that are not finite.
    """
    if weights is None:
        return None
    refuse_mask("sample_weight", weights)
    weights = np.asarray(weights, dtype=np.float64)
    if weights.ndim == 0:
        weights = np.full(sweeps, weights)
    if weights.ndim != 1:
        raise TactnetError(f"sample_weight: expected one number for each sweep, found shape {weights.shape}")
    if len(weights) != sweeps:
        raise TactnetError(f"sample_weight: expected one for each of {sweeps} sweeps, found {len(weights)}")
    if not np.isfinite(weights).all() or (weights < 0).any():
        raise TactnetError("sample_weight: expected numbers from 0, found negative ones, NaN or infinity")
    return weights


def class_weights(class_weight: Any, y: np.ndarray, weights: np.ndarray | None) -> np.ndarray | None:
    """Returns the weights of the sweeps times those of their materials; None if all are equal.

    class_weight: None, ``balanced``, or a dict of weights by material; materials that it lacks have a weight of 1.
    weights: ``(sweeps,)``, or None.
    """
    if class_weight is not None:
        classes, labels = np.unique(y, return_inverse=True)
        if isinstance(class_weight, str) and class_weight == "balanced":
            of_class = len(y) / (len(classes) * np.bincount(labels))
        elif isinstance(class_weight, dict):
            names = classes.tolist()
            unknown = [name for name in class_weight if name not in names]
            # A fold may lack a material; a name beside one without a weight is mistyped.
            if unknown and any(name not in class_weight for name in names):
                raise TactnetError(f"class_weight: expected materials of y, found {unknown[0]!r}")
            of_class = np.asarray([float(class_weight.get(name, 1.0)) for name in names])
            if not np.isfinite(of_class).all() or (of_class <= 0).any():
                raise TactnetError("class_weight: expected positive numbers")
        else:
            raise TactnetError(f"class_weight: expected None, \"balanced\" or a dict, found {class_weight!r}")
        weights = of_class[labels] if weights is None else weights * of_class[labels]
    if weights is None or (weights == weights[0]).all():
        return None
    return weights
