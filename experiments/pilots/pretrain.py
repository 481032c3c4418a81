"""Pre-training: the layers that all taxels share learn on several skins, then a new skin has 5, 10 or 20 sweeps of each material.

    tactnet data twin --seed 3 --out twin3.npz
    tactnet data twin --seed 5 --out skin5.npz
    tactnet data twin --seed 6 --contact-force 1.5 --out skin6.npz
    tactnet data twin --seed 7 --speed 0.6 --out skin7.npz
    tactnet data twin --seed 8 --contact-force 0.7 --speed 1.5 --out skin8.npz
    python experiments/pilots/pretrain.py twin3.npz --skins skin5.npz skin6.npz skin7.npz skin8.npz biotac_electrodes.h5 \\
        --out experiments/pilots/pretrain.jsonl
    python experiments/pilots/pretrain.py twin3.npz --skins biotac_electrodes.h5 --counts 5 --encoders wide --seeds 1 \\
        --out experiments/pilots/pretrain_of_biotac.jsonl
    python experiments/pilots/pretrain.py biotac_electrodes.h5 --skins skin5.npz skin6.npz skin7.npz skin8.npz --counts 5 10 \\
        --out experiments/pilots/pretrain_for_biotac.jsonl

Needs torch, numpy and h5py. Skins differ in the sweeps' seed, force and speed, and by what is made of them here: a skin has the whole patch,
a part of it or its taxels in another order, another gain of each taxel and noise of its own. The shared layers, one encoder for all skins,
learn with layers of taxels and materials that every skin has for itself. Skins of the twin give their even materials, the new skin has to
learn its odd ones: none of the materials was seen before. BioTac electrodes (400 steps, 19 electrodes) give all of theirs.

The new skin's sweeps are drawn five times from the training sweeps of spectra.py's split (of fold 0 of normalised.py where the new skin is
the BioTac's, with all of its materials). The network is trained as the recipe has it, from scratch, on the encoder as it came ("frozen"), or
with it ("fine-tuned"). Test sweeps are those of the split. "wide" is an encoder of two layers, 64 and 32 units, beside that of `spectra`,
one of 32.

Prediction, written before measuring: experiments/twin/PREDICTIONS.md.
"""

import argparse
import copy

import numpy
import torch
from torch.nn import functional

import results
from chosen import Chosen, Encoder, fit, log_energies
from normalised import biotac, folds
from spectra import judged, load

ENCODERS = {"as shipped": [32], "wide": [64, 32]}
PARTS = [range(16), [0, 1, 2, 4, 5, 6, 8, 9, 10], range(8), range(15, -1, -1), range(16)]


def skin(path, number):
    """Returns log energies and labels of another skin."""
    if path.endswith(".h5"):
        sweeps, labels = biotac(path, "kept")
    else:
        sweeps, labels, _ = load(path)
        sweeps, labels = sweeps[labels % 2 == 0], labels[labels % 2 == 0] // 2
        draw = torch.Generator().manual_seed(number)
        sweeps = sweeps[:, :, list(PARTS[number % len(PARTS)])]
        gains = (0.4 * torch.randn(sweeps.shape[2], generator=draw)).exp()
        sweeps = gains * sweeps + 0.1 * number * torch.randn(sweeps.shape, generator=draw)
    return log_energies(sweeps, sweeps), labels


def pretrained(skins, units, seed, steps=4000, batch=36, rate=2e-3):
    """Returns an encoder trained on all skins in turn."""
    torch.manual_seed(seed)
    encoder = Encoder(units)
    networks = [Chosen(logs.shape[2], int(labels.max()) + 1, encoder) for logs, labels in skins]
    parameters = {id(p): p for network in networks for p in network.parameters()}
    optimiser = torch.optim.Adam(parameters.values(), lr=rate, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps, pct_start=0.25)
    for step in range(steps):
        (logs, labels), network = skins[step % len(skins)], networks[step % len(skins)].train()
        chosen = torch.randint(len(labels), (batch,))
        loss = functional.cross_entropy(network(logs[chosen]), labels[chosen])
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        schedule.step()
    return encoder


class Frozen(torch.nn.Module):
    """An encoder whose weights and statistics are fixed."""

    def __init__(self, encoder):
        super().__init__()
        self.inner, self.units = encoder.eval().requires_grad_(False), encoder.units

    def train(self, mode=True):
        return super().train(False)

    def forward(self, logs):
        return self.inner(logs)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="sweeps of the new skin (.npz)")
    parser.add_argument("--skins", nargs="+", help="other skins (.npz of the twin, .h5 of the BioTac)")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--draws", type=int, default=5)
    parser.add_argument("--counts", nargs="*", type=int, default=[5, 10, 20], help="sweeps of a material")
    parser.add_argument("--encoders", nargs="*", default=list(ENCODERS), choices=list(ENCODERS), metavar="NAME")
    parser.add_argument("--out", help="JSON lines")
    arguments = parser.parse_args()
    torch.set_num_threads(1)

    skins = [skin(path, number) for number, path in enumerate(arguments.skins)]
    if arguments.data.endswith(".h5"):
        sweeps, labels = biotac(arguments.data, "kept")
        test = folds(labels) == 0
    else:
        sweeps, labels, test = load(arguments.data)
        odd = labels % 2 == 1
        sweeps, labels, test = sweeps[odd], labels[odd] // 2, test[odd]
    materials = int(labels.max()) + 1
    for name in arguments.encoders:
        units = ENCODERS[name]
        for seed in range(1, arguments.seeds + 1):
            ready = pretrained(skins, units, seed)
            for count in arguments.counts:
                for draw in range(arguments.draws):
                    random = numpy.random.default_rng(100 + draw)
                    rows = [random.permutation(numpy.where((labels == k) & ~test)[0])[:count] for k in range(materials)]
                    own = torch.tensor(numpy.concatenate(rows))
                    logs = log_energies(sweeps, sweeps[own])
                    for how in ("from scratch", "frozen", "fine-tuned"):
                        torch.manual_seed(seed)
                        encoder = Encoder(units)
                        if how != "from scratch":
                            encoder = copy.deepcopy(ready)
                        if how == "frozen":
                            encoder = Frozen(encoder)
                        network = fit(Chosen(sweeps.shape[2], materials, encoder), logs, labels, own, seed)
                        row = {"encoder": name, "seed": seed, "sweeps": count, "draw": draw, "how": how}
                        row |= judged(network, (logs,), labels, test)
                        results.say(row, arguments.out)


if __name__ == "__main__":
    main()
