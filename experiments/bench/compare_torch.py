#!/usr/bin/env python3
"""Times this project and PyTorch side by side: same shapes, same threads, in turns, in one process tree.

    cargo build --release --example turns
    pip install torch numpy          # or: uv pip install --index-url https://download.pytorch.org/whl/cpu torch
    python experiments/bench/compare_torch.py [--shapes all] [--rounds 15] [--threads 2] [--json]

Work is TactNet-II (32/64/128 maps, 512 units, 36 materials) on sweeps of a shape, by default the thesis's, 4 x 4 taxels and 1000 steps,
36 sweeps a batch (4 for 16 x 16 taxels):

    train_step        forward, backward, Adam
    adversarial_step  the same on clean sweeps, their input gradient, and once more on the perturbed sweeps
    forward           a batch of sweeps with frozen statistics
    single_forward    one sweep
    mc_forward        one sweep, Monte Carlo dropout with M = 100 (convolutions once, head on all masks together)

Each round times every piece of work with tactnet and with PyTorch in every way: three times in a row (short work ten times), of which the
median counts, so that a side's own caches are warm and not the other's. The ways are eager or compiled (torch.compile) with channels-last
or contiguous memory; a ratio is the best way's median over ours, so above 1 this project is faster. On processors with bf16 instructions
the same under autocast to bf16 is timed beside it, and does not count. Our times also hold what PyTorch is spared here: reading u8 digits,
normalising them, drawing dropout masks, and log-probabilities in f64.

`--device gpu` times training on this machine's card instead, both sides, by `gpu.py`; of the options only `--json` is for that.
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
MATERIALS, RUNS = 36, 100
# Rows x columns x steps, and the batch.
SHAPES = {
    "4x4x1000": 36,
    "8x8x400": 36,
    "6x10x75": 36,
    "19x1x400": 36,
    "1x1x8800": 36,
    "16x16x1000": 4,
    "3x3x64": 36,
}
FORMATS = ["channels_last", "contiguous"]

# PyTorch reads these variables on import; argparse also accepts `--isa=avx2`.
if "avx2" in " ".join(sys.argv).replace("=", " ").split():
    os.environ.update(ATEN_CPU_CAPABILITY="avx2", ONEDNN_MAX_CPU_ISA="AVX2", MKL_ENABLE_INSTRUCTIONS="AVX2")

try:
    import torch
    import torch.nn.functional as F
    from torch import nn
except ImportError:
    sys.exit("compare_torch.py needs PyTorch: pip install torch numpy")


class TactNet(nn.Module):
    """TactNet-II (Tulbure & Baeuml, Humanoids 2018, figure 4)."""

    def __init__(self, steps, taxels):
        super().__init__()
        pooled = steps
        for _ in range(3):
            pooled = -(-pooled // 10)
        maps = [1, 32, 64, 128]
        self.conv = nn.ModuleList(
            nn.Conv2d(i, o, (15, 5), padding=(7, 2), bias=False) for i, o in zip(maps, maps[1:])
        )
        self.norm = nn.ModuleList(nn.BatchNorm2d(o) for o in maps[1:])
        self.hidden = nn.Linear(128 * taxels * pooled, 512, bias=False)
        self.hidden_norm = nn.BatchNorm1d(512)
        self.output = nn.Linear(512, MATERIALS)

    def features(self, x):
        for conv, norm in zip(self.conv, self.norm):
            x = F.max_pool2d(F.relu(norm(conv(x))), (10, 1), ceil_mode=True)
        return x.flatten(1)

    def head(self, x):
        return self.output(F.relu(self.hidden_norm(self.hidden(x))))

    def forward(self, x):
        return self.head(F.dropout(self.features(x), 0.2, self.training))


class Torch:
    """One configuration of the network: memory format, compiled or eager, f32 or bf16."""

    def __init__(self, memory_format, shape, batch, compiled=False, bf16=False):
        torch.manual_seed(1)
        rows, columns, steps = map(int, shape.split("x"))
        layout = {"memory_format": {"contiguous": torch.contiguous_format}.get(memory_format, torch.channels_last)}
        self.layout, self.bf16 = layout, bf16
        self.net = TactNet(steps, rows * columns).to(**layout)
        self.eval_net = TactNet(steps, rows * columns).to(**layout).eval()
        self.run = torch.compile(self.net, dynamic=False) if compiled else self.net
        self.eval_run = torch.compile(self.eval_net, dynamic=False) if compiled else self.eval_net
        self.adam = torch.optim.Adam(self.net.parameters(), lr=1e-4, weight_decay=1e-3)
        self.x = torch.randint(0, 40, (batch, 1, steps, rows * columns)).float().contiguous(**layout)
        self.one = self.x[:1].clone(**layout)
        self.y = torch.arange(batch) % MATERIALS

    def loss(self, x):
        with torch.autocast("cpu", torch.bfloat16, enabled=self.bf16):
            out = self.run(x)
        return F.cross_entropy(out.float(), self.y)

    def train_step(self):
        self.adam.zero_grad()
        self.loss(self.x).backward()
        self.adam.step()

    def adversarial_step(self, alpha=0.5, epsilon=0.1):
        self.adam.zero_grad()
        x = self.x.detach().clone(**self.layout).requires_grad_(True)
        (alpha * self.loss(x)).backward()
        perturbed = x.detach() + epsilon * x.grad.sign()
        ((1 - alpha) * self.loss(perturbed)).backward()
        self.adam.step()

    @torch.no_grad()
    def predict(self, x):
        with torch.autocast("cpu", torch.bfloat16, enabled=self.bf16):
            out = self.eval_run(x)
        out.float().log_softmax(1)

    def forward(self):
        self.predict(self.x)

    def single_forward(self):
        self.predict(self.one)

    @torch.no_grad()
    def mc_forward(self):
        with torch.autocast("cpu", torch.bfloat16, enabled=self.bf16):
            features = self.eval_net.features(self.one)
            out = self.eval_net.head(F.dropout(features.expand(RUNS, -1), 0.2, True))
        out.float().softmax(1).mean(0).log()


class Ours:
    """The `turns` example: one line in, one time out."""

    def __init__(self, program, threads, shape, batch, isa):
        env = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
        self.process = subprocess.Popen(
            [program, shape, str(batch), *isa], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=env
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
    parser.add_argument("--work", nargs="+", choices=WORK, help="only this work (default: all; of several shapes "
                        "train_step, forward and single_forward)")
    parser.add_argument("--shapes", nargs="+", metavar="SHAPE", default=["4x4x1000"],
                        help="ROWSxCOLSxSTEPS, each a row of the table; `all` for " + ", ".join(SHAPES))
    parser.add_argument("--batch", type=int, help="sweeps of a batch (default: 36; 4 for 16x16x1000)")
    parser.add_argument("--isa", choices=["avx2"], help="no faster instructions than these on either side (our matrix products of the dense "
                        "layer excepted)")
    parser.add_argument("--no-compile", action="store_true", help="leave torch.compile out; it takes minutes a shape")
    parser.add_argument("--device", choices=["cpu", "gpu"], default="cpu", help="gpu: training on this machine's card, see gpu.py")
    parser.add_argument("--program", default=ROOT / "target/release/examples/turns", help="our side")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    if options.device == "gpu":
        script = ROOT / "experiments/bench/gpu.py"
        os.execv(sys.executable, [sys.executable, script, *(["--json"] if options.json else [])])
    if not os.path.exists(options.program):
        sys.exit(f"{options.program} is missing: cargo build --release --example turns")
    torch.set_num_threads(options.threads)
    torch.set_flush_denormal(True)
    shapes = list(SHAPES) if options.shapes == ["all"] else options.shapes
    work = options.work or (WORK if len(shapes) == 1 else ["train_step", "forward", "single_forward"])
    rows = []
    for shape in shapes:
        rows += compare(shape, options.batch or SHAPES.get(shape, 36), work, options)
        torch._dynamo.reset()
    about = {
        "processor": processor(),
        "isa": options.isa or "best",
        "threads": options.threads,
        "rounds": options.rounds,
        "commit": commit(),
        "torch": torch.__version__,
    }
    if options.json:
        ratios = {f"{row['work']}_ratio": row["ratio"] for row in rows} if len(shapes) == 1 else {}
        print(json.dumps({**ratios, "rows": rows, **about}, indent=2))
        return
    print(f"{about['processor']}, {options.threads} threads, {options.rounds} rounds, tactnet {commit()}, torch {torch.__version__}")
    print(f"{'median ms':<12}{'':<18}{'tactnet':>10}{'torch':>10}{'':<26}{'bf16':>10}{'ratio':>8}")
    for row in rows:
        bf16 = f"{row['torch_bf16_ms']:>10.1f}" if row["torch_bf16_ms"] else f"{'-':>10}"
        print(f"{row['shape']:<12}{row['work']:<18}{row['tactnet_ms']:>10.1f}{row['torch_best_ms']:>10.1f}"
              f"  {row['torch_best_way']:<24}{bf16}{row['ratio']:>8.1f}")


def has_bf16():
    """Returns True if the processor has bf16 instructions; elsewhere autocast is slower than f32."""
    try:
        flags = pathlib.Path("/proc/cpuinfo").read_text()
    except OSError:
        return False
    return "avx512_bf16" in flags or "amx_bf16" in flags


def compare(shape, batch, work, options):
    """Returns a row for each piece of work of one shape."""
    sides = {name: Torch(name, shape, batch) for name in FORMATS}
    if not options.no_compile:
        sides |= {f"compiled {name}": Torch(name, shape, batch, compiled=True) for name in FORMATS}
    f32 = list(sides)
    if has_bf16() and not options.isa:
        sides |= {f"bf16 {name}": Torch(name, shape, batch, bf16=True) for name in FORMATS}
    ours = Ours(str(options.program), options.threads, shape, batch, [options.isa] if options.isa else [])
    times = {name: {side: [] for side in ["tactnet", *sides]} for name in work}
    for turn in range(options.rounds + 1):
        for name, found in times.items():
            if sys.stderr.isatty():
                print(f"\r{shape}: round {turn} of {options.rounds}, {name:<18}", end="", file=sys.stderr, flush=True)
            for side in list(found):
                turn_times = []
                try:
                    for _ in range(10 if name in SHORT else 3):
                        if side == "tactnet":
                            turn_times.append(ours.time(name))
                        else:
                            begin = time.perf_counter()
                            getattr(sides[side], name)()
                            turn_times.append((time.perf_counter() - begin) * 1e3)
                except RuntimeError as error:
                    # torch.compile of PyTorch 2.15 generates a backward pass that fails under a limit of AVX2.
                    print(f"{shape}: {side} cannot do {name}, so it is left out: {str(error).splitlines()[0]}", file=sys.stderr)
                    del found[side]
                    continue
                if turn > 0:  # the first round warms up
                    found[side].append(statistics.median(turn_times))
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    ours.process.stdin.close()
    rows = []
    for name, found in times.items():
        medians = {side: statistics.median(values) for side, values in found.items()}
        best = min((side for side in f32 if side in medians), key=medians.get)
        bf16 = [value for side, value in medians.items() if side.startswith("bf16")]
        rows.append({
            "shape": shape,
            "batch": batch,
            "work": name,
            "tactnet_ms": medians["tactnet"],
            "torch_best_ms": medians[best],
            "torch_best_way": best,
            "torch_bf16_ms": min(bf16) if bf16 else None,
            "ratio": medians[best] / medians["tactnet"],
            "median_ms": medians,
        })
    return rows


main()
