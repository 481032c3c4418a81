#!/usr/bin/env python3
"""Measures what a known speed and force are worth to a network, on made sweeps.

    python experiments/bench/conditions.py --tactnet target/release/tactnet [--seeds 1 2] [--recipe fast spectra] [--json OUT]

Eight materials: four spatial frequencies (10 to 34 periods per second at the usual speed, a factor of 1.5 apart) at two levels (60 and 90
digits at the usual force). Every sweep has a speed and a force of its own, log-uniform between 2/3 and 3/2 of the usual ones: frequencies
scale with the speed, level and texture with the force. Half of a neighbour's sweeps are therefore ambiguous without the speed, and half
without the force. Training sweeps are 40 per material, test sweeps 100 per material.

Prediction, written before the first measurement: trained without conditions 35 to 60 % (perfect use of the sweep alone would give 0.625 x
0.75 = 47 %, and level and texture give the force away in part); trained with them and known at prediction at least 25 points more; trained
with them and unknown at prediction within 8 points of the network trained without. `regress` recovers neither fully: R^2 of 0.2 to 0.8.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile

import numpy as np

RATE, STEPS, TAXELS = 200.0, 200, 4
FREQUENCIES = 10.0 * 1.5 ** np.arange(4)
LEVELS = (60.0, 90.0)
USUAL_SPEED, USUAL_FORCE = 30.0, 2.0


def sweeps(each, rng):
    """Returns sweeps `[n][steps][taxels]`, names, speeds in mm/s and forces in N."""
    time = np.arange(STEPS) / RATE
    x, names, speeds, forces = [], [], [], []
    for frequency in range(len(FREQUENCIES)):
        for level in range(len(LEVELS)):
            for _ in range(each):
                speed, force = np.exp(rng.uniform(-np.log(1.5), np.log(1.5), 2))
                phase = rng.uniform(0, 2 * np.pi, TAXELS)
                texture = np.sin(2 * np.pi * FREQUENCIES[frequency] * speed * time[:, None] + phase)
                sweep = LEVELS[level] * force * (1 + 0.1 * texture) + rng.normal(0, 2.0, (STEPS, TAXELS))
                x.append(sweep)
                names.append(f"f{frequency}l{level}")
                speeds.append(USUAL_SPEED * speed)
                forces.append(USUAL_FORCE * force)
    return np.float32(x), np.array(names), np.float32(speeds), np.float32(forces)


def save(path, data, known):
    x, names, speeds, forces = data
    conditions = {"speed [mm/s]": speeds, "force [N]": forces} if known else {}
    np.savez(path, X=x, y=names, sample_rate_hz=RATE, **conditions)


def run(tactnet, *arguments):
    done = subprocess.run([tactnet, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{arguments}: {done.stderr}")
    return done.stdout


def accuracy(tactnet, run_dir, file):
    """Returns the accuracy of a run on all sweeps of a file, without dropout."""
    found = json.loads(run(tactnet, "predict", run_dir, "--data", file, "--mc", 0, "--json"))
    return float(np.mean([sweep["material"] == sweep["named"] for sweep in found["sweeps"]]))


def measured(tactnet, recipe, seed, folder):
    rng = np.random.default_rng(seed)
    train, test = sweeps(40, rng), sweeps(100, rng)
    files = {}
    for part, data in [("train", train), ("test", test)]:
        for known in (False, True):
            files[part, known] = folder / f"{part}-{'known' if known else 'bare'}.npz"
            save(files[part, known], data, known)
    runs = {}
    for known in (False, True):
        runs[known] = folder / f"run-{recipe}-{seed}-{known}"
        run(tactnet, "train", "--data", files["train", known], "--recipe", recipe, "--seed", seed, "--split", "hold-out", "--out", runs[known])
    return {
        "trained without": accuracy(tactnet, runs[False], files["test", False]),
        "trained with, known": accuracy(tactnet, runs[True], files["test", True]),
        "trained with, unknown": accuracy(tactnet, runs[True], files["test", False]),
    }, json.loads(run(tactnet, "regress", "--data", files["test", True], "--seed", seed, "--json"))["conditions"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tactnet", required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--recipe", nargs="+", default=["fast", "spectra"])
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    version = run(arguments.tactnet, "version").splitlines()[0]
    prediction = __doc__.split("Prediction, written before the first measurement: ")[1].replace("\n", " ").strip()
    result = {"command": "python experiments/bench/conditions.py", "version": version, "prediction": prediction, "accuracy": [], "regress": []}
    with tempfile.TemporaryDirectory() as folder:
        for recipe in arguments.recipe:
            for seed in arguments.seeds:
                found, recovered = measured(arguments.tactnet, recipe, seed, pathlib.Path(folder))
                result["accuracy"].append({"recipe": recipe, "seed": seed, "test_sweeps": 800, **found})
                print(recipe, seed, found, flush=True)
                if recipe == arguments.recipe[0]:
                    result["regress"].append({"seed": seed, "conditions": recovered})
                    print([(of["quantity"], of["r2"], of["rmse"]) for of in recovered], flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
