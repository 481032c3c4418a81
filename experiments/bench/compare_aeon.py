#!/usr/bin/env python3
"""Times this project's feature transforms and aeon's: same sweeps, same cores, alternating, in one process tree.

    cargo build --release && cargo build --release --examples
    pip install aeon numba torch h5py
    python experiments/bench/compare_aeon.py [--rounds 3] [--threads 2] [--json]

Work, on full-size sweeps of the synthetic twin (1000 steps x 16 taxels):

    minirocket         MiniRocket, 9996 features, of all 3600 sweeps
    multirocket-hydra  MultiRocket and Hydra, 56896 features, of 200 sweeps
    h                  the short-time spectrum, 494 features, of all 3600 sweeps; aeon has none

For each piece of work, both sides start anew, fit their kernels and transform a few sweeps untimed, so that numba has compiled. Then they
alternate, and the median counts. A ratio is aeon's time divided by ours, so above 1 this project is faster. The ratio of processor seconds
is less sensitive to other load. Memory is the peak of each process, including its interpreter and libraries, its copy of the sweeps (bytes
here, `f32` in aeon) and the features. Our times also include converting bytes to `f32` and transposing `[steps][taxels]` to
`[taxels][steps]`, which aeon does not need.

With `--public DIR` it measures the accuracy of aeon's classifiers instead, on the folds of `tactnet experiment run public --set data=DIR`,
and ranks them among the models of experiments/results/public.json.
"""

import argparse
import importlib.metadata
import json
import os
import pathlib
import platform
import statistics
import subprocess
import sys
import tempfile
import time

import aeon_public

ROOT = pathlib.Path(__file__).resolve().parents[2]
SWEEPS = {"minirocket": 3600, "multirocket-hydra": 200, "h": 3600}
WARM_UP, FITTED = 8, 360
PACKAGES = ["aeon", "numba", "torch", "numpy", "h5py"]


def aeon_side(path, threads):
    """Answers each line `work N` on standard input with milliseconds, like the example `feature_turns`."""
    import h5py
    import numpy as np
    import torch
    from aeon.transformations.collection.convolution_based import HydraTransformer, MiniRocket, MultiRocket

    torch.set_num_threads(threads)
    kinds = {"minirocket": [MiniRocket], "multirocket-hydra": [MultiRocket, HydraTransformer]}
    with h5py.File(path) as file:
        samples = file["samples"][()]
    all_sweeps = samples.reshape(-1, samples.shape[2], samples.shape[3] * samples.shape[4])

    def spread(count):
        """Returns `[count][taxels][steps]`, spread evenly over the file."""
        chosen = all_sweeps[np.arange(count) * len(all_sweeps) // count]
        return np.ascontiguousarray(chosen.transpose(0, 2, 1), dtype=np.float32)

    fitted, sweeps = {}, {}
    for line in sys.stdin:
        work, count = line.split()
        count = int(count)
        if work not in fitted:
            fitted[work] = [kind(n_jobs=threads, random_state=1) for kind in kinds[work]]
            for transformer in fitted[work]:
                transformer.fit(spread(min(FITTED, len(all_sweeps))))
        if count not in sweeps:
            sweeps.clear()
            sweeps[count] = spread(count)
        begin = time.perf_counter()
        found = [transformer.transform(sweeps[count]) for transformer in fitted[work]]
        milliseconds = (time.perf_counter() - begin) * 1e3
        assert all(len(features) == count for features in found)
        del found
        print(milliseconds, flush=True)


class Side:
    """A process that answers each line with the duration of its work in milliseconds."""

    def __init__(self, command, threads):
        limits = ["RAYON_NUM_THREADS", "NUMBA_NUM_THREADS", "OMP_NUM_THREADS"]
        self.process = subprocess.Popen(
            [str(word) for word in command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **{limit: str(threads) for limit in limits}},
        )

    def time(self, work, sweeps):
        """Returns elapsed seconds and processor seconds."""
        before = self.processor_seconds()
        self.process.stdin.write(f"{work} {sweeps}\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"{self.process.args[0]} ended with status {self.process.wait()}")
        return float(answer) / 1e3, self.processor_seconds() - before

    def processor_seconds(self):
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        user, system = int(fields[11]), int(fields[12])
        return (user + system) / os.sysconf("SC_CLK_TCK")

    def end(self):
        """Ends the process and returns its peak resident memory in MiB."""
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        peak = next(line for line in status.splitlines() if line.startswith("VmHWM:"))
        self.process.stdin.close()
        self.process.wait()
        return int(peak.split()[1]) / 1024


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


def versions():
    try:
        return {name: importlib.metadata.version(name) for name in PACKAGES}
    except importlib.metadata.PackageNotFoundError as missing:
        sys.exit(f"compare_aeon.py needs {missing.name}: pip install {' '.join(PACKAGES)}")


def ratio(sides, measure):
    return sides["aeon"][measure] / sides["tactnet"][measure]


def compare(work, sweeps, commands, options):
    """Runs both sides alternately and returns medians of seconds and processor seconds, all rounds' seconds, and peak memory."""
    sides = {name: Side(command, options.threads) for name, command in commands.items()}
    times = {name: [] for name in sides}
    for side in sides.values():
        side.time(work, min(WARM_UP, sweeps))
        # Runs once untimed, so that preparation for this number of sweeps counts for neither side.
        side.time(work, sweeps)
    for turn in range(options.rounds):
        if sys.stderr.isatty():
            print(f"\r\033[K{work}: round {turn + 1} of {options.rounds}", end="", file=sys.stderr, flush=True)
        for name, side in sides.items():
            times[name].append(side.time(work, sweeps))
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    found = {}
    for name, side in sides.items():
        seconds, processor_seconds = zip(*times[name])
        found[name] = {
            "seconds": statistics.median(seconds),
            "processor_seconds": statistics.median(processor_seconds),
            "rounds": seconds,
            "peak_rss_mib": side.end(),
        }
    return found


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    cores = len(os.sched_getaffinity(0))
    parser.add_argument("--rounds", type=int, default=3, help="times everything is timed (default 3)")
    parser.add_argument("--threads", type=int, default=cores, help="threads for both (default: all)")
    parser.add_argument("--work", nargs="+", choices=SWEEPS, default=list(SWEEPS), help="only this work")
    parser.add_argument("--sweeps", type=int, default=3600, help="at most this many sweeps (default 3600)")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "target/release/tactnet", help="makes the twin")
    parser.add_argument(
        "--example", type=pathlib.Path, default=ROOT / "target/release/examples/feature_turns", help="our side"
    )
    parser.add_argument("--public", metavar="DIR", help="folder of data sets: accuracy instead of time")
    parser.add_argument("--keep", metavar="FILE", type=pathlib.Path, help="with --public: file of finished trainings; a repeated call continues")
    parser.add_argument("--add", metavar="FILE", type=pathlib.Path, help="with --public: JSON of an earlier call, whose rows of other sets are added")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--aeon-side", metavar="FILE", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.aeon_side:
        aeon_side(options.aeon_side, options.threads)
        return
    options.program, options.example = options.program.resolve(), options.example.resolve()
    found_versions = versions()
    if options.public:
        rows = aeon_public.measure(options.program, options.public, options.threads, options.keep)
        commits, measured = [commit()], {row["data"] for row in rows}
        if options.add:
            before = json.loads(options.add.read_text())
            rows = [row for row in before["rows"] if row["data"] not in measured] + rows
            commits = sorted({*before["git"], *commits})
        command = "python experiments/bench/compare_aeon.py --public DIR --json"
        found = {"schema_version": 1, "command": command, "git": commits, "seed": 1, "versions": found_versions}
        found |= {"rows": rows, "ranks": aeon_public.ranked(rows)}
        if options.json:
            print(json.dumps(found, indent=2))
        else:
            for row in found["ranks"]:
                print(f"{row['classifier']:<26}error {100 * row['mean_error']:5.1f} %  rank {row['mean_rank']:.2f}  {row['sets']} sets")
        return
    for program in [options.program, options.example]:
        if not program.exists():
            sys.exit(f"{program} is missing: cargo build --release && cargo build --release --examples")

    with tempfile.TemporaryDirectory() as folder:
        data = pathlib.Path(folder) / "twin.h5"
        subprocess.run([options.program, "data", "twin", "--out", data], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        ours = [options.example, data]
        aeon = [sys.executable, __file__, "--threads", options.threads, "--aeon-side", data]
        results = {}
        for work in options.work:
            commands = {"tactnet": ours} if work == "h" else {"tactnet": ours, "aeon": aeon}
            results[work] = compare(work, min(SWEEPS[work], options.sweeps), commands, options)

    about = {
        "processor": processor(),
        "threads": options.threads,
        "rounds": options.rounds,
        "commit": commit(),
        "versions": found_versions,
    }
    if options.json:
        flat = {}
        for work, sides in results.items():
            name = {"h": "h_features"}.get(work, work.replace("-", "_"))
            if "aeon" in sides:
                flat[f"{name}_ratio"] = ratio(sides, "seconds")
                flat[f"{name}_processor_ratio"] = ratio(sides, "processor_seconds")
            for side, measured in sides.items():
                prefix = "" if side == "tactnet" else "aeon_"
                flat[f"{prefix}{name}_seconds"] = measured["seconds"]
                flat[f"{prefix}{name}_peak_rss_mib"] = measured["peak_rss_mib"]
        sweeps = {work: min(SWEEPS[work], options.sweeps) for work in results}
        print(json.dumps({**flat, "sweeps": sweeps, "measured": results, **about}, indent=2))
        return
    named = ", ".join(f"{name} {found_versions[name]}" for name in ["aeon", "numba", "torch"])
    print(f"{about['processor']}, {options.threads} threads, {options.rounds} rounds, tactnet {about['commit']}, {named}")
    print(f"{'':<25}{'median s':>19}{'':>8}{'processor s':>19}{'':>8}{'peak MiB':>16}")
    pair = f"{'tactnet':>10}{'aeon':>9}"
    print(f"{'':<18}{'sweeps':>7}{pair}{'ratio':>8}{pair}{'ratio':>8}{'tactnet':>9}{'aeon':>7}")
    for work, sides in results.items():
        cells = f"{work:<18}{min(SWEEPS[work], options.sweeps):>7}"
        for measure in ["seconds", "processor_seconds"]:
            cells += f"{sides['tactnet'][measure]:>10.2f}"
            cells += f"{sides['aeon'][measure]:>9.2f}{ratio(sides, measure):>8.1f}" if "aeon" in sides else f"{'-':>9}{'-':>8}"
        memory = f"{sides['aeon']['peak_rss_mib']:.0f}" if "aeon" in sides else "-"
        print(f"{cells}{sides['tactnet']['peak_rss_mib']:>9.0f}{memory:>7}")


main()
