#!/usr/bin/env python3
"""Compares the catch planner with SciPy's SLSQP and CasADi with IPOPT: same problems, starts and tolerances, soft objective.

    cargo run --release -p tactnet-catching-trials --example peer_problems -- 200 1 > problems.json
    python experiments/bench/compare_planners.py problems.json > experiments/results/catching_planners.json

Needs numpy, scipy, casadi, clarabel. The peers get the programme of 8 unknowns in the smooth form of `catching/src/plan/problem.rs`, with
functions and exact first derivatives compiled by CasADi (second ones, too, for IPOPT), and our starts. A start counts if it ends in a catch
within a hundredth of a millimetre, a ten thousandth of a radian and a millionth of the limits. `all` descends from every start, `first` from
the best one. Times are for one core; ours include the grid, the peers' do not. Finally, quadratic programmes of our size are compared with
Clarabel.
"""

import json
import platform
import sys
import time
import tomllib
from importlib.metadata import version
from pathlib import Path

import casadi as ca
import numpy as np
import scipy.optimize

ROOT = Path(__file__).resolve().parent.parent.parent
ROBOT = tomllib.loads((ROOT / "catching/packets/src/robot.toml").read_text())
GRAVITY = 9.697
# Number of steps of the flight's Runge-Kutta integration, each below 2 cm.
STEPS = 40


def rotation(axis, angle):
    c, s = ca.cos(angle), ca.sin(angle)
    if axis == "z":
        return ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))
    if axis == "x":
        return ca.vertcat(ca.horzcat(1, 0, 0), ca.horzcat(0, c, -s), ca.horzcat(0, s, c))
    if axis == "-y":
        s = -s
    return ca.vertcat(ca.horzcat(c, 0, s), ca.horzcat(0, 1, 0), ca.horzcat(-s, 0, c))


def hand(arm, q):
    """Returns position and rotation of the catch frame in the chest frame."""
    at = ca.DM(arm["position"])
    r = rotation("x", arm["lean"])
    at = at + r @ ca.vertcat(0, 0, arm["base_to_shoulder"])
    lengths = {2: arm["shoulder_to_elbow"], 4: arm["elbow_to_wrist"], 6: arm["wrist_to_catch"]}
    for i, axis in enumerate(["z", "-y", "z", "y", "z", "-y", "z"]):
        r = r @ rotation(axis, q[i])
        if i in lengths:
            at = at + r @ ca.vertcat(0, 0, lengths[i])
    return at, r


def flight(p, v, k, t):
    acceleration = lambda v: ca.vertcat(0, 0, -GRAVITY) - k * ca.sqrt(ca.dot(v, v)) * v
    h = t / STEPS
    for _ in range(STEPS):
        a1 = acceleration(v)
        v2 = v + h / 2 * a1
        a2 = acceleration(v2)
        v3 = v + h / 2 * a2
        a3 = acceleration(v3)
        v4 = v + h * a3
        a4 = acceleration(v4)
        p = p + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return p, v


def needed_acceleration(d, t, w0, speed):
    x = 2 * d - t * w0
    s = ca.if_else(x < 0, -1, 1)
    a = (x + s * ca.sqrt(x**2 + (t * w0) ** 2 + 1e-16)) / t**2
    peak = (w0 + a * t) / 2
    top = s * speed
    kept = (top**2 + (top - w0) ** 2) / (2 * (top * t - d))
    return ca.if_else(ca.fabs(peak) <= speed, a, kept)


def farthest(t, w0, joint):
    a, top = joint["acceleration"], joint["speed"]
    peak = (w0 + a * t) / 2
    return ca.if_else(peak <= top, (2 * peak**2 - w0**2) / (2 * a), top * t - (top**2 + (top - w0) ** 2) / (2 * a))


def programme(number, bodies):
    """Returns CasADi functions of (x, parameters) for an arm: cost, equations = 0, inequalities >= 0."""
    arm = ROBOT["arms"][number]
    x = ca.SX.sym("x", 8)
    parameters = ca.SX.sym("p", 3 + 3 + 1 + 7 + 7)
    p, v, k = parameters[0:3], parameters[3:6], parameters[6]
    q0, w0 = parameters[7:14], parameters[14:21]
    q, t = x[0:7], x[7]
    ball, velocity = flight(p, v, k, t)
    at, r = hand(arm, q)
    u = -r.T @ velocity / ca.sqrt(ca.dot(velocity, velocity))
    equations = ca.vertcat(at - ball, u[0], u[1])
    rows = [u[2]]
    shares = []
    for i, joint in enumerate(arm["joints"]):
        rows.append(q[i] - q0[i] + farthest(t, -w0[i], joint))
        rows.append(q0[i] + farthest(t, w0[i], joint) - q[i])
        a = needed_acceleration(q[i] - q0[i], t, w0[i], joint["speed"])
        shares.append(a / joint["acceleration"])
        # A joint that reverses must stay in its range at the reversal.
        turn = q0[i] - w0[i] ** 2 / (2 * a)
        rows.append(ca.if_else(ca.logic_and(w0[i] > 0, a < 0), joint["range"][1] - turn, 1))
        rows.append(ca.if_else(ca.logic_and(w0[i] < 0, a > 0), turn - joint["range"][0], 1))
    for body in bodies:
        if "cylinder" in body:
            body = body["cylinder"]
            rows.append(ca.sqrt((at[0] - body["centre"][0]) ** 2 + (at[1] - body["centre"][1]) ** 2) - body["radius"])
        else:
            body = body["wall"]
            rows.append(ca.dot(ca.DM(body["normal"]), at) - body["offset"])
    cost = ca.sqrt(ca.sumsqr(ca.vertcat(*shares)) / 7 + 1e-6)
    return x, parameters, cost, equations, ca.vertcat(*rows)


class Arm:
    """Both peers for one arm."""

    def __init__(self, number, bodies):
        x, parameters, cost, equations, rows = programme(number, bodies)
        self.joints = ROBOT["arms"][number]["joints"]
        values = ca.Function("values", [x, parameters], [cost, equations, rows])
        slopes = ca.Function("slopes", [x, parameters], [ca.gradient(cost, x), ca.jacobian(equations, x), ca.jacobian(rows, x)])
        self.values, self.slopes = values, slopes
        options = {
            "print_time": False,
            "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-6, "constr_viol_tol": 1e-7, "max_iter": 100},
        }
        problem = {"x": x, "p": parameters, "f": cost, "g": ca.vertcat(equations, rows)}
        self.ipopt = ca.nlpsol("ipopt", "ipopt", problem, options)
        self.equations, self.rows = equations.numel(), rows.numel()

    def bounds(self, problem):
        slowest = max(abs(w) / joint["acceleration"] for w, joint in zip(problem["w0"], self.joints))
        low = [joint["range"][0] for joint in self.joints] + [max(1e-3, slowest)]
        high = [joint["range"][1] for joint in self.joints] + [problem["latest"]]
        return np.array(low), np.array(high)

    def judge(self, x, parameters, bounds):
        """Returns the cost, or None if x is not a catch."""
        cost, equations, rows = (np.array(value).ravel() for value in self.values(x, parameters))
        low, high = bounds
        limits = max(np.max(-rows), np.max(low - x), np.max(x - high))
        catch = np.linalg.norm(equations[:3]) <= 1e-5 and np.linalg.norm(equations[3:]) <= 1e-4 and limits <= 1e-6
        return float(cost[0]) if catch and np.isfinite(cost[0]) else None

    def slsqp(self, start, parameters, bounds):
        last = {}

        def at(x):
            if "x" not in last or not np.array_equal(last["x"], x):
                cost, equations, rows = self.values(x, parameters)
                gradient, by_equations, by_rows = self.slopes(x, parameters)
                last.update(x=x.copy(), cost=float(cost), equations=np.array(equations).ravel(), rows=np.array(rows).ravel())
                last.update(gradient=np.array(gradient).ravel(), by_equations=np.array(by_equations), by_rows=np.array(by_rows))
            return last

        constraints = [
            {"type": "eq", "fun": lambda x: at(x)["equations"], "jac": lambda x: at(x)["by_equations"]},
            {"type": "ineq", "fun": lambda x: at(x)["rows"], "jac": lambda x: at(x)["by_rows"]},
        ]
        found = scipy.optimize.minimize(
            lambda x: at(x)["cost"],
            start,
            jac=lambda x: at(x)["gradient"],
            method="SLSQP",
            bounds=list(zip(*bounds)),
            constraints=constraints,
            options={"maxiter": 100, "ftol": 1e-6},
        )
        return np.clip(found.x, *bounds)

    def interior_point(self, start, parameters, bounds):
        low, high = bounds
        upper = np.concatenate([np.zeros(self.equations), np.full(self.rows, np.inf)])
        found = self.ipopt(x0=start, p=parameters, lbx=low, ubx=high, lbg=np.zeros(self.equations + self.rows), ubg=upper)
        return np.array(found["x"]).ravel()


def quantiles(values):
    values = np.sort(values)
    at = lambda share: float(values[min(len(values), max(1, int(np.ceil(share * len(values))))) - 1])
    return {"p50": at(0.5), "p99": at(0.99), "max": float(values[-1])}


def quadratic_programmes():
    """Solves convex programmes of 8 unknowns, 5 equations and 56 inequalities with Clarabel; the tests' bench times ours."""
    import clarabel
    from scipy import sparse

    rng = np.random.default_rng(1)
    times = []
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for _ in range(300):
        factors = rng.normal(size=(8, 8))
        matrix = factors.T @ factors + 0.1 * np.eye(8)
        rows = rng.normal(size=(61, 8))
        inside = rng.normal(size=8)
        slack = np.concatenate([np.zeros(5), rng.uniform(0, 1, size=56)])
        cones = [clarabel.ZeroConeT(5), clarabel.NonnegativeConeT(56)]
        upper, negative = sparse.csc_matrix(np.triu(matrix)), sparse.csc_matrix(-rows)
        bound = -(rows @ inside - slack)
        gradient = rng.normal(size=8)
        begun = time.perf_counter()
        solver = clarabel.DefaultSolver(upper, gradient, negative, bound, cones, settings)
        solver.solve()
        times.append(1e6 * (time.perf_counter() - begun))
    return {"clarabel_us": quantiles(times)}


def main():
    problems = json.loads(Path(sys.argv[1]).read_text())
    arms = [Arm(number, next(p["bodies"] for p in problems if p["arm"] == number)) for number in (0, 1)]
    names = {"slsqp": Arm.slsqp, "ipopt": Arm.interior_point}
    costs = {name: [] for name in names}
    first_costs = {name: [] for name in names}
    times = {name: [] for name in names}
    first_times = {name: [] for name in names}
    for done, problem in enumerate(problems, 1):
        arm = arms[problem["arm"]]
        parameters = np.array([*problem["p"], *problem["v"], problem["k"], *problem["q0"], *problem["w0"]])
        bounds = arm.bounds(problem)
        for name, solve in names.items():
            best, total = None, 0.0
            for number, (q, t) in enumerate(problem["starts"]):
                begun = time.perf_counter()
                try:
                    x = solve(arm, np.array([*q, t]), parameters, bounds)
                except Exception as error:
                    print(f"{name}, problem {problem['number']}: {error}", file=sys.stderr)
                    x = np.array([*q, t])
                total += 1e3 * (time.perf_counter() - begun)
                cost = arm.judge(x, parameters, bounds)
                if cost is not None and (best is None or cost < best):
                    best = cost
                if number == 0:
                    first_costs[name].append(best)
                    first_times[name].append(total)
            costs[name].append(best)
            times[name].append(total)
        if done % 20 == 0:
            print(f"{done} of {len(problems)} problems", file=sys.stderr)
    ours = [problem["ours"]["cost"] if problem["ours"] else None for problem in problems]
    # Ours, judged by the same functions.
    agreed = 0
    for problem in problems:
        if problem["ours"]:
            arm = arms[problem["arm"]]
            parameters = np.array([*problem["p"], *problem["v"], problem["k"], *problem["q0"], *problem["w0"]])
            cost = arm.judge(np.array([*problem["ours"]["q"], problem["ours"]["t"]]), parameters, arm.bounds(problem))
            agreed += cost is not None and abs(cost - problem["ours"]["cost"]) < 1e-5
    best = [min((c for c in all_costs if c is not None), default=None) for all_costs in zip(ours, *costs.values())]
    solvable = sum(b is not None for b in best)

    def row(own, milliseconds):
        gaps = [(c - b) / b for c, b in zip(own, best) if c is not None]
        return {
            "solved": sum(c is not None for c in own),
            "of": solvable,
            "cost_gap": quantiles(gaps) if gaps else None,
            "ms": quantiles(milliseconds),
        }

    report = {
        "problems": len(problems),
        "solvable": solvable,
        "ours_judged_by_the_peers_functions": agreed,
        "ours": row(ours, [problem["ours"]["ms"] for problem in problems if problem["ours"]]),
        "quadratic_programmes": quadratic_programmes(),
        "versions": {name: version(name) for name in ("scipy", "casadi", "numpy", "clarabel")},
        "machine": platform.processor() or platform.machine(),
    }
    for name in names:
        report[f"{name}_all"] = row(costs[name], times[name])
        report[f"{name}_first"] = row(first_costs[name], first_times[name])
    json.dump(report, sys.stdout, indent=2)
    print()


if __name__ == "__main__":
    main()
