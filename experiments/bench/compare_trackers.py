#!/usr/bin/env python3
"""The tracker of balls beside filterpy's unscented Kalman filter and Stone Soup's multi-frame assignment: same circles, models and starts.

    pip install numpy scipy filterpy==2.0.0 stonesoup==1.9.1 ortools
    python experiments/bench/compare_trackers.py --throws 200 --seed 1 \\
        --out experiments/results/catching_trackers.json

or, with the circles of `cargo run --release -p tactnet-catching-trials --example peer_circles -- 200 1 > circles.json`,
`--circles circles.json`.

The head stands still and is known. Everyone begins at our tracker's first report of a ball and has our models: flight by Runge and Kutta,
outline of a sphere, noise, blur, sigma points with alpha 0.5, beta 2, kappa 0, drawn anew for each picture.

    filter      one ball, all of its circles and no others: our filter and filterpy's after each pair of pictures. `state_sigmas` is the
                largest difference of a state in our standard deviations, `covariance_sigmas` that of a covariance's entry over the
                product of both. filterpy's interface takes one sigma point at a time, so its models are plain Python on floats.
    clutter     the usual clutter and misses: our tracker and Stone Soup's MFADataAssociator with the same gate, detection and clutter.
                A window of 6 pictures is 3 pairs, as far back as ours looks; hypotheses less than a millionth as probable as the best
                are dropped after each picture, as ours are (without that, ten throws took Stone Soup twenty times as long, and it found
                the same). Both are judged by the functions below at the catch, from the last pictures at least 200 ms before it, by
                their most probable hypothesis; `judged_alike` is the largest relative difference from what our own bench says of ours.
                A ball of ours is lost if nothing is said of it within 0.5 m of it, one of Stone Soup's if it is said to come farther
                than that from where it does. Ours also looks for other balls; Stone Soup is told of one. Stone Soup's models are numpy
                on all sigma points at once.

Times are of one pair of pictures, microseconds, one core, this process and ours one after the other.
"""

import argparse
import json
import math
import os
import platform
import subprocess
import sys
import time
import warnings
from datetime import datetime, timedelta
from importlib.metadata import version
from pathlib import Path

# One core, like ours.
os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

try:
    import numpy as np
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
    from stonesoup.base import Property
    from stonesoup.dataassociator.mfa import MFADataAssociator
    from stonesoup.hypothesiser.mfa import MFAHypothesiser
    from stonesoup.hypothesiser.probability import PDAHypothesiser
    from stonesoup.models.base import GaussianModel
    from stonesoup.models.measurement.base import MeasurementModel
    from stonesoup.models.transition.base import TransitionModel
    from stonesoup.predictor.kalman import UnscentedKalmanPredictor
    from stonesoup.types.array import CovarianceMatrix, StateVector, StateVectors
    from stonesoup.types.detection import Detection
    from stonesoup.types.mixture import GaussianMixture
    from stonesoup.types.numeric import Probability
    from stonesoup.types.state import TaggedWeightedGaussianState
    from stonesoup.types.track import Track
    from stonesoup.types.update import GaussianMixtureUpdate
    from stonesoup.updater.kalman import UnscentedKalmanUpdater
except ImportError as error:
    sys.exit(f"compare_trackers.py: {error}; needs numpy, scipy, filterpy, stonesoup, ortools")

STATES = 10
# Maximum step of the flight's integration, in s.
STEP = 0.01
# Distance from the ball above which a prediction belongs to another object, in m.
SAME_BALL = 0.5
SPREAD = {"alpha": 0.5, "beta": 2.0, "kappa": 0.0}


class Models:
    """The flight and camera models of the tracker, for numpy (states in columns) and for single states in plain Python."""

    def __init__(self, circles, throw):
        cameras, self.config = circles["cameras"], circles["config"]
        self.gravity, self.radius = circles["gravity"], circles["ball_radius"]
        self.focal, self.size, self.exposure = cameras["focal"], cameras["size"], cameras["exposure"]
        self.offsets = np.array(cameras["offsets"])
        self.head, self.rotation = np.array(throw["head"]), np.array(throw["head_rotation"])
        self.plain_offsets, self.plain_head, self.plain_rotation = cameras["offsets"], throw["head"], throw["head_rotation"]

    def fly(self, x, dt):
        """Returns the state `dt` seconds later; x: [10, n]."""
        p, v, k, lift = x[0:3], x[3:6], x[6], x[7:10]

        def acceleration(v):
            drag = k * np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
            a = -drag * v
            a[0] += lift[1] * v[2] - lift[2] * v[1]
            a[1] += lift[2] * v[0] - lift[0] * v[2]
            a[2] += lift[0] * v[1] - lift[1] * v[0] - self.gravity
            return a

        steps = max(1, math.ceil(abs(dt) / STEP))
        h = dt / steps
        for _ in range(steps):
            a1 = acceleration(v)
            v2 = v + a1 * (h / 2)
            a2 = acceleration(v2)
            v3 = v + a2 * (h / 2)
            a3 = acceleration(v3)
            v4 = v + a3 * h
            a4 = acceleration(v4)
            p = p + (v + (v2 + v3) * 2 + v4) * (h / 6)
            v = v + (a1 + (a2 + a3) * 2 + a4) * (h / 6)
        return np.concatenate([p, v, x[6:10]])

    def see(self, p, camera):
        """Returns circles [3, n] in pixels of positions p: [3, n] in the inertial frame."""
        x, y, z = self.rotation.T @ (p - self.head[:, None]) - self.offsets[camera][:, None]
        depth = x * x - self.radius**2
        scale = self.focal * x / depth
        tangential = self.focal * self.radius / np.sqrt(depth)
        radial = self.focal * self.radius / depth * np.sqrt(x * x + y * y + z * z - self.radius**2)
        return np.stack([self.size[0] / 2 - scale * y, self.size[1] / 2 - scale * z, (tangential + radial) / 2])

    def fly_plain(self, state, dt):
        """Returns the next state of a single state, a sequence of 10 floats."""
        px, py, pz, vx, vy, vz, k, lx, ly, lz = (float(number) for number in state)
        gravity = self.gravity

        def acceleration(x, y, z):
            drag = k * math.sqrt(x * x + y * y + z * z)
            return ly * z - lz * y - drag * x, lz * x - lx * z - drag * y, lx * y - ly * x - drag * z - gravity

        steps = max(1, math.ceil(abs(dt) / STEP))
        h = dt / steps
        half, sixth = h / 2, h / 6
        for _ in range(steps):
            a1x, a1y, a1z = acceleration(vx, vy, vz)
            v2x, v2y, v2z = vx + a1x * half, vy + a1y * half, vz + a1z * half
            a2x, a2y, a2z = acceleration(v2x, v2y, v2z)
            v3x, v3y, v3z = vx + a2x * half, vy + a2y * half, vz + a2z * half
            a3x, a3y, a3z = acceleration(v3x, v3y, v3z)
            v4x, v4y, v4z = vx + a3x * h, vy + a3y * h, vz + a3z * h
            a4x, a4y, a4z = acceleration(v4x, v4y, v4z)
            px += (vx + (v2x + v3x) * 2 + v4x) * sixth
            py += (vy + (v2y + v3y) * 2 + v4y) * sixth
            pz += (vz + (v2z + v3z) * 2 + v4z) * sixth
            vx += (a1x + (a2x + a3x) * 2 + a4x) * sixth
            vy += (a1y + (a2y + a3y) * 2 + a4y) * sixth
            vz += (a1z + (a2z + a3z) * 2 + a4z) * sixth
        return [px, py, pz, vx, vy, vz, k, lx, ly, lz]

    def see_plain(self, state, camera):
        """Returns the circle of a single state."""
        off = [float(state[i]) - self.plain_head[i] for i in range(3)]
        turned = self.plain_rotation
        x, y, z = (sum(turned[i][j] * off[i] for i in range(3)) - self.plain_offsets[camera][j] for j in range(3))
        depth = x * x - self.radius**2
        scale = self.focal * x / depth
        tangential = self.focal * self.radius / math.sqrt(depth)
        radial = self.focal * self.radius / depth * math.sqrt(x * x + y * y + z * z - self.radius**2)
        return [self.size[0] / 2 - scale * y, self.size[1] / 2 - scale * z, (tangential + radial) / 2]

    def process_noise(self, dt):
        """Returns the process noise [10, 10]: white acceleration, random walks of drag and lift."""
        q = self.config["acceleration_noise"]
        noise = np.zeros((STATES, STATES))
        for i in range(3):
            noise[i, i] = q * q * dt**3 / 3
            noise[i, i + 3] = noise[i + 3, i] = q * q * dt**2 / 2
            noise[i + 3, i + 3] = q * q * dt
        noise[6, 6] = self.config["drag_walk"] ** 2 * dt
        for i in range(7, STATES):
            noise[i, i] = self.config["lift_walk"] ** 2 * dt
        return noise

    def circle_noise(self, x, camera):
        """Returns the measurement noise [3, 3] for a state [10]: detector noise and blur."""
        half = x[3:6] * (self.exposure / 2)
        ends = self.see(np.stack([x[0:3] + half, x[0:3] - half], axis=1), camera)
        blur = (ends[:, 0] - ends[:, 1]) * (self.config["blur"] / math.sqrt(12))
        centre, radius = self.config["centre_noise"] ** 2, self.config["radius_noise"] ** 2
        return np.diag([centre, centre, radius]) + np.outer(blur, blur)


def quantiles(values):
    values = np.sort(values)
    at = lambda share: float(values[min(len(values), max(1, int(np.ceil(share * len(values))))) - 1])
    return {"p50": at(0.5), "p99": at(0.99), "max": float(values[-1])}


def follow_with_filterpy(models, run):
    """Returns the largest differences from ours, of states and of covariances, in sigmas, and the time of each pair in microseconds."""
    points = MerweScaledSigmaPoints(STATES, **SPREAD)
    ukf = UnscentedKalmanFilter(
        dim_x=STATES, dim_z=3, dt=0.04, hx=models.see_plain, fx=models.fly_plain, points=points
    )
    ukf.x, ukf.P = np.array(run["start"]["x"]), np.array(run["start"]["covariance"])
    last = run["start"]["t_ns"]
    states, covariances, times = 0.0, 0.0, []
    for pair in run["pairs"]:
        ours = pair["ours"]
        dt = (ours["t_ns"] - last) * 1e-9
        last = ours["t_ns"]
        begun = time.perf_counter()
        ukf.Q = models.process_noise(dt)
        ukf.predict(dt=dt)
        for camera, circle in enumerate(pair["circles"]):
            if circle is not None:
                ukf.sigmas_f = points.sigma_points(ukf.x, ukf.P)
                ukf.update(np.array(circle), R=models.circle_noise(ukf.x, camera), camera=camera)
        times.append(1e6 * (time.perf_counter() - begun))
        own = np.array(ours["covariance"])
        sigmas = np.sqrt(np.diag(own))
        states = max(states, np.max(np.abs(ukf.x - ours["x"]) / sigmas))
        covariances = max(covariances, np.max(np.abs(ukf.P - own) / np.outer(sigmas, sigmas)))
    return float(states), float(covariances), times


class BallFlight(TransitionModel, GaussianModel):
    """Stone Soup's transition model of a ball's flight."""

    models: Models = Property(doc="Flight and pictures")

    @property
    def ndim_state(self):
        return STATES

    def function(self, state, noise=False, time_interval=None, **kwargs):
        found = self.models.fly(np.asarray(state.state_vector, dtype=float), time_interval.total_seconds())
        return found.view(StateVectors if found.shape[1] > 1 else StateVector)

    def covar(self, time_interval=None, **kwargs):
        return CovarianceMatrix(self.models.process_noise(time_interval.total_seconds()))


class BallOutline(MeasurementModel, GaussianModel):
    """A camera for Stone Soup. `covar` depends on the state because of the blur."""

    models: Models = Property(doc="Flight and pictures")
    camera: int = Property(doc="0 left, 1 right")

    @property
    def ndim_meas(self):
        return 3

    def function(self, state, noise=False, **kwargs):
        found = self.models.see(np.asarray(state.state_vector, dtype=float)[0:3], self.camera)
        return found.view(StateVectors if found.shape[1] > 1 else StateVector)

    def covar(self, seen=None, **kwargs):
        return CovarianceMatrix(self.models.circle_noise(np.asarray(seen.state_vector, dtype=float)[:, 0], self.camera))


class BlurredUpdater(UnscentedKalmanUpdater):
    """An updater that passes the predicted state to the measurement's covariance."""

    def predict_measurement(self, predicted_state, measurement_model=None, measurement_noise=True, **kwargs):
        return super().predict_measurement(predicted_state, measurement_model, measurement_noise, seen=predicted_state)


def track_with_stone_soup(models, run, window):
    """Returns state and covariance of the most probable hypothesis after the last pair, and the time of each pair in microseconds."""
    config = models.config
    low, high = config["clutter_radius"]
    predictor = UnscentedKalmanPredictor(BallFlight(models=models), **SPREAD)
    updater = BlurredUpdater(measurement_model=None, **SPREAD)
    # The gate of 99.9 % equals ours, chi square of 3 degrees of freedom.
    hypothesiser = PDAHypothesiser(
        predictor,
        updater,
        clutter_spatial_density=config["clutter"] / (models.size[0] * models.size[1] * (high - low)),
        prob_detect=Probability(config["detection"]),
        prob_gate=Probability(0.999),
    )
    associator = MFADataAssociator(MFAHypothesiser(hypothesiser), slide_window=window)
    cameras = [BallOutline(ndim_state=STATES, mapping=(0, 1, 2), models=models, camera=camera) for camera in (0, 1)]
    epoch = datetime(2000, 1, 1)
    # Pictures are taken at whole milliseconds, so microseconds are exact.
    at = lambda t_ns: epoch + timedelta(microseconds=t_ns // 1000)
    start = run["start"]
    first = TaggedWeightedGaussianState(
        StateVector(start["x"]),
        CovarianceMatrix(start["covariance"]),
        timestamp=at(start["t_ns"]),
        weight=Probability(1),
        tag=[],
    )
    track = Track([GaussianMixture([first])])
    times = []
    for pair in run["pairs"]:
        begun = time.perf_counter()
        timestamp = at(pair["t_ns"])
        for camera, circles in zip(cameras, pair["circles"]):
            found = {
                Detection(StateVector(circle), timestamp=timestamp, measurement_model=camera) for circle in circles
            }
            hypotheses = associator.associate({track}, found, timestamp)[track]
            components = [updater.update(hypothesis) if hypothesis else hypothesis.prediction for hypothesis in hypotheses]
            least = config["least_weight"] * max(component.weight for component in components)
            components = [component for component in components if component.weight >= least]
            track.append(GaussianMixtureUpdate(hypothesis=hypotheses, components=components))
        times.append(1e6 * (time.perf_counter() - begun))
    best = max(track.state.components, key=lambda component: component.weight)
    return np.asarray(best.state_vector, dtype=float)[:, 0], np.asarray(best.covar, dtype=float), times


def judge(models, throw, t_ns, x, covariance):
    """Returns errors at the catch: distance m, across mm, along ms, normalised square."""
    dt = (throw["catch_ns"] - t_ns) * 1e-9
    p, v = np.array(throw["p"]), np.array(throw["v"])
    error = models.fly(x[:, None], dt)[0:3, 0] - p
    heading = v / np.linalg.norm(v)
    along = error @ heading
    h = 1e-5
    steps = h * np.eye(STATES)
    slopes = (models.fly(x[:, None] + steps, dt)[0:3] - models.fly(x[:, None] - steps, dt)[0:3]) / (2 * h)
    position = slopes @ covariance @ slopes.T
    return {
        "off_m": float(np.linalg.norm(error)),
        "across_mm": float(1e3 * np.linalg.norm(error - heading * along)),
        "along_ms": float(1e3 * along / np.linalg.norm(v)),
        "nees": float(error @ np.linalg.solve(position, error)),
    }


def figures(judged, lost, times):
    rms = lambda name: float(np.sqrt(np.mean([one[name] ** 2 for one in judged])))
    reach = 1.96 * math.sqrt(6 / len(judged))
    return {
        "across_mm_rms_200ms": rms("across_mm"),
        "along_ms_rms_200ms": rms("along_ms"),
        "nees_200ms": float(np.mean([one["nees"] for one in judged])),
        "nees_band": [3 - reach, 3 + reach],
        "predictions": len(judged),
        "lost": lost,
        "pair_us": quantiles(times),
    }


def compare_filters(circles):
    states, covariances, ours, theirs = [], [], [], []
    for throw in circles["throws"]:
        if throw["alone"] and throw["alone"]["pairs"]:
            state, covariance, times = follow_with_filterpy(Models(circles, throw), throw["alone"])
            states.append(state)
            covariances.append(covariance)
            ours += [pair["us"] for pair in throw["alone"]["pairs"]]
            theirs += times
    return {
        "throws": len(states),
        "pairs": len(theirs),
        "state_sigmas": max(states),
        "covariance_sigmas": max(covariances),
        "ours_us": quantiles(ours),
        "filterpy_us": quantiles(theirs),
    }


def compare_trackers(circles, window):
    ours, theirs, our_times, their_times = [], [], [], []
    our_lost, their_lost, alike, not_begun = 0, 0, 0.0, 0
    throws = circles["throws"]
    # Warm up: load everything that is loaded once.
    warm = next(throw for throw in throws if throw["cluttered"])
    track_with_stone_soup(Models(circles, warm), warm["cluttered"], window)
    for done, throw in enumerate(throws, 1):
        run = throw["cluttered"]
        if run is None:
            not_begun += 1
            continue
        models = Models(circles, throw)
        our_times += [pair["us"] for pair in run["pairs"]]
        if run["ours"]:
            own, state = run["ours"], run["ours"]["state"]
            judged = judge(models, throw, state["t_ns"], np.array(state["x"]), np.array(state["covariance"]))
            ours.append(judged)
            alike = max(alike, *(abs(judged[name] - own[name]) / abs(own[name]) for name in ("across_mm", "along_ms", "nees")))
        else:
            our_lost += 1
        x, covariance, times = track_with_stone_soup(models, run, window)
        their_times += times
        judged = judge(models, throw, run["pairs"][-1]["t_ns"], x, covariance)
        # Ours is checked at the pictures; the check at the catch is stricter.
        if judged["off_m"] < SAME_BALL:
            theirs.append(judged)
        else:
            their_lost += 1
        if done % 20 == 0:
            print(f"{done} of {len(throws)} throws", file=sys.stderr)
    return {
        "throws": len(throws),
        "not_begun": not_begun,
        "window": window,
        "judged_alike": alike,
        "ours": figures(ours, our_lost, our_times),
        "stonesoup_mfa": figures(theirs, their_lost, their_times),
    }


def export(throws, seed):
    """Returns the circles of the example `peer_circles`."""
    command = ["cargo", "run", "--release", "-q", "-p", "tactnet-catching-trials", "--example", "peer_circles", "--"]
    return json.loads(subprocess.run([*command, str(throws), str(seed)], check=True, capture_output=True).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--circles", type=Path, metavar="FILE", help="output of the example `peer_circles` [default: run it]")
    parser.add_argument("--throws", type=int, default=200, help="without --circles (default: 200)")
    parser.add_argument("--seed", type=int, default=1, help="without --circles (default: 1)")
    parser.add_argument("--window", type=int, default=6, help="pictures that Stone Soup assigns together (default: 6)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the figures here, not to stdout")
    arguments = parser.parse_args()
    circles = json.loads(arguments.circles.read_text()) if arguments.circles else export(arguments.throws, arguments.seed)
    warnings.filterwarnings("ignore", category=DeprecationWarning)
    report = {
        "seed": circles["seed"],
        "filter": compare_filters(circles),
        "clutter": compare_trackers(circles, arguments.window),
        "versions": {name: version(name) for name in ("filterpy", "stonesoup", "ortools", "numpy", "scipy")},
        "machine": platform.processor() or platform.machine(),
    }
    text = json.dumps(report, indent=2) + "\n"
    if arguments.out:
        arguments.out.write_text(text)
    else:
        sys.stdout.write(text)


if __name__ == "__main__":
    main()
