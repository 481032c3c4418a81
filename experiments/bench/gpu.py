#!/usr/bin/env python3
"""Times training on every device of this machine, and PyTorch on its CUDA card, in one call of at most eight minutes.

    cargo build --release --features vulkan
    python experiments/bench/gpu.py [--binary target/release/tactnet] [--rounds 2] [--json]
    python experiments/bench/gpu.py -- --device vulkan --sweeps 5 --steps 200     # what follows -- is for `tactnet bench device`

Rows are those of `tactnet bench device` (`device`, `name`, `work`, `networks`, `ms`), `rounds` of them; `stacked step` and `stacked adversarial step`
are those of so many networks trained at once, ms a step and network (`--networks`). For PyTorch `device` = "torch"; its work is
TactNet-II on 36 sweeps of 1000 x 16 values that lie on the card: `step` (forward, backward, fused Adam) and `adversarial step` (the gradient of
the input of a clean pass, then both losses, as recipe `thesis`). Its ways are 32-bit floats, TF32 or autocast to bf16, contiguous or
channels-last memory, launched one by one or replayed as one CUDA graph; `way` says which. Our steps also choose and normalise the sweeps, which lie on
the card as digits, and draw dropout; losses are read at an epoch's end. Without PyTorch or a CUDA card its rows are missing, and `missing` says why.
`ratios` has, for a step and an adversarial one on a GPU, PyTorch's best time in 32-bit floats over ours: above 1 ours is faster. It is empty where sizes were changed.
"""

import argparse
import itertools
import json
import pathlib
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
BATCH, STEPS, TAXELS, MATERIALS = 36, 1000, 16, 36


def net(torch):
    from torch import nn

    class TactNet(nn.Module):
        """TactNet-II (Tulbure & Baeuml, Humanoids 2018, figure 4)."""

        def __init__(self):
            super().__init__()
            maps = [1, 32, 64, 128]
            self.conv = nn.ModuleList(
                nn.Conv2d(i, o, (15, 5), padding=(7, 2), bias=False) for i, o in zip(maps, maps[1:])
            )
            self.norm = nn.ModuleList(nn.BatchNorm2d(o) for o in maps[1:])
            self.drop = nn.Dropout(0.2)
            self.hidden = nn.Linear(128 * TAXELS, 512, bias=False)
            self.hidden_norm = nn.BatchNorm1d(512)
            self.output = nn.Linear(512, MATERIALS)

        def forward(self, x):
            for conv, norm in zip(self.conv, self.norm):
                x = torch.max_pool2d(torch.relu(norm(conv(x))), (10, 1))
            return self.output(torch.relu(self.hidden_norm(self.hidden(self.drop(x.flatten(1))))))

    return TactNet()


def torch_time(torch, numbers, channels_last, graph, adversarial):
    """Returns the median ms of a step; None if it cannot be captured."""
    tf32 = numbers == "tf32"
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = tf32
    torch.backends.cudnn.benchmark = True
    device = torch.device("cuda")
    model = net(torch).to(device)
    if channels_last:
        model = model.to(memory_format=torch.channels_last)
    adam = torch.optim.Adam(model.parameters(), lr=1e-3, fused=True, capturable=True)
    sweeps = torch.randn(BATCH, 1, STEPS, TAXELS, device=device)
    labels = torch.randint(0, MATERIALS, (BATCH,), device=device)
    entropy = torch.nn.CrossEntropyLoss()

    def loss(x):
        with torch.autocast("cuda", torch.bfloat16, enabled=numbers == "bf16"):
            return entropy(model(x), labels)

    def step():
        adam.zero_grad(set_to_none=False)
        if adversarial:
            tracked = sweeps.detach().requires_grad_(True)
            clean = loss(tracked)
            inputs = [tracked, *model.parameters()]
            gradient, *others = torch.autograd.grad(0.5 * clean, inputs)
            attacked = (sweeps + 0.1 * gradient.sign()).detach()
            (0.5 * loss(attacked)).backward()
            for parameter, other in zip(model.parameters(), others):
                parameter.grad.add_(other)
        else:
            loss(sweeps).backward()
        adam.step()

    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        for _ in range(5):
            step()
    torch.cuda.current_stream().wait_stream(stream)
    torch.cuda.synchronize()
    run = step
    if graph:
        captured = torch.cuda.CUDAGraph()
        with torch.cuda.graph(captured):
            step()
        run = captured.replay
    times = []
    for _ in range(7):
        torch.cuda.synchronize()
        begin = time.perf_counter()
        for _ in range(30):
            run()
        torch.cuda.synchronize()
        times.append((time.perf_counter() - begin) / 30 * 1e3)
    return statistics.median(times)


def torch_rows():
    try:
        import torch
    except ImportError:
        return [], "PyTorch is not installed"
    if not torch.cuda.is_available():
        return [], "PyTorch sees no CUDA card"
    rows = []
    ways = itertools.product(["f32", "tf32", "bf16"], [False, True], [False, True], [False, True])
    for numbers, channels_last, graph, adversarial in ways:
        way = " ".join([numbers, "channels-last" if channels_last else "contiguous", "graph" if graph else "eager"])
        row = {
            "device": "torch",
            "name": f"{torch.cuda.get_device_name()}, PyTorch {torch.__version__}",
            "work": "adversarial step" if adversarial else "step",
            "way": way,
        }
        try:
            row["ms"] = torch_time(torch, numbers, channels_last, graph, adversarial)
        except RuntimeError as error:
            print(f"{way}: {str(error).splitlines()[0]}", file=sys.stderr)
            continue
        rows.append(row)
    return rows, None


def ratios(rows):
    """Returns PyTorch's best 32-bit time divided by the median of ours, by work."""
    found = {}
    for work in ["step", "adversarial step"]:
        of_work = [row for row in rows if row["work"] == work]
        theirs = [row["ms"] for row in of_work if row["device"] == "torch" and row["way"].startswith("f32")]
        ours = [row["ms"] for row in of_work if row["device"] in ("vulkan", "cuda")]
        if theirs and ours:
            found[work] = min(theirs) / statistics.median(ours)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default=str(ROOT / "target/release/tactnet"))
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--networks", default="1,5,10,20", help="numbers of networks that are trained at once")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("bench", nargs="*", metavar="-- ARGUMENT", help="for `tactnet bench device`")
    arguments = parser.parse_args()
    rows, missing = [], None
    for turn in range(arguments.rounds):
        command = [arguments.binary, "bench", "device", "--json", "--networks", arguments.networks, *arguments.bench]
        ours = subprocess.run(command, capture_output=True, text=True)
        if ours.returncode != 0:
            sys.exit(f"{arguments.binary} bench device: {ours.stderr.strip()}")
        rows += [{**row, "round": turn} for row in json.loads(ours.stdout)["rows"]]
        if turn == 0:
            theirs, missing = torch_rows()
            rows += theirs
    result = {"schema_version": 1, "batch": BATCH, "rows": rows, "ratios": {} if arguments.bench else ratios(rows), "missing": missing}
    if arguments.json:
        print(json.dumps(result, indent=1))
        return
    for row in rows:
        work = f"{row['work']} of {row['networks']}" if row["work"].startswith("stacked") else row["work"]
        print(f"{row['device']:8} {work:30} {row['ms']:9.2f} ms  {row.get('way', row['name'])}")
    for work, ratio in result["ratios"].items():
        print(f"{work}: {ratio:.2f} times as fast as PyTorch in 32-bit floats")
    if missing:
        print(f"PyTorch was left out: {missing}")


if __name__ == "__main__":
    main()
