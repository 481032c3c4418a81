#!/usr/bin/env python3
"""Runs the experiments of chapter 3 other than catching: calibration, throws, rallies, catches among obstacles.

    python experiments/bench/catching_chapter.py --tactnet target/release/tactnet --out experiments/results/catching_chapter.json

Runs each command once and keeps its JSON. A repeated call resumes; rows of another build run again. Takes about half an hour on two cores,
mostly for the obstacles. `--detected` runs the calibrations alone, each with features from truth plus noise and from rendered pictures.
"""

import argparse
import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROWS = [
    *[f"catch calibrate --simulate --seed {seed} --throws 100" for seed in range(1, 9)],
    "bench catch-throw --throws 20 --seed 1",
    "bench catch-throw --throws 20 --seed 1 --wheels 0.36",
    "catch rally --rallies 8 --most 50 --seed 2",
    "catch rally --rallies 4 --most 6 --distance 7.5 --wheels 0.31 --seed 1",
    *[f"catch throw-series --obstacles --throws 125 --seed {seed}" for seed in range(1, 5)],
    # Timed alone, without other load.
    "catch throw-series --obstacles --throws 60 --seed 5",
]

DETECTED = [f"catch calibrate --simulate --seed {seed} --throws 0{pixels}" for seed in range(1, 9) for pixels in ("", " --pixels")]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tactnet", required=True, help="the program")
    parser.add_argument("--out", required=True, type=Path, help="JSON file of the results")
    parser.add_argument("--detected", action="store_true", help="calibrations with features from pictures instead")
    arguments = parser.parse_args()
    begun = time.monotonic()
    commands = DETECTED if arguments.detected else ROWS
    build = json.loads(subprocess.run([arguments.tactnet, "version", "--json"], check=True, capture_output=True, text=True).stdout)
    kept = json.loads(arguments.out.read_text()) if arguments.out.exists() else {}
    done = {row["command"]: row for row in kept.get("rows", [])} if kept.get("commit") == build["git"] else {}

    todo = [row for row in commands if f"tactnet {row}" not in done]

    def run(row):
        return subprocess.run([arguments.tactnet, *row.split(), "--json"], capture_output=True, text=True)

    # A calibration from pictures keeps one core busy.
    with ThreadPoolExecutor(2 if arguments.detected else 1) as pool:
        for row, result in zip(todo, pool.map(run, todo)):
            said = result.stderr.strip().splitlines()[-1:]
            # A calibration that is refused is a result.
            if result.returncode and not arguments.detected:
                sys.exit(f"`tactnet {row}` failed: {said}")
            report = {"refused": said[0]} if result.returncode else json.loads(result.stdout)
            done[f"tactnet {row}"] = {"command": f"tactnet {row}", **report}
            rows = [done[f"tactnet {other}"] for other in commands if f"tactnet {other}" in done]
            arguments.out.write_text(json.dumps({"commit": build["git"], "rows": rows}, indent=1) + "\n")
            print(f"{len(done)} of {len(commands)}: {row}, {time.monotonic() - begun:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
