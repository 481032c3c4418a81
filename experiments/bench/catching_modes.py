#!/usr/bin/env python3
"""Runs the three objectives of the planners on the same balls of several seeds, and pools their counts.

    python3 experiments/bench/catching_modes.py --tactnet target/release/tactnet --out experiments/results/catching_modes.json

Runs `tactnet catch throw-series` for every seed and objective. A repeated call resumes; runs of another build or number of throws run again.
"""

import argparse
import json
import math
import subprocess
import sys
from pathlib import Path

RUNS = ("soft", "latest", "cool", "two balls")
Z = 1.959963984540054


def wilson(caught, of):
    share, spread = caught / of, Z * math.sqrt(caught * (of - caught) / of + Z * Z / 4)
    middle = caught + Z * Z / 2
    return share, (middle - spread) / (of + Z * Z), (middle + spread) / (of + Z * Z)


def pooled(name, rows):
    total = {key: sum(row[key] for row in rows) for key in ("throws", "in_catch_space", "caught", "stopped")}
    rate, low, high = wilson(total["caught"], total["in_catch_space"])
    everywhere = sum(row["over_all_throws"] * row["throws"] for row in rows) / total["throws"]
    predictions = sum(row["predictions"] for row in rows)

    def mean(key, power):
        return (sum(row[key] ** power * row["predictions"] for row in rows) / predictions) ** (1 / power)

    errors = {key: mean(key, 2) for key in ("across_mm_rms_200ms", "along_ms_rms_200ms")}
    errors |= {key: mean(key, 1) for key in ("far_off_200ms", "nees_200ms")}
    interval = {"rate": rate, "ci95_low": low, "ci95_high": high}
    return {"name": name, **total, **interval, "over_all_throws": everywhere, "predictions": predictions, **errors}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tactnet", required=True, help="the program")
    parser.add_argument("--throws", type=int, default=100, help="throws of each run (default 100)")
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds, from 11 on (default 10)")
    parser.add_argument("--out", required=True, type=Path, help="JSON file of the results")
    arguments = parser.parse_args()
    build = json.loads(subprocess.run([arguments.tactnet, "version", "--json"], check=True, capture_output=True, text=True).stdout)["git"]
    kept = json.loads(arguments.out.read_text()) if arguments.out.exists() else {}
    if kept.get("commit") != build or kept.get("throws") != arguments.throws:
        kept = {"rows": []}
    rows = {(row["name"], row["seed"]): row for row in kept["rows"]}
    for seed in range(11, 11 + arguments.seeds):
        for name in RUNS:
            if (name, seed) in rows:
                continue
            options = ["--balls", "2"] if name == "two balls" else ["--mode", name]
            command = ["catch", "throw-series", "--throws", str(arguments.throws), "--seed", str(seed), *options]
            result = subprocess.run([arguments.tactnet, *command, "--json"], stdout=subprocess.PIPE, text=True)
            if result.returncode:
                sys.exit(f"`tactnet {' '.join(command)}` failed")
            rows[name, seed] = {"name": name, "command": " ".join(["tactnet", *command]), **json.loads(result.stdout)}
            every = list(rows.values())
            pools = [pooled(one, [row for row in every if row["name"] == one]) for one in RUNS if any(row["name"] == one for row in every)]
            written = {"commit": build, "throws": arguments.throws, "pooled": pools, "rows": every}
            arguments.out.write_text(json.dumps(written, indent=1) + "\n")
            print(f"seed {seed}, {name}: {rows[name, seed]['caught']} of {rows[name, seed]['in_catch_space']}", file=sys.stderr)


if __name__ == "__main__":
    main()
