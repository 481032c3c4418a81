"""Version 2 of the twin as a probabilistic model: the latent points of its sweeps, and the information of a sweep about its point.

Reimplements data/src/twin/{embedding,excursions,materials,signal,envelope,construction}.rs for `bound.py`: the program draws sweeps, this
module computes likelihoods. The materials' points use the same random streams as the program.
"""

import hashlib
import pathlib

import numpy

CONFUSIONS = pathlib.Path(__file__).resolve().parents[2] / "data/src/twin/tactmat_confusion_robot.csv"
DIMENSIONS = 6

# Construction::two()
DISTANCE, BLOCK, SWEEP = 0.42, 0.12, 0.2
EXCURSIONS, REACH = 0.14, (0.44, 1.24)
GAINS = numpy.array([0.13, 0.18, 0.0, 0.12, 0.075, 0.075])
BOUND = 9.0
AMPLITUDES = numpy.array([0.091, 0.0305, 0.0362, 0.0036])
CORRELATION_STEPS = numpy.array([110.0, 25.0, 5.0, 1.5])
GRAIN, NOISE = 0.024, 0.057
SLIP_RATIO, SLIP_DURATION = 0.25, 1.2
ENVELOPE_DEPTH, ENVELOPE_GAIN, ENVELOPE_STEPS, ENVELOPE_STRIDE = 0.85, 0.15, 80.0, 8
RIDGED = (30, 31, 33)

# signal.rs
RESTING = numpy.array([19.7, 14.8, 16.4, 5.6, 12.5, 57.8, 44.9, 1.5, 13.1, 15.5, 5.7, 10.0, 6.3, 6.3, 2.7, 0.0])
SLIDING = numpy.array([19.4, 3.4, 1.2, 7.8, 9.7, 15.7, 7.1, 3.2, 11.8, 10.5, 3.9, 5.6, 6.2, 7.1, 2.9, 2.7])
TEXTURE_GAINS = numpy.array([1.0, 1.5, 2.0, 1.0, 1.0, 1.9, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
SPREADS = {  # force, tilt, taxel, slip, sliding
    "block": (0.06, 0.04, 0.17, 0.06, 0.15),
    "sweep": (0.05, 0.03, 0.19, 0.08, 0.22),
}
SPEED = 0.03
FAST_SHARE, FAST_STEPS, SLOW_STEPS, ONSET_STEPS = 0.45, 12.0, 400.0, 8.0
PLACES = numpy.array([-1.5, -0.5, 0.5, 1.5])
ROW, COLUMN = numpy.repeat(PLACES, 4), numpy.tile(PLACES, 4)


class Stream:
    """The program's named random stream: ChaCha8, keyed by SHA-256 of seed, name and indices (data/src/seed.rs)."""

    def __init__(self, seed, word, *indices):
        indices = [*indices, 0, 0][:2]
        text = seed.to_bytes(8, "little") + len(word).to_bytes(8, "little") + word.encode()
        key = hashlib.sha256(text + b"".join(i.to_bytes(8, "little") for i in indices)).digest()
        self.key = [int.from_bytes(key[4 * i : 4 * i + 4], "little") for i in range(8)]
        self.counter, self.words = 0, []

    def block(self):
        mask = 0xFFFFFFFF
        start = [0x61707865, 0x3320646E, 0x79622D32, 0x6B206574, *self.key]
        start += [self.counter & mask, self.counter >> 32, 0, 0]
        x = list(start)

        def quarter(a, b, c, d):
            for p, q, r, turn in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
                x[p] = (x[p] + x[q]) & mask
                mixed = x[r] ^ x[p]
                x[r] = (mixed << turn | mixed >> (32 - turn)) & mask

        for _ in range(4):
            for k in range(4):
                quarter(k, 4 + k, 8 + k, 12 + k)
            for k in range(4):
                quarter(k, 4 + (k + 1) % 4, 8 + (k + 2) % 4, 12 + (k + 3) % 4)
        self.counter += 1
        return [(a + b) & mask for a, b in zip(x, start)]

    def unit(self):
        if not self.words:
            self.words = self.block()
        low, high, *self.words = self.words
        return ((high << 32 | low) >> 11) / 2**53

    def normal(self):
        radius = (-2.0 * numpy.log(1.0 - self.unit())) ** 0.5
        return radius * numpy.cos(2 * numpy.pi * self.unit())


def confusions():
    return numpy.loadtxt(CONFUSIONS, delimiter=",")


def materials():
    """Returns the points of the 36 materials `[36][6]`, and the root mean square stress (embedding.rs)."""
    found = confusions()
    p = (found + found.T) / 2
    seen = p > 0.002
    wanted = numpy.sqrt(-8 * numpy.log(2 * numpy.clip(p, 0.002, 0.5)))

    def aim(points):
        present = numpy.linalg.norm(points[:, None] - points[None], axis=-1)
        return present, numpy.where(seen, wanted, numpy.maximum(present, wanted))

    best = None
    for start in range(8):
        stream = Stream(0, "twin-embedding", start)
        points = numpy.array([[3.0 * stream.normal() for _ in range(DIMENSIONS)] for _ in range(36)])
        for _ in range(300):
            present, to = aim(points)
            ratio = to / numpy.maximum(present, 1e-9)
            numpy.fill_diagonal(ratio, 0)
            points = (ratio.sum(1)[:, None] * points - ratio @ points) / 36
        present, to = aim(points)
        below = numpy.tril_indices(36, -1)
        stress = numpy.sqrt(((present - to)[below] ** 2).mean())
        if best is None or stress < best[0]:
            best = stress, points
    stress, points = best
    points = points - points.mean(0)
    _, axes = numpy.linalg.eigh(points.T @ points)
    points = points @ axes[:, ::-1]
    farthest = points[numpy.abs(points).argmax(0), numpy.arange(DIMENSIONS)]
    return points * numpy.sign(farthest), stress


def excursions():
    """Returns the share of excursions of each material, and their targets `[36][36]` (excursions.rs)."""
    found = confusions()
    errors = 1 - numpy.diag(found) / found.sum(1)
    others = found - numpy.diag(numpy.diag(found))
    sums = others.sum(1, keepdims=True)
    return EXCURSIONS * errors / errors.mean(), others / numpy.where(sums > 0, sums, 1)


def mixture():
    """Returns the orthonormal matrix that mixes the coordinates of a point (materials.rs)."""
    k, axis = numpy.arange(DIMENSIONS)[:, None], numpy.arange(DIMENSIONS)
    norm = numpy.where(k == 0, 1.0, 2.0) / DIMENSIONS
    return numpy.sqrt(norm) * numpy.cos(numpy.pi * (axis + 0.5) * k / DIMENSIONS)


def felt(points):
    """Returns the felt coordinates of latent points `[..., 6]`: mixed and bounded."""
    return BOUND * numpy.tanh(points @ mixture().T / BOUND)


def level_covariance(which):
    """Returns the covariance `[32][32]` of the logarithms of resting and sliding factors: 16 of both levels, 16 of the sliding levels alone."""
    force, tilt, taxel, slip, sliding = SPREADS[which]
    levels = force**2 + tilt**2 * (numpy.outer(ROW, ROW) + numpy.outer(COLUMN, COLUMN)) + taxel**2 * numpy.eye(16)
    own = slip**2 + sliding**2 * numpy.eye(16)
    return numpy.block([[levels, numpy.zeros((16, 16))], [numpy.zeros((16, 16)), own]])


def information(y, draw, rounding, steps=1000):
    """Fisher information `[6][6]` of one sweep about `y`, the mixed and bounded coordinates.

    The sweep is taken for Gaussian: mean and covariance of every taxel's readings, given what is told (envelopes, common force, onsets).
    Levels and speed are not told; they are parameters with their priors. Digits are not rounded, or rounding counts as noise of a variance
    of `rounding`, and nothing is cut off below three digits.
    """
    levels, speed = draw["levels"], numpy.exp(draw["speed"])
    u, c, _, length, rows, columns = GAINS * y
    amplitudes = AMPLITUDES * numpy.exp([u, c, 0.0, 0.0])
    taus = CORRELATION_STEPS * numpy.exp([0.0, length, length, length]) / speed
    depth = ENVELOPE_DEPTH * numpy.exp(ENVELOPE_GAIN * y[2])
    slowness = numpy.exp(SLIP_DURATION * length)
    gains = TEXTURE_GAINS * numpy.exp(rows * ROW + columns * COLUMN)
    resting = RESTING * numpy.exp(levels[:16])
    sliding = SLIDING * numpy.exp(levels[:16] + levels[16:] + SLIP_RATIO * (c - u))
    apart = numpy.abs(numpy.subtract.outer(numpy.arange(steps), numpy.arange(steps))).astype(float)
    kernels = [numpy.exp(-apart / tau) for tau in taus]
    time, knots = numpy.arange(1, steps + 1), numpy.arange(0, steps + ENVELOPE_STRIDE, ENVELOPE_STRIDE)
    # Parameters: y, log speed, 16 levels, 16 sliding levels.
    total = numpy.zeros((39, 39))
    for i in range(16):
        since = numpy.maximum(numpy.arange(steps) - draw["onset"][i] + 1, 0)
        fast, slow = since / (FAST_STEPS * slowness), since / (SLOW_STEPS * slowness)
        rest = FAST_SHARE * numpy.exp(-fast) + (1 - FAST_SHARE) * numpy.exp(-slow)
        level = numpy.maximum(sliding[i] + (resting[i] - sliding[i]) * rest, 1e-6)
        factors, slopes = [], []  # of the envelopes, and of their logarithms with y[2]
        for v in draw["envelopes"][i]:
            own = numpy.exp(depth * v - depth**2)
            factors.append(numpy.interp(time, knots, own))
            slopes.append(numpy.interp(time, knots, own * depth * (v - 2 * depth)) * ENVELOPE_GAIN / factors[-1])
        one = numpy.ones(steps)
        shape = level * (1 - numpy.exp(-since / ONSET_STEPS)) * gains[i]
        weights = [a * e * shape for a, e in zip(amplitudes, (one, factors[0], factors[1], factors[1]))]
        bands = [numpy.outer(w, w) * kernel for w, kernel in zip(weights, kernels)]
        texture = sum(bands)
        inverse = numpy.linalg.inv(texture + numpy.diag(NOISE**2 + GRAIN**2 * level + rounding))

        def of_level(slope):
            relative = slope / level
            return numpy.add.outer(relative, relative) * texture + numpy.diag(GRAIN**2 * slope)

        stretched = [band * apart / tau for band, tau in zip(bands, taus)]
        slower = SLIP_DURATION * (resting[i] - sliding[i]) * (
            FAST_SHARE * fast * numpy.exp(-fast) + (1 - FAST_SHARE) * slow * numpy.exp(-slow)
        )
        own_slope, slide_slope = level, sliding[i] * (1 - rest)
        covariance = [
            2 * bands[0],
            2 * bands[1],
            numpy.add.outer(slopes[0], slopes[0]) * bands[1] + numpy.add.outer(slopes[1], slopes[1]) * (bands[2] + bands[3]),
            sum(stretched[1:]) + of_level(slower),
            2 * texture,
            -sum(stretched),
            of_level(own_slope),
            of_level(slide_slope),
        ]
        zero = numpy.zeros(steps)
        mean = numpy.array([zero, zero, zero, slower, zero, zero, own_slope, slide_slope])
        small = inverse.astype("f4")
        products = [small @ part.astype("f4") for part in covariance]
        basic = mean @ inverse @ mean.T
        for a in range(8):
            for b in range(8):
                basic[a, b] += 0.5 * float((products[a] * products[b].T).sum(dtype=float))
        # Derivatives of the eight quantities by each parameter: the slip ratio follows the coarse band minus the
        # undulation.
        to = numpy.zeros((39, 8))
        to[0, [0, 7]] = GAINS[0], -SLIP_RATIO * GAINS[0]
        to[1, [1, 7]] = GAINS[1], SLIP_RATIO * GAINS[1]
        to[2, 2] = 1
        to[3, 3] = GAINS[3]
        to[4, 4], to[5, 4] = GAINS[4] * ROW[i], GAINS[5] * COLUMN[i]
        to[6, 5] = 1
        to[7 + i, 6] = to[23 + i, 7] = 1
        total += to @ basic @ to.T
    total[6, 6] += 1 / SPEED**2
    total[7:, 7:] += numpy.linalg.inv(level_covariance("block") + level_covariance("sweep"))
    return total[:6, :6] - total[:6, 6:] @ numpy.linalg.solve(total[6:, 6:], total[6:, :6])


def draw_contact(random, steps=1000):
    """Draws the properties of a sweep that do not depend on the material: levels, speed, onsets and the envelopes' processes."""
    both = level_covariance("block") + level_covariance("sweep")
    variances = numpy.repeat([sum(SPREADS[which][part] ** 2 for which in SPREADS) for part in (2, 4)], 16)
    keep = numpy.exp(-ENVELOPE_STRIDE / ENVELOPE_STEPS)
    values = [random.standard_normal((16, 2))]
    for _ in range(steps // ENVELOPE_STRIDE):
        values.append(keep * values[-1] + numpy.sqrt(1 - keep**2) * random.standard_normal((16, 2)))
    return {
        "levels": random.multivariate_normal(-variances / 2, both),
        "speed": SPEED * random.standard_normal(),
        "onset": 16 + 6 * random.random() + 10 * random.random(16),
        "envelopes": numpy.moveaxis(values, 0, -1),
    }
