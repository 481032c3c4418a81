"""The shipped `spectra` in PyTorch, for pilots that change its training: twelve bands, windows of a sixth of a sweep."""

import math

import torch
from torch import nn
from torch.nn import functional

from spectra import FLOOR, Layer, moments, powers, triangles

BANDS = 12


def log_energies(sweeps, training):
    """Returns `[sweeps, windows, taxels, bands + 1]` of sweeps `[sweeps, steps, taxels]`, with each taxel scaled by the sweeps `training`."""
    sixth = min(max(sweeps.shape[1] // 6, 8), 128)
    window = 1 << sixth.bit_length() - 1
    mean, deviation = training.mean((0, 1)), training.std((0, 1)) + 1e-6
    weights, found = triangles(window // 2, min(BANDS, window // 2)), []
    for part in sweeps.split(200):
        squares, levels = powers((part - mean) / deviation, window, window // 4)
        found.append(torch.cat([torch.log10(squares @ weights.T + FLOOR) + 1.5, levels], -1))
    return torch.cat(found)


class Encoder(nn.Module):
    """The layers that all taxels share: one for each number of units."""

    def __init__(self, units):
        super().__init__()
        sizes = [BANDS + 1, *units]
        self.layers = nn.Sequential(*(Layer(a, b) for a, b in zip(sizes, sizes[1:])))
        self.units = sizes[-1]

    def forward(self, logs):
        return self.layers(logs)


class Chosen(nn.Module):
    def __init__(self, taxels, materials, encoder=None, normalised=False):
        super().__init__()
        self.encoder = encoder or Encoder([32])
        self.window = Layer(taxels * self.encoder.units, 64)
        self.norm = nn.BatchNorm1d(128) if normalised else nn.Identity()
        self.hidden, self.output = Layer(128, 256), nn.Linear(256, materials)

    def forward(self, logs):
        features = self.norm(moments(self.window(self.encoder(logs).flatten(2)), None))
        return self.output(self.hidden(functional.dropout(features, 0.4, self.training)))


def fit(network, logs, labels, own, seed, soft=None, epochs=12, batch=36, rate=2e-3, least_steps=300):
    """Trains as in the recipe on the sweeps `own`; `soft(scores, chosen)` replaces the cross-entropy."""
    torch.manual_seed(1000 + seed)
    network.train()
    batches = max(len(own) // batch, 1)
    epochs = max(epochs, math.ceil(least_steps / batches))
    parameters = [p for p in network.parameters() if p.requires_grad]
    optimiser = torch.optim.Adam(parameters, lr=rate, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=epochs * batches, pct_start=0.25)
    for _ in range(epochs):
        for chosen in own[torch.randperm(len(own))].split(batch)[:batches]:
            scores = network(logs[chosen])
            loss = soft(scores, chosen) if soft else functional.cross_entropy(scores, labels[chosen])
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
            schedule.step()
    return network.eval()
