"""Base class of the classifiers, a scikit-learn estimator. It also works without scikit-learn."""

from __future__ import annotations

import io
import json
import tarfile
import tempfile
import warnings
from pathlib import Path
from typing import Any, Sequence

import numpy as np

from . import _tactnet
from ._dataset import Dataset, native_values, padded
from ._tactnet import TactnetError
from ._values import as_sweeps, checked_labels, checked_weights, class_weights, refuse_gaps, refuse_masks

try:
    from sklearn.base import BaseEstimator, ClassifierMixin
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError:
    from ._without_sklearn import BaseEstimator, ClassifierMixin, check_classification_targets, check_is_fitted, validate_data


#: Names of saved networks and committees in error messages.
NETWORK = "a network"
COMMITTEE = "a committee"

#: File of a saved classifier with materials that are numbers.
CLASSES = "classes.json"

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

    X: ``(sweeps, steps, taxels)`` or ``(sweeps, steps, rows, cols)``, finite numbers in the skin's unit; a list of sweeps of unequal length;
        or, with ``shape``, a table with a sweep in each row.
    y: one material per sweep.

    Attributes after ``fit``: ``classes_`` ``(materials,)``, in the order of the probability columns; ``n_features_in_``, the number of values
    of a sweep, unless the lengths differ. A ``fit`` that fails or is interrupted leaves the object as it was.
    """

    def __init__(
        self,
        *,
        rate: float | None = None,
        shape: Sequence[int] | None = None,
        seed: int = 1,
        random_state: Any = None,
    ):
        self.rate = rate
        self.shape = shape
        self.seed = seed
        self.random_state = random_state

    def _recipe(self) -> str:
        raise NotImplementedError

    def _settings(self) -> dict[str, Any]:
        return {}

    def _seed(self) -> int:
        """Returns the seed of a fit. ``random_state`` takes precedence over ``seed``."""
        state = self.random_state
        if state is None:
            return self.seed
        if isinstance(state, (int, np.integer)) and state >= 0:
            return int(state)
        draw = getattr(state, "integers", None) or getattr(state, "randint", None)
        if draw is None:
            raise TactnetError(f"random_state: expected a whole number from 0, a RandomState or a Generator, found {state!r}")
        return int(draw(2**31))

    def _takes_tables(self) -> bool:
        """Returns true if X may be a table; the tests override it."""
        return self.shape is not None

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = self._takes_tables()
        tags.input_tags.three_d_array = True
        return tags

    def fit(self, X: Any, y: Any, **unsupported: Any) -> SweepClassifier:
        """Fits to all sweeps.

        Raises TactnetError, a ValueError, for values that are not finite and for sweeps in which no taxel changes. Warns if the axes seem
        to be in another order, and of equal sweeps. Ctrl-C stops the training of a network at the next batch.
        """
        if "sample_weight" in unsupported:
            raise TactnetError(
                f"sample_weight: {type(self).__name__} cannot weigh sweeps; TactNetClassifier, LdaClassifier, MiniRocketClassifier and"
                " MultiRocketHydraClassifier can"
            )
        for name in unsupported:
            raise TypeError(f"{type(self).__name__}.fit has no argument {name!r}")
        return self._fit(X, y, None)

    def _fit(self, X: Any, y: Any, sample_weight: Any) -> SweepClassifier:
        """Fits a new object of this class, and takes over its attributes only after success."""
        fresh = type(self)(**self.get_params(deep=False))
        fresh._fit_fresh(X, y, sample_weight)
        is_fitted = lambda name: name.endswith("_") and not name.endswith("__")  # noqa: E731
        kept = {name: value for name, value in vars(self).items() if not is_fitted(name)}
        self.__dict__ = kept | {name: value for name, value in vars(fresh).items() if is_fitted(name)}
        return self

    def _fit_fresh(self, X: Any, y: Any, sample_weight: Any) -> None:
        self._refuse_input(X)
        if y is not None:
            checked_labels(y)
        X, lengths = padded(X)
        refuse_gaps(X)
        X, y = validate_data(self, X, y, allow_nd=True, dtype=None)
        check_classification_targets(y)
        weights = checked_weights(sample_weight, len(X))
        if weights is not None and not weights.all():
            used = np.flatnonzero(weights)
            X, y, weights = X[used], y[used], weights[used]
            lengths = None if lengths is None else [lengths[index] for index in used]
        classes = np.unique(y)
        if len(classes) < 2:
            found = repr(classes[0]) if len(classes) else "none"
            raise ValueError(f"y: expected at least two materials, found one class, {found}")
        self._count_features(X, lengths)
        weights = class_weights(getattr(self, "class_weight", None), y, weights)
        data = Dataset.from_arrays(self._sweeps(X), y, self.rate, lengths=lengths)
        self._check_sweeps(data)
        progress = self._progress()
        try:
            self.classifier_ = _tactnet.Classifier.fit(
                data._native,
                self._recipe(),
                weights=None if weights is None else weights.tolist(),
                seed=self._seed(),
                progress=progress,
                **self._settings(),
            )
        finally:
            if hasattr(progress, "close"):
                progress.close()
        self.classes_ = classes

    def _count_features(self, X: np.ndarray, lengths: Any) -> None:
        """Sets the number of values of a sweep, as of the table with a sweep in each row; sweeps of unequal length have none."""
        if X.ndim > 2:
            self.n_features_in_ = int(np.prod(X.shape[1:]))
        if lengths is not None:
            del self.n_features_in_

    def _progress(self):
        """Returns a function that is called with epoch, batch, batches, epochs, loss and accuracy after every batch, or None. Its method
        ``close``, if it has one, is called at the end."""
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
                # The caller of `fit`.
                warnings.warn(WARNED[kind].format(message=message), UserWarning, stacklevel=5)

    def _refuse_input(self, X: Any) -> None:
        """Raises TactnetError for masked arrays, and for tables without a shape, which scikit-learn would take for features."""
        refuse_masks(X)
        if not self._takes_tables() and getattr(X, "ndim", None) == 2:
            as_sweeps(X, None)

    def _sweeps(self, X: np.ndarray) -> np.ndarray:
        """Returns the sweeps of validated input; the tests override it."""
        return as_sweeps(X, self.shape)

    def _dataset(self, X: Any, y: Any = None) -> Any:
        check_is_fitted(self, "classifier_")
        self._refuse_input(X)
        X, lengths = padded(X)
        # For more than two axes the error below is clearer: scikit-learn would call steps features.
        many_axes = np.asarray(X).ndim > 2
        if many_axes:
            refuse_gaps(X)
        alike = type(self)(**self.get_params(deep=False)) if many_axes or not hasattr(self, "n_features_in_") else self
        X = validate_data(alike, X, allow_nd=True, dtype=None, reset=alike is not self)
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
            y = checked_labels(y)
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

    def decision_function(self, X: Any) -> np.ndarray:
        """Returns the logarithms of the probabilities ``(sweeps, materials)``; of two materials ``(sweeps,)``, the log-odds of the second."""
        log_proba = self.predict_log_proba(X)
        if len(self.classes_) == 2:
            return log_proba[:, 1] - log_proba[:, 0]
        return log_proba

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
        accept_risk: adapts to fewer than 8 sweeps, to sweeps of few materials, or to another recording on the same skin, with a warning in
            place of a TactnetError.
        """
        classifier, risks = self.classifier_.adapt(self._dataset(X, y), y is not None, accept_risk)
        adapted = copy_with_classifier(self, classifier)
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
        if self.classes_.dtype.kind in "iuf":
            (folder / CLASSES).write_text(json.dumps({"dtype": str(self.classes_.dtype), "classes": self.classes_.tolist()}) + "\n")

    @classmethod
    def _settings_of(cls, model: str) -> dict[str, Any] | None:
        """Returns the settings of a saved model of this class; None for models of other classes."""
        return {}

    @classmethod
    def load(cls, folder: Any) -> SweepClassifier:
        """Opens a folder of :meth:`save` or a run directory of the command line. ``classes_`` are names, or the numbers that were saved.

        ``SweepClassifier.load`` opens any classifier and returns an object of its class. A baseline without a class, such as ``means``,
        becomes a SweepClassifier that can predict, but not fit. Other classes raise TactnetError for a classifier of another class.
        """
        from ._estimators import ALL

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
        loaded.classes_ = saved_classes(Path(folder), native.materials)
        if not native.any_length:
            loaded.n_features_in_ = int(np.prod(native.sweep_shape))
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
                    # Debian 12 has Python 3.11.2, which lacks the filters of 3.11.4.
                    safe = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
                    archive.extractall(work, **safe)
                state["classifier_"] = _tactnet.Classifier.load(work)
        super().__setstate__(state)


def saved_classes(folder: Path, materials: list[str]) -> np.ndarray:
    """Returns the materials of a saved classifier: numbers if it was fitted to numbers, and still has the same materials."""
    file = folder / CLASSES
    if file.exists():
        saved = json.loads(file.read_text())
        classes = np.asarray(saved["classes"], dtype=saved["dtype"])
        if [str(name) for name in classes] == materials:
            return classes
    return np.asarray(materials)


def copy_with_classifier(estimator: SweepClassifier, classifier: _tactnet.Classifier) -> SweepClassifier:
    """Returns a copy of a fitted estimator with another native classifier."""
    copied = type(estimator)(**estimator.get_params(deep=False))
    copied.__dict__ = vars(estimator) | {"classifier_": classifier}
    return copied
