#!/usr/bin/env python3
"""Measures a catching stack whose planners run on another host: network namespaces of this machine, joined by a virtual cable.

    cargo build --release --features catching,zenoh
    sudo python experiments/bench/catching_remote.py [--throws 30] [--json]

Every row is a live run with the same balls, recorded on the robot's host:

    local             planners on the robot's host, no link
    remote            planners on the other host; requests and plans cross the link
    remote, loaded    the same, and 50 MB/s of monitoring data with low priority cross the same link in each direction

Exposure to path comes from stamps in the recorded packets (`tactnet catch timing`). All processes share this machine's cores.
"""

import argparse
import contextlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

from compare_dds import TwoHosts, processor, running

ROOT = pathlib.Path(__file__).resolve().parents[2]
ROBOT = ["world", "pose", "tracker", "coordinator", "controller", "safety", "hand"]
PLANNERS = ["planner-left", "planner-right"]
# Bytes of a packet of monitoring data, and packets per second.
BULK, RATE = 500_000, 100
BULK_CHANNEL = """
[channels.monitoring]
packet = "u8"
item_bytes = 1
items = {bytes}
depth = 4
distributed = true
priority = "bulk"
"""


def table(program, folder, host):
    """Writes the table of a host and returns its path."""
    text = subprocess.run([program, "catch", "role", "--print-table"], check=True, capture_output=True, text=True).stdout
    address = '"tcp/10.79.0.1:7447"'
    network = f"plain_text = true\n{'connect' if host else 'listen'} = [{address}]"
    text = text.replace("listen = []\nconnect = []", network)
    for channel in ["plan/request", "plan/result"]:
        before, name, after = text.partition(f'[channels."{channel}"]')
        text = before + name + after.replace("distributed = false", "distributed = true", 1)
    path = pathlib.Path(folder, f"host{host}.toml")
    path.write_text(text + BULK_CHANNEL.format(bytes=BULK))
    return path


class Run:
    """Hubs and processes of one condition on both hosts."""

    def __init__(self, program, hosts, stack, folder):
        self.program, self.hosts, self.stack, self.folder = program, hosts, stack, folder
        self.tables = [table(program, folder, host) for host in range(2)]

    def start(self, host, *words, text=None):
        """Starts a command of this program on a host and waits until it is ready."""
        # Hosts share no memory.
        environment = {**os.environ, "TACTNET_RUNTIME_DIR": f"{self.folder}/memory{host}"}
        command = [self.program, *words, "--table", self.tables[host]]
        options = {"env": environment, "stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
        process = self.hosts.popen(host, [str(word) for word in command], **options)
        self.stack.callback(self.end, process)
        if text is not None:
            process.stdin.write(text + "\n")
            process.stdin.flush()
        return process

    def begin(self, host, *words, text=None):
        process = self.start(host, *words, text=text)
        line = process.stdout.readline().strip()
        if line != "ready":
            sys.exit(f"{' '.join(map(str, words))}: expected `ready`, found `{line}`")
        return process

    @staticmethod
    def end(process):
        process.send_signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(10)
        process.kill()
        process.wait()


def measure(program, condition, options):
    """Returns one row."""
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(dir="/dev/shm"))
        hosts = TwoHosts(stack)
        run = Run(program, hosts, stack, folder)
        for host in range(2):
            run.begin(host, "channel", "hub")
        recording = f"{folder}/run.mcap"
        recorder = run.begin(0, "record", "--out", recording, "--channel", "*/*", "--channel", "imu")
        remote = condition != "local"
        for planner in PLANNERS:
            run.begin(int(remote), "catch", "role", planner)
        for role in ROBOT:
            run.begin(0, "catch", "role", role, text=json.dumps({"seed": options.seed}) if role == "world" else None)
        if condition == "remote, loaded":
            for host in range(2):
                run.start(1 - host, "channel", "hz", "monitoring", "--seconds", "100000")
                run.start(host, "channel", "put", "monitoring", "--rate", str(RATE), "--priority", "bulk")
        outcomes = run.start(0, "channel", "echo", "catch/outcome", "--count", str(options.throws), "--json")
        found = [json.loads(line)["packet"] for line in outcomes.stdout]
        run.end(recorder)
        timing = subprocess.run([program, "catch", "timing", "--json", recording], check=True, capture_output=True, text=True)
    timing = json.loads(timing.stdout)
    possible = [one for one in found if one["arms"] > 0]
    return {
        "condition": condition,
        "throws": len(found),
        "in_catch_space": len(possible),
        "caught_in_catch_space": sum(one["caught"] for one in possible),
        "caught": sum(one["caught"] for one in found),
        "exposure_to_path_ms": timing["exposure_to_path_ms"],
        "steps": timing["steps"],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--throws", type=int, default=30, help="throws of each condition (default 30)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the world (default 1)")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "target/release/tactnet", help="the command")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    program = options.program.resolve()
    if not program.exists():
        sys.exit(f"{program} is missing: cargo build --release --features catching,zenoh")
    if os.geteuid() != 0:
        sys.exit("network namespaces need root")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    rows = []
    for condition in ["local", "remote", "remote, loaded"]:
        rows.append(measure(program, condition, options))
        row = rows[-1]
        path = row["exposure_to_path_ms"]
        say = f"{condition}: {row['caught']} of {row['throws']} caught, exposure to path {path['p50']:.1f} ms (median), {path['p99']:.1f} (99 %)"
        print(say, file=sys.stderr if options.json else sys.stdout, flush=True)
    version = subprocess.run([program, "--version"], capture_output=True, text=True).stdout
    if options.json:
        commit = version.partition("commit ")[2].partition(")")[0]
        print(json.dumps({"rows": rows, "seed": options.seed, "bulk_bytes_per_s": BULK * RATE, "commit": commit, "processor": processor()}, indent=2))


if __name__ == "__main__":
    main()
