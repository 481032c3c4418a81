#!/usr/bin/env python3
"""Times round trips of this project's channels and of Cyclone DDS, a middleware of ROS 2: same sizes, one client, in turns.

    cargo build --release --features zenoh
    apt-get install cyclonedds-tools cyclonedds-dev iceoryx gcc
    python experiments/bench/compare_dds.py [--turns 3] [--seconds 2] [--json]
    sudo python experiments/bench/compare_dds.py --namespaces --json        # between two hosts: network namespaces

Our side is `tactnet channel stress`. Cyclone DDS has two ways:

    udp    UDP over loopback, or over a virtual cable between namespaces, by ddsperf, its own benchmark in C: `ping` writes a packet, `pong`
           answers with one of the same size, and the next ping follows at once. ddsperf prints half a round trip; this prints round trips.
    shm    its shared memory, iceoryx 2, by dds/round_trips.c, since ddsperf's ping does not use it; this compiles it and starts the daemon
           of iceoryx, iox-roudi. Packets are loaned: no copies.

Settings: reliable, keep-last 1, no rate limit, listeners (a packet is answered by the thread that receives it), one network interface, UDP
packets of 65500 B, socket buffers of 4 MB. ddsperf's packet of 4 B is a number, larger ones are sequences of bytes, which DDS copies on both
sides. No side spins.

A turn runs every side once for each size. A side's figure is the median over its turns, of the median and of the 99th percentile.
"""

import argparse
import contextlib
import json
import os
import pathlib
import platform
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
SIZES = [4, 65536, 1048576]
LINE = re.compile(r" size (\d+) mean .* 50% ([\d.]+)us 90% [\d.]+us 99% ([\d.]+)us max [\d.]+us cnt (\d+)")
# Size of ddsperf's packets that are a number without bytes beside it.
NUMBER_ONLY = 4


def settings(way, interface):
    """Returns the configuration of Cyclone DDS. The locator only has to be the same in all processes of a host."""
    shared = "true" if way == "shm" else "false"
    return f"""<CycloneDDS><Domain id="any">
        <General><Interfaces><NetworkInterface name="{interface}" multicast="true"/></Interfaces>
            <MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize></General>
        <Internal><SocketReceiveBufferSize min="4MB"/><SocketSendBufferSize min="4MB"/></Internal>
        <SharedMemory><Enable>{shared}</Enable><Locator>{":".join(["01"] * 16)}</Locator><LogLevel>error</LogLevel></SharedMemory>
    </Domain></CycloneDDS>"""


def over_udp(size, seconds, hosts):
    """Returns median and 99th percentile of a round trip in µs, and the number of round trips."""
    kind = ["-T", "OU"] if size == NUMBER_ONLY else ["-T", "KS"]
    sized = [] if size == NUMBER_ONLY else ["size", str(size)]
    # The first two seconds, in which both find each other, do not count.
    ping = ["ddsperf", *kind, "-D", str(seconds + 2), "ping", *sized]
    printed = between(["ddsperf", *kind, "pong"], ping, settings("udp", hosts.interface), hosts)
    intervals = [tuple(map(float, found.groups())) for found in LINE.finditer(printed)][1:]
    if not intervals:
        sys.exit(f"{' '.join(ping)} printed no round trips:\n{printed}")
    sizes, medians, high, counts = zip(*intervals)
    assert set(sizes) == {float(size)}, printed
    return 2 * statistics.median(medians), 2 * statistics.median(high), int(sum(counts))


def over_shared_memory(program, size, seconds, hosts):
    """Returns the same as `over_udp`."""
    master = [program, "master", str(size), str(seconds)]
    printed = between([program, "client", str(size)], master, settings("shm", hosts.interface), hosts)
    try:
        median, high, count = printed.splitlines()[-1].split()
        return float(median), float(high), int(count)
    except (IndexError, ValueError):
        sys.exit(f"{' '.join(master)} printed no round trips:\n{printed}")


def between(client, master, configuration, hosts):
    """Returns the output of the master while the client runs on the other host."""
    environment = {**os.environ, "CYCLONEDDS_URI": configuration}
    process = hosts.popen(1, client, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        return hosts.run(0, master, env=environment)
    finally:
        process.terminate()
        process.wait()


def compiled(folder):
    """Returns the path of dds/round_trips.c, compiled."""
    source = pathlib.Path(__file__).parent / "dds"
    program = f"{folder}/round_trips"
    subprocess.run(["idlc", "-o", folder, source / "packets.idl"], check=True)
    sources = [source / "round_trips.c", f"{folder}/packets.c"]
    subprocess.run(["gcc", "-O2", f"-I{folder}", *sources, "-lddsc", "-o", program], check=True)
    return program


def tactnet(program, size, seconds, hosts):
    command = [program, "channel", "stress", "--json", "--sizes", str(size), "--clients", "1", "--seconds", str(seconds), "--domain", hosts.domain]
    found = subprocess.run(command, check=True, capture_output=True, text=True)
    row = json.loads(found.stdout)["rows"][0]
    if row["failures"]:
        sys.exit(f"{' '.join(map(str, command))}: {row.get('failure')}")
    return row["median_us"], row["p99_us"], row["rounds"]


class OneHost:
    domain, interface = "host", "lo"

    def popen(self, _, command, **options):
        return subprocess.Popen(command, **options)

    def run(self, host, command, **options):
        process = self.popen(host, command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)
        return process.communicate()[0]


class TwoHosts(OneHost):
    """Two network namespaces and a cable; they vanish with the processes that sleep in them."""

    domain, interface = "namespaces", "cable"

    def __init__(self, stack):
        self.anchors = [stack.enter_context(running(["unshare", "--net", "sleep", "infinity"])) for _ in range(2)]
        time.sleep(0.3)
        near, far = self.anchors
        script = f"ip link add name cable type veth peer name cable netns {far.pid}"
        self.run(0, ["sh", "-c", script])
        for host in range(2):
            setup = f"ip link set lo up; ip addr add 10.79.0.{host + 1}/24 dev cable; ip link set cable up"
            self.run(host, ["sh", "-c", setup])

    def popen(self, host, command, **options):
        inside = ["nsenter", f"--target={self.anchors[host].pid}", "--net", "--", *command]
        return subprocess.Popen(inside, **options)


@contextlib.contextmanager
def running(command):
    # It also ends if this program is killed.
    command = ["setpriv", "--pdeathsig", "TERM", *command]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def processor():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    names = (line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or "unknown")


def version(package):
    found = subprocess.run(["dpkg-query", "--show", "--showformat=${Version}", package], capture_output=True, text=True)
    return found.stdout.strip() or None


def measure(sides, hosts, options):
    """Returns a row for each size and side.

    sides: function of each, from a size to median, 99th percentile and number of round trips
    """
    turns = {(size, side): [] for size in SIZES for side in sides}
    for turn in range(options.turns):
        for size, side in turns:
            if sys.stderr.isatty():
                print(f"\r\033[Kturn {turn + 1} of {options.turns}: {side}, {size} B", end="", file=sys.stderr, flush=True)
            turns[size, side].append(sides[side](size))
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    rows = []
    for (size, side), found in turns.items():
        medians, high, counts = zip(*found)
        rows.append({
            "transport": side,
            "domain": hosts.domain,
            "size": size,
            "clients": 1,
            "rounds": sum(counts),
            "median_us": round(statistics.median(medians), 3),
            "p99_us": round(statistics.median(high), 3),
            "medians_us": [round(median, 3) for median in medians],
        })
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--turns", type=int, default=3, help="times everything is measured (default 3)")
    parser.add_argument("--seconds", type=int, default=2, help="duration of each measurement (default 2)")
    parser.add_argument("--namespaces", action="store_true", help="between two network namespaces instead of on one host; needs root")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "target/release/tactnet", help="our side")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    if not options.program.exists():
        sys.exit(f"{options.program} is missing: cargo build --release --features zenoh")
    for needed in ["ddsperf", "idlc", "iox-roudi", "gcc"]:
        if not shutil.which(needed):
            sys.exit(f"{needed} is missing: apt-get install cyclonedds-tools cyclonedds-dev iceoryx gcc")
    if options.namespaces and os.geteuid() != 0:
        sys.exit("--namespaces needs root")
    # SIGTERM ends everything that this starts, as Ctrl-C does.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    with contextlib.ExitStack() as stack:
        hosts = TwoHosts(stack) if options.namespaces else OneHost()
        sides = {
            "tactnet": lambda size: tactnet(options.program, size, options.seconds, hosts),
            "cyclonedds-udp": lambda size: over_udp(size, options.seconds, hosts),
        }
        if not options.namespaces:
            program = compiled(stack.enter_context(tempfile.TemporaryDirectory()))
            stack.enter_context(running(["iox-roudi"]))
            time.sleep(1)
            sides["cyclonedds-shm"] = lambda size: over_shared_memory(program, size, options.seconds, hosts)
        rows = measure(sides, hosts, options)
    commit = subprocess.run(["git", "describe", "--always", "--dirty", "--abbrev=12"], cwd=ROOT, capture_output=True, text=True)
    about = {
        "processor": processor(),
        "cores": len(os.sched_getaffinity(0)),
        "turns": options.turns,
        "commit": commit.stdout.strip() or "unknown",
        "versions": {"cyclonedds": version("cyclonedds-tools"), "iceoryx": version("iceoryx")},
    }
    if options.json:
        print(json.dumps({"rows": rows, **about}, indent=2))
        return
    print(f"{about['processor']}, {about['cores']} cores, {options.turns} turns, tactnet {about['commit']}, {about['versions']}")
    print(f"{'transport':<16}{'size [B]':>10}{'median [us]':>13}{'p99 [us]':>11}")
    for row in rows:
        print(f"{row['transport']:<16}{row['size']:>10}{row['median_us']:>13.1f}{row['p99_us']:>11.1f}")


if __name__ == "__main__":
    main()
