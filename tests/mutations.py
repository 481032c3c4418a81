#!/usr/bin/env python3
"""Applies mutations one by one to a copy of the sources and checks that the unit tests fail.

    python3 tests/mutations.py                        # all of tests/mutations.toml; resumes an interrupted run
    python3 tests/mutations.py --only no-l2 --json    # one mutation
    python3 tests/mutations.py --random 3             # three, selected by the commit, as in .ci/run
    python3 tests/mutations.py --cargo='--workspace --features zenoh'    # with the build of these arguments
    python3 tests/mutations.py --write                # all, and tests/mutations_caught.json, the test that caught each

A mutation is caught if a unit test of its crate fails, or else a unit test of the workspace (`cargo test --lib`). The test named in
tests/mutations_caught.json runs first. Only the unit tests of the mutated crate are compiled, not its dependents. A mutation that does not compile, or whose
line is missing, is an error in the list. Exit code: 0 if all are caught, 1 if one survives, 2 for an error in the call or in the list.
"""

import argparse
import atexit
import hashlib
import json
import os
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST = ROOT / "tests" / "mutations.toml"
CAUGHT = ROOT / "tests" / "mutations_caught.json"
# A test that does not end because of a mutation counts as failed.
LIMIT_SECONDS = 900
# Wrapper of the compiler: compiles the unit tests of one crate and their dependencies. Cargo would compile all
# dependents of the crate first; such calls wait here until cargo is ended, or end when a compilation fails.
ONLY_THE_TESTS = """#!/bin/sh
crate= test= before=
for word; do
  [ "$before" = --crate-name ] && crate=$word
  [ "$word" = --test ] && test=1
  before=$word
done
case $crate in tactnet* | _tactnet) ;; *) exec "$@" ;; esac
wanted=
if [ "$crate" = "$TESTED_CRATE" ]; then
  wanted=$test
else
  case " $NEEDED_CRATES " in *" $crate "*) [ -n "$test" ] || wanted=1 ;; esac
fi
if [ -n "$wanted" ]; then
  "$@" && exit
  touch "$BROKEN_BUILD"
  exit 1
fi
while kill -0 $PPID && kill -0 "$RUNNER" && [ ! -e "$BROKEN_BUILD" ]; do sleep 0.2; done 2>/dev/null
exit 1
"""


class Mistake(Exception):
    """Error in the call or in the list."""


def read_list():
    """Returns the mutations; each one's line must occur once in its file."""
    mutations = tomllib.loads(LIST.read_text())["mutation"]
    seen = set()
    for mutation in mutations:
        name = mutation["id"]
        if name in seen:
            raise Mistake(f"{name}: occurs twice in {LIST.name}")
        seen.add(name)
        for key in ("find", "replace"):
            mutation[key] = mutation[key].removeprefix("\n")
        found = (ROOT / mutation["file"]).read_text().count(mutation["find"])
        if found != 1:
            raise Mistake(f"{name}: expected its line once in {mutation['file']}, found it {found} times")
    return mutations


def package(folder):
    """Returns the name of the package in a folder."""
    return tomllib.loads((folder / "Cargo.toml").read_text())["package"]["name"]


def crate_of(file):
    """Returns the package of a source file."""
    for folder in (ROOT / file).parents:
        manifest = folder / "Cargo.toml"
        if manifest.exists():
            return package(manifest.parent)
    raise Mistake(f"{file}: not part of a package")


def library(package):
    """Returns the name of a package's library in rustc."""
    kinds = {"lib", "rlib", "cdylib", "staticlib", "proc-macro"}
    return next(target["name"] for target in package["targets"] if kinds & set(target["kind"]))


def needed_crates(crate):
    """Returns the package's library in rustc, and the libraries of the workspace packages it depends on, by package."""
    call = ["cargo", "metadata", "--no-deps", "--format-version", "1"]
    packages = json.loads(subprocess.run(call, cwd=ROOT, check=True, capture_output=True, text=True).stdout)["packages"]
    packages = {each["name"]: each for each in packages}
    found, left = set(), [crate]
    while left:
        for dependency in packages[left.pop()]["dependencies"]:
            if dependency.get("path") and dependency["name"] not in found:
                found.add(dependency["name"])
                left.append(dependency["name"])
    return library(packages[crate]), {name: library(packages[name]) for name in sorted(found)}


def known_tests():
    """Returns the test that caught each mutation when tests/mutations_caught.json was written."""
    return {mutation: test for mutation, test in json.loads(CAUGHT.read_text()).items() if test}


def package_of(fingerprint):
    """Returns the package of a fingerprint folder: `tactnet-data` for `tactnet-data-0a1b2c3d4e5f6789`."""
    return fingerprint.name.rpartition("-")[0]


def fingerprints():
    """Returns cargo's fingerprint folders of the workspace packages."""
    return (target_folder() / "release" / ".fingerprint").glob("tactnet*")


def target_folder():
    if "CARGO_TARGET_DIR" in os.environ:
        return Path(os.environ["CARGO_TARGET_DIR"])
    return ROOT / "target"


def forget_since(begun):
    """Deletes cargo's fingerprints of workspace packages that were built since then, so that cargo builds them again."""
    for fingerprint in fingerprints():
        if fingerprint.stat().st_mtime >= begun or any(file.stat().st_mtime >= begun for file in fingerprint.iterdir()):
            shutil.rmtree(fingerprint)


def end_cargo_in(folder):
    """Ends the builds of a copy and waits for their end."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            while process.joinpath("cwd").resolve() == Path(folder):
                os.kill(int(process.name), signal.SIGTERM)
                time.sleep(0.1)
        except OSError:
            continue


def forget_killed():
    """Cleans up after killed calls: builds of their mutated copies must not be mistaken for the sources."""
    for owner in (target_folder() / "mutations").glob("saved-*/owner.json"):
        killed = json.loads(owner.read_text())
        if Path(f"/proc/{killed['process']}").exists():
            continue
        end_cargo_in(killed["copy"])
        forget_since(killed["begun"])
        shutil.rmtree(killed["copy"], ignore_errors=True)
        shutil.rmtree(owner.parent)


class Copy:
    """A copy of the sources that shares what cargo built of them: file times are copied, too, and cargo goes by those.

    It must not lie in the target folder: cargo would remember its files by their place there, and take what was built of them for what a
    checkout holds.
    """

    def __init__(self, folder, cargo=()):
        self.folder = folder
        forget_killed()
        self.saved = Path(tempfile.mkdtemp(prefix="saved-", dir=target_folder() / "mutations"))
        self.cargo = list(cargo)
        self.begun = time.time()
        (self.saved / "owner.json").write_text(json.dumps({"process": os.getpid(), "begun": self.begun, "copy": str(folder)}))
        names = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True
        ).stdout.decode()
        wanted = {name for name in names.split("\0") if name and (ROOT / name).is_file()}
        for name in wanted:
            copy = folder / name
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, copy)

    def forget(self):
        """Deletes the copy and its builds: file times cannot distinguish a mutated crate from the original."""
        shutil.rmtree(self.folder)
        shutil.rmtree(self.saved)
        forget_since(self.begun)

    def build(self, arguments, until=None):
        """Builds the unit tests, or only those up to the package `until`.

        Returns folders and programs, and what cargo said if it failed.
        """
        environment = {**os.environ, "CARGO_TARGET_DIR": str(target_folder())}
        alone = []
        if until:
            wrapper = self.saved / "only-the-tests"
            wrapper.write_text(ONLY_THE_TESTS)
            wrapper.chmod(0o755)
            environment["TESTED_CRATE"], needed = needed_crates(until)
            environment["NEEDED_CRATES"] = " ".join(needed.values())
            broken = self.saved / "broken"
            broken.unlink(missing_ok=True)
            environment["BROKEN_BUILD"] = str(broken)
            environment["RUNNER"] = str(os.getpid())
            # Waiting calls occupy a job each.
            alone = ["--jobs", "64", "--config", f"build.rustc-wrapper={json.dumps(str(wrapper))}"]
        cargo = ["cargo", "test", "--release", "--locked", "--lib", "--no-run", "--message-format", "json-render-diagnostics", *alone, *(self.cargo or arguments)]
        tests = []
        with tempfile.TemporaryFile("w+") as said:
            cargo = subprocess.Popen(cargo, cwd=self.folder, env=environment, stdout=subprocess.PIPE, stderr=said, text=True, start_new_session=True)
            try:
                for line in cargo.stdout:
                    message = json.loads(line)
                    if not message.get("executable"):
                        continue
                    tests.append((Path(message["manifest_path"]).parent, message["executable"]))
                    if until and package(tests[-1][0]) == until:
                        return tests[-1:], None
                cargo.wait()
            finally:
                # Once the tests are built, the remaining calls still wait. Cargo continues when this script is ended.
                if cargo.poll() is None:
                    os.killpg(cargo.pid, signal.SIGTERM)
                    cargo.communicate()
            if cargo.returncode != 0:
                said.seek(0)
                lines = said.read().splitlines()
                first = next((at for at, line in enumerate(lines) if line.startswith("error")), 0)
                # Waiting calls print nothing useful.
                ended = next((at for at, line in enumerate(lines) if line.startswith("warning: build failed")), len(lines))
                return [], "\n".join(lines[first : min(ended, first + 30)])
        if not tests:
            raise Mistake(f"cargo test {' '.join(self.cargo or arguments)} builds no unit tests")
        return tests, None

    def tests(self, arguments, until=None, first=None):
        """Builds the unit tests, or only those up to the package `until`, and runs them until a crate fails, starting with the test `first`.

        Returns 'passed', 'failed' or 'broken', and the first test that failed or what cargo said.
        """
        tests, complaint = self.build(arguments, until)
        if complaint:
            return "broken", complaint
        calls = [(folder, [program, "--exact", first]) for folder, program in tests if until and first]
        calls += [(folder, [program]) for folder, program in tests]
        for folder, call in calls:
            try:
                ran = subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=LIMIT_SECONDS)
            except subprocess.TimeoutExpired:
                return "failed", "a test that did not end"
            if ran.returncode != 0:
                failed = re.findall(r"^test (\S+) .*FAILED$", ran.stdout, re.MULTILINE)
                return "failed", failed[0] if failed else "a test process that broke"
        return "passed", ""

    def try_mutation(self, mutation):
        """Returns the name of the test that caught the mutation, or None."""
        path = self.folder / mutation["file"]
        original, times = path.read_text(), path.stat()
        path.write_text(original.replace(mutation["find"], mutation["replace"]))
        known = known_tests().get(mutation["id"])
        crate = crate_of(mutation["file"])
        everything = False
        self.remember()
        try:
            for arguments, until in ((["-p", crate], crate), (["--workspace"], None)):
                everything = until is None
                verdict, what = self.tests(arguments, until, known)
                if verdict == "broken":
                    raise Mistake(f"{mutation['id']} does not compile:\n{what}")
                if verdict == "failed":
                    return what
            return None
        finally:
            path.write_text(original)
            if everything:
                forget_since(self.begun)
            else:
                # Only the unit tests of the crate were built.
                os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
                self.remember_no_more(crate)

    def remember(self):
        """Saves cargo's fingerprints."""
        shutil.rmtree(self.saved / "fingerprints", ignore_errors=True)
        for fingerprint in fingerprints():
            shutil.copytree(fingerprint, self.saved / "fingerprints" / fingerprint.name)
        # Cargo deletes a library before it calls the compiler.
        shutil.rmtree(self.saved / "libraries", ignore_errors=True)
        (self.saved / "libraries").mkdir()
        for library in (target_folder() / "release" / "deps").glob("lib*tactnet*.rlib"):
            os.link(library, self.saved / "libraries" / library.name)

    def remember_no_more(self, crate):
        """Restores cargo's fingerprints, except that the unit tests of `crate` must be built again."""
        # The dependencies of the crate were built correctly, if at all.
        _, needed = needed_crates(crate)
        for fingerprint in list(fingerprints()):
            if package_of(fingerprint) not in needed:
                shutil.rmtree(fingerprint)
        for fingerprint in (self.saved / "fingerprints").iterdir():
            is_mutated = package_of(fingerprint) == crate and any(file.name.startswith("test-lib-") for file in fingerprint.iterdir())
            if package_of(fingerprint) not in needed and not is_mutated:
                shutil.copytree(fingerprint, target_folder() / "release" / ".fingerprint" / fingerprint.name)
        for library in (self.saved / "libraries").iterdir():
            built = target_folder() / "release" / "deps" / library.name
            if not built.exists():
                os.link(library, built)


def content_key():
    """Returns a key of the sources and the list, to which results belong."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout.decode().split("\0")
    digest = hashlib.sha256()
    for name in sorted(name for name in names if name.endswith((".rs", ".lock"))):
        if (ROOT / name).is_file():
            digest.update(name.encode() + (ROOT / name).read_bytes())
    return digest.hexdigest()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="ID", help="IDs of the mutations [default: all]")
    parser.add_argument("--random", type=int, metavar="N", help="number of mutations, selected by the commit")
    parser.add_argument("--write", action="store_true", help="write tests/mutations_caught.json")
    parser.add_argument("--unchecked", action="store_true", help="skip the check that the unit tests pass without a mutation")
    parser.add_argument("--cargo", default="", metavar="ARGS", help="packages and features [default: the mutated crate, then the workspace]")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    for ending in (signal.SIGTERM, signal.SIGHUP):
        # The default action would end without cleanup.
        signal.signal(ending, lambda number, _: sys.exit(128 + number))
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
    copy = Copy(Path(tempfile.mkdtemp(prefix="tactnet-mutations-")), shlex.split(arguments.cargo))
    atexit.register(copy.forget)
    log = work / f"{content_key()[:16]}.jsonl"
    known = {}
    if log.exists():
        for line in log.read_text().splitlines():
            entry = json.loads(line)
            known[entry["id"], entry["find"], entry["replace"]] = entry
    say = lambda text: print(text, file=sys.stderr, flush=True)
    if not arguments.unchecked and not known:
        say("running the unit tests of the unchanged sources …")
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
        caught_by = {result["id"]: result["caught_by"] for result in results}
        CAUGHT.write_text(json.dumps(caught_by, indent=1) + "\n")
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
