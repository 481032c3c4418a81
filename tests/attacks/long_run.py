#!/usr/bin/env python3
"""Sends many frames to one service and measures the growth of its memory and descriptors.

    python3 tests/attacks/long_run.py --tactnet target/release/tactnet --frames 64800000 --speed 10     # a day of 750 Hz
    python3 tests/attacks/long_run.py --tactnet target/release/tactnet --frames 64800000 --speed 40 --depth 4096      # the same in 36 min

Prints a JSON document with a row as in kills.py, and `frames`, `kib_per_million_frames` (slope of the resident private memory with its 95 %
interval) and `descriptors` (at the start of the measurement and at the end). The slope excludes the first fifth and the first 50 000 frames, which fill
the store of recent sweeps. `lost` counts lost frames, plus 1 if memory grows: if the whole interval is above 64 KiB per million frames (22 min of a
skin) and the growth is above 1 MiB.
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
    """Returns the private memory. It excludes the channels' pages, which are reserved in advance and counted when first touched."""
    status = Path(f"/proc/{pid}/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("RssAnon:"))


def descriptors(pid):
    """Returns the minimum of several counts, because a finished request is closed with a delay."""
    looks = []
    for _ in range(5):
        looks.append(len(list(Path(f"/proc/{pid}/fd").iterdir())))
        time.sleep(0.2)
    return min(looks)


def slope(points):
    """Least squares: returns the slope and half of its 95 % interval."""
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
    parser.add_argument("--speed", type=float, default=10, help="factor on 750 frames per second")
    parser.add_argument("--depth", type=int, help="queue length of a finger's channel, in frames [default: from the table, a third of a second at 750 Hz]")
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

        # The page's threads allocate memory at their first requests.
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
