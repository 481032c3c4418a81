"""Types of the native half; use the classes of `tactnet` instead."""

from collections.abc import Callable
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

class TactnetError(ValueError): ...

def check_resolution(samples: NDArray[np.float64]) -> None: ...
def fuse(log_proba: NDArray[np.float64]) -> NDArray[np.float64]: ...

class Dataset:
    @staticmethod
    def from_arrays(
        samples: NDArray[Any],
        labels: list[int],
        materials: list[str],
        rate_hz: float | None = None,
        blocks: list[int] | None = None,
        name: str = "arrays",
        lengths: list[int] | None = None,
    ) -> Dataset: ...
    @staticmethod
    def read(
        path: str | PathLike[str],
        rate_hz: float | None = None,
        steps: int | str | None = None,
        columns: list[str] = ...,
        resample_hz: float | None = None,
        window: int | float | str | None = None,
        hop: int | float | str | None = None,
        intervals: str | PathLike[str] | None = None,
        drop_labels: list[str] = ...,
        samples: str | None = None,
        labels: str | None = None,
        blocks: str | None = None,
    ) -> Dataset: ...
    reading_warnings: list[str]
    @staticmethod
    def read_unlabelled(
        path: str | PathLike[str], rate_hz: float | None = None, steps: int | str | None = None
    ) -> tuple[Dataset, list[str]]: ...
    @staticmethod
    def twin(
        materials: int | None = None,
        sweeps: int | None = None,
        steps: int | None = None,
        seed: int | None = None,
        version: int = 2,
    ) -> Dataset: ...
    def write(self, path: str | PathLike[str]) -> None: ...
    def check_json(self) -> str: ...
    def folds(
        self, scheme: str = "default", folds: int = 5, seed: int = 1, repeat: int = 0
    ) -> list[tuple[NDArray[np.uint64], NDArray[np.uint64]]]: ...
    samples: NDArray[Any]
    labels: NDArray[np.uint64]
    lengths: NDArray[np.uint64] | None
    blocks: NDArray[np.uint32] | None
    materials: list[str]
    sweep_shape: tuple[int, int, int]
    rate_hz: float
    rate_is_assumed: bool
    name: str
    sha256: str
    def __len__(self) -> int: ...

class Classifier:
    @staticmethod
    def fit(
        dataset: Dataset,
        recipe: str,
        epochs: int | None = None,
        seed: int = 1,
        levels: str | None = None,
        progress: Callable[[int, int, int, float | None, float | None], Any] | None = None,
    ) -> Classifier: ...
    @staticmethod
    def load(folder: str | PathLike[str]) -> Classifier: ...
    def save(self, folder: str | PathLike[str]) -> None: ...
    def predict_log_proba(self, dataset: Dataset) -> NDArray[np.float64]: ...
    def unknown_scores(self, dataset: Dataset) -> NDArray[np.float64]: ...
    def likeness(self, dataset: Dataset) -> str | None: ...
    def enroll(self, material: str, dataset: Dataset) -> Classifier: ...
    def adapt(self, dataset: Dataset, labelled: bool = False, accept_risk: bool = False) -> tuple[Classifier, list[str]]: ...
    def online(self) -> Online: ...
    materials: list[str]
    sweep_shape: tuple[int, int, int]
    any_length: bool
    rate_hz: float | None

class Online:
    def begin(self) -> None: ...
    def push(self, digits: NDArray[np.float32]) -> None: ...
    def classify(self, dropout: bool = False) -> NDArray[np.float64]: ...
    def fuse(self) -> None: ...
    def fused(self) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...
    frames: int
    is_complete: bool

class Hub:
    def __init__(self, table: str | PathLike[str] | None = None, bus: str = "tactnet") -> None: ...
    def stop(self) -> None: ...
    table: str
    def __enter__(self) -> Hub: ...
    def __exit__(self, *exception: Any) -> None: ...

class Bus:
    def __init__(self, table: str) -> None: ...
    fingers: list[str]
    def skin(self, finger: int = 0) -> SkinPort: ...
    def commands(self) -> CommandPort: ...
    def put_port(self, channel: str, name: str, version: int, item_bytes: int) -> RawPutPort: ...
    def get_port(self, channel: str, name: str, version: int, item_bytes: int, history: int) -> RawGetPort: ...
    def beliefs(self) -> BeliefPort: ...

class RawPutPort:
    def put(self, items: bytes) -> int: ...

class RawGetPort:
    def get(self, timeout: float | None = None) -> tuple[bytes, int] | None: ...
    @property
    def lost(self) -> int: ...

class SkinPort:
    def put(self, digits: NDArray[np.float32], sequence: int | None = None, sensor_time_ns: int | None = None) -> None: ...

class CommandPort:
    def put(self, kind: str, finger: int = 0, motion: int = 0, sweeps: int = 0, material: str = "") -> None: ...

class BeliefPort:
    def get_json(self, timeout: float | None = None) -> str | None: ...
    lost: int

class Recording:
    @staticmethod
    def read(path: str | PathLike[str]) -> Recording: ...
    fingers: list[str]
    def frames(
        self, finger: str | None = None
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64], NDArray[np.uint64], NDArray[np.float32]]: ...
    def packets_json(self) -> list[tuple[str, int, str]]: ...
    def sweeps(
        self,
        material: str | None = None,
        steps: int | None = None,
        rate_hz: float | None = None,
        rows_cols: tuple[int, int] | None = None,
    ) -> Dataset: ...
    cut: str | None
    def __len__(self) -> int: ...
