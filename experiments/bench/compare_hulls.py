#!/usr/bin/env python3
"""Compares distances of convex hulls with coal (formerly hpp-fcl, used by Pinocchio and others) on the same points.

    pip install numpy coal
    python experiments/bench/compare_hulls.py --tactnet target/release/tactnet --motions 2000 --seed 1 \\
        --out experiments/results/catching_hulls.json

The example `peer_hulls` of `tactnet-catching-trials` writes hulls of the robot's bodies in random postures and swept by random braking
motions, with our distances. coal gets capsules for two points and convex polyhedra for more; hulls without volume are skipped and counted. Touching hulls are
not compared, because we do not compute penetration depths. Times are for one pair and one thread, in microseconds. coal runs through its
Python bindings, where such a call takes `call_us` for two spheres.
"""

import argparse
import json
import platform
import subprocess
import time
from pathlib import Path

import coal
import numpy as np


def shape(points):
    """Returns coal's geometry without radius and its pose; None without volume."""
    points = np.unique(np.array(points), axis=0)
    if len(points) == 1:
        return coal.Sphere(1e-300), coal.Transform3s(np.eye(3), points[0])
    if len(points) == 2:
        middle, axis = points.mean(0), points[1] - points[0]
        length = np.linalg.norm(axis)
        z = axis / length
        x = np.cross(z, [1.0, 0.0, 0.0] if abs(z[0]) < 0.9 else [0.0, 1.0, 0.0])
        x /= np.linalg.norm(x)
        return coal.Capsule(1e-300, length), coal.Transform3s(np.column_stack([x, np.cross(z, x), z]), middle)
    if np.linalg.matrix_rank(points - points.mean(0), tol=1e-6) < 3:
        return None
    vertices = coal.StdVec_Vec3s()
    for point in points:
        vertices.append(point)
    return coal.Convex.convexHull(vertices, True, "Qt"), coal.Transform3s.Identity()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tactnet", type=Path, required=True, help="the program")
    parser.add_argument("--motions", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, help="write the comparison as JSON")
    arguments = parser.parse_args()
    command = [arguments.tactnet, "bench", "catch-safety", f"--motions={arguments.motions}", f"--seed={arguments.seed}"]
    export = ["cargo", "run", "--release", "-q", "-p", "tactnet-catching-trials", "--example", "peer_hulls", "--"]
    export += [str(arguments.motions), str(arguments.seed)]
    hulls = json.loads(subprocess.run(export, check=True, capture_output=True).stdout)
    program = json.loads(subprocess.run([arguments.tactnet, "version", "--json"], check=True, capture_output=True).stdout)
    report = json.loads(subprocess.run([*command, "--json"], check=True, capture_output=True).stdout)
    request = coal.DistanceRequest()
    request.gjk_tolerance, request.gjk_max_iterations = 1e-12, 1000

    def timed(a, b):
        result, begun = coal.DistanceResult(), time.perf_counter()
        distance = coal.distance(a[0], a[1], b[0], b[1], request, result)
        return distance, 1e6 * (time.perf_counter() - begun)

    differences, micros, flat, touching = [], [], 0, 0
    for pair in hulls:
        a, b = shape(pair["a"]), shape(pair["b"])
        if a is None or b is None:
            flat += 1
            continue
        timed(a, b)
        distance, spent = timed(a, b)
        ours = pair["distance"] + sum(pair["radii"])
        if distance <= 0.0 or ours <= 0.0:
            touching += 1
            continue
        micros.append(spent)
        differences.append(abs(distance - ours))
    spheres = [(coal.Sphere(0.1), coal.Transform3s(np.eye(3), np.array([x, 0.0, 0.0]))) for x in (0.0, 1.0)]
    call = float(np.median([timed(*spheres)[1] for _ in range(1000)]))
    document = {
        "schema_version": 1,
        "program": program,
        "coal": coal.__version__,
        "processor": platform.processor() or platform.machine(),
        "pairs": len(differences),
        "without_volume": flat,
        "touching": touching,
        "largest_difference_m": float(max(differences)),
        "coal_us_median": float(np.median(micros)),
        "call_us": call,
        "our_distance_us_mean": report["distance_us"],
        "our_swept_and_distance_us_mean": report["swept_us"],
    }
    text = json.dumps(document, indent=2)
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
