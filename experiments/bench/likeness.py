#!/usr/bin/env python3
"""Measures level and power of the verdict "unlike the training data".

    python experiments/bench/likeness.py --tactnet target/release/tactnet walk.npz containers.npz twin.npz [--repeats 4] [--json OUT]

For every fold of every repeat of a stratified cross-validation, `tactnet train --recipe lda` describes the training sweeps. The test sweeps
are then judged as they are (level: the share that is called unlike, 5 % wanted), and after each change that a sensor may bring (power).
"other skin" is a gain and an offset for every taxel, with standard deviations of 0.2 of its logarithm and of half a spread.
A data set is a `.npz` with the arrays that `tactnet data import` writes; `--other FILE` adds further sweeps of the same materials.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile

import numpy as np

LEVEL = 0.05


def load(path):
    """Returns sweeps `[n][steps][taxels]`, names of materials, blocks or None, rate, and rows and columns."""
    data = np.load(path, allow_pickle=True)
    samples = data["samples"] if "samples" in data else data["X"]
    if "y" in data:
        names = data["y"].astype(str)
    elif "labels" in data:
        names = data["materials"][data["labels"]]
    else:
        names = np.repeat(data["materials"], samples.shape[1])
        samples = samples.reshape(-1, *samples.shape[2:])
    grid = samples.shape[2:] if samples.ndim == 4 else (1, samples.shape[2])
    blocks = data["blocks"].reshape(-1) if "blocks" in data else None
    sweeps = samples.reshape(len(names), samples.shape[1], -1).astype(np.float32)
    return sweeps, names, blocks, float(data["sample_rate_hz"]), grid


def save(path, sweeps, names, rate, grid, blocks=None):
    arrays = {} if blocks is None else {"blocks": blocks.astype(np.uint32)}
    x = sweeps.reshape(*sweeps.shape[:2], *grid)
    np.savez(path, X=x, y=names, sample_rate_hz=rate, **arrays)


def half_speed(x):
    """The first half of every sweep, stretched to its length."""
    time = np.arange(x.shape[1]) / 2
    before = time.astype(int)
    share = (time - before)[None, :, None]
    return x[:, before] * (1 - share) + x[:, np.minimum(before + 1, x.shape[1] - 1)] * share


def changes(taxels, rng):
    """Returns the changes by name. Each test set has its own taxels."""
    first, second = rng.choice(taxels, 2, replace=False) if taxels > 1 else (0, 0)

    def exchanged(x):
        x = x.copy()
        x[:, :, [first, second]] = x[:, :, [second, first]]
        return x

    def dead(x):
        x = x.copy()
        x[:, :, first] = np.median(x[:, :, first])
        return x

    gains, offsets = np.exp(0.2 * rng.normal(size=taxels)), 0.5 * rng.normal(size=taxels)

    def other_skin(x):
        spread = x.std(axis=(0, 1)) + 1e-9
        mean = x.mean(axis=(0, 1))
        return mean + gains * (x - mean) + offsets * spread

    found = {
        "sign": lambda x: -x,
        "gain 1.5": lambda x: 1.5 * x,
        "gain 1.1": lambda x: 1.1 * x,
        "half speed": half_speed,
        "dead taxel": dead,
        "other skin": other_skin,
    }
    if taxels > 1:
        found["two taxels exchanged"] = exchanged
        found["order reversed"] = lambda x: x[:, :, ::-1]
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="+", type=pathlib.Path)
    parser.add_argument("--tactnet", default="tactnet")
    parser.add_argument("--other", type=pathlib.Path, action="append", default=[])
    parser.add_argument("--repeats", type=int, default=4)
    parser.add_argument("--few", type=int, default=10, help="sweeps of a small file")
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    work = pathlib.Path(tempfile.mkdtemp())
    rows = []

    def tactnet(*words):
        done = subprocess.run([arguments.tactnet, *map(str, words)], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"tactnet {' '.join(map(str, words))}: {done.stderr}")
        return done.stdout

    version = json.loads(tactnet("version", "--json"))
    for path in arguments.data:
        sweeps, names, blocks, rate, grid = load(path)
        data = work / "data.npz"
        save(data, sweeps, names, rate, grid, blocks)
        counts = {}
        rng = np.random.default_rng(1)

        def judge(change, run, x, y):
            for size, chosen in [("all", slice(None)), ("few", rng.permutation(len(x))[: arguments.few])]:
                file = work / "test.npz"
                save(file, x[chosen], y[chosen], rate, grid)
                found = json.loads(tactnet("predict", run, "--data", file, "--json"))["likeness"]
                of = counts.setdefault(change, {"sweeps": [0, 0], "all": [0, 0], "few": [0, 0], "named": {}})
                of[size][0] += found["p"] <= LEVEL
                of[size][1] += 1
                if size == "all":
                    of["sweeps"][0] += found["unlike_sweeps"]
                    of["sweeps"][1] += len(x)
                    for difference in found["differences"][:1]:
                        kind = difference["kind"]
                        of["named"][kind] = of["named"].get(kind, 0) + 1

        for repeat in range(arguments.repeats):
            for fold in range(5):
                run = work / f"run-{path.stem}-{repeat}-{fold}"
                split = ["--split", "k-fold", "--fold", fold, "--seed", 1 + repeat, "--axes-are-right"]
                tactnet("train", "--data", data, "--recipe", "lda", *split, "--out", run)
                test = json.loads((run / "split.json").read_text())["test"]
                judge("none", run, sweeps[test], names[test])
                for name, change in changes(sweeps.shape[2], rng).items():
                    judge(name, run, change(sweeps[test]), names[test])
                for other in arguments.other:
                    x, y, _, other_rate, other_grid = load(other)
                    if (other_rate, other_grid, x.shape[1]) == (rate, grid, sweeps.shape[1]):
                        judge(f"other file ({other.stem})", run, x, y)
        for change, of in counts.items():
            share = {key: of[key][0] / of[key][1] for key in ["sweeps", "all", "few"]}
            row = {"data": path.stem, "change": change, "files": of["all"][1], **share, "named": of["named"]}
            rows.append(row)
            print(f"{path.stem:12} {change:24} sweeps {share['sweeps']:.3f}  files {share['all']:.2f}  small {share['few']:.2f}  {of['named']}", flush=True)
    document = {"schema_version": 1, "level": LEVEL, "repeats": arguments.repeats, "few": arguments.few, "version": version, "rows": rows}
    if arguments.json:
        arguments.json.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
