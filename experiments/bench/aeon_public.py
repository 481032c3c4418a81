"""Accuracy of aeon's classifiers on the folds of `tactnet experiment run public`; called by compare_aeon.py --public."""

import json
import math
import pathlib
import subprocess
import sys
import tempfile
import time
import warnings

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
OURS = ROOT / "experiments/results/public.json"


def classifiers(threads, seed):
    """Returns constructors of aeon's classifiers by name."""
    from aeon.classification.convolution_based import MiniRocketClassifier, MultiRocketHydraClassifier
    from aeon.classification.interval_based import QUANTClassifier
    from aeon.classification.shapelet_based import RDSTClassifier

    return {
        "MiniRocket": lambda: MiniRocketClassifier(n_jobs=threads, random_state=seed),
        "MultiRocket-Hydra": lambda: MultiRocketHydraClassifier(n_jobs=threads, random_state=seed),
        "QUANT": lambda: QUANTClassifier(random_state=seed),
        "RDST": lambda: RDSTClassifier(n_jobs=threads, random_state=seed),
    }


def folds(program, data, out):
    """Runs the benchmark's fastest probe for its folds; yields set, condition, file, and indices of training and test sweeps."""
    settings = ["--set", f"data={data}", "--set", 'models=["means"]', "--set", "probes=[]"]
    command = [program, "experiment", "run", "public", *settings, "--axes-are-right", "--out", out, "--json"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"experiment run public ended with status {done.returncode}:\n{done.stderr}")
    for task in sorted(pathlib.Path(out, "tasks").glob("*/split.json")):
        split, config = json.loads(task.read_text()), json.loads((task.parent / "config.json").read_text())
        held_out = split["scheme"]["kind"] != "stratified-k-fold"
        yield config["spec"]["data"], "held-out groups" if held_out else "random folds", split["train"], split["test"]


def sweeps_of(file):
    """Returns sweeps `[sweeps][taxels][steps]` and their labels."""
    arrays = np.load(file, allow_pickle=False)
    samples = arrays["X"].astype(np.float32)
    samples = samples.reshape(samples.shape[0], samples.shape[1], -1)
    # A taxel that is constant in a sweep divides by zero in aeon's features.
    return np.ascontiguousarray(samples.transpose(0, 2, 1)), arrays["y"]


def interval(accuracies):
    """Returns the 95 % interval of the mean over folds, by Nadeau and Bengio's corrected standard error, as the benchmark's."""
    from scipy.stats import t

    count, mean = len(accuracies), float(np.mean(accuracies))
    if count < 2:
        return None
    half = float(t.ppf(0.975, count - 1) * np.std(accuracies, ddof=1) * math.sqrt(1 / count + 1 / (count - 1)))
    return [max(0.0, mean - half), min(1.0, mean + half)]


def measure(program, data, threads, kept=None, seed=1):
    """Returns one row for each set, split and classifier.

    - `kept`: file of finished trainings, a JSON object per line; a repeated call continues it
    """
    warnings.filterwarnings("ignore")
    rows, loaded, count = {}, {}, {}
    done = {}
    if kept and kept.exists():
        for line in kept.read_text().splitlines():
            one = json.loads(line)
            done[one["data"], one["condition"], one["fold"], one["classifier"]] = one
    # Tasks name the files that links point to.
    names = {str(file.resolve()): file.stem for file in pathlib.Path(data).iterdir()}
    with tempfile.TemporaryDirectory() as out:
        for file, condition, train, test in folds(program, data, out):
            if file not in loaded:
                loaded = {file: sweeps_of(file)}
            samples, labels = loaded[file]
            name_of_set = names.get(str(pathlib.Path(file).resolve()), pathlib.Path(file).stem)
            fold = count[file, condition] = count.get((file, condition), 0) + 1
            for name, make in classifiers(threads, seed).items():
                key = {"data": name_of_set, "condition": condition, "fold": fold, "classifier": name}
                one = done.get(tuple(key.values()))
                if one is None:
                    begin = time.perf_counter()
                    found = make().fit(samples[train], labels[train]).predict(samples[test])
                    one = {**key, "accuracy": float(np.mean(found == labels[test])), "seconds": time.perf_counter() - begin}
                    print(f"{name_of_set}, {condition}: {name} {one['accuracy']:.3f} in {one['seconds']:.0f} s", file=sys.stderr, flush=True)
                    if kept:
                        with kept.open("a") as lines:
                            lines.write(json.dumps(one) + "\n")
                row = rows.setdefault((name_of_set, condition, name), ([], []))
                row[0].append(one["accuracy"])
                row[1].append(one["seconds"])
    return [
        {
            "data": data,
            "condition": condition,
            "classifier": name,
            "accuracy": float(np.mean(accuracies)),
            "ci95": interval(accuracies),
            "folds": len(accuracies),
            "seconds": float(np.mean(seconds)),
        }
        for (data, condition, name), (accuracies, seconds) in rows.items()
    ]


def ranked(rows):
    """Returns mean error and mean rank of aeon's classifiers and of this project's models over the sets that both have."""
    headline = {}
    for row in rows:
        key = row["data"], row["classifier"]
        if row["condition"] == "held-out groups" or key not in headline:
            headline[key] = 1.0 - row["accuracy"]
    errors = {}
    for (data, name), error in headline.items():
        errors.setdefault(f"aeon {name}", {})[data] = error
    sets = {data for data, _ in headline}
    for row in json.loads(OURS.read_text())["rows"]:
        if row["condition"] == "headline" and row["data"] in sets:
            errors.setdefault(row["model"], {})[row["data"]] = 1.0 - row["accuracy"]
    complete = {name: of for name, of in errors.items() if set(of) == sets}
    ranks = {name: [] for name in complete}
    for data in sets:
        for name, of in complete.items():
            below = sum(other[data] < of[data] - 1e-9 for other in complete.values())
            equal = sum(abs(other[data] - of[data]) <= 1e-9 for other in complete.values())
            ranks[name].append(below + (equal + 1) / 2)
    found = [
        {"classifier": name, "mean_error": float(np.mean(list(of.values()))), "mean_rank": float(np.mean(ranks[name])), "sets": len(of)}
        for name, of in complete.items()
    ]
    return sorted(found, key=lambda row: row["mean_error"])
