#!/usr/bin/env python3
"""Compares the throw planner with SciPy's SLSQP: same problems, same starts, farthest flight in a direction.

    cargo run --release -p tactnet-catching-trials --example peer_throws -- 20 1 > throws.json
    python experiments/bench/compare_throws.py throws.json > experiments/results/catching_throws.json

Needs numpy and scipy. The peer gets the programme of 17 unknowns of `catching/src/throw/problem.rs` without the robot's bodies, with central
differences of all functions, and our starts. A start counts if its end keeps the direction to 0.1 mm/s and all limits to a millionth. `all`
descends from every start, `first` from the best one; times are for one core. SLSQP gets finite bounds on all unknowns, because SciPy 1.17.1
does not converge with open ones.
"""

import json
import platform
import sys
import time
import tomllib
from importlib.metadata import version
from pathlib import Path

import numpy as np
import scipy.optimize

ROOT = Path(__file__).resolve().parent.parent.parent
ROBOT = tomllib.loads((ROOT / "catching/packets/src/robot.toml").read_text())
GRAVITY = 9.697
# Step of the flight's Runge-Kutta integration in s: its error over a throw is below a hundredth of a millimetre.
STEP = 0.03
TIMES = (0.05, 0.8)


def cross(a, b):
    return np.cross(a, b, axis=-1)


def turn(axis, angle):
    """Returns rotations [..., 3, 3] about z or y."""
    c, s = np.cos(angle), np.sin(angle)
    o, i = np.zeros_like(c), np.ones_like(c)
    rows = [[c, -s, o], [s, c, o], [o, o, i]] if axis == "z" else [[c, o, s], [o, i, o], [-s, o, c]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


class Swing:
    """The motion of a hand on the swing of an arm; all arguments are batches."""

    def __init__(self, number):
        arm, torso = ROBOT["arms"][number], ROBOT["torso"]
        self.arm = arm
        self.joints = [torso["joints"][0], *arm["joints"]]
        self.up = torso["lower_pitch_height"] + torso["lower_length"] + torso["upper_length"]
        c, s = np.cos(arm["lean"]), np.sin(arm["lean"])
        self.lean = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        self.speeds = np.array([joint["speed"] for joint in self.joints])
        self.accelerations = np.array([joint["acceleration"] for joint in self.joints])
        self.ranges = np.array([joint["range"] for joint in self.joints])

    def hand(self, q, rates):
        """Returns position, velocity and axis of the hand."""
        r = turn("z", q[..., 0])
        at = np.zeros(q.shape[:-1] + (3,))
        at[..., 2] = self.up
        origins, axes = [np.zeros_like(at)], [r[..., :, 2]]
        at = at + r @ np.array(self.arm["position"])
        r = r @ self.lean
        at = at + r[..., :, 2] * self.arm["base_to_shoulder"]
        lengths = {2: self.arm["shoulder_to_elbow"], 4: self.arm["elbow_to_wrist"], 6: self.arm["wrist_to_catch"]}
        for i, axis in enumerate(["z", "-y", "z", "y", "z", "-y", "z"]):
            sign = -1.0 if axis == "-y" else 1.0
            column = 2 if axis == "z" else 1
            origins.append(at)
            axes.append(sign * r[..., :, column])
            r = r @ turn(axis[-1], sign * q[..., i + 1])
            if i in lengths:
                at = at + r[..., :, 2] * lengths[i]
        v = sum(cross(a, at - o) * rates[..., i, None] for i, (a, o) in enumerate(zip(axes, origins)))
        return at, v, r[..., :, 2]


def length(p, v, drag, height, heading):
    """Returns how far flights go along the heading until they reach the height; minus infinity if they do not."""

    def slope(v):
        return np.array([0, 0, -GRAVITY]) - drag * np.linalg.norm(v, axis=-1, keepdims=True) * v

    def step(p, v, h):
        a1 = slope(v)
        v2 = v + h / 2 * a1
        a2 = slope(v2)
        v3 = v + h / 2 * a2
        a3 = slope(v3)
        v4 = v + h * a3
        a4 = slope(v4)
        return p + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    start = p
    before = (p, v)
    down = np.zeros(p.shape[:-1], bool)
    for _ in range(134):
        p2, v2 = step(p, v, STEP)
        down |= (v2[..., 2] < 0) & (p2[..., 2] <= height)
        move = ~down[..., None]
        p, v = np.where(move, p2, p), np.where(move, v2, v)
        if down.all():
            break
    h = np.full(down.shape + (1,), STEP)
    for _ in range(8):
        p2, v2 = step(p, v, h)
        h = h - (p2[..., 2:] - height) / v2[..., 2:]
    p2, v2 = step(p, v, h)
    ok = down & (np.abs(p2[..., 2] - height) < 1e-8) & (v2[..., 2] < 0)
    return np.where(ok, (p2 - start) @ heading, -10.0)


class Peer:
    def __init__(self, problem):
        self.problem = problem
        self.swing = Swing(problem["arm"])
        self.heading = np.array([np.cos(problem["heading"]), np.sin(problem["heading"]), 0.0])
        self.aside = np.array([-self.heading[1], self.heading[0], 0.0])

    def functions(self, x):
        """Returns cost, equation and inequalities, concatenated, of a batch of points."""
        swing, problem = self.swing, self.problem
        q, u, time_ = x[..., :8], x[..., 8:16], x[..., 16:]
        rates = u * swing.speeds
        p, v, axis = swing.hand(q, rates)
        cost = -length(p, v, problem["drag"], problem["height"], self.heading)
        speed = np.maximum(np.linalg.norm(v, axis=-1), 1e-3)
        way = rates * (time_ / 2 + problem["coast"])
        quick = swing.accelerations / swing.speeds * time_
        rows = [
            quick - u,
            quick + u,
            q + way - swing.ranges[:, 0],
            swing.ranges[:, 1] - q - way,
            q - way - swing.ranges[:, 0],
            swing.ranges[:, 1] - q + way,
            ((axis * v).sum(-1) / speed - np.cos(problem["palm"]))[..., None],
        ]
        return np.concatenate([cost[..., None], (v @ self.aside)[..., None], *rows], -1)

    def slopes(self, x, h=1e-6):
        steps = np.eye(17) * h
        return ((self.functions(x + steps) - self.functions(x - steps)) / (2 * h)).T

    def descend(self, start):
        # SLSQP asks for functions and slopes at the same point separately.
        kept = {}

        def at(x, what):
            key = (what, x.tobytes())
            if key not in kept:
                if len(kept) > 8:
                    kept.clear()
                kept[key] = self.functions(x) if what == "values" else self.slopes(x)
            # SLSQP overwrites its arguments.
            return kept[key].copy()

        answer = scipy.optimize.minimize(
            lambda x: at(x, "values")[0],
            start,
            jac=lambda x: at(x, "slopes")[0],
            method="SLSQP",
            bounds=[tuple(ends) for ends in self.swing.ranges] + [(-1, 1)] * 8 + [TIMES],
            constraints=[
                {"type": "eq", "fun": lambda x: at(x, "values")[1:2], "jac": lambda x: at(x, "slopes")[1:2]},
                {"type": "ineq", "fun": lambda x: at(x, "values")[2:], "jac": lambda x: at(x, "slopes")[2:]},
            ],
            options={"maxiter": 150, "ftol": 1e-8},
        )
        values = self.functions(answer.x)
        feasible = abs(values[1]) < 1e-4 and values[2:].min() > -1e-6 and np.abs(answer.x[8:16]).max() < 1 + 1e-6
        return -values[0] if feasible else None


def main():
    problems = json.loads(Path(sys.argv[1]).read_text())
    rows = []
    for problem in problems:
        peer = Peer(problem)
        found, times = [], []
        for start in problem["starts"]:
            begun = time.perf_counter()
            found.append(peer.descend(np.array(start)))
            times.append(1e3 * (time.perf_counter() - begun))
        rows.append((problem, found, times))
        print(f"{len(rows)} of {len(problems)}", file=sys.stderr)
    best = [max((f for f in found if f is not None), default=None) for _, found, _ in rows]
    first = [found[0] for _, found, _ in rows]
    ours = [problem["distance"] for problem, _, _ in rows]
    gaps = [o - b for o, b in zip(ours, best) if b is not None]
    report = {
        "problems": len(rows),
        "starts": len(rows[0][1]),
        "ours_m_mean": float(np.mean(ours)),
        "slsqp_all_m_mean": float(np.mean([b for b in best if b is not None])),
        "slsqp_first_found": sum(f is not None for f in first),
        "slsqp_first_m_mean": float(np.mean([f for f in first if f is not None])) if any(f is not None for f in first) else None,
        "slsqp_starts_found": float(np.mean([np.mean([f is not None for f in found]) for _, found, _ in rows])),
        "ours_less_slsqp_all_mm": {"least": 1e3 * min(gaps), "median": 1e3 * float(np.median(gaps)), "greatest": 1e3 * max(gaps)},
        "ours_same_or_farther": sum(bool(gap >= -1e-3) for gap in gaps),
        "ours_ms_median": float(np.median([problem["ms"] for problem, _, _ in rows])),
        "slsqp_all_ms_median": float(np.median([sum(times) for _, _, times in rows])),
        "versions": {"python": platform.python_version(), "numpy": version("numpy"), "scipy": version("scipy")},
    }
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
