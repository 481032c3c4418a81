"""Lower bound on the twin: the accuracy of a network with many times the sweeps, and the benefit of knowing recording blocks on random folds.

    for seed in 3 $(seq 11 26); do tactnet data twin --seed $seed --out twin$seed.npz; done
    python experiments/pilots/many_sweeps.py twin3.npz --more $(seq -f twin%g.npz 11 26) --out experiments/pilots/bound.jsonl

Needs torch and numpy. All seeds of the twin have the same materials, but their own blocks and sweeps. The network is `spectra` with a second
layer for each taxel and twice the units for each window. It is evaluated on the test sweeps of spectra.py's split of the first file, whose
blocks do not occur in the other files. The shipped `spectra`, trained on the training sweeps of that split, is the reference.

"with blocks" adds a classifier of levels that knows the blocks of the training sweeps of the first file: logarithms of each taxel's mean
level at rest and at the end, normal about the mean of their block with a common covariance. Random folds put sweeps of all blocks into
training and test sets; new recordings have no such advantage.
"""

import argparse

import numpy
import torch
from torch import nn
from torch.nn import functional

import results
from chosen import Chosen, Encoder, fit, log_energies
from spectra import Layer, judged, load


class Wide(Chosen):
    def __init__(self, taxels, materials):
        super().__init__(taxels, materials, Encoder([32, 32]))
        self.window, self.hidden = Layer(taxels * 32, 128), Layer(256, 256)


def levels(sweeps):
    """Returns logarithms of the mean level of each taxel before it slips and in the last 400 steps, `[sweeps][32]`."""
    return torch.log(torch.cat([sweeps[:, :16].mean(1), sweeps[:, -400:].mean(1)], 1) + 0.5).double()


def of_blocks(sweeps, labels, blocks, test):
    """Returns log probabilities of the test sweeps by their levels alone."""
    found, own = levels(sweeps), torch.where(~test)[0]
    found = found[:, found.std(0) > 0]  # one taxel never reads anything at rest
    names = labels * 10 + blocks
    means = torch.stack([found[own[names[own] == name]].mean(0) for name in range(360)])
    counts = torch.bincount(names[own], minlength=360)
    rest = found[own] - means[names[own]]
    within = rest.T @ rest / (len(own) - 360)
    centred = means - means.mean(0)
    between = centred.T @ centred / 360 - within / counts.double().mean()
    # The uncertainty of a block's mean depends on its sweeps; the variance between blocks shrinks it towards the
    # centre.
    scores = torch.zeros(int(test.sum()), 360, dtype=torch.double)
    for name in range(360):
        n = float(counts[name])
        gain = between @ torch.linalg.inv(between + within / n)
        middle = means.mean(0) + gain @ (means[name] - means.mean(0))
        spread = within + between - gain @ between
        apart = found[test] - middle
        distance = (apart @ torch.linalg.inv(spread) * apart).sum(1)
        scores[:, name] = -0.5 * (distance + torch.logdet(spread)) + torch.log(torch.tensor(n / 80))
    return functional.log_softmax(torch.logsumexp(scores.reshape(-1, 36, 10), 2), 1)


class Given(nn.Module):
    """Precomputed scores, for `judged`."""

    def forward(self, scores):
        return scores


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="sweeps (.npz)")
    parser.add_argument("--more", nargs="+", help="sweeps of other seeds (.npz)")
    parser.add_argument("--counts", nargs="*", type=int, default=[4, 16], help="how many of them")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--epochs", type=int, default=5)
    parser.add_argument("--out", help="JSON lines")
    arguments = parser.parse_args()
    torch.set_num_threads(1)

    def say(row):
        results.say(row, arguments.out)

    sweeps, labels, test = load(arguments.data)
    # Sweeps are in the order of drawing: ten of each block in turn.
    blocks = torch.arange(len(labels)) % 100 // 10
    by_levels = of_blocks(sweeps, labels, blocks, test)
    tested = torch.ones(int(test.sum()), dtype=torch.bool)

    def of_scores(scores):
        return judged(Given(), (scores.float(),), labels[test], tested)

    say({"network": "levels of blocks alone", **of_scores(by_levels)})
    own = torch.where(~test)[0]
    logs = log_energies(sweeps, sweeps[own])
    for seed in range(1, arguments.seeds + 1):
        torch.manual_seed(seed)
        network = fit(Chosen(16, 36), logs, labels, own, seed)
        with torch.no_grad():
            scores = functional.log_softmax(network(logs[test]), 1)
        row = {"network": "spectra", "training sweeps of a material": 80, "seed": seed}
        say({**row, **of_scores(scores)})
        say({**row, "network": "spectra, with blocks", **of_scores(scores + by_levels)})
    scale = load(arguments.more[0])[0]
    asked = log_energies(sweeps[test], scale)
    logs, truth = [], []
    for path in arguments.more:
        others, names, _ = load(path)
        logs.append(log_energies(others, scale))
        truth.append(names)
        if len(logs) not in arguments.counts:
            continue
        every, all_names = torch.cat(logs), torch.cat(truth)
        for seed in range(1, arguments.seeds + 1):
            torch.manual_seed(seed)
            network = fit(Wide(16, 36), every, all_names, torch.arange(len(every)), seed, epochs=arguments.epochs, batch=72)
            with torch.no_grad():
                scores = functional.log_softmax(network(asked), 1)
            row = {"network": "wide", "training sweeps of a material": len(every) // 36, "seed": seed}
            say({**row, **of_scores(scores)})
            say({**row, "network": "wide, with blocks", **of_scores(scores + by_levels)})
        del every


if __name__ == "__main__":
    main()
