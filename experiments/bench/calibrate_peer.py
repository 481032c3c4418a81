#!/usr/bin/env python3
"""Compares our calibration with SciPy's least_squares on the same session, model, priors and loss, and therefore the same minimum.

    cargo run --release -p tactnet-catching-trials --example peer_session -- 7 > problem.json
    python experiments/bench/calibrate_peer.py problem.json > experiments/results/catching_calibration_peer.json

Needs numpy and scipy. The model is implemented again in numpy over all pictures at once, with numerical derivatives ("2-point"), so the
comparison also checks our model and derivatives. Huber's loss applies to measurements only; priors are squares, which SciPy supports by a
`loss` function of the squared residuals. `cost_of_ours` is the peer's cost at our minimum, `cost_relative` the relative difference of the
peer's own cost, and `farthest` the unknown with the largest difference, in standard deviations of its prior. Both start at the prior means.
Times are for one core and include the peer's numerical derivatives.
"""

import json
import os
import platform
import sys
import time
from importlib.metadata import version

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

GRAVITY = 9.81
NEAREST = 0.02


def turns(axis, angles):
    """Returns rotations about an axis, `[angles][3][3]`."""
    return Rotation.from_rotvec(np.outer(angles, axis)).as_matrix()


class Problem:
    def __init__(self, text):
        self.__dict__.update(text)
        self.guess, self.sigmas = np.array(self.guess), np.array(self.sigmas)
        (self.camera, self.marker, self.offset, self.compliance, self.mount) = self.places[:5]
        (self.neck, self.imu, self.accelerometer, self.gyroscope, self.clocks) = self.places[5:]
        self.lengths = self.clocks + 2
        pictures = self.session["pictures"]
        rows = [
            (p, camera, feature)
            for p in pictures
            for camera, feature in enumerate(p["features"])
            if feature is not None
        ]
        self.views = []
        for arm in range(2):
            for camera in range(2):
                own = [(p, f) for p, c, f in rows if c == camera and p["arm"] == arm]
                column = lambda get: np.array([get(p) for p, _ in own])
                self.views.append({
                    "arm": arm,
                    "camera": camera,
                    "found": np.array([f for _, f in own]),
                    "q": column(lambda p: p["q"]),
                    "loads": column(lambda p: p["loads"]),
                    **self.necks([p["neck"] for p, _ in own]),
                })
        rests, turned = self.session["rests"], self.session["turns"]
        still = [{"q": r["neck"], "dq": [0.0, 0.0], "ddq": [0.0, 0.0]} for r in rests]
        self.rest_necks = np.array([r["neck"] for r in rests])
        self.rest_felt = np.array([r["acceleration"] for r in rests])
        self.rates = [
            (self.necks(still), np.array([r["rate"] for r in rests]), self.noise["rest_rate"]),
            (self.necks([t["neck"] for t in turned]), np.array([t["rate"] for t in turned]), self.noise["rate"]),
        ]

    @staticmethod
    def necks(necks):
        return {k: np.array([n[s] for n in necks]) for k, s in [("pt", "q"), ("dpt", "dq"), ("ddpt", "ddq")]}

    @staticmethod
    def before(motion, late):
        q = motion["pt"] - late * motion["dpt"] + late**2 / 2 * motion["ddpt"]
        return q, motion["dpt"] - late * motion["ddpt"]

    def hand(self, x, view):
        """Returns the markers in the chest frame, in m."""
        arm = view["arm"]
        seven = lambda first: x[first + 7 * arm : first + 7 * arm + 7]
        q = view["q"] + seven(self.offset) + view["loads"] * seven(self.compliance)
        position, lean, lengths = self.arms[arm]
        lengths = np.array(lengths)
        lengths[1:] += x[self.lengths + 2 * arm : self.lengths + 2 * arm + 2]
        r = np.broadcast_to(turns([1, 0, 0], [lean])[0], (len(q), 3, 3))
        at = np.array(position) + x[self.mount + 3 * arm : self.mount + 3 * arm + 3] + r[:, :, 2] * lengths[0]
        axes = [[0, 0, 1], [0, -1, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1], [0, -1, 0], [0, 0, 1]]
        for i, axis in enumerate(axes):
            r = r @ turns(axis, q[:, i])
            if i in (2, 4):
                at = at + r[:, :, 2] * lengths[1 + (i == 4)]
        return at + r @ x[self.marker + 3 * arm : self.marker + 3 * arm + 3]

    def features(self, x, view):
        camera = view["camera"]
        own = x[self.camera + 11 * camera : self.camera + 11 * camera + 11]
        neck, _ = self.before(view, x[self.clocks])
        neck = neck + x[self.neck : self.neck + 2]
        head = turns([0, 0, 1], neck[:, 0]) @ turns([0, 1, 0], neck[:, 1])
        inverse = lambda r, v: np.einsum("nji,nj->ni", r, v)
        seen = inverse(head, self.hand(x, view) - np.array([0, 0, self.neck_height]))
        centre, baseline, (focal, width, height) = self.cameras
        eye = np.array(centre) + np.array([0, (0.5 - camera) * baseline, 0]) + own[8:11]
        seen = (seen - eye) @ Rotation.from_rotvec(own[5:8]).as_matrix()
        ray = -seen[:, 1:] / seen[:, :1]
        s = (ray**2).sum(axis=1, keepdims=True)
        pixel = ray * (focal + own[0]) * (1 + s * (own[3] + s * own[4]))
        pixel = pixel + np.array([width, height]) / 2 + own[1:3]
        left = pixel - view["found"]
        if (seen[:, 0] <= NEAREST).any():
            raise ValueError("a marker behind a camera: ours counts it as a constant, this does not")
        return left / self.noise["feature"]

    def residuals(self, z):
        x = self.guess + self.sigmas * z
        parts = [self.features(x, view).ravel() for view in self.views if len(view["found"])]
        imu = Rotation.from_rotvec(x[self.imu : self.imu + 3]).as_matrix()
        tilt = lambda neck: turns([0, 1, 0], neck[:, 1] + x[self.neck + 1])
        up = np.einsum("nji,j->ni", tilt(self.rest_necks), np.array([0, 0, GRAVITY]))
        bias = x[self.accelerometer : self.accelerometer + 3]
        parts.append(((up @ imu + bias - self.rest_felt) / self.noise["acceleration"]).ravel())
        bias = x[self.gyroscope : self.gyroscope + 3]
        for motion, found, noise in self.rates:
            neck, rate = self.before(motion, x[self.clocks] - x[self.clocks + 1])
            pan = np.stack([0 * rate[:, 0], 0 * rate[:, 0], rate[:, 0]], axis=1)
            turning = np.einsum("nji,nj->ni", tilt(neck), pan) + np.outer(rate[:, 1], [0, 1, 0])
            parts.append(((turning @ imu + bias - found) / noise).ravel())
        return np.concatenate(parts + [z])

    def loss(self, squares):
        """Returns rho and its derivatives by the square: Huber's loss for measurements, squares for priors."""
        rho = np.stack([squares, np.ones_like(squares), np.zeros_like(squares)])
        beyond = squares > self.huber**2
        beyond[-len(self.guess) :] = False
        root = np.sqrt(squares[beyond])
        rho[0, beyond] = 2 * self.huber * root - self.huber**2
        rho[1, beyond] = self.huber / root
        rho[2, beyond] = -self.huber / (2 * root**3)
        return rho


def main():
    problem = Problem(json.load(open(sys.argv[1])))
    cost = lambda z: 0.5 * problem.loss(problem.residuals(z) ** 2)[0].sum()
    ours = (np.array(problem.ours) - problem.guess) / problem.sigmas
    begun = time.perf_counter()
    found = least_squares(
        problem.residuals, np.zeros(len(ours)), loss=problem.loss, method="trf", ftol=1e-12, xtol=1e-12, gtol=1e-10, max_nfev=300
    )
    seconds = time.perf_counter() - begun
    apart = np.abs(found.x - ours)
    farthest = int(apart.argmax())
    print(json.dumps({
        "unknowns": len(ours),
        "residuals": len(problem.residuals(ours)),
        "ours": {"cost": problem.cost, "seconds": problem.solve_seconds},
        "scipy": {
            "cost": found.cost,
            "seconds": seconds,
            "evaluations": int(found.nfev),
            "status": found.message,
            "version": version("scipy"),
        },
        "cost_of_ours": cost(ours),
        "cost_relative": found.cost / problem.cost - 1,
        "farthest": {"unknown": problem.names[farthest], "sigmas": float(apart[farthest])},
        "machine": f"{platform.processor() or platform.machine()}, Python {platform.python_version()}",
    }, indent=2))
    same = abs(found.cost / problem.cost - 1) < 1e-6 and abs(cost(ours) / problem.cost - 1) < 1e-9
    sys.exit(0 if same else 1)


if __name__ == "__main__":
    main()
