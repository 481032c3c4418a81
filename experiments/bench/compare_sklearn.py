#!/usr/bin/env python3
"""Compares this project's k nearest neighbours and support vector machines with scikit-learn: same features, folds, settings.

    cargo build --release
    pip install scikit-learn numpy scipy h5py
    python experiments/bench/compare_sklearn.py [--data twin FILE.h5 ...] [--folds 0 1 2] [--json]

For each data set, model and fold, `tactnet train` fits and evaluates. Its split and its selected settings then go to scikit-learn, with
features by numpy as in tests/golden/features_with_aeon.py, standardised if the recipe says so, and `KNeighborsClassifier` or `SVC` (LIBSVM).
Ours predicts the most probable material. SVC predicts in two ways: the same (`proba`: Platt's sigmoids on five random inner folds, coupled)
and by the most won pairs (`vote`).

`same` is the share of test sweeps with the same prediction, ours compared with scikit-learn's `proba` (`vote` for k nearest neighbours). A
difference is ours minus scikit-learn's, in points of accuracy; its mean over the folds must stay within one point. Differences between equal
methods decide the exit status. Differences from SVC's votes are also printed; they include the difference between coupled probabilities and
votes of the same machine.
"""

import argparse
import csv
import importlib.metadata
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile
import tomllib
import warnings

ROOT = pathlib.Path(__file__).resolve().parents[2]
MODELS = ["knn-l", "knn-h", "svm-l", "svm-h"]
CLAIM = 1.0
# Rate of a file that does not state one, as in data/src/format/tactmat.rs.
DEFAULT_RATE = 750.0
sys.path.insert(0, str(ROOT / "tests/golden"))

try:
    import h5py
    import numpy as np
    from features_with_aeon import h_features, l_features
    from sklearn.neighbors import KNeighborsClassifier
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC
except ImportError as missing:
    sys.exit(f"compare_sklearn.py needs {missing.name}: pip install scikit-learn numpy scipy h5py")


class Sweeps:
    """A data set's labels and, on demand, its features."""

    def __init__(self, path):
        with h5py.File(path) as file:
            samples = file["samples"]
            materials, each, steps = samples.shape[:3]
            self.values = samples[()].reshape(materials * each, steps, -1).astype(np.float64)
            rates = [a["sample_rate_hz"] for a in (samples.attrs, file.attrs) if "sample_rate_hz" in a]
        self.rate = float(rates[0]) if rates else DEFAULT_RATE
        self.labels = np.repeat(np.arange(materials), each)
        self.known = {}

    def features(self, kind):
        if kind not in self.known:
            compute = {"l": l_features, "h": h_features}[kind]
            # Ours are in single precision, too.
            rows = np.array([compute(sweep, self.rate) for sweep in self.values], dtype=np.float32)
            if not np.isfinite(rows).all():
                sys.exit(f"{kind}-features of sweep {np.argwhere(~np.isfinite(rows))[0][0]} are not finite")
            self.known[kind] = rows.astype(np.float64)
        return self.known[kind]


def train(program, model, data, fold, out):
    """Trains ours and returns result, split, and the prediction of every test sweep."""
    command = [program, "train", "--model", model, "--data", data, "--split", "k-fold", "--fold", fold, "--out", out, "--json"]
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"tactnet train ended with status {done.returncode}:\n{done.stderr}")
    with open(out / "predictions_test.csv", newline="") as file:
        rows = list(csv.reader(file))[3:]
    split = json.loads((out / "split.json").read_text())
    return json.loads(done.stdout), split, np.array([int(row[1]) for row in rows])


def scikit_learn(recipe, chosen, train_features, train_labels, test_features):
    """Returns predictions by method; the first method equals ours."""
    if recipe.get("scaling", "raw") == "standard":
        scaler = StandardScaler().fit(train_features)
        train_features, test_features = scaler.transform(train_features), scaler.transform(test_features)
    if recipe["classifier"]["kind"] == "knn":
        knn = KNeighborsClassifier(n_neighbors=int(chosen["neighbours"])).fit(train_features, train_labels)
        return {"vote": knn.predict(test_features)}
    gamma = chosen["gamma_times_features"] / train_features.shape[1]
    machine = SVC(
        C=chosen["c"], gamma=gamma, decision_function_shape="ovo", probability=True, random_state=1, cache_size=1000
    )
    with warnings.catch_warnings():
        # Deprecated since 1.9; its replacement calibrates one against the rest, which is another classifier.
        warnings.simplefilter("ignore", FutureWarning)
        machine.fit(train_features, train_labels)
    return {
        "proba": machine.classes_[machine.predict_proba(test_features).argmax(axis=1)],
        "vote": machine.predict(test_features),
    }


def compare(options, model, data, path, sweeps, fold, folder):
    """Returns one row: accuracies in percent."""
    recipe = tomllib.loads((ROOT / f"pipeline/recipes/{model}.toml").read_text())
    result, split, ours = train(options.program, model, path, fold, folder)
    features = sweeps.features(recipe["features"])
    fitted, tested = split["train"], split["test"]
    truth = sweeps.labels[tested]
    # The settings that the recipe leaves open were selected on inner splits; the others are in the recipe.
    only = {name: values[0] for name, values in recipe["classifier"].items() if isinstance(values, list) and len(values) == 1}
    if "gamma" in only:
        only["gamma_times_features"] = only["gamma"]
    chosen = only | result.get("chosen", {})
    found = scikit_learn(recipe, chosen, features[fitted], sweeps.labels[fitted], features[tested])
    accuracy = 100 * result["accuracy_one_sweep"]["mean"]
    assert abs(accuracy - 100 * (ours == truth).mean()) < 1e-9, "predictions belong to the split's test sweeps"
    percent = {way: 100 * float((predicted == truth).mean()) for way, predicted in found.items()}
    like_ours = next(iter(found.values()))
    return {
        "data": data,
        "model": model,
        "fold": fold,
        "test_sweeps": len(tested),
        "chosen": chosen,
        "tactnet": accuracy,
        "scikit_learn": percent,
        "difference": {way: accuracy - value for way, value in percent.items()},
        "same": 100 * float((like_ours == ours).mean()),
    }


def means(rows):
    """Returns a row's numbers, averaged over folds."""
    over = lambda pick: statistics.mean(pick(row) for row in rows)
    ways = rows[0]["difference"]
    return {
        "tactnet": over(lambda row: row["tactnet"]),
        "scikit_learn": {way: over(lambda row: row["scikit_learn"][way]) for way in ways},
        "difference": {way: over(lambda row: row["difference"][way]) for way in ways},
        "same": over(lambda row: row["same"]),
    }


def line(label, row):
    cell = lambda values, way, sign="": f"{values[way]:>{sign}8.1f}" if way in values else f"{'-':>8}"
    theirs, difference = row["scikit_learn"], row["difference"]
    cells = cell(theirs, "proba") + cell(theirs, "vote") + cell(difference, "proba", "+") + cell(difference, "vote", "+")
    return f"{label:<30}{row['tactnet']:>8.1f}{cells}{row['same']:>8.1f}"


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", nargs="+", default=["twin"], help="`twin` or .h5 files (default: twin)")
    parser.add_argument("--models", nargs="+", choices=MODELS, default=MODELS, help="only these models")
    parser.add_argument("--folds", nargs="+", type=int, default=[0, 1, 2], help="of five (default 0 1 2)")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "target/release/tactnet", help="our side")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    options.program = options.program.resolve()
    if not options.program.exists():
        sys.exit(f"{options.program} is missing: cargo build --release")

    groups = []
    with tempfile.TemporaryDirectory() as temporary:
        temporary = pathlib.Path(temporary)
        for number, data in enumerate(options.data):
            path = pathlib.Path(data)
            if data == "twin":
                path = temporary / "twin.h5"
                twin = [options.program, "data", "twin", "--out", path]
                subprocess.run(twin, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            sweeps = Sweeps(path)
            for model in options.models:
                rows = []
                for fold in options.folds:
                    if sys.stderr.isatty():
                        print(f"\r\033[K{path.stem} {model} fold {fold}", end="", file=sys.stderr, flush=True)
                    out = temporary / f"{number}-{model}-{fold}"
                    rows.append(compare(options, model, path.stem, path, sweeps, fold, out))
                groups.append({"data": path.stem, "model": model, "mean": means(rows), "folds": rows})
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)

    largest = {}
    for group in groups:
        difference = group["mean"]["difference"]
        # Both nearest-neighbour classifiers predict by votes; for SVC votes are the other method.
        for way, value in difference.items():
            kind = "like_for_like" if way == next(iter(difference)) else "beside_votes"
            largest[kind] = max(largest.get(kind, 0.0), abs(value))
    holds = {kind: value <= CLAIM for kind, value in largest.items()}
    if options.json:
        versions = {name: importlib.metadata.version(name) for name in ["scikit-learn", "numpy", "scipy", "h5py"]}
        document = {
            "largest_mean_difference": largest,
            "within_points": CLAIM,
            "holds": holds,
            "comparisons": groups,
            "commit": subprocess.run(
                ["git", "describe", "--always", "--dirty", "--abbrev=12"], cwd=ROOT, capture_output=True, text=True
            ).stdout.strip()
            or "unknown",
            "versions": versions,
        }
        print(json.dumps(document, indent=2))
    else:
        print(f"{'':<38}{'scikit-learn':>16}{'difference':>16}")
        print(f"{'accuracy, percent':<30}{'tactnet':>8}{'proba':>8}{'vote':>8}{'proba':>8}{'vote':>8}{'same':>8}")
        for group in groups:
            name = f"{group['data']} {group['model']}"
            for row in group["folds"]:
                print(line(f"{name} fold {row['fold']}", row))
            print(line(f"{name} mean", group["mean"]))
        names = {"like_for_like": "predicted alike", "beside_votes": "ours beside SVC's votes"}
        for kind, value in largest.items():
            verdict = "holds" if holds[kind] else "does not hold"
            print(f"largest mean difference, {names[kind]}: {value:.2f} points; within {CLAIM:g}: {verdict}")
    sys.exit(0 if holds["like_for_like"] else 1)


main()
