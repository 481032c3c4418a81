"""Classifiers as scikit-learn estimators. They also work without scikit-learn."""

from __future__ import annotations

import io
import json
import tarfile
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from . import _tactnet
from ._dataset import Dataset, native_values, padded
from ._tactnet import TactnetError

try:
    from sklearn.base import BaseEstimator, ClassifierMixin
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError:
    from ._without_sklearn import BaseEstimator, ClassifierMixin, check_classification_targets, check_is_fitted, validate_data


#: Names of saved networks and committees in error messages.
NETWORK = "a network"
COMMITTEE = "a committee"


def fuse(log_proba: Any) -> np.ndarray:
    """Returns ``(materials,)``: the posterior of one object from several sweeps, by Bayes' rule with equal priors.

    log_proba: ``(sweeps, materials)``, natural logarithms from ``predict_log_proba``. Raises TactnetError for probabilities.
    """
    log_proba = np.ascontiguousarray(log_proba, dtype=np.float64)
    if log_proba.ndim != 2 or log_proba.shape[1] == 0:
        raise TactnetError(f"log_proba: expected (sweeps, materials), found shape {log_proba.shape}")
    # Logarithms of probabilities are negative, except for a single certain material.
    if log_proba.size and log_proba.shape[1] > 1 and (log_proba >= 0).all() and np.allclose(log_proba.sum(axis=1), 1, atol=1e-3):
        raise TactnetError("log_proba: expected logarithms, found probabilities; use predict_log_proba or np.log")
    return _tactnet.fuse(log_proba)


def refuse_gaps(X: Any) -> None:
    """Raises TactnetError for sweeps with values that are not finite. Other arrays are checked elsewhere."""
    values = np.asarray(X)
    if values.ndim < 3 or values.dtype.kind != "f":
        return
    odd = ~np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
    if odd.any():
        raise TactnetError(f"X: expected finite numbers, found NaN or infinity in {odd.sum()} of {len(values)} sweeps, the first X[{odd.argmax()}]")


#: Findings of :meth:`Dataset.check` that are errors in ``fit``.
REFUSED = ("not_finite", "constant_sweep")

#: Findings that are warnings in ``fit``. Equal sweeps are an error of the check, since one of them may be a test sweep, but a bootstrap
#: sample contains them legitimately.
WARNED = {
    "axis_order": "{message}",
    "identical_sweeps": "{message}; if one of two equal sweeps is a test sweep, the accuracy is invalid",
}


class SweepClassifier(ClassifierMixin, BaseEstimator):
    """Base class of all classifiers.

    X: ``(sweeps, steps, taxels)`` or ``(sweeps, steps, rows, cols)``, finite numbers in the skin's unit; or a list of sweeps of unequal length.
    y: one material per sweep.

    Attributes after ``fit``: ``classes_`` ``(materials,)``, in the order of the probability columns.
    """

    def __init__(self, *, rate: float | None = None, seed: int = 1):
        self.rate = rate
        self.seed = seed

    def _recipe(self) -> str:
        raise NotImplementedError

    def _settings(self) -> dict[str, Any]:
        return {}

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.input_tags.three_d_array = True
        return tags

    def fit(self, X: Any, y: Any) -> SweepClassifier:
        """Fits to all sweeps.

        Raises TactnetError, a ValueError, for values that are not finite and for sweeps in which no taxel changes. Warns if the axes seem
        to be in another order, and of equal sweeps. Ctrl-C stops the training of a network at the next batch.
        """
        X, lengths = padded(X)
        refuse_gaps(X)
        X, y = validate_data(self, X, y, allow_nd=True, dtype=None)
        check_classification_targets(y)
        self.classes_ = np.unique(y)
        if len(self.classes_) < 2:
            raise ValueError(f"y: expected at least two materials, found one class, {self.classes_[0]!r}")
        data = Dataset.from_arrays(self._sweeps(X), y, self.rate, lengths=lengths)
        self._check_sweeps(data)
        self.classifier_ = _tactnet.Classifier.fit(
            data._native, self._recipe(), seed=self.seed, progress=self._progress(), **self._settings()
        )
        return self

    def _progress(self):
        return None

    def _check_sweeps(self, data: Dataset) -> None:
        """Raises TactnetError for unusable training sweeps, and warns once per kind of other findings."""
        warned = set()
        for finding in json.loads(data._native.check_json())["findings"]:
            kind, message, sweep = finding["kind"], finding["message"], finding["at"]["sweep"]
            if sweep is not None:
                message = f"X[{sweep}], {message}"
            if kind in REFUSED:
                raise TactnetError(message)
            if kind in WARNED and kind not in warned:
                warned.add(kind)
                warnings.warn(WARNED[kind].format(message=message), UserWarning, stacklevel=3)

    def _sweeps(self, X: np.ndarray) -> np.ndarray:
        """Returns the sweeps of validated input; the tests override it."""
        return X

    def _dataset(self, X: Any, y: Any = None) -> Any:
        check_is_fitted(self, "classifier_")
        X, lengths = padded(X)
        # For more than two axes the error below is clearer: scikit-learn would call steps features.
        many_axes = np.asarray(X).ndim > 2
        if many_axes:
            refuse_gaps(X)
        alike = type(self)(**self.get_params(deep=False)) if many_axes else self
        X = validate_data(alike, X, allow_nd=True, dtype=None, reset=many_axes)
        values = native_values(self._sweeps(X))
        steps, rows, cols = self.classifier_.sweep_shape
        if values.shape[2] == 1 and values.shape[3] == rows * cols:
            values = values.reshape(len(values), -1, rows, cols)
        any_length = lengths is not None or self.classifier_.any_length
        if values.shape[2:] != (rows, cols) or (values.shape[1] != steps and not any_length):
            raise TactnetError(
                f"X: expected sweeps of {steps} steps of {rows}x{cols} taxels, as in fit, found shape {X.shape}"
            )
        labels, names = [0] * len(values), ["unlabelled"]
        if y is not None:
            names = [str(name) for name in self.classes_]
            if len(y) != len(values):
                raise TactnetError(f"y: expected a material for each of {len(values)} sweeps, found {len(y)}")
            unknown = [name for name in map(str, y) if name not in names]
            if unknown:
                raise TactnetError(f"y: expected known materials ({', '.join(names[:4])}, …), found {unknown[0]!r}; `enroll` adds one")
            labels = [names.index(str(name)) for name in y]
            names = self.classifier_.materials
        return _tactnet.Dataset.from_arrays(values, labels, names, self.classifier_.rate_hz, lengths=lengths)

    def predict_log_proba(self, X: Any) -> np.ndarray:
        """Returns ``(sweeps, materials)``, the natural logarithms of the probabilities."""
        data = self._dataset(X)
        return self.classifier_.predict_log_proba(data)

    def predict_proba(self, X: Any) -> np.ndarray:
        """Returns ``(sweeps, materials)``, the probabilities."""
        return np.exp(self.predict_log_proba(X))

    def predict(self, X: Any) -> np.ndarray:
        """Returns ``(sweeps,)``, the most probable material of each sweep."""
        best = np.argmax(self.predict_log_proba(X), axis=1)
        return self.classes_[best]

    def likeness(self, X: Any) -> dict[str, Any] | None:
        """Compares sweeps with the training sweeps; None if those were fewer than 20.

        The dictionary has ``verdict`` ("like", "other-block" or "unlike"), ``p`` of all sweeps together, ``p_of_sweeps``, and
        ``differences``: what differs, such as a unit, signs, the order of the taxels, the speed or dead taxels.
        """
        found = self.classifier_.likeness(self._dataset(X))
        return None if found is None else json.loads(found)

    def adapt(self, X: Any, y: Any = None, *, accept_risk: bool = False) -> SweepClassifier:
        """Returns a classifier that is adapted to sweeps of another skin, robot or day. This object is unchanged.

        The scaling (and a network's running statistics) follow the sweeps, which must be of all materials in about equal numbers, 16 or more.
        With y, a material per sweep, the output layer is fitted, too, with the old one as prior.
        accept_risk: adapts to fewer than 8 sweeps, or to sweeps of few materials, with a warning in place of a TactnetError.
        """
        adapted = copy_without_classifier(self)
        adapted.classifier_, risks = self.classifier_.adapt(self._dataset(X, y), y is not None, accept_risk)
        for risk in risks:
            warnings.warn(risk, UserWarning, stacklevel=2)
        return adapted

    def predict_table(self, X: Any) -> Any:
        """Returns a pandas DataFrame with a row per sweep: ``material``, ``probability``, and one probability column per material."""
        import pandas

        probabilities = self.predict_proba(X)
        best = np.argmax(probabilities, axis=1)
        columns = {"material": self.classes_[best], "probability": probabilities[np.arange(len(best)), best]}
        columns |= {f"p({name})": probabilities[:, at] for at, name in enumerate(self.classes_)}
        return pandas.DataFrame(columns)

    def save(self, folder: Any) -> None:
        """Saves into a new folder, which the command line can open as well.

        Raises TactnetError if the folder contains files; nothing is overwritten.
        """
        check_is_fitted(self, "classifier_")
        folder = Path(folder)
        if folder.is_dir() and any(folder.iterdir()):
            raise TactnetError(f"{folder}: expected a new or an empty folder, found files; choose another folder or remove this one")
        self.classifier_.save(folder)

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        """Returns the settings of a saved model of this class; None for models of other classes."""
        return {}

    @classmethod
    def load(cls, folder: Any) -> SweepClassifier:
        """Opens a folder of :meth:`save` or a run directory of the command line; ``classes_`` are then names.

        ``SweepClassifier.load`` opens any classifier and returns an object of its class. A baseline without a class, such as ``means``,
        becomes a SweepClassifier that can predict, but not fit. Other classes raise TactnetError for a classifier of another class.
        """
        native = _tactnet.Classifier.load(folder)
        described = json.loads((Path(folder) / "config.json").read_text())["classifier"]["model"]
        model = COMMITTEE if "committee" in described else described.get("baseline", {}).get("name", NETWORK)
        own = next((known for known in ALL if known._settings_of(model) is not None), SweepClassifier)
        if cls is SweepClassifier:
            cls = own
        settings = cls._settings_of(model)
        if settings is None:
            raise TactnetError(f"{folder}: expected a classifier of {cls.__name__}, found {model}; use {own.__name__}.load")
        loaded = cls(rate=native.rate_hz, **settings)
        loaded.classifier_ = native
        loaded.classes_ = np.asarray(native.materials)
        loaded.n_features_in_ = native.sweep_shape[0]
        return loaded

    def __getstate__(self) -> dict[str, Any]:
        state = dict(super().__getstate__())
        if "classifier_" in state:
            with tempfile.TemporaryDirectory() as work:
                folder = Path(work) / "classifier"
                state["classifier_"].save(folder)
                packed = io.BytesIO()
                with tarfile.open(fileobj=packed, mode="w") as archive:
                    for file in sorted(folder.rglob("*")):
                        archive.add(file, file.relative_to(folder), recursive=False)
            state["classifier_"] = packed.getvalue()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        state = dict(state)
        packed = state.get("classifier_")
        if isinstance(packed, bytes):
            with tempfile.TemporaryDirectory() as work:
                with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
                    archive.extractall(work, filter="data")
                state["classifier_"] = _tactnet.Classifier.load(work)
        super().__setstate__(state)


class _OfRecipe(SweepClassifier):
    """Base class of the classifiers whose recipe can be a TOML file."""

    def __init__(
        self,
        *,
        recipe: str = "fast",
        epochs: int | None = None,
        levels: str | None = None,
        rate: float | None = None,
        seed: int = 1,
        progress: bool = False,
    ):
        super().__init__(rate=rate, seed=seed)
        self.recipe = recipe
        self.epochs = epochs
        self.levels = levels
        self.progress = progress

    def _recipe(self) -> str:
        return str(self.recipe)

    def _settings(self) -> dict[str, Any]:
        if self.epochs is not None and self.epochs < 1:
            raise TactnetError(f"epochs: expected at least 1, found {self.epochs}")
        return {"epochs": self.epochs, "levels": self.levels}

    def _progress(self):
        if not self.progress:
            return None
        try:
            from tqdm.auto import tqdm
        except ImportError:

            def lines(epoch, batch, batches, loss, accuracy):
                if batch + 1 == batches:
                    print(f"epoch {epoch + 1}: loss {loss:.3f}, training accuracy {accuracy:.3f}", flush=True)

            return lines
        bar = tqdm(unit="batch")

        def show(epoch, batch, batches, loss, accuracy):
            bar.set_description(f"epoch {epoch + 1}", refresh=False)
            bar.set_postfix(loss=f"{loss:.3f}", accuracy=f"{accuracy:.3f}", refresh=False)
            bar.update()

        return show

    def unknown_score(self, X: Any) -> np.ndarray:
        """Returns ``(sweeps,)``, a score that is larger for sweeps unlike any known material.

        Of a network it is the mutual information of material and dropout masks in nats (Gal & Ghahramani, 2016), of a committee the negative
        logarithm of its largest probability.
        """
        data = self._dataset(X)
        return self.classifier_.unknown_scores(data)


class TactNetClassifier(_OfRecipe):
    """A network: TactNet-II (Tulbure & Bäuml, Humanoids 2018), or a smaller one on spectra of short windows (``recipe="spectra"``).

    recipe: ``fast``, ``spectra``, ``thesis`` (200 adversarial epochs, as published), ``robust`` (trained for dead taxels, drift and other disturbances), ``distilled`` (taught by a committee), or the path of a TOML file.
    epochs: number of epochs instead of the recipe's.
    levels: ``kept`` or ``removed``: use of a taxel's mean over the sweep; None: as in the recipe.
    rate: frames per second; None: unknown, and sweeps of any rate are accepted.
    seed: seed of all random numbers; equal seeds give identical results, also on the command line.
    progress: shows a progress bar of batches (with tqdm if installed).
    """

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == NETWORK else None

    def enroll(self, X: Any, material: Any) -> SweepClassifier:
        """Returns a classifier with one more material, learned from a few sweeps of it. This object is unchanged."""
        data = self._dataset(X)
        grown = copy_without_classifier(self)
        grown.classifier_ = self.classifier_.enroll(str(material), data)
        grown.classes_ = np.append(self.classes_, material)
        return grown

    def online(self) -> OnlineClassifier:
        """Returns the same network for frame-by-frame classification."""
        check_is_fitted(self, "classifier_")
        return OnlineClassifier(self.classifier_.online(), self.classes_)


class TactNetCommittee(_OfRecipe):
    """The mean of the probabilities of several models.

    recipe: ``committee`` (TactNet-II, a network on spectra, MiniRocket, MultiRocket + Hydra, linear discriminants, a support vector machine), or
        the path of a TOML file with a list ``members``. A member that the sweeps do not allow is left out.
    epochs, levels, rate, seed, progress: as of :class:`TactNetClassifier`; epochs and levels are those of all members.
    """

    def __init__(
        self,
        *,
        recipe: str = "committee",
        epochs: int | None = None,
        levels: str | None = None,
        rate: float | None = None,
        seed: int = 1,
        progress: bool = False,
    ):
        super().__init__(recipe=recipe, epochs=epochs, levels=levels, rate=rate, seed=seed, progress=progress)

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == COMMITTEE else None


def copy_without_classifier(estimator: SweepClassifier) -> SweepClassifier:
    """Returns a copy of a fitted estimator without the native classifier."""
    copied = type(estimator)(**estimator.get_params())
    for name, value in vars(estimator).items():
        if name != "classifier_":
            setattr(copied, name, value)
    return copied


class OnlineClassifier:
    """Classifies one sweep at a time, frame by frame, and fuses the sweeps of one object.

    Attributes: ``classes_``, in the order of probabilities.
    """

    def __init__(self, native: _tactnet.Online, classes: np.ndarray):
        self._native = native
        self.classes_ = classes

    def begin(self) -> None:
        """Begins a sweep."""
        self._native.begin()

    def push(self, digits: Any) -> None:
        """Adds the next frame, ``(taxels,)`` or ``(rows, cols)``, in raw digits."""
        self._native.push(np.ascontiguousarray(digits, dtype=np.float32).reshape(-1))

    def predict_proba(self, dropout: bool = False) -> np.ndarray:
        """Returns ``(materials,)``, the probabilities given the sweep so far.

        dropout: mean over Monte Carlo dropout masks, like ``TactNetClassifier.predict_proba`` for a recipe with them. After the last
            frame the two agree up to rounding.
        """
        return self._native.classify(dropout)

    def fuse(self) -> np.ndarray:
        """Fuses the newest prediction with those of earlier sweeps of the object, and returns ``(materials,)``."""
        self._native.fuse()
        return self._native.fused()

    def reset(self) -> None:
        """Forgets the fused sweeps; the next sweep is of another object."""
        self._native.reset()

    @property
    def frames(self) -> int:
        """Number of frames of this sweep so far."""
        return self._native.frames

    @property
    def is_complete(self) -> bool:
        """True if the sweep has all its frames."""
        return self._native.is_complete


class MiniRocketClassifier(SweepClassifier):
    """MiniRocket features with a ridge classifier (Dempster et al., 2021)."""

    def _recipe(self) -> str:
        return "minirocket"

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == "minirocket" else None


class MultiRocketHydraClassifier(SweepClassifier):
    """MultiRocket and Hydra features with a ridge classifier (Dempster et al., 2023)."""

    def _recipe(self) -> str:
        return "multirocket-hydra"

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == "multirocket-hydra" else None


class QuantClassifier(SweepClassifier):
    """Quantiles over intervals with extremely randomised trees (Dempster et al., 2024)."""

    def _recipe(self) -> str:
        return "quant"

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == "quant" else None


class LdaClassifier(SweepClassifier):
    """Linear discriminant analysis of levels and logarithmic spectra of every taxel."""

    def _recipe(self) -> str:
        return "lda"

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == "lda" else None


class _OnFeatures(SweepClassifier):
    _KINDS: dict[str, str] = {}

    def __init__(self, *, features: str = "h", rate: float | None = None, seed: int = 1):
        super().__init__(rate=rate, seed=seed)
        self.features = features

    def _recipe(self) -> str:
        if self.features not in self._KINDS:
            raise TactnetError(f"features: expected one of {', '.join(self._KINDS)}, found {self.features!r}")
        return self._KINDS[self.features]

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return next(({"features": features} for features, kind in cls._KINDS.items() if kind == model), None)


class SvmClassifier(_OnFeatures):
    """Support vector machine.

    features: ``h``, the short-time spectrum; ``l``, roughness and two spectral centroids; ``spectra``, levels and logarithmic spectra.
    """

    _KINDS = {"h": "svm-h", "l": "svm-l", "spectra": "svm-spectra"}


class KnnClassifier(_OnFeatures):
    """Nearest neighbours.

    features: ``h``, the short-time spectrum; ``l``, roughness and two spectral centroids.
    """

    _KINDS = {"h": "knn-h", "l": "knn-l"}


#: Classes of saved classifiers.
ALL = (
    TactNetClassifier,
    TactNetCommittee,
    MiniRocketClassifier,
    MultiRocketHydraClassifier,
    QuantClassifier,
    LdaClassifier,
    SvmClassifier,
    KnnClassifier,
)
