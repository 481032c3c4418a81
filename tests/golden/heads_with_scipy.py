#!/usr/bin/env python3
"""Golden values of few-sweep output layers: scipy and scikit-learn against this project.

    pip install numpy scipy scikit-learn safetensors
    python tests/golden/heads_with_scipy.py

Writes heads.safetensors next to itself; versions stand in its metadata. Read by models/src/heads.rs.
"""

import pathlib

import numpy as np
import scipy
import scipy.optimize
import scipy.special
import scipy.stats
import sklearn
from safetensors.numpy import save_file
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

rng = np.random.default_rng(7)
CLASSES, WIDTH, SHOTS = 4, 12, 3
centres = rng.normal(size=(CLASSES, WIDTH))
labels = np.repeat(np.arange(CLASSES), SHOTS)
x = (centres[labels] + 0.7 * rng.normal(size=(len(labels), WIDTH))).astype(np.float32)
queries = (centres[rng.integers(0, CLASSES, 9)] + 0.7 * rng.normal(size=(9, WIDTH))).astype(np.float32)
knowledge = rng.normal(size=(7, WIDTH + 1)) * 0.6 + rng.normal(size=WIDTH + 1) * 0.3  # weights and bias of each class
mean = knowledge.mean(axis=0)
# The thesis's prior covers the F weights of a class; its bias has an almost flat prior.
away = (knowledge - mean)[:, :WIDTH]
strength = 1 / (2 * (away**2).sum() / away.size)
FREE_BIAS = 30.0
u = np.concatenate([x.astype(np.float64), np.ones((len(x), 1))], axis=1)


def objective(flat, mean, strength, bias_scale):
    strength = np.append(np.full(WIDTH, strength), strength / bias_scale**2)
    w = flat.reshape(CLASSES, WIDTH + 1)
    scores = u @ w.T
    log_p = scores - scipy.special.logsumexp(scores, axis=1, keepdims=True)
    value = -log_p[np.arange(len(u)), labels].sum() + (strength * (w - mean) ** 2).sum()
    error = np.exp(log_p)
    error[np.arange(len(u)), labels] -= 1
    return value, (error.T @ u + 2 * strength * (w - mean)).ravel()


arrays = {"features": x, "labels": labels, "queries": queries, "knowledge": knowledge, "strength": [strength]}
decay = 1e-3 * len(x) / 2
for name, m, s, scale in [("ol_mean", mean, strength, FREE_BIAS), ("ol", np.zeros(WIDTH + 1), decay, 1.0)]:
    found = scipy.optimize.minimize(
        objective, np.tile(m, CLASSES), args=(m, s, scale), jac=True, method="BFGS", options={"gtol": 1e-10, "maxiter": 10000}
    )
    assert np.linalg.norm(found.jac) < 1e-7, found.message
    arrays[f"{name}.weights"] = found.x.reshape(CLASSES, WIDTH + 1)

# LDA with the pooled within-class covariance of the training sweeps (equal priors).
big_labels = np.repeat(np.arange(CLASSES), 40)
big = (centres[big_labels] + rng.normal(size=(160, WIDTH)) @ rng.normal(size=(WIDTH, WIDTH))).astype(np.float32)
means = np.stack([big[big_labels == c].mean(axis=0, dtype=np.float64) for c in range(CLASSES)])
residuals = big - means[big_labels]
pooled = residuals.T @ residuals / (len(big) - CLASSES)
log_p = np.stack([scipy.stats.multivariate_normal(m, pooled).logpdf(queries) for m in means], axis=1)
arrays |= {
    "lda.features": big,
    "lda.labels": big_labels,
    "lda.log_p": log_p - scipy.special.logsumexp(log_p, axis=1, keepdims=True),
}
# scikit-learn divides the covariance by the number of sweeps instead; its decisions are the same.
lda = LinearDiscriminantAnalysis(solver="lsqr", priors=np.full(CLASSES, 1 / CLASSES)).fit(big.astype(np.float64), big_labels)
assert (lda.predict(queries) == log_p.argmax(axis=1)).all()

arrays = {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in arrays.items()}
path = pathlib.Path(__file__).with_name("heads.safetensors")
save_file(arrays, path, metadata={m.__name__: m.__version__ for m in (np, scipy, sklearn)})
path.chmod(0o644)
