"""Which material did the fingertip sweep over, and how sure is that?

Sweeps are NumPy arrays ``X`` of shape ``(sweeps, steps, taxels)`` or ``(sweeps, steps, rows, cols)``, with a material ``y`` for each.

>>> import tactnet
>>> classifier = tactnet.TactNetClassifier(rate=750).fit(X, y)     # doctest: +SKIP
>>> classifier.predict_proba(X_new)                                # doctest: +SKIP

- :class:`Dataset`: sweeps with materials, rate and recording blocks; files of any format, checks, folds.
- :func:`read_sweeps`: sweeps without materials, from files.
- :class:`TactNetClassifier`, :class:`MiniRocketClassifier`, …: estimators of scikit-learn.
- :mod:`tactnet.aeon`: the same for collections of aeon, ``(cases, channels, timepoints)``.
- :mod:`tactnet.channel`: frames and beliefs on the robot's channels.
- :class:`Recording`: MCAP files of ``tactnet record``.
"""

from ._dataset import Dataset, Finding, Sweeps, read_sweeps
from ._estimators import (
    KnnClassifier,
    LdaClassifier,
    MiniRocketClassifier,
    MultiRocketHydraClassifier,
    SvmClassifier,
    SweepClassifier,
    TactNetClassifier,
    fuse,
)
from ._recording import Packet, Recording
from ._tactnet import TactnetError, __version__

__all__ = [
    "Dataset",
    "Finding",
    "KnnClassifier",
    "LdaClassifier",
    "MiniRocketClassifier",
    "MultiRocketHydraClassifier",
    "Packet",
    "Recording",
    "SvmClassifier",
    "SweepClassifier",
    "Sweeps",
    "TactNetClassifier",
    "TactnetError",
    "__version__",
    "fuse",
    "read_sweeps",
]
