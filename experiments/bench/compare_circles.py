#!/usr/bin/env python3
"""Compares the ball detector with OpenCV's Hough transform on the same pictures.

    pip install numpy opencv-python-headless
    python experiments/bench/compare_circles.py --tactnet target/release/tactnet --throws 6 --seed 1 \\
        --out experiments/results/catching_circles.json

The example `peer_pictures` of `tactnet-catching-trials` renders the pictures and writes the true balls and our detections in each single picture,
without gates. OpenCV runs HoughCircles on the same pictures with both of its methods:

    gradient        HOUGH_GRADIENT (Yuen and others), after a 5x5 blur as its documentation advises
    gradient-alt    HOUGH_GRADIENT_ALT, the newer method

each over a grid of its thresholds (param1, param2), with radii from 9 to 140 pixels, at full and half resolution (`resolution`). Circles are
undistorted as ours are. A ball is found if centre and radius of a circle are within 4 pixels or a fifth of the radius.

`at_our_false_alarms` has the best recall of each method with at most our number of false detections in each picture. It is selected on these
very pictures, which favours OpenCV. Times are for one picture and one thread, in milliseconds.
"""

import argparse
import json
import platform
import subprocess
import tempfile
import time
from itertools import product
from pathlib import Path

import cv2
import numpy as np

GRADIENT = [(p1, p2) for p1, p2 in product((60, 100, 160), (12, 18, 26, 36, 50))]
ALT = [(p1, p2) for p1, p2 in product((100, 200, 300), (0.5, 0.65, 0.8, 0.9))]


def undistorted(circles, document):
    """Returns undistorted centres and radii from the four ends of each circle's axes, as ours does."""
    (width, height), focal, (k1, k2) = document["size"], document["focal"], document["distortion"]
    middle = np.array([width / 2, height / 2])

    def undone(place):
        seen = (place - middle) / focal
        ray = seen.copy()
        for _ in range(12):
            s = (ray**2).sum(-1, keepdims=True)
            ray = seen / (1 + s * (k1 + s * k2))
        return ray * focal + middle

    centres, radii = circles[:, :2], circles[:, 2:3]
    right, down = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    ends = [undone(centres + radii * way) for way in (-right, right, -down, down)]
    radius = (ends[1][:, 0] - ends[0][:, 0] + ends[3][:, 1] - ends[2][:, 1]) / 4
    return np.column_stack([sum(ends) / 4, radius])


def judge(circles, ball):
    """Returns if the ball is detected, the error of its centre, and the number of false detections."""
    if ball is None:
        return None, None, len(circles)
    u, v, r = ball
    near = max(4.0, 0.2 * r)
    for a, b, c, *_ in circles:
        if np.hypot(a - u, b - v) < near and abs(c - r) < near:
            return True, (a - u) ** 2 + (b - v) ** 2, len(circles) - 1
    return False, None, len(circles)


def figures(judged, millis):
    found = [hit for hit, _, _ in judged if hit is not None]
    squares = [square for _, square, _ in judged if square is not None]
    return {
        "balls": len(found),
        "recall": sum(found) / max(1, len(found)),
        "false_alarms": sum(false for _, _, false in judged) / len(judged),
        "centre_px_rms": float(np.sqrt(np.mean(squares) / 2)) if squares else None,
        "picture_ms_median": float(np.median(millis)) if millis else None,
    }


def hough(picture, way, param1, param2, resolution):
    scale = 1 if resolution == "full" else 2
    if scale == 2:
        picture = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    if way == "gradient":
        picture = cv2.GaussianBlur(picture, (5, 5), 0)
    method = cv2.HOUGH_GRADIENT if way == "gradient" else cv2.HOUGH_GRADIENT_ALT
    circles = cv2.HoughCircles(
        picture, method, 1.5 if way == "gradient-alt" else 1, 8, param1=param1, param2=param2,
        minRadius=9 // scale, maxRadius=140 // scale,
    )
    return np.zeros((0, 3)) if circles is None else circles.reshape(-1, circles.shape[-1])[:, :3].astype(float) * scale


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tactnet", type=Path, required=True, help="the program")
    parser.add_argument("--throws", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every", type=int, default=5, help="every so many pictures [default: 5]")
    parser.add_argument("--resolutions", nargs="+", default=["full", "half"], choices=["full", "half"])
    parser.add_argument("--out", type=Path, help="write the comparison as JSON")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        pictures = Path(folder) / "pictures"
        export = ["cargo", "run", "--release", "-q", "-p", "tactnet-catching-trials", "--example", "peer_pictures", "--"]
        subprocess.run([*export, str(arguments.throws), str(arguments.seed), str(pictures)], check=True)
        program = json.loads(subprocess.run([arguments.tactnet, "version", "--json"], check=True, capture_output=True).stdout)
        document = json.loads((pictures / "pictures.json").read_text())
        chosen = document["pictures"][:: arguments.every]
        images = [cv2.imread(str(pictures / picture["file"]), cv2.IMREAD_GRAYSCALE) for picture in chosen]
    balls = [picture["ball"] for picture in chosen]
    ours = figures([judge(picture["circles"], ball) for picture, ball in zip(chosen, balls)], [])
    ours["picture_ms_median"] = document["report"]["search"]["picture_ms"]["p50"]
    rows = []
    for resolution in arguments.resolutions:
        for way, grid in (("gradient", GRADIENT), ("gradient-alt", ALT)):
            for param1, param2 in grid:
                judged, millis = [], []
                for image, ball in zip(images, balls):
                    begun = time.perf_counter()
                    circles = hough(image, way, param1, param2, resolution)
                    millis.append(1e3 * (time.perf_counter() - begun))
                    judged.append(judge(undistorted(circles, document) if len(circles) else circles, ball))
                row = {"way": way, "resolution": resolution, "param1": param1, "param2": param2, **figures(judged, millis)}
                rows.append(row)
                print(json.dumps(row), flush=True)
    best = {}
    for resolution in arguments.resolutions:
        for way in ("gradient", "gradient-alt"):
            able = [
                row for row in rows
                if (row["way"], row["resolution"]) == (way, resolution) and row["false_alarms"] <= ours["false_alarms"]
            ]
            best[f"{way}, {resolution}"] = max(able, key=lambda row: row["recall"], default=None)
    report = {
        "schema_version": 1,
        "program": program,
        "opencv": cv2.__version__,
        "processor": platform.processor() or platform.machine(),
        "throws": arguments.throws,
        "seed": arguments.seed,
        "pictures": len(chosen),
        "ours": ours,
        "at_our_false_alarms": best,
        "opencv_rows": rows,
    }
    text = json.dumps({key: value for key, value in report.items() if key != "opencv_rows"}, indent=2)
    print(text)
    if arguments.out:
        arguments.out.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
