#!/usr/bin/env python3
"""Trains recipes over the folds of a repeated cross-validation and compares them. Needs nothing but Python and the built binary.

    cargo build --release
    python experiments/crossval.py --out runs/twin --recipes fast thesis --folds 10
    python experiments/crossval.py --out runs/twin --recipes fast --folds 10 --split leave-block-out

Folds 0-4 belong to run 0, folds 5-9 to run 1. A fold that has ended is not trained again, one that was interrupted goes on
where it stopped, so the same call can be repeated until all is done. Prints, for each recipe, mean, standard deviation and 95 %
interval over folds, and for each pair the corrected resampled t-test of Nadeau & Bengio (2003) on the folds that both have:
its variance is multiplied with 1/J + n_test/n_train, as training sets of different folds overlap.
"""

import argparse
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys

FOLDS_PER_RUN = 5


def student_tail(t, freedom):
    """Two-sided p-value: the density integrated from |t| on, with x = |t| / u."""
    if t == 0:
        return 1.0
    scale = math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2)) / math.sqrt(freedom * math.pi)
    steps = 20000
    total = 0.0
    for i in range(steps):
        u = (i + 0.5) / steps
        x = abs(t) / u
        total += scale * (1 + x * x / freedom) ** (-(freedom + 1) / 2) * abs(t) / (u * u)
    return min(1.0, 2 * total / steps)


def student_quantile(freedom, tail=0.05):
    low, high = 0.0, 100.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if student_tail(middle, freedom) > tail else (low, middle)
    return high


def resampled(values, ratio):
    """Mean, standard deviation, and the corrected standard error of the mean."""
    mean = statistics.fmean(values)
    if len(values) < 2:
        return mean, float("nan"), float("nan")
    sd = statistics.stdev(values)
    return mean, sd, sd * math.sqrt(1 / len(values) + ratio)


def train(options, recipe, fold):
    name = pathlib.Path(recipe).stem
    folder = options.out / f"{name}-{options.split}-{fold}"
    result = folder / "result.json"
    if not result.exists():
        place = ["--fold", str(fold % FOLDS_PER_RUN), "--run", str(fold // FOLDS_PER_RUN)]
        if options.split == "leave-block-out":
            place = ["--split", "leave-block-out", "--fold", str(fold)]
        call = [options.program, "train"]
        if (folder / "config.json").exists():
            call += ["--resume", str(folder)]
        else:
            call += ["--data", options.data, "--recipe", recipe, "--seed", str(options.seed), "--out", str(folder), *place]
        print(" ".join(str(part) for part in call), file=sys.stderr, flush=True)
        ended = subprocess.run(call, stdout=subprocess.DEVNULL)
        if ended.returncode != 0:
            sys.exit(f"fold {fold} of {recipe} ended with status {ended.returncode}; repeat this call to go on")
    return json.loads(result.read_text())


def measures(result):
    found = {}
    for way, evaluation in result["evaluations"].items():
        found[f"{way}, 1 sweep"] = evaluation["one_sweep"]["mean"]
        if evaluation.get("fused"):
            found[f"{way}, {evaluation['fused']['sweeps']} sweeps (Bayes)"] = evaluation["fused"]["bayes"]["mean"]
        found[f"{way}, NLL"] = evaluation["negative_log_likelihood"]
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the run directories")
    parser.add_argument("--recipes", nargs="+", default=["fast"], help="recipe names or files")
    parser.add_argument("--folds", type=int, default=10, help="folds of each recipe (default 10: two runs of five)")
    parser.add_argument("--split", choices=["k-fold", "leave-block-out"], default="k-fold")
    parser.add_argument("--data", default="twin", help="data set (default twin)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--program", default=pathlib.Path(__file__).parents[1] / "target/release/tactnet")
    parser.add_argument("--json", type=pathlib.Path, help="write the summary there")
    options = parser.parse_args()
    options.program = os.fspath(options.program)
    results = {}
    # Fold by fold, so that an interrupted comparison has the same folds of every recipe.
    for fold in range(options.folds):
        for recipe in options.recipes:
            results.setdefault(pathlib.Path(recipe).stem, []).append(train(options, recipe, fold))
    summary = {"data": options.data, "split": options.split, "folds": options.folds, "recipes": {}, "comparisons": []}
    ratio = 1.0
    for name, found in results.items():
        ratio = found[0]["n_test"] / found[0]["n_train"]
        rows = {}
        print(f"\n{name}: {len(found)} folds, commit {', '.join(sorted({r['git'] for r in found}))}")
        for measure in measures(found[0]):
            values = [measures(r)[measure] for r in found]
            mean, sd, error = resampled(values, ratio)
            reach = error * student_quantile(len(values) - 1) if len(values) > 1 else float("nan")
            rows[measure] = {"mean": mean, "sd": sd, "ci95": [mean - reach, mean + reach], "folds": values}
            print(f"  {measure:<32} {mean:.4f}  sd {sd:.4f}  95 % [{mean - reach:.4f}, {mean + reach:.4f}]")
        seconds = [r["train_seconds"] for r in found]
        print(f"  training seconds a fold: median {statistics.median(seconds):.0f}")
        summary["recipes"][name] = {
            "measures": rows,
            "train_seconds": seconds,
            "commits": sorted({r["git"] for r in found}),
            "recipe_sha256": found[0]["recipe_sha256"],
            "splits_sha256": [r["split_sha256"] for r in found],
        }
    names = list(results)
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            pairs = list(zip(results[first], results[second]))
            if any(a["split_sha256"] != b["split_sha256"] for a, b in pairs):
                sys.exit(f"{first} and {second} were not trained on the same splits")
            for measure in measures(pairs[0][0]):
                differences = [measures(a)[measure] - measures(b)[measure] for a, b in pairs if measure in measures(b)]
                mean, sd, error = resampled(differences, ratio)
                p = student_tail(mean / error, len(differences) - 1) if error > 0 else float("nan")
                summary["comparisons"].append({"first": first, "second": second, "measure": measure, "mean": mean, "p": p})
                print(f"{first} - {second}, {measure}: {mean:+.4f} (sd {sd:.4f}), p = {p:.3f}")
    if options.json:
        options.json.write_text(json.dumps(summary, indent=2) + "\n")


main()
