#!/usr/bin/env python3
"""Golden values of the differentiation network: PyTorch against this project.

    pip install torch safetensors numpy
    python tests/golden/siamese_with_torch.py

Writes siamese.safetensors next to itself; versions stand in its metadata. Read by models/src/siamese.rs.
"""

import pathlib

import torch
from safetensors.torch import save_file

torch.manual_seed(5)
PAIRS, WIDTH, HIDDEN, MARGIN = 9, 6, 5, 1.5

first = torch.randn(PAIRS, WIDTH, requires_grad=True)
second = torch.randn(PAIRS, WIDTH, requires_grad=True)
different = (torch.arange(PAIRS) % 3 != 0).float()[:, None]


def contrastive(distance, margin):
    far = torch.clamp(margin - distance, min=0)
    return ((1 - different) * distance**2 + different * far**2).mean() / 2


distance = torch.linalg.vector_norm(first - second, dim=1, keepdim=True)
# Some pairs are closer than the margin, others are not.
scaled = distance / 2
direct = contrastive(scaled, MARGIN)
direct.backward()
tensors = {
    "first": first.detach(),
    "second": second.detach(),
    "different": different,
    "direct.loss": direct.detach()[None],
    "direct.d_first": first.grad,
    "direct.d_second": second.grad,
}

head = torch.nn.Sequential(
    torch.nn.Linear(1, HIDDEN), torch.nn.ReLU(), torch.nn.Linear(HIDDEN, HIDDEN), torch.nn.ReLU(), torch.nn.Linear(HIDDEN, 2)
)
mask = torch.bernoulli(torch.full((PAIRS, HIDDEN), 0.7)) / 0.7
distance = distance.detach()
hidden = head[1](head[0](distance)) * mask
p_different = torch.softmax(head[4](head[3](head[2](hidden))), dim=1)[:, 1:]
loss = contrastive(p_different, 1.0)
loss.backward()
tensors |= {"mask": mask, "p_different": p_different.detach(), "loss": loss.detach()[None]}
for index, layer in enumerate((head[0], head[2], head[4])):
    tensors |= {
        f"weight{index}": layer.weight.detach(),
        f"bias{index}": layer.bias.detach(),
        f"d_weight{index}": layer.weight.grad,
        f"d_bias{index}": layer.bias.grad,
    }

path = pathlib.Path(__file__).with_name("siamese.safetensors")
save_file({name: value.contiguous() for name, value in tensors.items()}, path, metadata={"torch": torch.__version__})
print(path, {name: tuple(value.shape) for name, value in tensors.items()})
