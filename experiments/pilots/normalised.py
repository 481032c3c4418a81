"""Features normalised in `spectra` as it ships: accuracy over circumstances and ECE, on five folds.

    tactnet data twin --seed 3 --out twin3.npz
    for x in 0.5 0.7 1.3 1.5; do
        tactnet data twin --seed 3 --contact-force $x --out force$x.npz
        tactnet data twin --seed 3 --speed $x --out speed$x.npz
    done
    python experiments/pilots/normalised.py twin3.npz --felt force*.npz speed*.npz --biotac biotac_electrodes.h5 \\
        --out experiments/pilots/normalised.jsonl

Needs torch, numpy and h5py. Batch normalisation of mean and deviation over the windows, in front of the dropout, won four to fifteen points
at lower contact force in the first design (windows of 64 steps, 24 bands; spectra.py). Folds are random fifths of every material's sweeps;
"blocks left out" trains without two of the ten blocks of every material. The rule is in experiments/twin/PREDICTIONS.md.
"""

import argparse

import numpy
import torch

import results
from chosen import Chosen, fit, log_energies
from spectra import judged, load


def biotac(path, levels):
    import h5py

    with h5py.File(path) as file:
        samples = numpy.array(file["samples"]).astype("f4")
    labels = torch.arange(samples.shape[0]).repeat_interleave(samples.shape[1])
    sweeps = torch.tensor(samples.reshape(len(labels), samples.shape[2], -1))
    return sweeps if levels == "kept" else sweeps - sweeps.mean(1, keepdim=True), labels


def folds(labels, seed=12, parts=5):
    """Returns the fold of each sweep: random, stratified by material."""
    random, found = numpy.random.default_rng(seed), torch.zeros(len(labels), dtype=torch.long)
    for label in range(int(labels.max()) + 1):
        own = numpy.where(labels == label)[0]
        found[own] = torch.tensor(random.permutation(len(own)) % parts)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="sweeps (.npz)")
    parser.add_argument("--felt", nargs="*", default=[], help="the same sweeps, felt otherwise (.npz)")
    parser.add_argument("--biotac", help="sweeps of BioTac electrodes (.h5)")
    parser.add_argument("--counts", nargs="*", type=int, default=[5, 20], help="sweeps of a material")
    parser.add_argument("--folds", type=int, default=5, help="how many of five folds")
    parser.add_argument("--out", help="JSON lines")
    arguments = parser.parse_args()
    torch.set_num_threads(1)

    def run(data, sweeps, labels, test, condition, felt=(), count=None):
        own = torch.where(~test)[0]
        if count:
            random = numpy.random.default_rng(count)
            own = torch.cat([own[labels[own] == k][random.permutation(int((labels[own] == k).sum()))[:count]] for k in labels.unique()])
        logs = log_energies(sweeps, sweeps[own])
        for normalised in (False, True):
            torch.manual_seed(fold + 1)
            network = Chosen(sweeps.shape[2], int(labels.max()) + 1, normalised=normalised)
            fit(network, logs, labels, own, fold + 1)
            rows = [(condition, logs[test])]
            for path in felt:
                rows.append((path.removesuffix(".npz"), log_energies(load(path)[0][test], sweeps[own])))
            for name, asked in rows:
                every = torch.ones(len(asked), dtype=torch.bool)
                found = judged(network, (asked,), labels[test], every)
                row = {"data": data, "condition": name, "fold": fold, "normalised": normalised, **found}
                results.say(row, arguments.out)

    for fold in range(arguments.folds):
        sweeps, labels, _ = load(arguments.data)
        test = folds(labels) == fold
        run("twin", sweeps, labels, test, "as trained", arguments.felt)
        for count in arguments.counts:
            run("twin", sweeps, labels, test, f"{count} sweeps a material", count=count)
        # Sweeps are in the order of drawing: ten of each block in turn.
        run("twin", sweeps, labels, torch.arange(len(labels)) % 100 // 20 == fold, "blocks left out")
        for levels in ("kept", "removed") if arguments.biotac else ():
            sweeps, labels = biotac(arguments.biotac, levels)
            test = folds(labels) == fold
            run(f"biotac, levels {levels}", sweeps, labels, test, "as trained")
            run(f"biotac, levels {levels}", sweeps, labels, test, "5 sweeps a material", count=5)


if __name__ == "__main__":
    main()
