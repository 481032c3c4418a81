"""Pilot for `spectra`: small networks on spectra and waveforms, in PyTorch, on one split.

    tactnet data twin --seed 3 --out twin3.npz
    python experiments/pilots/spectra.py twin3.npz --seeds 2 --out experiments/pilots/twin3.jsonl

Needs torch and numpy. No other result uses this split (a fifth of each material's sweeps, drawn by seed 11) or this seed of the twin, so the
selection sees no sweep that any result is evaluated on. Each line of the output is one training.
"""

import argparse
import json
import math
import time

import numpy
import torch
from torch import nn
from torch.nn import functional

import results

FLOOR = 1e-3
BANDS = 24

# Changes to the first design: windows of 64 of 1000 steps, 24 bands. The shipped network was selected from there
# (choice.toml).
VARIANTS = {
    "first design": {},
    "energies relative to the taxel's own": {"branches": ["relative"]},
    "shape of each window's spectrum": {"branches": ["shape"]},
    "waveform": {"branches": ["waveform"]},
    "spectra and waveform": {"branches": ["absolute", "waveform"]},
    "three branches, dropped at random": {
        "branches": ["absolute", "relative", "waveform"],
        "branch_dropout": 0.4,
    },
    "spectra of whole sweeps": {"branches": ["whole"]},
    "no layer shared by taxels": {"shared": False},
    "learnt filter bank": {"learnt": True},
    "maximum beside mean and deviation": {"maximum": True},
    "three neighbouring windows": {"context": 3},
    "features normalised": {"normalised": True},
    "without levels": {"levels": False},
    "mixup": {"mixup": 0.2},
    "squeeze and excitation of taxels": {"gate": True},
    "attention over taxels with positions": {"attention": True},
    "gain 0.2": {"gain": 0.2},
    "normalised, gain 0.2": {"gain": 0.2, "normalised": True},
    "spectra and waveform, gain 0.2": {"gain": 0.2, "branches": ["absolute", "waveform"]},
    "spectra and waveform, dropped": {"branches": ["absolute", "waveform"], "branch_dropout": 0.2},
}


def load(path):
    with numpy.load(path, allow_pickle=True) as file:
        sweeps = file["samples"]  # [materials, sweeps, steps, rows, columns]
    labels = numpy.repeat(numpy.arange(sweeps.shape[0]), sweeps.shape[1])
    sweeps = sweeps.reshape(len(labels), sweeps.shape[2], -1).astype("f4")
    draw = numpy.random.default_rng(11)
    test = numpy.zeros(len(labels), bool)
    for label in range(labels.max() + 1):
        own = draw.permutation(numpy.where(labels == label)[0])
        test[own[: len(own) // 5]] = True
    return torch.tensor(sweeps), torch.tensor(labels), torch.tensor(test)


def powers(sweeps, window, hop):
    """Returns squared Fourier coefficients of Hann windows [sweeps, windows, taxels, bins], and their means."""
    shape = torch.hann_window(window)
    shape = shape / shape.square().sum().sqrt()
    found, means = [], []
    for part in sweeps.split(400):
        windows = part.unfold(1, window, hop)
        mean = windows.mean(-1, keepdim=True)
        found.append(torch.fft.rfft((windows - mean) * shape)[..., 1:].abs().square())
        means.append(mean)
    return torch.cat(found), torch.cat(means)


def triangles(bins, bands):
    centres = numpy.geomspace(1, bins, bands)
    weights = numpy.zeros((bands, bins), "f4")
    steps = numpy.arange(1, bins + 1)
    for band, centre in enumerate(centres):
        below = min(centres[band - 1] if band else 0, centre - 1)
        above = max(centres[band + 1] if band + 1 < bands else bins + 1, centre + 1)
        own = numpy.minimum((steps - below) / (centre - below), (above - steps) / (above - centre))
        weights[band] = own.clip(0) / own.clip(0).sum()
    return torch.tensor(weights)


class Layer(nn.Module):
    """Dense, batch normalisation, ReLU, over the last axis."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.dense = nn.Linear(inputs, outputs, bias=False)
        self.norm = nn.BatchNorm1d(outputs)

    def forward(self, x):
        rows = self.dense(x.reshape(-1, x.shape[-1]))
        return functional.relu(self.norm(rows)).reshape(*x.shape[:-1], -1)


def moments(windows, maximum):
    found = [windows.mean(1), (windows.var(1, unbiased=False) + 1e-5).sqrt()]
    return torch.cat([*found, windows.amax(1)] if maximum else found, -1)


class OfSpectra(nn.Module):
    def __init__(self, taxels, values, settings):
        super().__init__()
        self.settings, units, shared = settings, 64, settings.get("shared", True)
        self.taxel = Layer(values, 32) if shared else nn.Identity()
        width = 32 if shared else values
        if settings.get("gate"):
            self.gate = nn.Sequential(nn.Linear(taxels, 8), nn.ReLU(), nn.Linear(8, taxels), nn.Sigmoid())
        if settings.get("attention"):
            self.positions = nn.Parameter(0.02 * torch.randn(taxels, width))
            self.attention = nn.MultiheadAttention(width, 4, batch_first=True)
        self.window = Layer(taxels * width, units)
        if settings.get("context"):
            self.context = Layer(settings["context"] * units, units)
        self.features = (3 if settings.get("maximum") else 2) * units

    def forward(self, spectra):
        batch, windows, taxels, _ = spectra.shape
        x = self.taxel(spectra)
        if self.settings.get("gate"):
            x = x * self.gate(x.mean((1, 3)))[:, None, :, None]
        if self.settings.get("attention"):
            rows = x.reshape(batch * windows, taxels, -1) + self.positions
            x = rows + self.attention(rows, rows, rows, need_weights=False)[0]
        x = self.window(x.reshape(batch, windows, -1))
        if reach := self.settings.get("context"):
            x = self.context(x.unfold(1, reach, 1).transpose(2, 3).flatten(2))
        return moments(x, self.settings.get("maximum"))


class OfWaveform(nn.Module):
    def __init__(self, taxels, maximum):
        super().__init__()
        self.first, self.maximum = Layer(16 * taxels, 32), maximum
        self.rest = nn.ModuleList(Layer(5 * 32, 32) for _ in range(2))
        self.features = (3 if maximum else 2) * 32

    def forward(self, sweeps):
        x = self.first(sweeps.unfold(1, 16, 4).flatten(2))
        for layer in self.rest:
            x = layer(x.unfold(1, 5, 2).flatten(2))
        return moments(x, self.maximum)


class Network(nn.Module):
    def __init__(self, taxels, bins, materials, settings):
        super().__init__()
        self.settings, maximum = settings, settings.get("maximum")
        bands = triangles(bins, min(BANDS, bins))
        learnt = settings.get("learnt", False)
        self.bands = nn.Parameter(torch.log(bands + 1e-4) if learnt else bands, requires_grad=learnt)
        values = len(bands) + settings.get("levels", True)
        self.branches = nn.ModuleDict()
        for branch in settings.get("branches", ["absolute"]):
            if branch == "waveform":
                self.branches[branch] = OfWaveform(taxels, maximum)
            elif branch == "whole":
                self.branches[branch] = nn.Identity()
                self.branches[branch].features = taxels * values
            else:
                of = values if branch == "absolute" else len(bands)
                self.branches[branch] = OfSpectra(taxels, of, settings)
        features = sum(branch.features for branch in self.branches.values())
        several = settings.get("normalised") or len(self.branches) > 1 or "whole" in self.branches
        self.norm = nn.BatchNorm1d(features) if several else nn.Identity()
        self.hidden, self.output = Layer(features, 256), nn.Linear(256, materials)

    def forward(self, sweeps, powers, means):
        weights = self.bands.exp() if self.settings.get("learnt") else self.bands
        energies = powers @ weights.T
        logs = torch.log10(energies + FLOOR) + 1.5
        found = []
        for name, branch in self.branches.items():
            if name == "waveform":
                x = branch(sweeps)
            elif name == "whole":
                whole = torch.log10(energies.mean(1) + FLOOR) + 1.5
                x = torch.cat([whole, means.mean(1)], -1).flatten(1)
            elif name == "relative":
                own = energies.mean((1, 3), keepdim=True)
                x = branch(torch.log10((energies + 0.1 * FLOOR) / (own + FLOOR)))
            elif name == "shape":
                x = branch(logs - logs.mean(-1, keepdim=True))
            else:
                levels = self.settings.get("levels", True)
                x = branch(torch.cat([logs, means], -1) if levels else logs)
            if (drop := self.settings.get("branch_dropout")) and self.training:
                x = x * (torch.rand(len(x), 1) >= drop) / (1 - drop)
            found.append(x)
        x = functional.dropout(self.norm(torch.cat(found, 1)), 0.4, self.training)
        return self.output(self.hidden(x))


def train(inputs, labels, test, settings, seed, epochs=12, batch=36, rate=2e-3):
    """Trains with one-cycle Adam and an L2 penalty of 1e-3, as the recipe does; returns the network and seconds."""
    torch.manual_seed(seed)
    sweeps, found, _ = inputs
    network = Network(sweeps.shape[2], found.shape[-1], int(labels.max()) + 1, settings)
    optimiser = torch.optim.Adam(network.parameters(), lr=rate, weight_decay=1e-3)
    own = torch.where(~test)[0]
    steps = epochs * (len(own) // batch)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps, pct_start=0.25)
    begun = time.perf_counter()
    network.train()
    for _ in range(epochs):
        for chosen in own[torch.randperm(len(own))].split(batch)[: len(own) // batch]:
            parts, truth = [part[chosen] for part in inputs], labels[chosen]
            if spread := settings.get("gain"):
                gain = (spread * torch.randn(len(chosen), 1, 1)).exp()
                parts = [parts[0] * gain, parts[1] * gain.square()[..., None], parts[2] * gain[..., None]]
            share, others = 1.0, torch.arange(len(chosen))
            if alpha := settings.get("mixup"):
                share = float(numpy.random.default_rng(int(torch.randint(1 << 30, ()))).beta(alpha, alpha))
                others = torch.randperm(len(chosen))
                parts = [share * part + (1 - share) * part[others] for part in parts]
            scores = network(*parts)
            loss = share * functional.cross_entropy(scores, truth)
            if share < 1:
                loss = loss + (1 - share) * functional.cross_entropy(scores, truth[others])
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
            schedule.step()
    return network.eval(), time.perf_counter() - begun


@torch.no_grad()
def judged(network, inputs, labels, test):
    parts = [part[test].split(200) for part in inputs]
    log_p = torch.cat([functional.log_softmax(network(*rows), 1) for rows in zip(*parts)])
    truth = labels[test]
    confidence, guess = log_p.exp().max(1)
    right = (guess == truth).float()
    gap = 0.0
    for low in numpy.arange(15) / 15:
        inside = (confidence > low) & (confidence <= low + 1 / 15)
        if inside.any():
            gap += float(inside.float().mean() * (confidence[inside].mean() - right[inside].mean()).abs())
    fused = []
    for label in range(int(labels.max()) + 1):
        own = log_p[truth == label]
        groups = own[: len(own) // 3 * 3].reshape(-1, 3, own.shape[1]).sum(1)
        fused.append((groups.argmax(1) == label).float())
    return {
        "accuracy": float(right.mean()),
        "three_sweeps": float(torch.cat(fused).mean()),
        "nll": float(functional.nll_loss(log_p, truth)),
        "ece": gap,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", help="sweeps (.npz)")
    parser.add_argument("--felt", nargs="*", default=[], help="the same sweeps, felt otherwise (.npz)")
    parser.add_argument("--variants", nargs="*", default=list(VARIANTS), choices=list(VARIANTS), metavar="NAME")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", help="JSON lines; what they already hold is not run again")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)

    sweeps, labels, test = load(arguments.data)
    window = 64 if sweeps.shape[1] >= 768 else 32
    # The training sweeps scale each taxel, also for sweeps under other conditions.
    mean, deviation = sweeps[~test].mean((0, 1)), sweeps[~test].std((0, 1)) + 1e-6

    def prepared(sweeps):
        scaled = (sweeps - mean) / deviation
        return scaled, *powers(scaled, window, window // 4)

    inputs = prepared(sweeps)
    felt = {path: prepared(load(path)[0]) for path in arguments.felt}
    try:
        with open(arguments.out) as file:
            done = {(row["variant"], row["seed"]) for row in map(json.loads, file)}
    except (TypeError, FileNotFoundError):
        done = set()
    for name in arguments.variants:
        for seed in range(1, arguments.seeds + 1):
            if (name, seed) in done:
                continue
            network, seconds = train(inputs, labels, test, VARIANTS[name], seed)
            row = {"variant": name, "seed": seed, **judged(network, inputs, labels, test)}
            for path, others in felt.items():
                row[f"accuracy, {path}"] = judged(network, others, labels, test)["accuracy"]
            row["parameters"] = sum(p.numel() for p in network.parameters() if p.requires_grad)
            row["seconds"] = round(seconds, 1)
            results.say(row, arguments.out)


if __name__ == "__main__":
    main()
