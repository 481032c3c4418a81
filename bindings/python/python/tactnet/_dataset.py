"""Data sets."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, NamedTuple, Sequence

import numpy as np

from . import _tactnet
from ._tactnet import TactnetError


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong or odd about a data set."""

    severity: str
    """``error``, ``warning`` or ``note``; ``tactnet train`` refuses errors."""
    kind: str
    """``not_finite``, ``dead_taxel``, ``assumed_rate``, …"""
    message: str
    """A sentence: material, sweep, taxels, numbers."""


def native_values(X: Any) -> np.ndarray:
    """Returns ``X`` as ``(sweeps, steps, rows, cols)`` of a type that is kept: uint8, uint16 or float32.

    Raises TactnetError for arrays of other axes, for words, and for numbers that a 32-bit float cannot hold.
    """
    X = np.asarray(X)
    if X.ndim == 3:
        X = X[:, :, None, :]
    if X.ndim != 4:
        raise TactnetError(
            f"X: expected (sweeps, steps, taxels) or (sweeps, steps, rows, cols), found shape {X.shape}"
        )
    if 0 in X.shape:
        raise TactnetError(f"X: expected at least one sweep, step and taxel, found shape {X.shape}")
    if X.dtype == np.bool_:
        X = X.astype(np.uint8)
    elif X.dtype.kind in "iu" and X.dtype not in (np.uint8, np.uint16):
        low, high = int(X.min()), int(X.max())
        if low >= 0 and high <= 255:
            X = X.astype(np.uint8)
        elif low >= 0 and high <= 65535:
            X = X.astype(np.uint16)
        elif max(-low, high) <= 1 << 24:
            X = X.astype(np.float32)
        else:
            raise TactnetError(f"X: expected values that a 32-bit float holds, found {low} to {high}")
    elif X.dtype.kind == "f":
        finite = np.isfinite(X)
        if X.dtype.itemsize > 4 and (np.abs(X, where=finite, out=np.zeros_like(X)) > np.finfo(np.float32).max).any():
            raise TactnetError("X: expected values that a 32-bit float holds, found larger ones")
        X = X.astype(np.float32, copy=False)
    elif X.dtype not in (np.uint8, np.uint16):
        raise TactnetError(f"X: expected numbers, found {X.dtype}")
    return np.ascontiguousarray(X)


class Dataset:
    """Sweeps of a tactile skin, each with its material.

    Made by :meth:`from_arrays`, :meth:`read` or :meth:`twin`.
    """

    def __init__(self, native: _tactnet.Dataset):
        self._native = native

    @classmethod
    def from_arrays(
        cls,
        X: Any,
        y: Sequence[Any],
        rate: float | None = None,
        blocks: Sequence[int] | None = None,
        name: str = "arrays",
    ) -> Dataset:
        """Puts a data set together.

        X: ``(sweeps, steps, taxels)`` or ``(sweeps, steps, rows, cols)``, any numbers; copied once.
        y: a material for each sweep, names or numbers.
        rate: frames a second; None: 750 is assumed, and :attr:`rate_is_assumed` says so.
        blocks: the recording block of each sweep, for :meth:`folds` that leave blocks out.
        """
        y = np.asarray(y)
        if y.ndim != 1:
            raise TactnetError(f"y: expected a material for each sweep, found shape {y.shape}")
        materials, labels = np.unique(y, return_inverse=True)
        native = _tactnet.Dataset.from_arrays(
            native_values(X),
            labels.tolist(),
            [str(material) for material in materials],
            rate,
            None if blocks is None else [int(block) for block in blocks],
            name,
        )
        return cls(native)

    @classmethod
    def read(cls, path: Any, rate: float | None = None) -> Dataset:
        """Reads HDF5, npz, CSV, Parquet or a folder of CSV, as ``tactnet data import`` does.

        rate: frames a second, for files that do not say.

        Sweeps without materials need no data set: :func:`read_sweeps` opens them, ``predict`` of a classifier takes arrays.
        """
        return cls(_tactnet.Dataset.read(path, rate))

    @classmethod
    def twin(cls, **settings: Any) -> Dataset:
        """Generates the synthetic twin of TactMat.

        settings: ``materials``, ``sweeps`` of each, ``steps``, ``seed``, ``version``.
        """
        return cls(_tactnet.Dataset.twin(**settings))

    def write(self, path: Any) -> None:
        """Writes a file in the format that its extension names: .h5, .npz, .ts."""
        self._native.write(path)

    def check(self) -> list[Finding]:
        """Returns what is wrong or odd, errors first."""
        found = json.loads(self._native.check_json())["findings"]
        return [Finding(entry["severity"], entry["kind"], entry["message"]) for entry in found]

    def folds(
        self, scheme: str = "default", folds: int | None = None, seed: int = 1, repeat: int = 0
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Returns ``(train, test)`` indices of every fold: those of the command line for equal seeds. Serves as ``cv`` in scikit-learn.

        scheme: ``default`` (the file's own test sweeps, else stratified folds), ``k-fold`` or ``leave-block-out``.
        folds: how many of ``k-fold``, which it stands for where no scheme is named; None: 5.
        """
        if not isinstance(scheme, str):
            raise TactnetError(f"scheme: expected default, k-fold or leave-block-out, found {scheme!r}; a number of folds is named, folds={scheme!r}")
        if folds is not None and scheme == "default":
            scheme = "k-fold"
        if folds is not None and scheme != "k-fold":
            raise TactnetError(f"folds: expected none with {scheme}, which has as many as the data, found {folds}")
        return self._native.folds(scheme, 5 if folds is None else folds, seed, repeat)

    @property
    def X(self) -> np.ndarray:
        """``(sweeps, steps, rows, cols)``, a copy; uint8, uint16 or float32, the smallest type that holds the values."""
        return self._native.samples

    @property
    def y(self) -> np.ndarray:
        """``(sweeps,)``: the names of the materials."""
        return np.asarray(self.materials)[self._native.labels]

    @property
    def materials(self) -> list[str]:
        """Names of the materials, in label order."""
        return self._native.materials

    @property
    def blocks(self) -> np.ndarray | None:
        """``(sweeps,)``: recording blocks, or None."""
        return self._native.blocks

    @property
    def rate(self) -> float:
        """Frames a second."""
        return self._native.rate_hz

    @property
    def rate_is_assumed(self) -> bool:
        """True if nobody said the rate."""
        return self._native.rate_is_assumed

    @property
    def sha256(self) -> str:
        """SHA-256 over the content, whatever file it came in."""
        return self._native.sha256

    def __len__(self) -> int:
        return len(self._native)

    def __repr__(self) -> str:
        return repr(self._native)


class Sweeps(NamedTuple):
    """Sweeps without materials, as ``predict`` takes them."""

    X: np.ndarray
    """``(sweeps, steps, rows, cols)``."""
    names: list[str]
    """``(sweeps,)``: names of files or of sweeps in a table; numbers from 0 where there are none."""
    rate: float
    """Frames a second."""
    rate_is_assumed: bool
    """True if nobody said the rate."""


def read_sweeps(path: Any, rate: float | None = None, steps: int | None = None) -> Sweeps:
    """Reads sweeps whose materials nobody needs to name: any file that :meth:`Dataset.read` takes, npz with ``X`` alone, CSV and Parquet without a column of materials.

    rate: frames a second, for files that do not say.
    steps: frames of every sweep that are kept, from its beginning; None: all.
    """
    native, names = _tactnet.Dataset.read_unlabelled(path, rate, steps)
    return Sweeps(native.samples, names, native.rate_hz, native.rate_is_assumed)
