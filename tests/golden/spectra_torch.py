"""Golden values of the network on spectra from PyTorch in float64.

    pip install torch safetensors numpy && python tests/golden/spectra_torch.py

Writes `spectra.safetensors`: logits, loss, every gradient, ten adversarial training steps. The spectra come from `torch.fft`.
"""

import numpy as np
import torch
import torch.nn.functional as F

from tactnet_torch import Network, trained, write


class Spectra(Network):
    """The network as plain functions on a dictionary of tensors, the names being those of the Rust side."""

    def __init__(self, window, hop, bands, weights):
        self.window, self.hop, self.w = window, hop, weights
        self.bands = triangles(window // 2, bands)

    def forward(self, x, mask, train, follow=False):
        windows = x[:, 0].unfold(1, self.window, self.hop)  # [batch, windows, taxels, steps]
        mean = windows.mean(-1, keepdim=True)
        shape = torch.hann_window(self.window, dtype=torch.float64)
        shape = shape / shape.square().sum().sqrt()
        powers = torch.fft.rfft((windows - mean) * shape)[..., 1:].abs().square()
        spectra = torch.cat([torch.log10(powers @ self.bands.T + 1e-3) + 1.5, mean], -1)
        batch, count, taxels, values = spectra.shape
        rows = self.dense(spectra.reshape(-1, values), "taxel", train, follow)
        rows = self.dense(rows.reshape(batch * count, -1), "window", train, follow)
        rows = rows.reshape(batch, count, -1)
        x = torch.cat([rows.mean(1), (rows.var(1, unbiased=False) + 1e-5).sqrt()], 1)
        if mask is not None:
            x = x * mask
        x = self.dense(x, "hidden", train, follow)
        return F.linear(x, self.w["output.weight"], self.w["output.bias"])

    def dense(self, x, layer, train, follow):
        return F.relu(self.norm(F.linear(x, self.w[f"{layer}.weight"]), layer, train, follow))


def triangles(bins, bands):
    """[bands, bins]: triangles from the centre before to the one behind, at least a bin wide to either side."""
    centres = np.geomspace(1, bins, bands)
    weights, bin = np.zeros((bands, bins)), np.arange(1, bins + 1)
    for band, centre in enumerate(centres):
        below = min(centres[band - 1] if band > 0 else 0.0, centre - 1)
        above = max(centres[band + 1] if band + 1 < bands else bins + 1.0, centre + 1)
        own = np.minimum((bin - below) / (centre - below), (above - bin) / (above - centre)).clip(0)
        weights[band] = own / own.sum()
    return torch.tensor(weights)


def main():
    taxels, steps, materials, hidden = 5, 100, 4, 9
    window, hop, bands, of_taxel, units = 16, 6, 5, 6, 7
    layers = {
        "taxel": (of_taxel, bands + 1),
        "window": (units, taxels * of_taxel),
        "hidden": (hidden, 2 * units),
    }
    described = {"output.weight": ((materials, hidden), hidden), "output.bias": ((materials,), hidden)}
    for layer, (outputs, inputs) in layers.items():
        described[f"{layer}.weight"] = ((outputs, inputs), inputs)
        for name in ("gamma", "beta", "running_mean", "running_variance"):
            described[f"{layer}.{name}"] = ((outputs,), 0)
    network = lambda weights: Spectra(window, hop, bands, weights)
    out = trained(network, described, 3, (6, steps, taxels), 2 * units, materials)
    spectra = {"window": window, "hop": hop, "bands": bands, "taxel_units": of_taxel, "units": units}
    extra = {"spectra": spectra, "hidden": hidden, "materials": materials}
    write("spectra.safetensors", out, extra, "tests/golden/spectra_torch.py")


if __name__ == "__main__":
    main()
