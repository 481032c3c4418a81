#!/usr/bin/env python3
"""Calibrates version 2 of the twin, and records the results of trained classifiers on it.

    python experiments/twin/calibrate.py --program target/release/tactnet try FILE.json
    python experiments/twin/calibrate.py --program target/release/tactnet search --trials 20
    python experiments/twin/calibrate.py --program target/release/tactnet record

`try` evaluates constructions (a JSON object of names, each with fields of `Construction`). `search` varies the best one at random. Both
append a line for each construction to calibration.jsonl in this folder and skip known ones. Lines called `pilot` used scikit-learn's linear
discriminant on 14 bands a taxel; names that a construction leaves out have the values of the line `pilot K2`. `record` trains on the built-in twin with several
twin seeds and network seeds, and writes data/src/twin/trained_targets.json, which `tactnet data twin --stats` shows.

Only the numbers in TARGETS are tuned. The network is trained on fold 0 of twin seed 1, on which no recipe was selected; the linear classifier
and the nearest mean use the same fold. Needs Python 3.9 and nothing else; a trial takes about four minutes on two cores.
"""

import argparse
import csv
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
LOG = HERE / "calibration.jsonl"
RECORD = HERE.parent.parent / "data/src/twin/trained_targets.json"
TWIN_SEEDS = (1, 2, 3)
NETWORK_SEEDS = (1, 2, 3)

# Name, target, tolerance, and the accepted minimum and maximum if the two sides differ.
TARGETS = {
    "base, one sweep": (0.855, 0.015),
    "base, three sweeps": (0.943, 0.015),
    "adversarial minus base": (0.0075, 0.0125),
    "standard deviation of the confusions' diagonal": (0.107, 0.02),
    "least of the confusions' diagonal": (0.56, 0.08),
    "nearest means": (0.0, 0.20),
    "linear discriminant on log spectra": (0.0, 0.75),
}

# Numbers that `search` varies, and the standard deviation of their natural logarithm.
STEPS = {
    "distance": 0.15,
    "block": 0.2,
    "sweep": 0.2,
    "excursions": 0.1,
    "bound": 0.15,
    "slip_ratio": 0.3,
    "slip_duration": 0.3,
    "gains": 0.15,
    "amplitudes": 0.05,
}


def miss(value, target, tolerance):
    """Returns how far a value is outside its tolerance, in tolerances."""
    return max(0.0, abs(value - target) / tolerance - 1.0)


class Bench:
    def __init__(self, program, folder):
        self.program = program
        self.folder = pathlib.Path(folder)
        self.adversarial = self.folder / "adversarial.toml"
        shown = self.tactnet("experiment", "show", "crossval_tactnet2")
        assert "epsilon = 0.1" in shown, "the adversarial variant perturbs by 0.1 digits"

    def tactnet(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"tactnet {' '.join(map(str, arguments))}\n{done.stderr.strip()}")
        return done.stdout

    def signal(self, construction, seed=1, sweeps=30):
        """Returns targets of the signal by name: value, target, tolerance."""
        arguments = ["data", "twin", "--stats", "--json", "--seed", seed, "--sweeps", sweeps]
        targets = json.loads(self.tactnet(*arguments, *self.built(construction)))["targets"]
        return [t for t in targets if t["source"] == "measured"]

    def built(self, construction):
        if construction is None:
            return []
        file = self.folder / "construction.json"
        file.write_text(json.dumps(construction))
        return ["--construction", file]

    def twin(self, construction, seed=1):
        out = self.folder / "twin.h5"
        self.tactnet("data", "twin", "--force", "--out", out, "--seed", seed, *self.built(construction))
        return out

    def train(self, data, recipe, seed=1, fold=0):
        """Returns the result of a training, and its predictions as pairs of true and predicted material."""
        with tempfile.TemporaryDirectory(dir=self.folder) as run:
            run = pathlib.Path(run) / "run"
            arguments = ["train", "--data", data, "--recipe", recipe, "--seed", seed, "--fold", fold]
            result = json.loads(self.tactnet(*arguments, "--json", "--out", run))
            plain = run / "predictions_test_plain.csv"
            plain = plain if plain.exists() else run / "predictions_test.csv"
            rows = plain.read_text().splitlines()[3:]
        pairs = [(int(row[0]), int(row[1])) for row in csv.reader(rows)]
        return result, pairs

    def recipe(self, method):
        """Returns the `fast` recipe, trained by `method`."""
        if method == "base":
            return "fast"
        text = (HERE.parent.parent / "pipeline/recipes/fast.toml").read_text()
        base = 'method = { kind = "base" }'
        assert base in text
        attack = 'method = { kind = "adversarial", alpha = 0.5, epsilon = 0.1 }'
        self.adversarial.write_text(text.replace(base, attack).replace('name = "fast"', 'name = "fast-adversarial"'))
        return self.adversarial


def figures(result, way="plain"):
    evaluation = result["evaluations"][way]
    fused = evaluation["fused"]
    return {
        "one": evaluation["one_sweep"]["mean"],
        "three": fused["bayes"]["mean"],
        "votes": fused["majority"]["mean"],
    }


def accuracy(pairs):
    return sum(a == b for a, b in pairs) / len(pairs)


def diagonal(pairs):
    """Returns the share of each material's sweeps that is recognised."""
    materials = sorted({a for a, _ in pairs})
    shares = []
    for material in materials:
        found = [b == material for a, b in pairs if a == material]
        shares.append(sum(found) / len(found))
    return shares


def deviation(values):
    mean = sum(values) / len(values)
    return math.sqrt(sum((v - mean) ** 2 for v in values) / len(values))


def trial(bench, name, construction):
    began = time.time()
    signal = bench.signal(construction)
    missed = {t["name"]: round(t["value"], 4) for t in signal if not t["met"]}
    signal_misses = sum(miss(t["value"], t["target"], t["tolerance"]) ** 2 for t in signal if t["tolerance"])
    found = {"name": name, "construction": construction, "signal_misses": round(signal_misses, 3), "missed": missed}
    if signal_misses > 5.0:
        return {**found, "cost": 100.0 + signal_misses, "seconds": round(time.time() - began)}
    data = bench.twin(construction)
    linear, _ = bench.train(data, "lda")
    means, _ = bench.train(data, "means")
    base, _ = bench.train(data, bench.recipe("base"))
    values = {
        "base, one sweep": figures(base)["one"],
        "base, three sweeps": figures(base)["three"],
        "nearest means": next(iter(means["evaluations"].values()))["one_sweep"]["mean"],
        "linear discriminant on log spectra": next(iter(linear["evaluations"].values()))["one_sweep"]["mean"],
    }
    cost = signal_misses + sum(miss(v, *TARGETS[k]) ** 2 for k, v in values.items())
    if cost < 4.0:
        adversarial, _ = bench.train(data, bench.recipe("adversarial"))
        values["adversarial minus base"] = figures(adversarial)["one"] - figures(base)["one"]
        values["adversarial, three sweeps (not a target)"] = figures(adversarial)["three"]
        cost += miss(values["adversarial minus base"], *TARGETS["adversarial minus base"]) ** 2
    values["three votes (not a target)"] = figures(base)["votes"]
    values = {k: round(v, 4) for k, v in values.items()}
    return {**found, "values": values, "cost": round(cost, 3), "seconds": round(time.time() - began)}


def logged():
    return [json.loads(line) for line in LOG.read_text().splitlines()] if LOG.exists() else []


def note(found):
    with LOG.open("a") as log:
        log.write(json.dumps(found) + "\n")
    print(f"{found['name']}: cost {found['cost']}", found.get("values", ""), found["missed"], flush=True)


def changed(construction, rng):
    """Returns every number multiplied by a random factor."""
    other = json.loads(json.dumps(construction))
    for name, step in STEPS.items():
        factor = lambda: math.exp(step * rng.gauss(0, 1))
        value = other.get(name)
        if isinstance(value, list):
            other[name] = [round(v * factor(), 4) for v in value]
        elif value:
            other[name] = round(value * factor(), 4)
    return other


def search(bench, trials, seed):
    for number in range(trials):
        done = logged()
        rated = [line for line in done if "values" in line]
        best = min(rated, key=lambda line: line["cost"])
        rng = random.Random(f"{seed} {len(done)} {best['name']}")
        name = f"search-{seed}-{len(done)}"
        note(trial(bench, name, changed(best["construction"], rng)))


def mean_and_interval(values):
    """Returns the mean, and half the width of its 95 % interval by Student's t for at most 9 values."""
    t = {2: 12.706, 3: 4.303, 4: 3.182, 5: 2.776, 6: 2.571, 7: 2.447, 8: 2.365, 9: 2.306}
    mean = sum(values) / len(values)
    if len(values) < 2:
        return mean, None
    spread = math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1))
    return mean, t[len(values)] * spread / math.sqrt(len(values))


def means_of_equal_parts(values, parts):
    size = len(values) // parts
    return [sum(values[start : start + size]) / size for start in range(0, len(values), size)]


def record(bench):
    """Trains on every twin seed with every network seed; finished trainings are kept and not repeated."""
    kept_file = HERE / "record.jsonl"
    kept = [json.loads(line) for line in kept_file.read_text().splitlines()] if kept_file.exists() else []
    shas = {}
    lines = []

    def once(twin_seed, recipe, network_seed, fold):
        key = [shas[twin_seed], recipe, network_seed, fold]
        for line in kept:
            if line["key"] == key:
                return line
        name = bench.recipe(recipe) if recipe in ("base", "adversarial") else recipe
        result, pairs = bench.train(bench.twin(None, twin_seed), name, network_seed, fold)
        line = {"key": key, "twin_seed": twin_seed, "git": result["git"]}
        if recipe == "base" and twin_seed == network_seed == 1:
            line["pairs"] = pairs
        line["ways"] = {way: figures(result, way) for way in result["evaluations"]}
        kept.append(line)
        with kept_file.open("a") as file:
            file.write(json.dumps(line) + "\n")
        print(recipe, "twin", twin_seed, "network", network_seed, "fold", fold, line["ways"], flush=True)
        return line

    for seed in TWIN_SEEDS:
        stats = json.loads(bench.tactnet("data", "twin", "--stats", "--json", "--seed", seed))
        shas[seed] = stats["data_sha256"]
    pairs_of_seeds = [(t, n) for t in TWIN_SEEDS for n in NETWORK_SEEDS]
    base = [once(t, "base", n, 0) for t, n in pairs_of_seeds]
    folds = [once(1, "base", 1, fold) for fold in range(5)]
    linear = [once(t, "lda", 1, 0) for t in TWIN_SEEDS]
    means = [once(t, "means", 1, 0) for t in TWIN_SEEDS]
    adversarial = [once(t, "adversarial", n, 0) for t, n in pairs_of_seeds]
    one = lambda line: line["ways"]["plain"]["one"]
    first = lambda line: next(iter(line["ways"].values()))["one"]
    shares = diagonal([pair for line in folds for pair in line["pairs"]])
    values = {
        "base, one sweep": [one(line) for line in base],
        "base, three sweeps": [line["ways"]["plain"]["three"] for line in base],
        "adversarial minus base": [one(a) - one(b) for a, b in zip(adversarial, base)],
        "standard deviation of the confusions' diagonal": [deviation(shares)],
        "least of the confusions' diagonal": [min(shares)],
        "nearest means": [first(line) for line in means],
        "linear discriminant on log spectra": [first(line) for line in linear],
    }
    for name, (target, tolerance) in TARGETS.items():
        # Networks of one twin are not independent draws of twins, so the interval is over the twins' means.
        mean, half = mean_and_interval(means_of_equal_parts(values[name], len(TWIN_SEEDS)) if len(values[name]) > 1 else values[name])
        shown = name if target else f"{name}, at most {tolerance:g}"
        line = {"name": shown, "value": round(mean, 4), "target": target, "tolerance": tolerance, "trainings": len(values[name])}
        if half is not None:
            line["ci95_half_width"] = round(half, 4)
        lines.append(line)
        print(f"{shown:<60}{mean:8.3f} +-{half or float('nan'):.3f}   wanted {target} +-{tolerance}")
    # Values that pages quote and that have no target.
    for name, way in [("one sweep", "one"), ("three sweeps", "three"), ("three votes", "votes")]:
        plain = lambda line: line["ways"]["plain"][way]
        for what, per_pair in {
            f"base, {name}": [plain(line) for line in base],
            f"adversarial, {name}": [plain(line) for line in adversarial],
            f"adversarial with MC dropout, {name}": [line["ways"]["mc_dropout"][way] for line in adversarial],
            f"adversarial minus base, {name}": [plain(a) - plain(b) for a, b in zip(adversarial, base)],
        }.items():
            mean, half = mean_and_interval(means_of_equal_parts(per_pair, len(TWIN_SEEDS)))
            print(f"{what:<60}{mean:8.4f} +-{half:.4f}")
    document = {
        "schema_version": 1,
        "command": "python experiments/twin/calibrate.py record",
        "git": sorted({git for line in base + adversarial + folds for git in line["git"]}),
        "twin_seeds": list(TWIN_SEEDS),
        "network_seeds": list(NETWORK_SEEDS),
        "data_sha256": [shas[seed] for seed in TWIN_SEEDS],
        "targets": lines,
    }
    RECORD.write_text(json.dumps(document, indent=1) + "\n")
    print(f"{RECORD.relative_to(HERE.parent.parent)} written")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", default="tactnet", help="the program to measure with")
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("try", help="measure constructions of a file").add_argument("file", type=pathlib.Path)
    searching = verbs.add_parser("search", help="change the best one at random")
    searching.add_argument("--trials", type=int, default=20)
    searching.add_argument("--seed", type=int, default=1)
    verbs.add_parser("record", help="train on the built-in twin and write the targets")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(arguments.program, folder)
        if arguments.verb == "try":
            done = {line["name"] for line in logged()}
            for name, construction in json.loads(arguments.file.read_text()).items():
                if name not in done:
                    note(trial(bench, name, construction))
        elif arguments.verb == "search":
            search(bench, arguments.trials, arguments.seed)
        else:
            record(bench)


if __name__ == "__main__":
    main()
