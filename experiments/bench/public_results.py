#!/usr/bin/env python3
"""Condenses the JSON document of the public benchmark to experiments/results/public.json: accuracies, intervals, ranks and times.

    tactnet experiment run public --set data=DIR --axes-are-right --json > report.json
    python experiments/bench/public_results.py report.json [--name walk_accel4=walking] > experiments/results/public.json
"""

import argparse
import json

COMMAND = "tactnet experiment run public --set data=DIR --axes-are-right"
OF_SET = ["data", "materials", "sweeps", "steps"]
OF_REPORT = ["git", "seed", "tasks", "processors"]


def rounded(value):
    """Returns the value with its numbers rounded to five decimals."""
    if isinstance(value, dict):
        return {key: rounded(of) for key, of in value.items()}
    if isinstance(value, list):
        return [rounded(of) for of in value]
    return round(value, 5) if isinstance(value, float) else value


def condensed(report, names, command):
    """Returns one row per condition, set and model, one mean per condition and model, and the default model.

    - `names`: names of sets to replace
    """
    means, rows = [], []
    for condition in report["benchmark"]["conditions"]:
        here = {"condition": condition["condition"]}
        means += [here | model for model in condition["models"]]
        for one in condition["sets"]:
            about = {key: one[key] for key in OF_SET} | {"data": names.get(one["data"], one["data"])}
            rows += [here | about | model for model in one["models"]]
    about = {"schema_version": 1, "command": command} | {key: report[key] for key in OF_REPORT}
    return rounded(about | {"default": report["benchmark"]["default"], "means": means, "rows": rows})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", help="document of `tactnet experiment run public --json`")
    parser.add_argument("--name", metavar="FILE=NAME", action="append", default=[], help="name for a set, instead of its file's name")
    parser.add_argument("--command", default=COMMAND, help="command of the report (default: that of the public benchmark)")
    options = parser.parse_args()
    with open(options.report) as file:
        report = json.load(file)
    names = dict(name.split("=") for name in options.name)
    print(json.dumps(condensed(report, names, options.command), indent=1))


main()
