#!/usr/bin/env python3
"""Golden values of features and of the ridge classifier: aeon, scikit-learn, numpy and scipy against this project.

    pip install numpy scipy scikit-learn aeon torch safetensors
    python tests/golden/features_with_aeon.py

Writes features.safetensors next to itself; versions stand in its metadata. Read by pipeline/src/features/golden.rs.
"""

import pathlib

import numpy as np
import scipy
import scipy.signal

arrays = {}
rng = np.random.default_rng(20261121)


def put(name, values):
    arrays[name] = np.ascontiguousarray(values, dtype=np.float32)


def sweeps(kind, count, steps, taxels):
    """[sweeps][steps][taxels]: digits like the sensor's, or noise."""
    noise = rng.normal(size=(count, steps, taxels))
    if kind == "noise":
        return noise.astype(np.float32)
    walk = np.cumsum(noise, axis=1) * 0.8 + rng.uniform(5, 40, size=(count, 1, taxels))
    digits = np.clip(np.round(walk), 0, 255)
    digits[digits < 3] = 0
    return digits.astype(np.float32)


def put_kernels(name, parameters, taxels):
    if taxels == 1:
        dilations, per_dilation, biases = parameters[-3:]
        combinations = 84 * len(dilations)
        counts, chosen = np.ones(combinations), np.zeros(combinations)
    else:
        counts, chosen, dilations, per_dilation, biases = parameters
    for part, values in [
        ("taxel_counts", counts),
        ("taxels", chosen),
        ("dilations", dilations),
        ("biases_per_kernel", per_dilation),
        ("biases", biases),
    ]:
        put(f"{name}.{part}", values)


# Spectral features (Baishya & Baeuml, IROS 2016, section III).
def taxel_weights(sweep):
    sums = sweep.sum(axis=0)
    return sums / sums.sum()


def l_features(sweep, rate):
    steps = len(sweep)
    spectrum = np.abs(np.fft.rfft(sweep, axis=0, norm="ortho"))
    frequency = np.fft.rfftfreq(steps, 1 / rate)
    weights = taxel_weights(sweep)
    high, low = frequency >= 20, (frequency >= 2) & (frequency < 20)
    roughness = np.log((spectrum[high] ** 2).mean(axis=0).sum())
    centroids = []
    for band in (high, low):
        amplitude = spectrum[band].sum(axis=0)
        moment = (spectrum[band] * frequency[band, None]).sum(axis=0)
        # A taxel without power in a band adds nothing.
        centroids.append((weights * moment / np.where(amplitude > 0, amplitude, 1)).sum())
    return [roughness, *centroids]


def h_features(sweep, rate):
    window, hop = round(0.1 * rate), 0.05 * rate
    windows = int(len(sweep) / hop)
    padded = np.concatenate([sweep, np.zeros((window, sweep.shape[1]))])
    band = (np.fft.rfftfreq(window, 1 / rate) / 20 + 1e-9).astype(int)
    weights = taxel_weights(sweep)
    rows = []
    for i in range(windows):
        start = int(np.floor(i * hop + 0.5))
        power = np.abs(np.fft.rfft(padded[start : start + window], axis=0, norm="ortho")) ** 2 @ weights
        row = np.bincount(band, weights=power)
        rows.append(row / (row.sum() or 1))
    return np.concatenate(rows)


def scipy_agrees(sweep, rate):
    """Where the hop is a whole number of steps and no window is padded, scipy's short-time spectrum is the same."""
    window, hop = round(0.1 * rate), round(0.05 * rate)
    _, _, stft = scipy.signal.stft(
        sweep, rate, "boxcar", window, window - hop, boundary=None, padded=False, axis=0
    )
    power = np.einsum("fmt,m->tf", np.abs(stft) ** 2, taxel_weights(sweep))
    band = (np.fft.rfftfreq(window, 1 / rate) / 20 + 1e-9).astype(int)
    rows = np.stack([np.bincount(band, weights=row) for row in power])
    rows /= rows.sum(axis=1, keepdims=True)
    ours = h_features(sweep, rate).reshape(-1, rows.shape[1])[: len(rows)]
    np.testing.assert_allclose(ours, rows, rtol=1e-9)


def main():
    import aeon
    import sklearn
    import torch
    from aeon.classification.convolution_based._hydra import _SparseScaler
    from aeon.transformations.collection.convolution_based import HydraTransformer, MiniRocket, MultiRocket
    from safetensors.numpy import save_file
    from sklearn.linear_model import RidgeClassifierCV

    # Random convolution kernels.
    for case, (kind, taxels, steps) in {
        "digits": ("digits", 5, 120),
        "noise": ("noise", 3, 101),
        "one_taxel": ("noise", 1, 150),
    }.items():
        x = sweeps(kind, 4, steps, taxels)
        put(f"{case}.sweeps", x)
        aeon_x = x.transpose(0, 2, 1)
        mini = MiniRocket(n_kernels=840, random_state=1)
        put(f"{case}.minirocket.features", mini.fit_transform(aeon_x))
        put_kernels(f"{case}.minirocket", mini.parameters, taxels)
        multi = MultiRocket(n_kernels=420, random_state=2)
        put(f"{case}.multirocket.features", multi.fit_transform(aeon_x))
        put_kernels(f"{case}.multirocket", multi.parameter, taxels)
        difference = multi.parameter1
        if taxels > 1:
            # aeon 1.6 fits biases of the difference with taxels of its own, then transforms with those of the base series.
            difference = (*multi.parameter[:2], *multi.parameter1[2:])
        put_kernels(f"{case}.multirocket_difference", difference, taxels)
        hydra = HydraTransformer(random_state=3, output_type="numpy")
        features = hydra.fit_transform(aeon_x)
        put(f"{case}.hydra.features", features)
        put(f"{case}.hydra.weights", hydra._hydra.W.numpy().ravel())
        idx = [i.numpy() for i in hydra._hydra.idx]
        if taxels == 1:
            idx = [np.zeros_like(i[..., :1]) for i in idx]
        put(f"{case}.hydra.taxels", np.concatenate([i.ravel() for i in idx]))
        put(f"{case}.hydra.taxel_counts", [idx[0].shape[-1]] * (idx[0].shape[0] * idx[0].shape[1] * len(idx)))

    # Hydra's scaling of features.
    counts = np.maximum(rng.normal(size=(12, 40)) * 3 + 1, 0).astype(np.float32)
    counts[:, 7] = 0
    put("sparse.train", counts)
    put("sparse.scaled", _SparseScaler().fit_transform(torch.tensor(counts)).numpy())

    # Ridge classifier: more features than sweeps, a repeated feature, and a repeated sweep.
    x = rng.normal(size=(40, 90)).astype(np.float32)
    labels = np.arange(40) % 4
    x[np.arange(40), labels] += 1.5
    x[:, 50] = x[:, 51]
    x[8] = x[4]
    queries = rng.normal(size=(7, 90)).astype(np.float32)
    penalties = np.logspace(-3, 3, 10)
    ridge = RidgeClassifierCV(alphas=penalties).fit(x.astype(np.float64), labels)
    put("ridge.train", x)
    put("ridge.labels", labels)
    put("ridge.queries", queries)
    put("ridge.penalty", [ridge.alpha_])
    put("ridge.scores", ridge.decision_function(queries.astype(np.float64)))

    for case, (steps, taxels, rate) in {
        "thesis": (1500, 16, 750),
        "tactmat": (1000, 16, 750),
        "biotac": (400, 19, 100),
        "odd": (333, 2, 220),
    }.items():
        x = sweeps("digits", 2, steps, taxels).astype(np.float64)
        put(f"spectrum.{case}.sweeps", x)
        put(f"spectrum.{case}.rate", [rate])
        put(f"spectrum.{case}.l", [l_features(s, rate) for s in x])
        put(f"spectrum.{case}.h", [h_features(s, rate) for s in x])
        if 0.05 * rate == round(0.05 * rate):
            scipy_agrees(x[0], rate)

    versions = {m.__name__: m.__version__ for m in (aeon, np, scipy, sklearn, torch)}
    save_file(arrays, pathlib.Path(__file__).with_name("features.safetensors"), metadata=versions)
    print(versions, {k: v.shape for k, v in arrays.items() if k.endswith("features") or ".h" in k[-3:]})


if __name__ == "__main__":
    main()
