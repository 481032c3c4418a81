#!/usr/bin/env python3
"""Trains the first fold of the twin alternately in Python and on the command line, and prints accuracies and times.

    TACTNET=target/release/tactnet python bindings/python/tests/same_as_command_line.py [--rounds 3] [--materials 36] [--sweeps 100]

Times are of `fit`, copies of the arrays included, and of the command line's training steps alone (`train_seconds`). Prints one JSON.
"""

import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import tactnet


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--materials", type=int, default=36)
    parser.add_argument("--sweeps", type=int, default=100)
    arguments = parser.parse_args()
    program = os.environ.get("TACTNET", "tactnet")
    twin = tactnet.Dataset.twin(materials=arguments.materials, sweeps=arguments.sweeps)
    found = {"python": [], "command line": []}
    with tempfile.TemporaryDirectory() as work:
        file = Path(work) / "twin.npz"
        np.savez_compressed(file, X=twin.X, y=twin.y, sample_rate_hz=twin.rate)
        data = tactnet.Dataset.read(file)
        X, y = data.X, data.y
        train, test = data.folds()[0]
        for turn in range(arguments.rounds):
            begun = time.monotonic()
            classifier = tactnet.TactNetClassifier(rate=data.rate).fit(X[train], y[train])
            found["python"].append((time.monotonic() - begun, classifier.score(X[test], y[test])))
            run = Path(work) / f"run{turn}"
            subprocess.run([program, "train", "--recipe", "fast", "--data", file, "--out", run], check=True, capture_output=True)
            result = json.loads((run / "result.json").read_text())
            found["command line"].append((result["train_seconds"], result["accuracy_one_sweep"]["mean"]))
    seconds = {side: statistics.median(time for time, _ in turns) for side, turns in found.items()}
    accuracies = {side: turns[0][1] for side, turns in found.items()}
    print(json.dumps({"seconds": seconds, "ratio": seconds["python"] / seconds["command line"], "accuracies": accuracies}))


if __name__ == "__main__":
    main()
