#!/usr/bin/env python3
"""Runs throw series of the catching stack: the complete stack, ablations, and negative controls.

    python experiments/bench/catching_series.py --tactnet target/release/tactnet --out experiments/results/catching_series.json
    python experiments/bench/catching_series.py --tactnet target/release/tactnet --fingers --out experiments/results/catching_caged.json
    python experiments/bench/catching_series.py --tactnet target/release/tactnet --pixels --out experiments/results/catching_pixels.json

`--fingers` compares the judge with simulated fingers (three modes, lead of the fingers, assumed values) instead; `--pixels` runs three seeds
from rendered pictures and pools them. Runs `tactnet catch throw-series` once for each row and keeps its JSON with its options. A repeated call resumes; rows of another build run
again. Takes about 20 minutes on two cores; `--throws N` shortens it. Prints the table of the results page.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from catching_modes import pooled

# Name, options, settings of the world, share of the throws.
ROWS = [
    ("whole stack", [], {}, 1),
    ("whole stack, seed 2", ["--seed", "2"], {}, 1),
    ("two balls", ["--balls", "2"], {}, 2),
    ("two balls, seed 2", ["--balls", "2", "--seed", "2"], {}, 2),
    ("delays of the thesis, 152 ms", ["--timing", "thesis"], {}, 1),
    ("head and balls known", ["--perfect-perception"], {}, 1),
    ("calibration off by 3 mm, 2 mm, 2 mrad", [], {"errors": {"arm_mount": 0.003, "camera_mount": 0.002, "camera_turn": 0.002}}, 1),
    ("without the inertial unit", ["--without", "imu"], {}, 0.5),
    ("without the inertial unit, arms alone", ["--without", "imu", "--without", "lower-body"], {}, 0.5),
    ("without drag", ["--without", "drag"], {}, 0.5),
    ("without re-planning", ["--without", "replan"], {}, 0.5),
    ("without near misses", ["--without", "near-miss"], {}, 1),
    ("without the lower body", ["--without", "lower-body"], {}, 1),
    ("hands close 30 ms late", ["--closing-error", "30"], {}, 0.2),
]

PIXELS = [(f"from pictures, seed {seed}", ["--pixels", "--seed", str(seed)], {}, 0.1) for seed in (1, 2, 3)]

FINGERS = [
    ("soft", ["--mode", "soft"], {}, 1),
    ("latest", ["--mode", "latest"], {}, 1),
    ("cool", ["--mode", "cool"], {}, 1),
    ("two balls", ["--balls", "2"], {}, 0.5),
    ("hands close 10 ms late", ["--closing-error", "10"], {}, 0.2),
    ("hands close 30 ms late", ["--closing-error", "30"], {}, 0.2),
    ("hands close 30 ms early", ["--closing-error", "-30"], {}, 0.2),
    *((f"fingers start {lead} ms before the catch", [], {"fingers": {"lead": lead / 1000}}, 0.2) for lead in (-10, 0, 5, 15, 20, 30)),
    ("restitution 0.5", [], {"fingers": {"restitution": 0.5}}, 0.2),
    ("restitution 0.85", [], {"fingers": {"restitution": 0.85}}, 0.2),
    ("friction 0.1", [], {"fingers": {"friction": 0.1}}, 0.2),
    ("friction 1", [], {"fingers": {"friction": 1.0}}, 0.2),
    ("moved mass of a finger 100 g", [], {"fingers": {"mass": 0.1}}, 0.2),
    ("tips in the plane of the catch frame", [], {"fingers": {"height": 0.0}}, 0.2),
]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tactnet", required=True, help="the program")
    parser.add_argument("--throws", type=int, default=1000, help="throws of a whole row (default 1000)")
    parser.add_argument("--fingers", action="store_true", help="compare the judge with simulated fingers")
    parser.add_argument("--pixels", action="store_true", help="three seeds from rendered pictures")
    parser.add_argument("--only", metavar="TEXT", default="", help="only rows whose name contains TEXT")
    parser.add_argument("--out", required=True, type=Path, help="JSON file of the results")
    arguments = parser.parse_args()
    build = json.loads(subprocess.run([arguments.tactnet, "version", "--json"], check=True, capture_output=True, text=True).stdout)
    kept = json.loads(arguments.out.read_text()) if arguments.out.exists() else {"rows": []}
    if kept.get("commit") != build["git"] or kept.get("throws") != arguments.throws:
        kept = {"rows": []}
    done = {row["name"]: row for row in kept["rows"]}
    all_rows = FINGERS if arguments.fingers else PIXELS if arguments.pixels else ROWS
    all_rows = [row for row in all_rows if arguments.only in row[0]]
    for number, (name, options, world, share) in enumerate(all_rows):
        if name in done:
            continue
        command = ["catch", "throw-series", "--throws", str(max(1, round(share * arguments.throws))), *options]
        begun = time.monotonic()
        with tempfile.NamedTemporaryFile("w", suffix=".json") as settings:
            given = list(command)
            if world:
                json.dump(world, settings)
                settings.flush()
                given += ["--world", settings.name]
            result = subprocess.run([arguments.tactnet, *given, "--json"], stdout=subprocess.PIPE, text=True)
        if result.returncode:
            sys.exit(f"{name}: `tactnet {' '.join(command)}` failed")
        done[name] = {"name": name, "command": " ".join(["tactnet", *command]), "world": world, **json.loads(result.stdout)}
        rows = [done[other] for other, *_ in all_rows if other in done]
        found = {"commit": build["git"], "throws": arguments.throws, "rows": rows}
        if arguments.pixels:
            found["pooled"] = pooled("from pictures", rows)
        arguments.out.write_text(json.dumps(found, indent=1) + "\n")
        print(f"{number + 1} of {len(all_rows)}: {name}, {time.monotonic() - begun:.0f} s", file=sys.stderr)
    if arguments.fingers:
        return print_fingers([done[name] for name, *_ in all_rows])
    print("| | in the catch space | caught [%] | of all throws [%] | across, along, 200 ms before | NEES | misses |\n|---|---|---|---|---|---|---|")
    for name, *_ in all_rows:
        row = done[name]
        ahead = "-" if row["across_mm_rms_200ms"] is None else f"{row['across_mm_rms_200ms']:.1f} mm, {row['along_ms_rms_200ms']:.2f} ms"
        nees = "-" if row["nees_200ms"] is None else f"{row['nees_200ms']:.2f}"
        misses = ", ".join(f"{cause} {count}" for cause, count in row["misses"].items()) or "-"
        print(
            f"| {name} | {row['in_catch_space']} of {row['throws']} | {100 * row['rate']:.1f} [{100 * row['ci95_low']:.1f}, {100 * row['ci95_high']:.1f}]"
            f" | {100 * row['over_all_throws']:.1f} | {ahead} | {nees} | {misses} |"
        )


def print_fingers(rows):
    print("| | throws | caught [%] | caged [%] | of the catch space: caught, caged [%] | only caught | only caged |\n|---|---|---|---|---|---|---|")
    for row in rows:
        caged = row["fingers"]
        numbers = [row["over_all_throws"], *caged["caught_over_all_ci95"], caged["over_all_throws"], *caged["over_all_ci95"], row["rate"], caged["rate"]]
        shares = "{:.1f} [{:.1f}, {:.1f}] | {:.1f} [{:.1f}, {:.1f}] | {:.1f}, {:.1f}".format(*(100 * number for number in numbers))
        print(f"| {row['name']} | {row['throws']} | {shares} | {caged['caught_not_caged']} | {caged['caged_not_caught']} |")


if __name__ == "__main__":
    main()
