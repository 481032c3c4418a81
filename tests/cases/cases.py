#!/usr/bin/env python3
"""Other people's data: generates files with every known fault and sound ones, and compares what tactnet says with what it should say.

Called by `run.sh`. Prints a table of the cases that are wrong, or with --json one object: `cases`, `right`, `wrong` (name, expectation with
what was found, seed), `by_item`, `seconds`.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import re
import shutil
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

import contents
import controls
import cutting
import dialects
import formats
import recordings
import stamps
import tables
import values
from expectations import Case, Trial
from signals import seed_of

CHAPTERS = (stamps, cutting, values, contents, dialects, formats, tables, recordings, controls)
#: Processes that run cases.
PROCESSES = 2
#: Widest text of the table, in characters.
WIDTH = 400

CASES: list[Case] = []


def selected(only: str, without: list[str]) -> list[Case]:
    """Returns the cases whose names match, sorted by item."""
    cases = [case for chapter in CHAPTERS for case in chapter.cases()]
    names = [case.name for case in cases]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise SystemExit(f"error: names of several cases: {', '.join(sorted(twice))}")
    cases = [case for case in cases if re.search(only, case.name) and case.format not in without]
    return sorted(cases, key=lambda case: case.item)


def run_case(task: tuple[int, str, str]) -> dict[str, Any]:
    """Writes the files of a case and returns its result; `fault` is null if all is as expected."""
    index, tactnet, parent = task
    case = CASES[index]
    folder = Path(parent) / re.sub(r"[^A-Za-z0-9.]+", "-", case.name)
    folder.mkdir()
    start = time.monotonic()
    try:
        made = case.make(folder)
        trial = Trial(tactnet, folder, made.path, made.options)
        faults = [fault for fault in (expectation.fault(trial) for expectation in made.expect) if fault]
        panicked = "panicked" in trial.check().err
        fault = "panicked: " + trial.check().err[:300] if panicked else " | ".join(faults)
    except Exception:
        fault = "the case failed: " + traceback.format_exc(limit=-3)
    return {"name": case.name, "item": case.item, "fault": fault or None, "seed": seed_of(case.name), "seconds": time.monotonic() - start}


def report(results: list[dict[str, Any]], seconds: float) -> dict[str, Any]:
    """Returns the summary of all results."""
    wrong = [{"name": of["name"], "seed": of["seed"], "found": of["fault"]} for of in results if of["fault"]]
    items = sorted({of["item"] for of in results})
    by_item = {
        ("sound" if item == 0 else str(item)): {
            "cases": sum(of["item"] == item for of in results),
            "right": sum(of["item"] == item and not of["fault"] for of in results),
        }
        for item in items
    }
    return {
        "schema_version": 1,
        "cases": len(results),
        "right": len(results) - len(wrong),
        "wrong": wrong,
        "by_item": by_item,
        "seconds": round(seconds, 1),
    }


def print_table(found: dict[str, Any]) -> None:
    print(f"{'item':>6} {'cases':>6} {'right':>6}")
    for item, counts in found["by_item"].items():
        print(f"{item:>6} {counts['cases']:>6} {counts['right']:>6}")
    print(f"{'all':>6} {found['cases']:>6} {found['right']:>6}   in {found['seconds']} s")
    for wrong in found["wrong"]:
        text = wrong["found"]
        print(f"\nwrong: {wrong['name']}\n  {text[:WIDTH]}{' ...' if len(text) > WIDTH else ''}")


def main() -> int:
    parser = argparse.ArgumentParser(description="Compares what tactnet says about files with known faults with what it should say.")
    parser.add_argument("--tactnet", required=True, metavar="PROGRAM")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--only", default="", metavar="PATTERN", help="run the cases whose name matches this regular expression")
    parser.add_argument("--without", default="", metavar="FORMAT,...", help="leave out formats that the program was built without")
    parser.add_argument("--keep", metavar="FOLDER", help="keep the files in this folder")
    parser.add_argument("--list", action="store_true", help="print the names of the cases")
    arguments = parser.parse_args()
    CASES.extend(selected(arguments.only, [name for name in arguments.without.split(",") if name]))
    if arguments.list:
        print("\n".join(case.name for case in CASES))
        return 0
    if not CASES:
        print(f"error: no case matches `{arguments.only}`", file=sys.stderr)
        return 2
    start = time.monotonic()
    if arguments.keep:
        parent = Path(arguments.keep)
        if parent.exists() and any(parent.iterdir()):
            print(f"error: {parent}: expected a new or an empty folder", file=sys.stderr)
            return 2
        parent.mkdir(parents=True, exist_ok=True)
    else:
        parent = Path(tempfile.mkdtemp(prefix="tactnet-cases-"))
    try:
        tasks = [(index, arguments.tactnet, str(parent)) for index in range(len(CASES))]
        with multiprocessing.get_context("fork").Pool(PROCESSES) as pool:
            results = pool.map(run_case, tasks, chunksize=1)
    finally:
        if not arguments.keep:
            shutil.rmtree(parent, ignore_errors=True)
    found = report(results, time.monotonic() - start)
    if arguments.json:
        print(json.dumps(found, indent=2))
    else:
        print_table(found)
    return 1 if found["wrong"] else 0


if __name__ == "__main__":
    sys.exit(main())
