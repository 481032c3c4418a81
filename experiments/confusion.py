#!/usr/bin/env python3
"""Confusions of several runs set beside the published ones. Needs nothing but Python.

    python experiments/confusion.py runs/twin/fast-k-fold-*

Adds up the confusion matrices of the runs' own predictions (1 sweep) and prints the mean of the diagonal and Pearson's
correlation of the off-diagonal entries with the published matrix of TactNet-II (Tulbure & Baeuml, Humanoids 2018, read off the
figure's pixels), with its 95 % interval over materials: rows and columns are resampled together, 1000 times, seed 1.
"""

import argparse
import csv
import pathlib
import random
import statistics

PUBLISHED = pathlib.Path(__file__).parents[1] / "data/src/twin/tactmat_confusion_robot.csv"


def predictions(path):
    """(true, predicted) of a tsml file: three header lines, then true,predicted,,scores."""
    with open(path, newline="") as file:
        for row in list(csv.reader(file))[3:]:
            yield int(row[0]), int(row[1])


def correlation(found, published, materials):
    pairs = [(found[i][j], published[i][j]) for i in materials for j in materials if i != j]
    return statistics.correlation([a for a, _ in pairs], [b for _, b in pairs])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=pathlib.Path, help="run directories")
    options = parser.parse_args()
    with open(PUBLISHED, newline="") as file:
        published = [[float(value) for value in row] for row in csv.reader(file)]
    size = len(published)
    counts = [[0] * size for _ in range(size)]
    for run in options.runs:
        for true, predicted in predictions(run / "predictions_test.csv"):
            counts[true][predicted] += 1
    found = [[count / max(1, sum(row)) for count in row] for row in counts]
    diagonal = [statistics.fmean(matrix[i][i] for i in range(size)) for matrix in (found, published)]
    everything = range(size)
    draws = random.Random(1)
    resampled = sorted(
        correlation(found, published, draws.choices(everything, k=size)) for _ in range(1000)
    )
    print(f"{len(options.runs)} runs, {sum(map(sum, counts))} sweeps")
    print(f"mean of the diagonal: {diagonal[0]:.3f}, published {diagonal[1]:.3f}")
    print(
        f"correlation off the diagonal: {correlation(found, published, everything):.3f} "
        f"[{resampled[25]:.3f}, {resampled[974]:.3f}]"
    )


main()
