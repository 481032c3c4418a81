#!/usr/bin/env python3
"""Kills tactnet's processes at random moments and counts the losses.

    python3 tests/attacks/kills.py --tactnet target/release/tactnet --kills 40

Prints a JSON document with a row per attack: `target`, `executions` (kills), `panics`, `hangs`, `over_memory`, `lost`. Output with `panicked` counts
as a panic, no end or response within a minute as a hang. Finished work that is changed or missing after a kill counts as lost. A program that does
not start again also counts as lost and ends its attack.
"""

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PATIENCE = 60
RECIPE = """name = "small"
[network]
maps = [8, 8]
hidden = 16
keep_probability = 0.8
[training]
epochs = 30
batch = 8
learning_rate = 0.005
method = { kind = "base" }
"""


class DoesNotStart(Exception):
    """A program that does not get ready, with its output."""


class Attack:
    """One row of the result, and the way to run its processes."""

    def __init__(self, name, tactnet, work):
        self.tactnet, self.work = tactnet, work
        self.row = {"target": name, "executions": 0, "panics": 0, "hangs": 0, "over_memory": 0, "lost": 0}
        self.started = []

    def start(self, *arguments, ready=False):
        log = open(self.work / "log", "w+")
        process = subprocess.Popen(
            [self.tactnet, *map(str, arguments)], cwd=self.work, stdout=subprocess.PIPE if ready else log, stderr=log, start_new_session=True
        )
        process.log = log
        self.started.append(process)
        if ready:
            line = process.stdout.readline()
            if line != b"ready\n":
                raise DoesNotStart(f"{' '.join(map(str, arguments))}: {line!r} {self.said(process)}")
        return process

    def said(self, process):
        process.log.flush()
        process.log.seek(0)
        return process.log.read()

    def end(self):
        """Ends all processes and removes all files, however the attack ended."""
        for process in self.started:
            if process.poll() is None:
                process.kill()
                process.wait()

    def kill(self, process):
        """Kills a process as the kernel does when out of memory: the process, not its children."""
        process.kill()
        process.wait()
        self.row["executions"] += 1
        self.look(process)

    def look(self, process):
        self.row["panics"] += "panicked" in self.said(process)
        process.log.close()

    def run(self, *arguments, expected=0):
        process = self.start(*arguments)
        try:
            code = process.wait(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.row["hangs"] += 1
            process.kill()
            process.wait()
            return False
        if code != expected:
            print(f"{' '.join(map(str, arguments))}: {self.said(process)}", file=sys.stderr)
        self.look(process)
        return code == expected

    def lost(self, happened):
        self.row["lost"] += bool(happened)


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def seconds_of(call):
    begun = time.monotonic()
    call()
    return time.monotonic() - begun


def train(attack, kills, rng):
    """A training that is killed repeatedly ends with the same bits as an undisturbed one."""
    spec = ["train", "--data", "data.h5", "--recipe", "small.toml", "--out"]
    whole = seconds_of(lambda: attack.run(*spec, "whole"))
    while attack.row["executions"] < kills:
        shutil.rmtree(attack.work / "killed", ignore_errors=True)
        for _ in range(min(8, kills - attack.row["executions"])):
            begun = (attack.work / "killed/config.json").exists()
            process = attack.start(*(["train", "--resume", "killed"] if begun else [*spec, "killed"]))
            time.sleep(rng.uniform(0, whole))
            attack.kill(process)
        begun = (attack.work / "killed/config.json").exists()
        ended = attack.run(*(["train", "--resume", "killed"] if begun else [*spec, "killed"]))
        files = ["weights.safetensors", "predictions_test.csv"]
        attack.lost(not ended or any(digest(attack.work / "whole" / file) != digest(attack.work / "killed" / file) for file in files))
        leftovers = [path for path in (attack.work / "killed").iterdir() if path.name.startswith(".writing-")]
        attack.lost(leftovers)


def experiment(attack, kills, rng):
    """An experiment with a killed runner resumes, with the same results."""
    spec = ["experiment", "run", "crossval_baselines", "--set", "data=data.h5", "--set", "folds=3", "--set", 'models=["knn-l", "small.toml"]', "--out"]

    def figures(folder):
        rows = json.loads((attack.work / folder / "summary.json").read_text())["rows"]
        return [(row["model"], row["measure"], row["values"]) for row in rows if row["measure"] != "train seconds"]

    whole = seconds_of(lambda: attack.run(*spec, "whole"))
    while attack.row["executions"] < kills:
        shutil.rmtree(attack.work / "killed", ignore_errors=True)
        for _ in range(min(5, kills - attack.row["executions"])):
            process = attack.start(*spec, "killed")
            time.sleep(rng.uniform(0, whole))
            attack.kill(process)
            # Its tasks end with it.
            time.sleep(0.3)
        ended = attack.run(*spec, "killed")
        attack.lost(not ended or figures("whole") != figures("killed"))


def enroll(attack, kills, rng):
    """A killed enrolment leaves the run unchanged, and no incomplete classifier."""
    attack.run("train", "--data", "data.h5", "--recipe", "small.toml", "--calibrate", "--false-alarms", "0.2", "--coverage", "0.8", "--out", "run")
    spec = ["enroll", "run", "--data", "five.h5", "--material", attack.new, "--out"]
    whole = seconds_of(lambda: attack.run(*spec, "whole"))
    before = {path.name: digest(path) for path in (attack.work / "run").iterdir()}
    for number in range(kills):
        process = attack.start(*spec, f"killed{number}")
        time.sleep(rng.uniform(0, 1.2 * whole))
        attack.kill(process)
        attack.lost(before != {path.name: digest(path) for path in (attack.work / "run").iterdir()})
        made = attack.work / f"killed{number}"
        # The new run is complete or does not exist.
        whole_one = made.exists() and (made / "manifest.json").exists()
        attack.lost(made.exists() and not (whole_one and digest(made / "weights.safetensors") == digest(attack.work / "whole/weights.safetensors")))
        attack.lost(not attack.run(*spec, f"again{number}"))
        # The same output folder can be used again.
        attack.lost(not made.exists() and not attack.run(*spec, f"killed{number}"))
        for folder in (f"killed{number}", f"again{number}"):
            shutil.rmtree(attack.work / folder, ignore_errors=True)


class Robot:
    """Hub, skin and classifier on a private bus."""

    def __init__(self, attack):
        self.attack = attack
        table = subprocess.run([attack.tactnet, "serve", "--print-table"], capture_output=True, text=True, check=True).stdout
        bus = next(line for line in table.splitlines() if line.startswith("bus ="))
        (attack.work / "robot.toml").write_text(table.replace(bus, f'bus = "kills{os.getpid()}"', 1))
        self.processes = {}

    SPECS = {
        "hub": ["channel", "hub"],
        "serve": ["serve", "--metrics", "off", "--models", "models"],
        "skin": ["simulate", "skin", "--data", "data.h5", "--sweeps-per-object", "none"],
    }

    def start(self, *names):
        for name in names:
            self.processes[name] = self.attack.start(*self.SPECS[name], "--table", "robot.toml", ready=True)

    def kill(self, name):
        self.attack.kill(self.processes.pop(name))

    def believes(self):
        """Waits for a belief sent after this call."""
        echo = ["timeout", "-s", "TERM", str(PATIENCE), self.attack.tactnet, "channel", "echo", "tactile/belief", "--table", "robot.toml", "--count", "1"]
        found = subprocess.run(echo, cwd=self.attack.work, capture_output=True, text=True)
        self.attack.row["hangs"] += found.returncode == 124
        return found.returncode == 0 and found.stdout.strip() != ""

    def end(self):
        for name in ("skin", "serve", "hub"):
            if process := self.processes.pop(name, None):
                process.send_signal(signal.SIGTERM)
                try:
                    process.wait(timeout=PATIENCE)
                except subprocess.TimeoutExpired:
                    self.attack.row["hangs"] += 1
                    process.kill()
                    process.wait()
                self.attack.look(process)


def models(attack):
    attack.run("train", "--data", "data.h5", "--recipe", "small.toml", "--epochs", "3", "--out", "models/1")


def channels(attack, kills, rng):
    """After a kill and restart of any process of the robot, beliefs arrive again."""
    models(attack)
    robot = Robot(attack)
    robot.start("hub", "serve", "skin")
    attack.lost(not robot.believes())
    for _ in range(kills):
        name = rng.choice(["hub", "serve", "skin"])
        time.sleep(rng.uniform(0, 0.3))
        robot.kill(name)
        time.sleep(rng.uniform(0, 0.3))
        robot.start(name)
        attack.lost(not robot.believes())
    robot.end()


def record(attack, kills, rng):
    """The file of a killed recorder can be read; at most the last second is missing."""
    models(attack)
    robot = Robot(attack)
    robot.start("hub", "serve", "skin")
    for number in range(kills):
        file = attack.work / f"{number}.mcap"
        begun = time.monotonic()
        process = attack.start("record", "--table", "robot.toml", "--out", file, ready=True)
        time.sleep(rng.uniform(0.5, 4))
        attack.kill(process)
        lasted = time.monotonic() - begun
        info = subprocess.run([attack.tactnet, "data", "import", file, "--out", attack.work / f"{number}.h5"], capture_output=True, text=True)
        # A sweep takes less than a second; the last second may be missing.
        attack.lost(info.returncode not in (0, 2) or (lasted > 3 and info.returncode != 0))
        for made in (file, attack.work / f"{number}.h5"):
            made.unlink(missing_ok=True)
    robot.end()


def swap(attack, kills, rng):
    """A service killed during a change of models restarts with the newest complete one."""
    models(attack)
    robot = Robot(attack)
    robot.start("hub", "serve", "skin")
    version = 1
    for _ in range(kills):
        version += 1
        # Like a copy by hand: file by file, the last one last.
        new = attack.work / f"models/{version}"
        new.mkdir()
        for path in sorted((attack.work / "models/1").iterdir(), key=lambda path: path.name == "result.json"):
            shutil.copyfile(path, new / path.name)
        time.sleep(rng.uniform(0, 1))
        robot.kill("serve")
        robot.start("serve")
        attack.lost(not robot.believes())
        if version > 3:
            shutil.rmtree(attack.work / f"models/{version - 2}")
    robot.end()


#: Optional features of the program without which an attack is skipped.
NEEDS = {"kill record": "recording"}
ATTACKS = {"kill train": train, "kill experiment": experiment, "kill enroll": enroll, "kill record": record, "kill model swap": swap, "kill channels": channels}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tactnet", type=Path, required=True)
    parser.add_argument("--kills", type=int, default=10, metavar="N", help="number of kills of each kind")
    parser.add_argument("--channel-kills", type=int, metavar="N", help="number of kills of processes on the channels [default: as --kills]")
    parser.add_argument("--only", nargs="+", choices=ATTACKS)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    version = subprocess.run([arguments.tactnet, "version", "--json"], capture_output=True, check=True)
    features = json.loads(version.stdout)["features"]
    rows, skipped = [], []
    for name, attack_with in ATTACKS.items():
        if arguments.only and name not in arguments.only:
            continue
        if name in NEEDS and NEEDS[name] not in features:
            skipped.append({"target": name, "reason": f"this build lacks the feature; build with `--features {NEEDS[name]}`"})
            print(f"{name}: skipped, {skipped[-1]['reason']}", file=sys.stderr, flush=True)
            continue
        with tempfile.TemporaryDirectory() as folder:
            attack = Attack(name, arguments.tactnet.resolve(), Path(folder))
            (attack.work / "small.toml").write_text(RECIPE)
            twin = ["data", "twin", "--steps", "200", "--sweeps", "20"]
            attack.run(*twin, "--materials", "4", "--out", "data.h5")
            attack.run(*twin, "--materials", "5", "--out", "five.h5")
            info = subprocess.run([attack.tactnet, "data", "info", "--json", attack.work / "five.h5"], capture_output=True, check=True)
            attack.new = json.loads(info.stdout)["materials"][4]["name"]
            kills = arguments.channel_kills if name == "kill channels" and arguments.channel_kills else arguments.kills
            begun = time.monotonic()
            print(f"{name} …", file=sys.stderr, flush=True)
            try:
                attack_with(attack, kills, random.Random(f"{name} {arguments.seed}"))
            except DoesNotStart as error:
                attack.row["lost"] += 1
                print(error, file=sys.stderr)
            finally:
                attack.end()
            attack.row["seconds"] = round(time.monotonic() - begun, 1)
            # The other attacks may take hours.
            print(json.dumps(attack.row), file=sys.stderr, flush=True)
            rows.append(attack.row)
    print(json.dumps({"schema_version": 1, "seed": arguments.seed, "rows": rows, "skipped": skipped}, indent=2))
    return 1 if any(row[key] for row in rows for key in ("panics", "hangs", "over_memory", "lost")) else 0


if __name__ == "__main__":
    sys.exit(main())
