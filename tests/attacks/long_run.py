#!/usr/bin/env python3
"""Feeds one service many frames, and looks whether its memory and its descriptors grow.

    python3 tests/attacks/long_run.py --tactnet target/release/tactnet --frames 64800000 --speed 10     # a day of 750 Hz
    python3 tests/attacks/long_run.py --tactnet target/release/tactnet --frames 64800000 --speed 40 --depth 4096      # the same in 36 minutes

Prints one JSON with a row like those of kills.py, and `frames`, `kib_per_million_frames` (slope of its own resident memory with its 95 %
interval; the first fifth is left out, and the first 50 000 frames, in which the store of newest sweeps is touched for the first time) and `descriptors` (at that time and at the end). `lost` counts frames that were lost, and 1 more if
memory grows: if the whole interval is above 64 KiB per million frames, twenty-two minutes of a skin, and above a mebibyte in the run.
"""

import argparse
import json
import math
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from kills import PATIENCE, RECIPE, Attack, Robot, models  # noqa: E402

GROWS = 64


def resident_kib(pid):
    """Returns its own memory; pages of the channels, which are reserved beforehand and counted when they are first touched, are left out."""
    status = Path(f"/proc/{pid}/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("RssAnon:"))


def descriptors(pid):
    """Returns the least of several looks: a request that has just been answered is still being closed."""
    looks = []
    for _ in range(5):
        looks.append(len(list(Path(f"/proc/{pid}/fd").iterdir())))
        time.sleep(0.2)
    return min(looks)


def slope(points):
    """Least squares; returns slope and half of its 95 % interval."""
    n = len(points)
    mean_x, mean_y = (sum(point[axis] for point in points) / n for axis in (0, 1))
    spread = sum((x - mean_x) ** 2 for x, _ in points)
    rise = sum((x - mean_x) * (y - mean_y) for x, y in points) / spread
    rest = sum((y - mean_y - rise * (x - mean_x)) ** 2 for x, y in points)
    return rise, 1.96 * math.sqrt(rest / max(n - 2, 1) / spread)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tactnet", type=Path, required=True)
    parser.add_argument("--frames", type=int, default=200_000, help="at least 80 000")
    parser.add_argument("--speed", type=float, default=10, help="times 750 frames a second")
    parser.add_argument("--depth", type=int, help="frames that a finger's channel holds [default: the table's own, a third of a second of 750 Hz]")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        attack = Attack("one service for long", arguments.tactnet.resolve(), Path(folder))
        (attack.work / "small.toml").write_text(RECIPE)
        attack.run("data", "twin", "--steps", "1000", "--sweeps", "10", "--materials", "4", "--out", "data.h5")
        models(attack)
        port = random.randrange(20_000, 30_000)
        robot = Robot(attack)
        if arguments.depth:
            table = attack.work / "robot.toml"
            text, count = re.subn(r"(?m)^depth = 256\b", f"depth = {arguments.depth}", table.read_text())
            assert count, "no channel of a finger in the table"
            table.write_text(text)
        robot.SPECS = {
            **Robot.SPECS,
            "serve": ["serve", "--metrics", f"127.0.0.1:{port}", "--models", "models"],
            "skin": [*Robot.SPECS["skin"], "--speed", arguments.speed],
        }
        robot.start("hub", "serve")
        service = robot.processes["serve"].pid

        def counted(name):
            text = urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=PATIENCE).read().decode()
            return next(int(float(line.split()[1])) for line in text.splitlines() if line.startswith(f"tactnet_{name}_total "))

        # The page's threads take their memory at their first requests.
        for _ in range(500):
            counted("frames")
        log = open(attack.work / "skin", "w")
        skin = [attack.tactnet, *map(str, robot.SPECS["skin"]), "--table", "robot.toml"]
        robot.processes["skin"] = subprocess.Popen(skin, cwd=attack.work, stdout=subprocess.DEVNULL, stderr=log)
        robot.processes["skin"].log = open(attack.work / "skin", "r+")
        begun = time.monotonic()
        seconds = arguments.frames / (750 * arguments.speed)
        points, early = [], None
        while (frames := counted("frames")) < arguments.frames:
            points.append((frames / 1e6, resident_kib(service)))
            if early is None and frames > max(arguments.frames / 5, 50_000):
                early = descriptors(service)
            if time.monotonic() - begun > 3 * seconds + PATIENCE:
                attack.row["hangs"] += 1
                break
            time.sleep(min(10, seconds / 100))
        took = time.monotonic() - begun
        late = descriptors(service)
        dropped = counted("dropped_frames")
        robot.end()
        begin = max(arguments.frames / 5, 50_000) / 1e6
        grows, half = slope([point for point in points if point[0] > begin])
        attack.row |= {
            "executions": frames,
            "lost": dropped + (grows - half > max(GROWS, 1024 / (frames / 1e6))) + (late > (early or late)),
            "frames": frames,
            "frames_per_second": round(frames / took),
            "kib_per_million_frames": [round(grows, 1), round(grows - half, 1), round(grows + half, 1)],
            "resident_mib": round(points[-1][1] / 1024, 1),
            "descriptors": [early, late],
            "seconds": round(took, 1),
        }
    print(json.dumps({"schema_version": 1, "rows": [attack.row]}, indent=2))
    return 1 if attack.row["lost"] or attack.row["hangs"] or attack.row["panics"] else 0


if __name__ == "__main__":
    sys.exit(main())
