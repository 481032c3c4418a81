#!/usr/bin/env python3
"""Counts the crates of others, checks where they are from and under which licences, and which of our own know each other.

    python3 tests/check_dependencies.py          prints the counts beside their budgets
    python3 tests/check_dependencies.py --json

What `cargo deny check licenses bans sources` checks by deny.toml is checked here as well, so that it is checked where cargo-deny is not
installed; the budgets are checked here alone. A budget is raised with a reason in the commit.
"""

import argparse
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Crates of others in a build, and versions of crates beside a first one.
BUDGETS = {"crates": 380, "crates with all of CI's features": 820, "second versions": 70}
# Crates that must know nothing of others: what judges knows nothing of what is judged, and what acts cannot see the truth.
STRANGERS = {
    "tactnet-catching-world": ["tactnet-catching", "tactnet-catching-roles"],
    "tactnet-catching": ["tactnet-catching-world", "tactnet-catching-trials", "tactnet-catching-stage"],
    "tactnet-catching-roles": ["tactnet-catching-world", "tactnet-catching-trials", "tactnet-catching-stage"],
}
REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"


def cargo(*arguments):
    return subprocess.run(["cargo", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def crates(*features):
    """Returns name and version of the crates of others in a build of the program."""
    lines = cargo("tree", "--locked", "--edges", "normal", "--prefix", "none", "--format", "{p}", *features).splitlines()
    return {tuple(line.split()[:2]) for line in lines if line and "(/" not in line}


def allowed(expression, licences):
    """Returns true if the licences of an SPDX expression, or one of its alternatives, are allowed."""
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
            wrong.append(f"{name}: is from {package['source']}, not from crates.io")
        if name in banned:
            wrong.append(f"{name}: is not wanted, since {banned[name]}")
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
