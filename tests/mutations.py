#!/usr/bin/env python3
"""Applies wrong lines one by one to a copy of the sources and demands that the unit tests fail.

    python3 tests/mutations.py                        # all of tests/mutations.toml; goes on where an interrupted run stopped
    python3 tests/mutations.py --only no-l2 --json    # one of them
    python3 tests/mutations.py --random 3             # three, drawn by the commit: what .ci/run does
    python3 tests/mutations.py --cargo='--workspace --features zenoh'    # with what is built already for these arguments
    python3 tests/mutations.py --write                # all, and tests/MUTATIONS.md with the test that caught each

A mutation is caught if a unit test of its crate fails, or, where those pass, one of the whole workspace (`cargo test --lib`). One that
does not compile, or whose line is no longer there, is a mistake in the list. Exit code: 0 if all are caught, 1 if one survives, 2 for a
mistake in the call or in the list.
"""

import argparse
import hashlib
import json
import os
import random
import re
import shlex
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST = ROOT / "tests" / "mutations.toml"
PAGE = ROOT / "tests" / "MUTATIONS.md"
# A test that a mutation keeps from ending has failed.
LIMIT_SECONDS = 900


class Mistake(Exception):
    """Something to correct in the call or in the list."""


def read_list():
    """Returns the mutations; each one's line must stand once in its file."""
    mutations = tomllib.loads(LIST.read_text())["mutation"]
    seen = set()
    for mutation in mutations:
        name = mutation["id"]
        if name in seen:
            raise Mistake(f"{name}: stands twice in {LIST.name}")
        seen.add(name)
        for key in ("find", "replace"):
            mutation[key] = mutation[key].removeprefix("\n")
        found = (ROOT / mutation["file"]).read_text().count(mutation["find"])
        if found != 1:
            raise Mistake(f"{name}: expected its line once in {mutation['file']}, found it {found} times")
    return mutations


def crate_of(file):
    """Returns the package that a source file belongs to."""
    for folder in (ROOT / file).parents:
        manifest = folder / "Cargo.toml"
        if manifest.exists():
            return tomllib.loads(manifest.read_text())["package"]["name"]
    raise Mistake(f"{file} belongs to no package")


def target_folder():
    if "CARGO_TARGET_DIR" in os.environ:
        return Path(os.environ["CARGO_TARGET_DIR"])
    return ROOT / "target"


class Copy:
    """A copy of the sources, beside what cargo builds of it, so that a second mutation compiles one crate."""

    def __init__(self, folder, cargo=()):
        self.folder = folder
        self.cargo = list(cargo)
        names = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True
        ).stdout.decode()
        wanted = {name for name in names.split("\0") if name and (ROOT / name).is_file()}
        for name in wanted:
            source, copy = ROOT / name, folder / name
            if not copy.exists() or copy.read_bytes() != source.read_bytes():
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, copy)
        for path in sorted(folder.rglob("*"), reverse=True):
            if path.is_file() and str(path.relative_to(folder)) not in wanted:
                path.unlink()

    def tests(self, arguments, crate=None):
        """Builds unit tests and runs them, those of `crate` first, up to the first crate that fails.

        Returns 'passed', 'failed' or 'broken', and the first test that failed or what cargo said.
        """
        cargo = ["cargo", "test", "--profile", "ci", "--locked", "--lib", "--no-run", "--message-format", "json-render-diagnostics", *(self.cargo or arguments)]
        environment = {**os.environ, "CARGO_TARGET_DIR": str(target_folder())}
        built = subprocess.run(cargo, cwd=self.folder, env=environment, capture_output=True, text=True)
        if built.returncode != 0:
            return "broken", "\n".join(built.stderr.splitlines()[-30:])
        messages = [json.loads(line) for line in built.stdout.splitlines()]
        tests = [(Path(message["manifest_path"]).parent, message["executable"]) for message in messages if message.get("executable")]
        if not tests:
            raise Mistake(f"no unit tests are built by cargo test {' '.join(self.cargo or arguments)}")
        tests.sort(key=lambda test: tomllib.loads((test[0] / "Cargo.toml").read_text())["package"]["name"] != crate)
        for folder, program in tests:
            try:
                ran = subprocess.run([program], cwd=folder, env=environment, capture_output=True, text=True, timeout=LIMIT_SECONDS)
            except subprocess.TimeoutExpired:
                return "failed", "a test that did not end"
            if ran.returncode != 0:
                failed = re.findall(r"^test (\S+) .*FAILED$", ran.stdout, re.MULTILINE)
                return "failed", failed[0] if failed else "a test process that broke"
        return "passed", ""

    def try_mutation(self, mutation):
        """Returns the name of the test that caught it, or None."""
        path = self.folder / mutation["file"]
        original = path.read_text()
        path.write_text(original.replace(mutation["find"], mutation["replace"]))
        try:
            crate = crate_of(mutation["file"])
            for arguments in ([self.cargo] if self.cargo else (["-p", crate], ["--workspace"])):
                verdict, what = self.tests(arguments, crate)
                if verdict == "broken":
                    raise Mistake(f"{mutation['id']} does not compile:\n{what}")
                if verdict == "failed":
                    return what
            return None
        finally:
            path.write_text(original)


def content_key():
    """Names the sources and the list that results belong to."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout.decode().split("\0")
    digest = hashlib.sha256()
    for name in sorted(name for name in names if name.endswith((".rs", ".lock"))):
        if (ROOT / name).is_file():
            digest.update(name.encode() + (ROOT / name).read_bytes())
    return digest.hexdigest()


def page(results):
    """Returns tests/MUTATIONS.md."""
    caught = sum(result["caught_by"] is not None for result in results)
    lines = [
        "# Mutations",
        "",
        "Wrong lines in what results rest on ([list](mutations.toml)), and the unit test that fails for each. Written by",
        "`python3 tests/mutations.py --write`; `.ci/run` tries three, drawn by the commit.",
        "",
        f"{caught} of {len(results)} are caught.",
        "",
        "| mutation | what is wrong then | in | caught by |",
        "|---|---|---|---|",
    ]
    for result in results:
        by = f"`{result['caught_by']}`" if result["caught_by"] else "**nothing**"
        lines.append(f"| {result['id']} | {result['what']} | `{result['file']}` | {by} |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="ID", help="these mutations")
    parser.add_argument("--random", type=int, metavar="N", help="N of them, drawn by the commit")
    parser.add_argument("--write", action="store_true", help="write tests/MUTATIONS.md")
    parser.add_argument("--unchecked", action="store_true", help="the unit tests of the sources as they are have just passed")
    parser.add_argument("--cargo", default="", metavar="ARGS", help="packages and features, instead of the mutated crate and then the workspace")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    mutations = read_list()
    if arguments.only:
        unknown = set(arguments.only) - {mutation["id"] for mutation in mutations}
        if unknown:
            raise Mistake(f"no such mutation: {', '.join(sorted(unknown))}")
        mutations = [mutation for mutation in mutations if mutation["id"] in arguments.only]
    if arguments.random:
        commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
        mutations = random.Random(commit.strip()).sample(mutations, min(arguments.random, len(mutations)))
    work = target_folder() / "mutations"
    work.mkdir(parents=True, exist_ok=True)
    copy = Copy(work / "sources", shlex.split(arguments.cargo))
    log = work / f"{content_key()[:16]}.jsonl"
    known = {}
    if log.exists():
        for line in log.read_text().splitlines():
            entry = json.loads(line)
            known[entry["id"], entry["find"], entry["replace"]] = entry
    say = lambda text: print(text, file=sys.stderr, flush=True)
    if not arguments.unchecked and not known:
        say("the unit tests of the sources as they are …")
        verdict, what = copy.tests(["--workspace"])
        if verdict != "passed":
            raise Mistake(f"the unit tests fail without any mutation: {what}")
    results = []
    begun = time.monotonic()
    for number, mutation in enumerate(mutations, 1):
        key = mutation["id"], mutation["find"], mutation["replace"]
        if key not in known:
            started = time.monotonic()
            caught_by = copy.try_mutation(mutation)
            known[key] = {**mutation, "caught_by": caught_by, "seconds": round(time.monotonic() - started)}
            with log.open("a") as file:
                file.write(json.dumps(known[key]) + "\n")
        result = known[key]
        results.append(result)
        left = (time.monotonic() - begun) / number * (len(mutations) - number)
        say(f"{number}/{len(mutations)} {result['id']}: {result['caught_by'] or 'SURVIVES'} ({left / 60:.0f} min left)")
    caught = sum(result["caught_by"] is not None for result in results)
    if arguments.write:
        PAGE.write_text(page(results))
    if arguments.json:
        shown = [{key: result[key] for key in ("id", "file", "caught_by")} for result in results]
        print(json.dumps({"mutations": len(results), "caught": caught, "results": shown}, indent=2))
    else:
        print(f"{caught} of {len(results)} mutations caught")
    return 0 if caught == len(results) else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Mistake as mistake:
        print(f"error: {mistake}", file=sys.stderr)
        sys.exit(2)
