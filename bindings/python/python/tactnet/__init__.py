"""Material classification from tactile sweeps, with probabilities.

Sweeps are NumPy arrays ``X`` of shape ``(sweeps, steps, taxels)`` or ``(sweeps, steps, rows, cols)``; ``y`` has one material per sweep.

>>> import tactnet
>>> classifier = tactnet.TactNetClassifier(rate=750).fit(X, y)     # doctest: +SKIP
>>> classifier.predict_proba(X_new)                                # doctest: +SKIP

- :class:`Dataset`: labelled sweeps with rate and recording blocks; reads all formats, checks data, makes folds.
- :func:`read_sweeps`: sweeps without labels, from files.
- :class:`TactNetClassifier`, :class:`TactNetCommittee`, :class:`MiniRocketClassifier`, …: scikit-learn estimators.
- :mod:`tactnet.aeon`: the same classifiers for aeon collections, ``(cases, channels, timepoints)``.
- :mod:`tactnet.channel`: frames, commands and beliefs on the robot's channels.
- :class:`Recording`: recordings of channels (MCAP files).
"""

from ._dataset import Dataset, Finding, Sweeps, read_sweeps
from ._estimators import (
    KnnClassifier,
    LdaClassifier,
    MiniRocketClassifier,
    MultiRocketHydraClassifier,
    QuantClassifier,
    SvmClassifier,
    TactNetClassifier,
    TactNetCommittee,
    fuse,
)
from ._recording import Packet, Recording
from ._sweep_classifier import SweepClassifier
from ._tactnet import TactnetError, __version__

__all__ = [
    "Dataset",
    "Finding",
    "KnnClassifier",
    "LdaClassifier",
    "MiniRocketClassifier",
    "MultiRocketHydraClassifier",
    "Packet",
    "QuantClassifier",
    "Recording",
    "SvmClassifier",
    "SweepClassifier",
    "Sweeps",
    "TactNetClassifier",
    "TactNetCommittee",
    "TactnetError",
    "__version__",
    "fuse",
    "read_sweeps",
]
