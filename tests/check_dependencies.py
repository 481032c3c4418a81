#!/usr/bin/env python3
"""Counts external crates, checks their sources and licences, and checks the dependencies between workspace crates.

    python3 tests/check_dependencies.py          prints the counts and their budgets
    python3 tests/check_dependencies.py --json

This repeats the checks of `cargo deny check licenses bans sources` with deny.toml, for machines without cargo-deny. Only this script checks the
budgets. A commit that raises a budget gives the reason.
"""

import argparse
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# External crates of the default build and of the full build, and additional versions of the same crate.
BUDGETS = {"crates": 346, "crates with all of CI's features": 807, "second versions": 62}
# Forbidden dependencies: the simulated world and the catching stack must not know each other, so that the stack cannot
# see the ground truth.
STRANGERS = {
    "tactnet-catching-world": ["tactnet-catching", "tactnet-catching-roles"],
    "tactnet-catching": ["tactnet-catching-world", "tactnet-catching-trials", "tactnet-catching-stage"],
    "tactnet-catching-roles": ["tactnet-catching-world", "tactnet-catching-trials", "tactnet-catching-stage"],
}
REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"


def cargo(*arguments):
    return subprocess.run(["cargo", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def crates(*features):
    """Returns name and version of the external crates in a build of the program."""
    lines = cargo("tree", "--locked", "--edges", "normal", "--prefix", "none", "--format", "{p}", *features).splitlines()
    return {tuple(line.split()[:2]) for line in lines if line and "(/" not in line}


def allowed(expression, licences):
    """Returns true if the licences of an SPDX expression, or of one of its alternatives, are allowed."""
    tokens = re.findall(r"\(|\)|AND|OR|/|[^\s()/]+(?: WITH [^\s()/]+)?", expression)

    def either():
        found = both()
        while tokens and tokens[0] in ("OR", "/"):
            tokens.pop(0)
            found = both() or found
        return found

    def both():
        found = one()
        while tokens and tokens[0] == "AND":
            tokens.pop(0)
            found = one() and found
        return found

    def one():
        token = tokens.pop(0)
        if token == "(":
            found = either()
            tokens.pop(0)
            return found
        return token in licences

    return either()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    deny = tomllib.loads((ROOT / "deny.toml").read_text())
    features = ["--features", ",".join(deny["graph"]["features"])]
    full = crates(*features)
    names = [name for name, _ in full]
    counts = {"crates": len(crates()), "crates with all of CI's features": len(full), "second versions": len(names) - len(set(names))}
    wrong = [f"{counted}: {count}, at most {BUDGETS[counted]} are allowed" for counted, count in counts.items() if count > BUDGETS[counted]]
    packages = json.loads(cargo("metadata", "--locked", "--format-version", "1", *features))["packages"]
    for crate, strangers in STRANGERS.items():
        known = {line.split()[0] for line in cargo("tree", "--locked", "--edges", "normal", "--prefix", "none", "--package", crate).splitlines() if line}
        wrong += [f"{crate}: depends on {stranger}" for stranger in strangers if stranger in known]
    banned = {crate["name"]: crate["reason"] for crate in deny["bans"]["deny"]}
    for package in packages:
        name, version = package["name"], f"v{package['version']}"
        if (name, version) not in full:
            continue
        if package["source"] != REGISTRY:
            wrong.append(f"{name}: source {package['source']}, expected crates.io")
        if name in banned:
            wrong.append(f"{name}: banned: {banned[name]}")
        licence = package["license"]
        if licence is None or not allowed(licence, deny["licenses"]["allow"]):
            wrong.append(f"{name}: licence {licence} is not allowed in deny.toml")
    if arguments.json:
        print(json.dumps({"schema_version": 1, "counts": counts, "budgets": BUDGETS, "wrong": wrong}, indent=2))
    else:
        for counted, count in counts.items():
            print(f"{count} {counted} (budget {BUDGETS[counted]})")
    for line in wrong:
        print(f"error: {line}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
