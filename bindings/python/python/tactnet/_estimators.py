"""Classifiers as scikit-learn estimators."""

from __future__ import annotations

import warnings
from typing import Any, Sequence

import numpy as np

from . import _tactnet
from ._progress import progress_of
from ._sweep_classifier import COMMITTEE, NETWORK, SweepClassifier, check_is_fitted, copy_with_classifier
from ._tactnet import TactnetError


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


class _Weighted(SweepClassifier):
    """Base class of the classifiers whose training can weigh sweeps."""

    def __init__(
        self,
        *,
        rate: float | None = None,
        shape: Sequence[int] | None = None,
        class_weight: Any = None,
        seed: int = 1,
        random_state: Any = None,
    ):
        super().__init__(rate=rate, shape=shape, seed=seed, random_state=random_state)
        self.class_weight = class_weight

    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> SweepClassifier:
        """Fits to all sweeps.

        sample_weight: weight of each sweep in the fit, ``(sweeps,)``, from 0; sweeps with 0 are left out. Only ratios matter. Normalisation,
            scaling of features and calibration count every sweep once.

        Raises TactnetError, a ValueError, for values that are not finite and for sweeps in which no taxel changes. Warns if the axes seem
        to be in another order, and of equal sweeps. Ctrl-C stops the training of a network at the next batch.
        """
        return self._fit(X, y, sample_weight)


class _OfRecipe(_Weighted):
    """Base class of the classifiers whose recipe can be a TOML file."""

    def __init__(
        self,
        *,
        recipe: str = "fast",
        epochs: int | None = None,
        levels: str | None = None,
        rate: float | None = None,
        shape: Sequence[int] | None = None,
        class_weight: Any = None,
        seed: int = 1,
        random_state: Any = None,
        progress: bool = False,
    ):
        super().__init__(rate=rate, shape=shape, class_weight=class_weight, seed=seed, random_state=random_state)
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
        return progress_of(type(self).__name__) if self.progress else None

    def unknown_score(self, X: Any) -> np.ndarray:
        """Returns ``(sweeps,)``, a score that is larger for sweeps unlike any known material.

        Of a network it is the mutual information of material and dropout masks in nats (Gal & Ghahramani, 2016), of a committee the negative
        logarithm of its largest probability.
        """
        data = self._dataset(X)
        return self.classifier_.unknown_scores(data)


class TactNetClassifier(_OfRecipe):
    """A network: that of TactNet-II (Tulbure & Bäuml, Humanoids 2018), or a smaller one on spectra of short windows (``recipe="spectra"``).

    recipe: ``fast``, ``spectra``, ``thesis`` (200 adversarial epochs, as published), ``robust`` (trained for dead taxels, drift and other disturbances), ``distilled`` (taught by a committee), or the path of a TOML file.
    epochs: number of epochs instead of the recipe's.
    levels: ``kept`` or ``removed``: use of a taxel's mean over the sweep; None: as in the recipe.
    rate: frames per second; None: unknown, and sweeps of any rate are accepted.
    shape: shape of each sweep of a table, ``(steps, taxels)``; None: X is no table.
    class_weight: ``balanced`` (every material counts the same), or a dict with the weight of each material; None: every sweep counts the same.
    seed: seed of all random numbers; equal seeds give identical results, also on the command line.
    random_state: scikit-learn's name of the seed, or a source of seeds; takes precedence over ``seed``.
    progress: shows a progress bar of batches (with tqdm if installed, also in notebooks).
    """

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == NETWORK else None

    def enroll(self, X: Any, material: Any) -> SweepClassifier:
        """Returns a classifier with one more material, learned from a few sweeps of it. This object is unchanged."""
        grown = copy_with_classifier(self, self.classifier_.enroll(str(material), self._dataset(X)))
        grown.classes_ = np.append(self.classes_, material)
        return grown

    def online(self) -> OnlineClassifier:
        """Returns the same network for frame-by-frame classification."""
        check_is_fitted(self, "classifier_")
        return OnlineClassifier(self.classifier_.online(), self.classes_)


class TactNetCommittee(_OfRecipe):
    """The mean of the probabilities of several models.

    recipe: ``committee`` (TactNet-II's network, a network on spectra, MiniRocket, MultiRocket + Hydra, linear discriminants, a support vector machine), or
        the path of a TOML file with a list ``members``. A member that the sweeps do not allow is left out.
    epochs, levels, rate, shape, seed, random_state, progress: as of :class:`TactNetClassifier`; epochs and levels are those of all members.
    class_weight, and ``sample_weight`` of ``fit``: refused if a member cannot use them, such as the support vector machine of ``committee``.
    """

    def __init__(
        self,
        *,
        recipe: str = "committee",
        epochs: int | None = None,
        levels: str | None = None,
        rate: float | None = None,
        shape: Sequence[int] | None = None,
        class_weight: Any = None,
        seed: int = 1,
        random_state: Any = None,
        progress: bool = False,
    ):
        super().__init__(
            recipe=recipe,
            epochs=epochs,
            levels=levels,
            rate=rate,
            shape=shape,
            class_weight=class_weight,
            seed=seed,
            random_state=random_state,
            progress=progress,
        )

    def enroll(self, X: Any, material: Any, X_train: Any, y_train: Any) -> SweepClassifier:
        """Returns a committee with one more material, learned from a few sweeps X of it. This object is unchanged.

        X_train, y_train: the sweeps of ``fit``, to which members that are no networks are fitted again. Warns of members that X is too small for;
            the new committee lacks them.
        """
        train, new = self._dataset(X_train, y_train), self._dataset(X)
        classifier, left_out = self.classifier_.enroll_with(train, str(material), new)
        for reason in left_out:
            warnings.warn(reason, UserWarning, stacklevel=2)
        grown = copy_with_classifier(self, classifier)
        grown.classes_ = np.append(self.classes_, material)
        return grown

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == COMMITTEE else None


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


class MiniRocketClassifier(_Weighted):
    """MiniRocket features with a ridge classifier (Dempster et al., 2021)."""

    def _recipe(self) -> str:
        return "minirocket"

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == "minirocket" else None


class MultiRocketHydraClassifier(_Weighted):
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


class LdaClassifier(_Weighted):
    """Linear discriminant analysis of levels and logarithmic spectra of every taxel."""

    def _recipe(self) -> str:
        return "lda"

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        return {} if model == "lda" else None


class _OnFeatures(SweepClassifier):
    _KINDS: dict[str, str] = {}

    def __init__(
        self,
        *,
        features: str = "h",
        rate: float | None = None,
        shape: Sequence[int] | None = None,
        seed: int = 1,
        random_state: Any = None,
    ):
        super().__init__(rate=rate, shape=shape, seed=seed, random_state=random_state)
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
