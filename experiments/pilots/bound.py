"""What the best classifier could reach on version 2 of the twin with one sweep: estimates from above.

    python experiments/pilots/bound.py --out experiments/pilots/bound.jsonl

Needs numpy; half an hour of a core. The classifier knows how the twin is made (twin_model.py): all materials' points, how often sweeps of
which material feel like which other, and how sweeps vary. It is told more than a sweep says, so it is better than any that could be built:

- "point told": the point in the latent space that the sweep was drawn at, exactly. What is left are sweeps that lie where those of two
  materials may lie.
- "sweep told in part": the point as well as the best estimate from the sweep gives it, with the envelopes of the texture, the common force
  and the onsets told. The errors of that estimate are normal, with the inverse of the Fisher information of a sweep that is taken for
  Gaussian; they are computed at `--references` points of each material, and every sweep takes those of the nearest. Once with readings that
  nobody rounds, once with rounding counted as noise of a twelfth of a square digit. That nothing below three digits is read counts in neither.
- Ridges are told: the three materials that have them are never mistaken.
- "blocks told" is about random folds: the drift of the levels in a block of ten sweeps is drawn once, for that material alone, and test
  sweeps share it with training sweeps. The classifier is told the drift of all 360 blocks and the levels of the sweep, and nothing else.

Materials are equally frequent. Intervals are over sweeps (two standard errors).
"""

import argparse

import numpy

import results
import twin_model as twin

GRID = 40


class Model:
    """Latent points of each material as a mixture of normal distributions: one for usual sweeps, others for excursions."""

    def __init__(self):
        points, _ = twin.materials()
        self.points = points / twin.DISTANCE
        self.share, self.others = twin.excursions()
        reaches = twin.REACH[0] + (numpy.arange(GRID) + 0.5) / GRID * (twin.REACH[1] - twin.REACH[0])
        centres, weights, labels = [], [], []
        for label in range(36):
            centres.append(self.points[label][None])
            weights.append([1 - self.share[label]])
            for other in numpy.where(self.others[label] > 0)[0]:
                centres.append(self.points[label] + reaches[:, None] * (self.points[other] - self.points[label]))
                weights.append(numpy.full(GRID, self.share[label] * self.others[label, other] / GRID))
            labels += [label] * (sum(map(len, centres)) - len(labels))
        self.centres, self.labels = numpy.concatenate(centres), numpy.array(labels)
        with numpy.errstate(divide="ignore"):
            self.log_weights = numpy.log(numpy.concatenate(weights))
        self.variance = twin.BLOCK**2 + twin.SWEEP**2
        slope = 1 - (twin.felt(self.centres) / twin.BOUND) ** 2
        turned = slope[:, :, None] * twin.mixture()
        self.own = self.variance * turned @ turned.transpose(0, 2, 1)

    def draw(self, random, label):
        """Returns a sweep's point, and whether it is an excursion."""
        centre, astray = self.points[label], random.random() < self.share[label]
        if astray:
            other = random.choice(36, p=self.others[label])
            centre = centre + random.uniform(*twin.REACH) * (self.points[other] - centre)
        return centre + self.variance**0.5 * random.standard_normal(6), astray

    def log_likelihoods(self, at, error=None):
        """Returns log likelihoods of all materials `[n][36]` at `[n][6]`: latent points, or felt coordinates, with a covariance `error`."""
        if error is None:
            factors = numpy.broadcast_to(numpy.eye(6) / self.variance**0.5, (len(self.centres), 6, 6))
            centres = self.centres
        else:
            factors = numpy.linalg.inv(numpy.linalg.cholesky(self.own + error))
            centres = twin.felt(self.centres)
        norm = numpy.log(numpy.diagonal(factors, axis1=1, axis2=2)).sum(1) + self.log_weights
        found = numpy.full((len(at), 36), -numpy.inf)
        for n, one in enumerate(at):
            apart = numpy.einsum("cij,cj->ci", factors, one - centres)
            logs = norm - 0.5 * (apart**2).sum(1)
            most = logs.max()
            sums = numpy.bincount(self.labels, numpy.exp(logs - most), 36)
            with numpy.errstate(divide="ignore"):
                found[n] = most + numpy.log(sums)
        return found


def summary(name, logs, labels, astray):
    logs = numpy.maximum(logs - logs.max(1, keepdims=True), -700)
    ridged = numpy.isin(labels, twin.RIDGED)
    logs[:, twin.RIDGED] = -1e4
    logs[ridged] = -1e4
    logs[ridged, labels[ridged]] = 0
    logs = logs - numpy.log(numpy.exp(logs).sum(1, keepdims=True))
    right = logs.argmax(1) == labels
    fused = []
    for label in range(36):
        own = logs[labels == label]
        fused += list(own[: len(own) // 3 * 3].reshape(-1, 3, 36).sum(1).argmax(1) == label)
    return {
        "told": name,
        "accuracy": right.mean(),
        "two_standard_errors": 2 * right.std() / len(right) ** 0.5,
        "accuracy_not_astray": right[~astray].mean(),
        "accuracy_astray": right[astray].mean(),
        "three_sweeps": numpy.mean(fused),
        "nll": -logs[numpy.arange(len(labels)), labels].mean(),
        "sweeps": len(labels),
    }


def blocks(random, sweeps):
    """Returns the accuracy by levels alone if the drift of all blocks is known."""
    names = numpy.repeat(numpy.arange(36), 10)
    drifts = random.multivariate_normal(numpy.zeros(32), twin.level_covariance("block"), len(names))
    own = random.multivariate_normal(numpy.zeros(32), twin.level_covariance("sweep"), (len(names), sweeps // len(names)))
    whiten = numpy.linalg.inv(numpy.linalg.cholesky(twin.level_covariance("sweep"))).T
    white = drifts @ whiten
    right = []
    for name, sweeps_of_block in zip(names, (drifts[:, None] + own) @ whiten):
        distances = ((sweeps_of_block[:, None] - white) ** 2).sum(-1)
        nearest = numpy.array([distances[:, names == other].min(1) for other in range(36)])
        right += list(nearest.argmin(0) == name)
    right = numpy.array(right)
    # Sliding levels also depend on the texture slightly; this is neglected.
    return {"told": "blocks", "accuracy": right.mean(), "two_standard_errors": 2 * right.std() / len(right) ** 0.5, "sweeps": len(right)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sweeps", type=int, default=500, help="of each material")
    parser.add_argument("--references", type=int, default=1, help="points of each material at which errors are computed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", help="JSON lines")
    arguments = parser.parse_args()
    random = numpy.random.default_rng(arguments.seed)
    model = Model()

    def say(row):
        results.say({**row, "seed": arguments.seed}, arguments.out)

    labels = numpy.repeat(numpy.arange(36), arguments.sweeps)
    drawn = [model.draw(random, label) for label in labels]
    points, astray = numpy.array([point for point, _ in drawn]), numpy.array([flag for _, flag in drawn])
    say(summary("point", model.log_likelihoods(points), labels, astray))
    say(blocks(random, 36000))

    places, contacts = [], []
    for label in range(36):
        for _ in range(arguments.references):
            places.append(twin.felt(model.draw(random, label)[0]))
            contacts.append(twin.draw_contact(random))
    seen = twin.felt(points)
    nearest = ((seen[:, None] - numpy.array(places)) ** 2).sum(-1).argmin(1)
    for name, rounding in (("sweep in part, not rounded", 0.0), ("sweep in part, rounding as noise", 1 / 12)):
        logs = numpy.zeros((len(labels), 36))
        deviations = []
        for place, contact in enumerate(contacts):
            error = numpy.linalg.inv(twin.information(places[place], contact, rounding))
            deviations.append(numpy.diag(error) ** 0.5)
            own = nearest == place
            noisy = seen[own] + random.multivariate_normal(numpy.zeros(6), error, own.sum())
            logs[own] = model.log_likelihoods(noisy, error)
        row = summary(name, logs, labels, astray)
        row["errors"] = [round(float(x), 3) for x in numpy.median(deviations, 0)]
        say(row)


if __name__ == "__main__":
    main()
