#!/usr/bin/env python3
"""Times this project and PyTorch side by side: same shapes, same threads, in turns, in one process tree.

    cargo build --release --example turns
    pip install torch numpy          # or: uv pip install --index-url https://download.pytorch.org/whl/cpu torch
    python experiments/bench/compare_torch.py [--rounds 15] [--threads 2] [--json]

Work is full-size TactNet-II (1000 steps x 16 taxels, 32/64/128 maps, 512 units, 36 materials), batch 36:

    train_step        forward, backward, Adam
    adversarial_step  the same on clean sweeps, their input gradient, and once more on the perturbed sweeps
    forward           36 sweeps with frozen statistics
    single_forward    one sweep
    mc_forward        one sweep, Monte Carlo dropout with M = 100 (convolutions once, head on all masks together)

Each round times every piece of work with tactnet, with PyTorch's channels-last and with its contiguous memory format: three times in
a row (short work ten times), of which the median counts, so that a side's own caches are warm and not the other's. A ratio is PyTorch's better median over ours, so above 1 this project is faster. Our times also hold what PyTorch is spared here:
reading u8 digits, normalising them, drawing dropout masks, and log-probabilities in f64.
"""

import argparse
import json
import os
import pathlib
import platform
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
WORK = ["train_step", "adversarial_step", "forward", "single_forward", "mc_forward"]
SHORT = ["single_forward", "mc_forward"]
BATCH, STEPS, TAXELS, MATERIALS, RUNS = 36, 1000, 16, 36, 100
FORMATS = ["channels_last", "contiguous"]

try:
    import torch
    import torch.nn.functional as F
    from torch import nn
except ImportError:
    sys.exit("compare_torch.py needs PyTorch: pip install torch numpy")


class TactNet(nn.Module):
    """TactNet-II (Tulbure & Baeuml, Humanoids 2018, figure 4)."""

    def __init__(self):
        super().__init__()
        maps = [1, 32, 64, 128]
        self.conv = nn.ModuleList(
            nn.Conv2d(i, o, (15, 5), padding=(7, 2), bias=False) for i, o in zip(maps, maps[1:])
        )
        self.norm = nn.ModuleList(nn.BatchNorm2d(o) for o in maps[1:])
        self.hidden = nn.Linear(2048, 512, bias=False)
        self.hidden_norm = nn.BatchNorm1d(512)
        self.output = nn.Linear(512, MATERIALS)

    def features(self, x):
        for conv, norm in zip(self.conv, self.norm):
            x = F.max_pool2d(F.relu(norm(conv(x))), (10, 1))
        return x.flatten(1)

    def head(self, x):
        return self.output(F.relu(self.hidden_norm(self.hidden(x))))

    def forward(self, x):
        return self.head(F.dropout(self.features(x), 0.2, self.training))


class Torch:
    """One memory format's network, optimiser and sweeps."""

    def __init__(self, memory_format):
        torch.manual_seed(1)
        layout = {"memory_format": {"contiguous": torch.contiguous_format}.get(memory_format, torch.channels_last)}
        self.layout = layout
        self.net = TactNet().to(**layout)
        self.eval_net = TactNet().to(**layout).eval()
        self.adam = torch.optim.Adam(self.net.parameters(), lr=1e-4, weight_decay=1e-3)
        self.x = torch.randint(0, 40, (BATCH, 1, STEPS, TAXELS)).float().contiguous(**layout)
        self.y = torch.arange(BATCH)

    def train_step(self):
        self.adam.zero_grad()
        F.cross_entropy(self.net(self.x), self.y).backward()
        self.adam.step()

    def adversarial_step(self, alpha=0.5, epsilon=0.1):
        self.adam.zero_grad()
        x = self.x.detach().clone(**self.layout).requires_grad_(True)
        (alpha * F.cross_entropy(self.net(x), self.y)).backward()
        perturbed = x.detach() + epsilon * x.grad.sign()
        ((1 - alpha) * F.cross_entropy(self.net(perturbed), self.y)).backward()
        self.adam.step()

    @torch.no_grad()
    def forward(self):
        self.eval_net(self.x).log_softmax(1)

    @torch.no_grad()
    def single_forward(self):
        self.eval_net(self.x[:1]).log_softmax(1)

    @torch.no_grad()
    def mc_forward(self):
        features = self.eval_net.features(self.x[:1])
        self.eval_net.head(F.dropout(features.expand(RUNS, -1), 0.2, True)).softmax(1).mean(0).log()


class Ours:
    """The `turns` example, one line in, one time out."""

    def __init__(self, program, threads):
        env = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
        self.process = subprocess.Popen(
            [program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=env
        )

    def time(self, work):
        self.process.stdin.write(work + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"{self.process.args[0]} ended with status {self.process.wait()}")
        return float(answer)


def processor():
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown"


def commit():
    found = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=12"], cwd=ROOT, capture_output=True, text=True
    )
    return found.stdout.strip() or "unknown"


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=15, help="times everything is timed (default 15)")
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)), help="threads for both (default: all)")
    parser.add_argument("--work", nargs="+", choices=WORK, default=WORK, help="only this work")
    parser.add_argument("--program", default=ROOT / "target/release/examples/turns", help="our side")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    if not os.path.exists(options.program):
        sys.exit(f"{options.program} is missing: cargo build --release --example turns")
    torch.set_num_threads(options.threads)
    torch.set_flush_denormal(True)
    sides = {name: Torch(name) for name in FORMATS}
    ours = Ours(str(options.program), options.threads)
    times = {work: {side: [] for side in ["tactnet", *FORMATS]} for work in options.work}
    for turn in range(options.rounds + 1):
        if sys.stderr.isatty():
            print(f"\rround {turn} of {options.rounds}", end="", file=sys.stderr, flush=True)
        for work, found in times.items():
            for side in ["tactnet", *FORMATS]:
                turn_times = []
                for _ in range(10 if work in SHORT else 3):
                    if side == "tactnet":
                        turn_times.append(ours.time(work))
                    else:
                        begin = time.perf_counter()
                        getattr(sides[side], work)()
                        turn_times.append((time.perf_counter() - begin) * 1e3)
                if turn > 0:  # the first round warms up
                    found[side].append(statistics.median(turn_times))
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    medians = {work: {side: statistics.median(t) for side, t in found.items()} for work, found in times.items()}
    ratios = {f"{work}_ratio": min(m[f] for f in FORMATS) / m["tactnet"] for work, m in medians.items()}
    if options.json:
        about = {
            "processor": processor(),
            "threads": options.threads,
            "rounds": options.rounds,
            "commit": commit(),
            "torch": torch.__version__,
        }
        print(json.dumps({**ratios, "median_ms": medians, **about}, indent=2))
        return
    print(f"{processor()}, {options.threads} threads, {options.rounds} rounds, tactnet {commit()}, torch {torch.__version__}")
    print(f"{'median ms':<18}{'tactnet':>10}{'channels-last':>15}{'contiguous':>12}{'ratio':>8}")
    for work, m in medians.items():
        cells = f"{m['tactnet']:>10.1f}{m['channels_last']:>15.1f}{m['contiguous']:>12.1f}"
        print(f"{work:<18}{cells}{ratios[work + '_ratio']:>8.1f}")


main()
