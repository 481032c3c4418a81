"""Golden values of TactNet-II from PyTorch in float64.

    pip install torch safetensors numpy && python tests/golden/tactnet_torch.py

Writes `tactnet_reduced.safetensors` (logits, loss, every gradient, ten adversarial training steps of a small
network), `tactnet_uneven.safetensors` (the same where pools do not divide the steps) and
`tactnet_full.safetensors` (logits of the full-size network whose weights come from `counter_uniform` below, so that
they need not be stored). Library versions stand in each file's metadata.
"""

import json
import pathlib
import platform

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.numpy import save_file

HERE = pathlib.Path(__file__).parent
BN_EPSILON, BN_MOMENTUM = 1e-5, 0.1
ALPHA, EPSILON = 0.3, 0.1
LEARNING_RATE, L2 = 1e-3, 1e-3


class Network:
    """TactNet-II as plain functions on a dictionary of tensors, the names being those of the Rust side."""

    def __init__(self, maps, kernel, pools, weights):
        self.maps, self.kernel, self.pools, self.w = maps, kernel, pools, weights

    def norm(self, x, layer, train, follow):
        w = self.w
        dims = [d for d in range(x.dim()) if d != 1]
        shape = [1, -1] + [1] * (x.dim() - 2)
        if train:
            mean, var = x.mean(dims), x.var(dims, unbiased=False)
            if follow:
                count = x.numel() / x.shape[1]
                for name, batch in (("mean", mean), ("variance", var * count / (count - 1))):
                    key = f"{layer}.running_{name}"
                    w[key] = (1 - BN_MOMENTUM) * w[key] + BN_MOMENTUM * batch.detach()
        else:
            mean, var = w[f"{layer}.running_mean"], w[f"{layer}.running_variance"]
        x = (x - mean.view(shape)) / torch.sqrt(var.view(shape) + BN_EPSILON)
        return x * w[f"{layer}.gamma"].view(shape) + w[f"{layer}.beta"].view(shape)

    def forward(self, x, mask, train, follow=False):
        for i, pool in enumerate(self.pools):
            layer = f"conv{i + 1}"
            pad = (self.kernel[0] // 2, self.kernel[1] // 2)
            x = F.conv2d(x, self.w[f"{layer}.weight"], padding=pad)
            x = F.relu(self.norm(x, layer, train, follow))
            x = F.max_pool2d(x, (pool, 1), (pool, 1), ceil_mode=True)
        x = x.flatten(1)
        if mask is not None:
            x = x * mask
        x = F.relu(self.norm(F.linear(x, self.w["hidden.weight"]), "hidden", train, follow))
        return F.linear(x, self.w["output.weight"], self.w["output.bias"])

    def parameters(self):
        return {k: v for k, v in self.w.items() if "running" not in k}


def shapes(maps, kernel, hidden, features, materials):
    out, maps_in = {}, 1
    for i, m in enumerate(maps):
        out[f"conv{i + 1}.weight"] = ((m, maps_in, *kernel), maps_in * kernel[0] * kernel[1])
        for name in ("gamma", "beta", "running_mean", "running_variance"):
            out[f"conv{i + 1}.{name}"] = ((m,), 0)
        maps_in = m
    out["hidden.weight"] = ((hidden, features), features)
    for name in ("gamma", "beta", "running_mean", "running_variance"):
        out[f"hidden.{name}"] = ((hidden,), 0)
    out["output.weight"] = ((materials, hidden), hidden)
    out["output.bias"] = ((materials,), hidden)
    return out


def counter_uniform(stream, count):
    """splitmix64 of (stream << 32) + 0..count, top 24 bits as a fraction, mapped to [-1, 1)."""
    with np.errstate(over="ignore"):
        z = (np.uint64(stream) << np.uint64(32)) + np.arange(count, dtype=np.uint64)
        z = z * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    return (z >> np.uint64(40)).astype(np.float64) / 2.0**24 * 2.0 - 1.0


def counter_weights(described):
    """Weights from counters: `stream` is the tensor's place in name order."""
    weights = {}
    for stream, name in enumerate(sorted(described)):
        shape, fan_in = described[name]
        u = counter_uniform(stream, int(np.prod(shape)))
        if fan_in:
            value = u / np.sqrt(fan_in)
        elif name.endswith("gamma"):
            value = 1.0 + 0.1 * u
        elif name.endswith("variance"):
            value = 1.5 + 0.5 * u
        else:
            value = 0.1 * u
        weights[name] = torch.tensor(value.astype(np.float32).astype(np.float64).reshape(shape))
    return weights


def write(name, tensors, extra, generator="tests/golden/tactnet_torch.py"):
    metadata = {
        "generator": generator,
        "torch": torch.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
        **{k: json.dumps(v) for k, v in extra.items()},
    }
    arrays = {k: np.ascontiguousarray(v.detach().numpy().astype(np.float32)) for k, v in tensors.items()}
    save_file(arrays, str(HERE / name), metadata=metadata)
    print(name, metadata)


def training(name, seed, batch, steps, taxels, maps, kernel, pools, hidden, materials):
    left = steps
    for pool in pools:
        left = -(-left // pool)
    features = left * taxels * maps[-1]
    described = shapes(maps, kernel, hidden, features, materials)
    extra = {"maps": maps, "kernel": kernel, "pools": pools, "hidden": hidden, "materials": materials}
    out = trained(lambda w: Network(maps, kernel, pools, w), described, seed, (batch, steps, taxels), features, materials)
    write(name, out, extra)


def trained(network, described, seed, shape, features, materials):
    """What `network`, made of its weights, gives and becomes in ten adversarial steps on sweeps of `shape`."""
    rng = np.random.default_rng(seed)
    batch, steps, taxels = shape
    weights = counter_weights(described)
    as_input = lambda a: torch.tensor(a.astype(np.float32).astype(np.float64))
    sweeps = as_input(rng.normal(size=(batch, 1, steps, taxels)))
    labels = torch.tensor(rng.integers(0, materials, batch))
    mask = lambda: as_input((rng.random((batch, features)) < 0.8) / 0.8)
    masks = [(mask(), mask()) for _ in range(10)]
    out = {f"initial.{k}": v.clone() for k, v in weights.items()}
    out |= {"sweeps": sweeps, "labels": labels.double()}
    for i, (clean, adversarial) in enumerate(masks):
        out[f"mask.{i}.clean"], out[f"mask.{i}.adversarial"] = clean, adversarial

    net = network(weights)
    out["eval.logits"] = net.forward(sweeps, None, train=False)
    parameters = net.parameters()
    for p in parameters.values():
        p.requires_grad_(True)
    adam = torch.optim.Adam(parameters.values(), lr=LEARNING_RATE, betas=(0.9, 0.999), eps=1e-8, weight_decay=L2)
    losses = []
    for i, (clean_mask, adversarial_mask) in enumerate(masks):
        x = sweeps.clone().requires_grad_(True)
        logits = net.forward(x, clean_mask, train=True, follow=True)
        clean = F.cross_entropy(logits, labels)
        names = list(parameters)
        grads = torch.autograd.grad(clean, [x, *parameters.values()])
        if i == 0:
            out |= {"clean.logits": logits, "clean.gradient.sweeps": grads[0]}
            out |= {f"clean.gradient.{n}": g for n, g in zip(names, grads[1:])}
        shifted = (sweeps + EPSILON * torch.sign(grads[0])).detach()
        adversarial = F.cross_entropy(net.forward(shifted, adversarial_mask, train=True), labels)
        shifted_grads = torch.autograd.grad(adversarial, list(parameters.values()))
        for n, g, s in zip(names, grads[1:], shifted_grads):
            parameters[n].grad = ALPHA * g + (1 - ALPHA) * s
            if i == 0:
                out[f"combined.gradient.{n}"] = parameters[n].grad.clone()
        adam.step()
        losses.append([clean.item(), adversarial.item()])
    out["losses"] = torch.tensor(losses)
    out |= {f"final.{k}": v for k, v in net.w.items()}
    out["final.eval.logits"] = net.forward(sweeps, None, train=False)
    return out


def full():
    maps, kernel, pools, hidden, materials = [32, 64, 128], (15, 5), [10, 10, 10], 512, 36
    weights = counter_weights(shapes(maps, kernel, hidden, 2048, materials))
    digits = np.floor((counter_uniform(1000, 2 * 1000 * 16) + 1.0) * 20.0)
    sweeps = torch.tensor(digits.reshape(2, 1, 1000, 16))
    logits = Network(maps, kernel, pools, weights).forward(sweeps, None, train=False)
    write("tactnet_full.safetensors", {"logits": logits}, {})


if __name__ == "__main__":
    training("tactnet_reduced.safetensors", 1, 6, 100, 5, [4, 6, 8], (15, 5), [10, 5, 2], 16, 5)
    training("tactnet_uneven.safetensors", 2, 3, 43, 3, [3, 4], (7, 3), [10, 3], 6, 4)
    full()
