#!/usr/bin/env python3
"""Measures what adapting to another skin or recording is worth, without labels and with a few.

    python experiments/bench/adapt.py twin5.npz:twin6.npz walk.npz containers.npz grasps.npz [--seeds 2] [--json OUT]

A third of the sweeps is the new domain: held-out recording blocks where the set has them, else a stratified third. The new domain of sets other
than walking has other gains (log-normal, sigma 0.3) and offsets (normal, one spread) of every taxel. `A.npz:B.npz` takes the new domain from B
(of the same materials) and trains on all of A. The new sweeps are halved: classifiers are
adapted to sweeps of one half and evaluated on the other. "Scratch" trains the same model on the labelled sweeps alone.
A data set is a `.npz` with the arrays that `tactnet data import` writes. Needs the Python package.

Predictions, written before the measurement:
1. Gains and offsets lower every model to less than half of its accuracy on the skin of training; unlabelled sweeps restore 80 % of the loss for
   `lda`, `svm-spectra` and `fast`, and 50 % for `minirocket`, whose kernels were fitted to the old gains.
2. Eight sweeps are worth half as much as all.
3. On walking, where the domain is only other bouts, unlabelled sweeps of all bouts change the accuracy by less than 2 points; those of a single
   bout (one material) lower it by more than 20 points, and are refused.
4. One label a material adds less than 3 points to unlabelled sweeps, five add 5. Training from scratch on five is worse than both.
5. The committee loses less on another skin than its worst member, and unlabelled sweeps bring it within 3 points of its best member.
"""

import argparse
import json
import pathlib
import warnings

import numpy as np

import tactnet
from likeness import load

MODELS = {
    "fast": lambda seed: tactnet.TactNetClassifier(recipe="fast", seed=seed),
    "spectra": lambda seed: tactnet.TactNetClassifier(recipe="spectra", seed=seed),
    "lda": lambda seed: tactnet.LdaClassifier(seed=seed),
    "svm-spectra": lambda seed: tactnet.SvmClassifier(features="spectra", seed=seed),
    "minirocket": lambda seed: tactnet.MiniRocketClassifier(seed=seed),
    "committee": lambda seed: tactnet.TactNetCommittee(seed=seed),
}
FEW = 8


def thirds(y, blocks, rng):
    """Returns the sweeps of the training skin and of the new domain."""
    held = np.zeros(len(y), bool)
    for material in np.unique(y):
        own = np.flatnonzero(y == material)
        if blocks is None:
            held[rng.permutation(own)[: len(own) // 3]] = True
            continue
        for block in rng.permutation(np.unique(blocks[own])):
            if held[own].sum() < len(own) // 3:
                held[own[blocks[own] == block]] = True
    return np.flatnonzero(~held), np.flatnonzero(held)


def other_skin(x, spread, rng):
    taxels = x.shape[2]
    return (x * np.exp(rng.normal(0, 0.3, taxels)) + rng.normal(0, 1, taxels) * spread).astype(np.float32)


def halves(y, rng):
    """Returns a stratified half to adapt to, and the other half."""
    order = rng.permutation(len(y))
    first = np.zeros(len(y), bool)
    for material in np.unique(y):
        own = order[y[order] == material]
        first[own[: len(own) // 2]] = True
    return order[first[order]], order[~first[order]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="+")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--models", default=",".join(MODELS))
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    counts = {}

    def count(data, model, case, right, of):
        found = counts.setdefault((data, model, case), [0, 0])
        found[0] += int(right)
        found[1] += int(of)

    for data in arguments.data:
        path, _, second = data.partition(":")
        name = pathlib.Path(path).stem
        x, y, blocks, _, _ = load(path)
        other = load(second) if second else None
        own_skin = other is None and blocks is not None and len(np.unique(blocks)) > len(np.unique(y))
        for seed in range(1, 1 + arguments.seeds):
            rng = np.random.default_rng(seed)
            if other:
                train, test = np.arange(len(y)), np.arange(len(other[1]))
                new_x, new_y = other[:2]
            else:
                train, test = thirds(y, blocks if own_skin else None, rng)
                new_x, new_y = x[test], y[test]
            spread = x[train].reshape(-1, x.shape[2]).std(0)
            domain = new_x if own_skin else other_skin(new_x, spread, rng)
            names = new_y
            new, held = halves(names, rng)
            for model in arguments.models.split(","):
                fitted = MODELS[model](seed).fit(x[train], y[train])

                def score(case, classifier, sweeps=domain[held], truth=names[held]):
                    count(name, model, case, (classifier.predict(sweeps) == truth).sum(), len(truth))

                def attempt(case, make, *data):
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")
                        try:
                            score(case, make(), *data)
                        except ValueError as error:
                            count(name, model, f"{case}, refused", 1, 1)
                            assert isinstance(error, tactnet.TactnetError) or "scratch" in case, error

                score("training skin", fitted, new_x[held])
                score("before", fitted)
                attempt("adapted", lambda: fitted.adapt(domain[new]))
                attempt(f"adapted to {FEW}", lambda: fitted.adapt(domain[new[:FEW]], accept_risk=True))
                first = names == names[new[0]]
                if own_skin:
                    own = blocks[test]
                    first = own == own[new[0]]
                one = np.flatnonzero(first)
                attempt("adapted to one material", lambda: fitted.adapt(domain[one], accept_risk=True))
                attempt("one material, asked", lambda: fitted.adapt(domain[one]))
                for each in [1, 2, 5]:
                    labelled = np.concatenate([new[names[new] == material][:each] for material in np.unique(names)])
                    attempt(f"{each} labels", lambda: fitted.adapt(domain[labelled], names[labelled], accept_risk=True))
                    attempt(f"{each} labels after adapted", lambda: fitted.adapt(domain[new]).adapt(domain[labelled], names[labelled], accept_risk=True))
                    attempt(f"{each} from scratch", lambda: MODELS[model](seed).fit(domain[labelled], names[labelled]))
            print(name, seed, flush=True)
    rows = []
    for (data, model, case), (right, of) in counts.items():
        share, z = right / of, 1.96
        centre = (share + z * z / (2 * of)) / (1 + z * z / of)
        half = z * np.sqrt(share * (1 - share) / of + z * z / (4 * of * of)) / (1 + z * z / of)
        rows.append({"data": data, "model": model, "case": case, "right": right, "n": of, "share": share, "low": centre - half, "high": centre + half})
        print(f"{data:24} {model:12} {case:28} {100 * share:5.1f} % ({100 * (centre - half):.1f} to {100 * (centre + half):.1f}) of {of}")
    document = {"schema_version": 1, "seeds": arguments.seeds, "few": FEW, "predictions": __doc__.split("measurement:\n")[1].strip(), "rows": rows}
    if arguments.json:
        arguments.json.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
