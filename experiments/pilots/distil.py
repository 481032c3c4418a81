"""Distillation: `spectra` learns the out-of-fold predictions of MultiRocket + Hydra on the training sweeps.

    tactnet data twin --seed 3 --out twin3.npz
    tactnet data twin --seed 3 --contact-force 0.7 --out weak.npz
    tactnet data twin --seed 3 --speed 0.5 --out slow.npz
    python experiments/pilots/distil.py twin3.npz --felt weak.npz slow.npz --seeds 2 --out experiments/pilots/distil.jsonl

Needs torch, numpy, scikit-learn and aeon, and half an hour on one core. The split is that of spectra.py. The teacher uses aeon's transforms,
fitted to the training sweeps without labels. Its ridge classifier is fitted five times, each time to four fifths of them, and scores the
remaining fifth. The ridge strength and the temperature that turns scores into probabilities maximise the log-likelihood of these scores. The
student's loss is (1 - weight) x cross-entropy + weight x T^2 x cross-entropy with the teacher's probabilities at T.

The prediction, written before the measurement, is in experiments/twin/PREDICTIONS.md.
"""

import argparse
import os
import time

import numpy
import torch
from torch.nn import functional

import results
from chosen import Chosen, fit, log_energies
from spectra import judged, load


def transforms(sweeps, test, path):
    """Returns features of MultiRocket and Hydra, scaled by the training sweeps, as in aeon's MultiRocketHydraClassifier."""
    if path and os.path.exists(path):
        return torch.tensor(numpy.load(path))
    from aeon.classification.convolution_based._hydra import _SparseScaler
    from aeon.transformations.collection.convolution_based import HydraTransformer, MultiRocket
    from sklearn.preprocessing import StandardScaler

    series, own = sweeps.transpose(1, 2).numpy(), (~test).numpy()
    found = []
    for transform, scaler in ((HydraTransformer(random_state=1), _SparseScaler()), (MultiRocket(random_state=1), StandardScaler())):
        transform.fit(series[own])
        parts = [numpy.asarray(transform.transform(part)) for part in numpy.array_split(series, 36)]
        features = torch.tensor(numpy.concatenate(parts))
        features = features if isinstance(scaler, _SparseScaler) else features.numpy()
        scaler.fit(features[own])
        found.append(numpy.asarray(scaler.transform(features), "f4"))
    features = numpy.concatenate(found, 1)
    if path:
        numpy.save(path, features)
    return torch.tensor(features)


def ridge(gram, labels, fitted, asked, strength):
    """Returns scores of the sweeps `asked` by a ridge classifier fitted to the sweeps `fitted`."""
    targets = 2 * functional.one_hot(labels[fitted]).double() - 1
    middle = targets.mean(0)
    penalty = strength * torch.eye(len(fitted), dtype=torch.double)
    weights = torch.linalg.solve(gram[fitted][:, fitted] + penalty, targets - middle)
    return gram[asked][:, fitted] @ weights + middle


def teacher(features, labels, test):
    """Returns out-of-fold log probabilities of the training sweeps, log probabilities of the test sweeps, and both accuracies."""
    gram = (features @ features.T).double()
    own, asked = torch.where(~test)[0], torch.where(test)[0]
    part = torch.tensor(numpy.random.default_rng(5).permutation(len(own)) % 5)
    best = None
    for strength in (1e2, 1e3, 1e4, 1e5, 1e6):
        scores = torch.zeros(len(own), int(labels.max()) + 1, dtype=torch.double)
        for fold in range(5):
            scores[part == fold] = ridge(gram, labels, own[part != fold], own[part == fold], strength)
        for factor in (1, 2, 4, 6, 8, 12, 16, 24, 32):
            loss = float(functional.cross_entropy(factor * scores, labels[own]))
            if best is None or loss < best[0]:
                best = loss, strength, factor, functional.log_softmax(factor * scores, 1)
    loss, strength, factor, found = best
    tested = functional.log_softmax(factor * ridge(gram, labels, own, asked, strength), 1)
    row = {
        "network": "MultiRocket + Hydra",
        "accuracy": float((tested.argmax(1) == labels[asked]).float().mean()),
        "nll": float(functional.nll_loss(tested, labels[asked])),
        "accuracy, out of fold": float((found.argmax(1) == labels[own]).float().mean()),
        "ridge": strength,
        "factor": factor,
    }
    every = torch.zeros(len(labels), found.shape[1])
    every[own] = found.float()
    return every, row


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="sweeps (.npz)")
    parser.add_argument("--felt", nargs="*", default=[], help="the same sweeps, felt otherwise (.npz)")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--features", help="keep the teacher's features here (.npy, 800 MB), or read them")
    parser.add_argument("--out", help="JSON lines")
    arguments = parser.parse_args()
    torch.set_num_threads(1)

    def say(row):
        results.say(row, arguments.out)

    sweeps, labels, test = load(arguments.data)
    begun = time.perf_counter()
    found, row = teacher(transforms(sweeps, test, arguments.features), labels, test)
    say({**row, "seconds": round(time.perf_counter() - begun)})
    logs = log_energies(sweeps, sweeps[~test])
    felt = {path: log_energies(load(path)[0], sweeps[~test]) for path in arguments.felt}
    own = torch.where(~test)[0]
    settings = [(None, None), *((weight, at) for weight in (0.5, 0.9) for at in (1, 2, 4))]
    for seed in range(1, arguments.seeds + 1):
        for weight, at in settings:

            def soft(scores, chosen):
                taught = functional.softmax(found[chosen] / at, 1)
                hard = functional.cross_entropy(scores, labels[chosen])
                return (1 - weight) * hard + weight * at**2 * functional.cross_entropy(scores / at, taught)

            torch.manual_seed(seed)
            network = fit(Chosen(sweeps.shape[2], 36), logs, labels, own, seed, soft if weight else None)
            row = {"network": "spectra", "weight": weight, "temperature": at, "seed": seed}
            row |= judged(network, (logs,), labels, test)
            for path, others in felt.items():
                row[f"accuracy, {path}"] = judged(network, (others,), labels, test)["accuracy"]
            say(row)


if __name__ == "__main__":
    main()
