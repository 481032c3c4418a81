"""Data sets."""

from __future__ import annotations

import json
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator, NamedTuple, Sequence

import numpy as np

from . import _tactnet
from ._tactnet import TactnetError
from ._values import as_sweeps, block_numbers, checked_labels


@dataclass(frozen=True)
class Finding:
    """One finding of the check of a data set."""

    severity: str
    """``error``, ``warning`` or ``note``."""
    kind: str
    """``not_finite``, ``dead_taxel``, ``assumed_rate``, …"""
    message: str
    """Message with material, sweep, taxels and numbers."""


def native_values(X: Any) -> np.ndarray:
    """Returns ``X`` as ``(sweeps, steps, rows, cols)`` of a supported type: uint8, uint16 or float32.

    Raises TactnetError for arrays with other axes, for text, for numbers out of the range of a 32-bit float, and for signals on
    an offset that leaves a 32-bit float too few steps.
    """
    X = np.asarray(X)
    if X.ndim == 3:
        X = X[:, :, None, :]
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
            raise TactnetError(f"X: expected values in the range of a 32-bit float, found {low} to {high}")
    elif X.dtype.kind == "f":
        finite = np.isfinite(X)
        if X.dtype.itemsize > 4 and (np.abs(X, where=finite, out=np.zeros_like(X)) > np.finfo(np.float32).max).any():
            raise TactnetError("X: expected values in the range of a 32-bit float, found larger ones")
        if X.dtype.itemsize > 4:
            _tactnet.check_resolution(np.ascontiguousarray(X, dtype=np.float64))
        X = X.astype(np.float32, copy=False)
    elif X.dtype not in (np.uint8, np.uint16):
        raise TactnetError(f"X: expected numbers, found {X.dtype}")
    return np.ascontiguousarray(X)


def padded(X: Any) -> tuple[Any, list[int] | None]:
    """Returns a list of sweeps of unequal length as one array, and their lengths; anything else as it is, and None.

    X: sweeps ``(steps, taxels)`` or ``(steps, rows, cols)`` in a list or an object array. The last frame of a shorter sweep is repeated.
    """
    if not isinstance(X, (list, tuple)) and getattr(X, "dtype", None) != np.object_:
        return X, None
    sweeps = [np.asarray(sweep) for sweep in X]
    if not sweeps or any(sweep.ndim not in (2, 3) for sweep in sweeps):
        return X, None
    lengths = [len(sweep) for sweep in sweeps]
    if len(set(lengths)) == 1:
        return X, None
    for index, sweep in enumerate(sweeps):
        if sweep.shape[1:] != sweeps[0].shape[1:] or len(sweep) == 0:
            raise TactnetError(
                f"X[{index}]: expected at least one frame of the taxels of X[0], {sweeps[0].shape[1:]}, found shape {sweep.shape}"
            )
    longest = max(lengths)
    return np.stack([sweep[np.minimum(np.arange(longest), len(sweep) - 1)] for sweep in sweeps]), lengths


class Dataset:
    """Labelled sweeps of a tactile skin, from :meth:`from_arrays`, :meth:`read` or :meth:`twin`.
    """

    def __init__(self, native: _tactnet.Dataset):
        self._native = native

    @classmethod
    def from_arrays(
        cls,
        X: Any,
        y: Sequence[Any],
        rate: float | None = None,
        blocks: Sequence[Any] | None = None,
        name: str = "arrays",
        lengths: Sequence[int] | None = None,
        shape: Sequence[int] | None = None,
    ) -> Dataset:
        """Creates a data set from arrays.

        X: ``(sweeps, steps, taxels)`` or ``(sweeps, steps, rows, cols)``, any numeric type; copied once. Or a list of sweeps of unequal
            length, ``(steps, taxels)`` or ``(steps, rows, cols)`` each. Or a table with a sweep in each row, with ``shape``.
        y: one material per sweep, as names or numbers.
        rate: frames per second; None: 750, and :attr:`rate_is_assumed` is true.
        blocks: recording block of each sweep, as names or numbers: recording, session, day or subject.
        lengths: number of frames of each sweep of a padded array; None: all.
        shape: shape of each sweep of a table, ``(steps, taxels)`` or ``(steps, rows, cols)``; None: X is no table.
        """
        y = checked_labels(y)
        if y.ndim != 1:
            raise TactnetError(f"y: expected one material per sweep, found shape {y.shape}")
        materials, labels = np.unique(y, return_inverse=True)
        X, of_list = padded(as_sweeps(X, shape))
        lengths = of_list if lengths is None else [int(steps) for steps in lengths]
        native = _tactnet.Dataset.from_arrays(
            native_values(X),
            labels.tolist(),
            [str(material) for material in materials],
            rate,
            None if blocks is None else block_numbers(blocks),
            name,
            lengths,
        )
        return cls(native)

    @classmethod
    def read(
        cls,
        path: Any,
        rate: float | None = None,
        *,
        steps: int | str | None = None,
        columns: Sequence[str] = (),
        resample: float | None = None,
        window: int | float | str | None = None,
        hop: int | float | str | None = None,
        intervals: Any = None,
        drop_labels: Sequence[str] = (),
        samples: str | None = None,
        labels: str | None = None,
        blocks: str | None = None,
    ) -> Dataset:
        """Reads HDF5, npz, MATLAB, CSV, Parquet or a folder of CSV. :func:`read_sweeps` reads files without labels.

        rate: frames per second; takes precedence over that of the file, with a warning.
        steps: number of frames to keep, from the beginning of every sweep, or ``"shortest"``; ``"all"``: all, of sweeps of unequal
            length; None: all, of equally long sweeps.
        columns: names of a table's columns that are taxels; empty: all without another meaning.
        resample: frames per second of the result: low-pass filtered, from the time stamps; gaps are not bridged.
        window: length of windows that are cut from continuous recordings: frames (int), seconds (float) or ``"1.28s"``.
            A window has one label and no gap; each stretch of one label is a block.
        hop: distance between the starts of windows; None: their length.
        intervals: table of labelled intervals, with columns ``start``, ``end``, ``label``; None: the column ``label`` of the recording.
        drop_labels: labels whose frames are left out.
        samples: name or HDF5 path of the samples in a file that has several arrays, e.g. ``"recorded/skin"``; ``"data/*/tactile"``: one sweep each.
        labels: name or HDF5 path of the material of each sweep, names or numbers.
        blocks: name of the column or array with the block of each sweep: recording, session, day or subject.
        """
        native = _tactnet.Dataset.read(
            path, rate, steps, list(columns), resample, window, hop, intervals, list(drop_labels), samples, labels, blocks
        )
        _warn(native)
        return cls(native)

    @classmethod
    def twin(cls, **settings: Any) -> Dataset:
        """Generates the synthetic twin of TactMat.

        settings: ``materials``, ``sweeps`` per material, ``steps``, ``seed``, ``version``.
        """
        return cls(_tactnet.Dataset.twin(**settings))

    def write(self, path: Any) -> None:
        """Writes a file in the format that its extension names: .h5, .npz, .ts."""
        self._native.write(path)

    def check(self) -> list[Finding]:
        """Checks the data and returns the findings, errors first."""
        found = json.loads(self._native.check_json())["findings"]
        return [Finding(entry["severity"], entry["kind"], entry["message"]) for entry in found]

    def regress(self, target: str | None = None, seed: int = 1) -> list[dict]:
        """Predicts speed and force of held-out sweeps from the sweeps alone; one dictionary for each condition of the file.

        target: ``speed`` or ``force``; None: both, where the file has them.

        ``r2``, ``rmse`` and ``mean_absolute_error`` are dictionaries of ``value``, ``ci95_low`` and ``ci95_high``.
        """
        return json.loads(self._native.regress_json(target, seed))["conditions"]

    def folds(
        self, scheme: str = "default", folds: int | None = None, seed: int = 1, repeat: int = 0
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Returns ``(train, test)`` indices of every fold, usable as ``cv`` in scikit-learn. Equal seeds give the folds of the command line.

        scheme: ``k-fold`` (random folds), ``group-k-fold`` (the sweeps of a block stay together), ``leave-block-out``, or ``default``: the
            file's own test sweeps, otherwise ``group-k-fold`` if materials have several blocks, otherwise ``k-fold``.
        folds: number of folds; None: 5, or fewer where sweeps or blocks are fewer. The default scheme then ignores the file's own test sweeps.
        """
        if not isinstance(scheme, str):
            raise TactnetError(
                f"scheme: expected default, k-fold, group-k-fold or leave-block-out, found {scheme!r}; pass a number of folds as `folds={scheme!r}`"
            )
        if folds is not None and scheme == "leave-block-out":
            raise TactnetError(f"folds: expected None with {scheme}, whose folds follow from the data, found {folds}")
        return self._native.folds(scheme, folds, seed, repeat)

    @property
    def X(self) -> np.ndarray:
        """Copy of the sweeps, ``(sweeps, steps, rows, cols)``, in the smallest type that holds the values: uint8, uint16 or float32."""
        return self._native.samples

    @property
    def lengths(self) -> np.ndarray | None:
        """Number of frames of each sweep, ``(sweeps,)``; None if all have as many as :attr:`X`, in which last frames are repeated."""
        return self._native.lengths

    @property
    def y(self) -> np.ndarray:
        """Material of each sweep, ``(sweeps,)``."""
        return np.asarray(self.materials)[self._native.labels]

    @property
    def materials(self) -> list[str]:
        """Names of the materials, in label order."""
        return self._native.materials

    @property
    def blocks(self) -> np.ndarray | None:
        """Recording block of each sweep, ``(sweeps,)``, or None."""
        return self._native.blocks

    @property
    def rate(self) -> float:
        """Frames per second."""
        return self._native.rate_hz

    @property
    def rate_is_assumed(self) -> bool:
        """True if the rate is unknown and 750 is assumed."""
        return self._native.rate_is_assumed

    @property
    def sha256(self) -> str:
        """SHA-256 of the content, independent of the file format."""
        return self._native.sha256

    def __len__(self) -> int:
        return len(self._native)

    def __getitem__(self, index: Any) -> Any:
        """Returns the sweep with this index, ``(steps, rows, cols)``, and its material; a data set for a slice, indices or a mask."""
        if not isinstance(index, (int, np.integer)):
            return Dataset(self._native.select(np.arange(len(self))[index].tolist()))
        if not -len(self) <= index < len(self):
            raise IndexError(f"sweep: expected an index below {len(self)}, found {index}")
        index = int(index) % len(self)
        return self._native.sweep(index), self.materials[self._native.labels[index]]

    def __iter__(self) -> Iterator[tuple[np.ndarray, str]]:
        labels, materials = self._native.labels, self.materials
        for index in range(len(self)):
            yield self._native.sweep(index), materials[labels[index]]

    def __getstate__(self) -> dict[str, Any]:
        # The file lacks the name and whether the rate is assumed.
        with tempfile.TemporaryDirectory() as work:
            file = Path(work) / "data.npz"
            self._native.write(file)
            content = file.read_bytes()
        return {"npz": content, "name": self._native.name, "rate_is_assumed": self.rate_is_assumed}

    def __setstate__(self, state: dict[str, Any]) -> None:
        with tempfile.TemporaryDirectory() as work:
            file = Path(work) / "data.npz"
            file.write_bytes(state["npz"])
            self._native = _tactnet.Dataset.restored(file, state["name"], state["rate_is_assumed"])

    def __repr__(self) -> str:
        return repr(self._native)


class Sweeps(NamedTuple):
    """Unlabelled sweeps, for ``predict``."""

    X: np.ndarray | list[np.ndarray]
    """``(sweeps, steps, rows, cols)``; a list of ``(steps, rows, cols)`` if the lengths differ."""
    names: list[str]
    """Names of files or of sweeps in a table, ``(sweeps,)``; otherwise numbers from 0."""
    rate: float
    """Frames per second."""
    rate_is_assumed: bool
    """True if the rate is unknown and 750 is assumed."""


def _warn(native: _tactnet.Dataset) -> None:
    """Passes the warnings of the reader on to Python."""
    for message in native.reading_warnings[:3]:
        warnings.warn(message, stacklevel=3)


def read_sweeps(path: Any, rate: float | None = None, steps: int | str | None = None) -> Sweeps:
    """Reads unlabelled sweeps: all files of :meth:`Dataset.read`, npz with ``X`` only, CSV and Parquet without a column of materials.

    rate: frames per second; takes precedence over that of the file, with a warning.
    steps: number of frames to keep, from the beginning of every sweep; ``"all"``: all, of sweeps of unequal length; None: all, of
        equally long sweeps.
    """
    native, names = _tactnet.Dataset.read_unlabelled(path, rate, steps)
    _warn(native)
    X: Any = native.samples
    if native.lengths is not None:
        X = [sweep[:steps] for sweep, steps in zip(X, native.lengths)]
    return Sweeps(X, names, native.rate_hz, native.rate_is_assumed)
