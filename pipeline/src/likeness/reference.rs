//! Scores of held-out training sweeps, from which p-values follow.

use std::collections::BTreeMap;

use rand::{Rng, RngExt};

use super::distances::Distance;

/// Number of sweeps of a material for which its own typical distance counts as much as that of all materials.
const SHRUNK_SWEEPS: f64 = 3.0;
/// Number of resampled sets of sweeps behind a p-value.
const RESAMPLES: usize = 999;

/// Held-out training sweep.
pub(super) struct ReferenceSweep {
    /// Distance from the other training sweeps.
    pub distance: Distance,
    /// Number of standard deviations by which a taxel is more constant than in the other training sweeps, `[taxels]`.
    pub constant: Vec<f64>,
    /// Direction in which it differs from the nearest material, of length 1; empty if directions are not compared.
    pub direction: Vec<f64>,
    /// Unit of sweeps that are resampled together.
    pub unit: usize,
}

/// Sweeps to compare with the training sweeps.
pub(super) struct SweepSet<'a> {
    /// Distance of every sweep.
    pub distances: &'a [Distance],
    /// Number of standard deviations by which a taxel is more constant than in training sweeps, `[sweeps][taxels]`.
    pub constant: Vec<Vec<f64>>,
    /// Directions in which sweeps differ from the nearest material, of length 1: `[sweeps][width]`.
    pub directions: Vec<Vec<f64>>,
}

/// Statistics of a set of sweeps; large ones are evidence of a difference.
#[derive(Clone, Copy)]
struct Statistics {
    /// Mean surprise about a sweep.
    surprise: f64,
    /// Largest mean score over taxels of being constant.
    constant: f64,
    /// Squared length of the sum of the directions, over the number of sweeps; 1 on average for independent directions.
    agreement: f64,
}

/// Scores of held-out training sweeps.
pub(super) struct ReferenceScores {
    /// Typical logarithmic distance by nearest material.
    typical: BTreeMap<usize, f64>,
    /// Typical logarithmic distance over all materials.
    typical_of_all: f64,
    /// Logarithmic distances relative to the typical one, ascending.
    excess: Vec<f64>,
    /// Surprises about constant taxels, ascending.
    constant_surprises: Vec<f64>,
    /// Smaller p-value of the two, ascending.
    smaller: Vec<f64>,
    /// Negative logarithm of the p-value of every sweep.
    surprises: Vec<f64>,
    /// Scores of being constant: `[sweeps][taxels]`.
    constant: Vec<Vec<f64>>,
    /// Directions: `[sweeps][width]`.
    directions: Vec<Vec<f64>>,
    /// Positions of the sweeps of every unit that is resampled as a whole.
    units: Vec<Vec<usize>>,
    /// Number of sweeps by nearest material.
    sweeps: BTreeMap<usize, usize>,
}

impl ReferenceScores {
    /// - `reference`: held-out training sweeps, at least one
    pub fn new(reference: Vec<ReferenceSweep>) -> Self {
        let distances: Vec<Distance> = reference.iter().map(|of| of.distance).collect();
        let mut sums: BTreeMap<usize, (f64, usize)> = BTreeMap::new();
        for distance in &distances {
            let (sum, sweeps) = sums.entry(distance.nearest).or_default();
            *sum += distance.log;
            *sweeps += 1;
        }
        let all: f64 = distances.iter().map(|of| of.log).sum();
        let typical_of_all = all / distances.len() as f64;
        let shrunk = |sum: f64, sweeps: usize| {
            (sum + SHRUNK_SWEEPS * typical_of_all) / (sweeps as f64 + SHRUNK_SWEEPS)
        };
        // The typical distance of the other sweeps, so that the excess is as large as that of a further sweep.
        let excess_of = |of: &Distance| {
            let (sum, sweeps) = sums[&of.nearest];
            of.log - shrunk(sum - of.log, sweeps - 1)
        };
        let excess: Vec<f64> = distances.iter().map(excess_of).collect();
        let sorted = |mut values: Vec<f64>| {
            values.sort_unstable_by(f64::total_cmp);
            values
        };
        let mut scores = Self {
            typical: sums
                .iter()
                .map(|(label, (sum, sweeps))| (*label, shrunk(*sum, *sweeps)))
                .collect(),
            typical_of_all,
            excess: sorted(excess.clone()),
            constant_surprises: sorted(distances.iter().map(|of| of.stuck).collect()),
            smaller: Vec::new(),
            surprises: Vec::new(),
            constant: Vec::new(),
            directions: Vec::new(),
            units: Vec::new(),
            sweeps: sums.into_iter().map(|(label, (_, n))| (label, n)).collect(),
        };
        let of_both = excess.iter().zip(&distances);
        let smaller: Vec<f64> = of_both
            .map(|(excess, distance)| scores.smaller_of(*excess, distance.stuck))
            .collect();
        scores.smaller = sorted(smaller.clone());
        // Counts the sweep itself in place of the one that is added to those of a further sweep.
        let p = |smaller| scores.as_small(smaller) as f64 / (1 + scores.smaller.len()) as f64;
        scores.surprises = smaller.into_iter().map(|of| -p(of).ln()).collect();
        let mut by_unit: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (at, sweep) in reference.into_iter().enumerate() {
            by_unit.entry(sweep.unit).or_default().push(at);
            scores.constant.push(sweep.constant);
            scores.directions.push(sweep.direction);
        }
        scores.units = by_unit.into_values().collect();
        scores
    }

    /// Returns the logarithmic distances relative to the typical one, ascending.
    pub fn excesses(&self) -> &[f64] {
        &self.excess
    }

    /// Returns the surprises about constant taxels, ascending.
    pub fn constant_surprises(&self) -> &[f64] {
        &self.constant_surprises
    }

    /// Returns the smaller p-value of the two for every sweep, ascending.
    pub fn smaller_p_values(&self) -> &[f64] {
        &self.smaller
    }

    /// Returns the logarithmic distance relative to the typical one of the nearest material.
    pub fn excess_of(&self, distance: &Distance) -> f64 {
        let typical = self.typical.get(&distance.nearest);
        distance.log - typical.unwrap_or(&self.typical_of_all)
    }

    /// Returns the p-value of one sweep: the share of reference sweeps that are as far from the training sweeps.
    pub fn p_of_sweep(&self, distance: &Distance) -> f64 {
        let smaller = self.smaller_of(self.excess_of(distance), distance.stuck);
        (1 + self.as_small(smaller)) as f64 / (1 + self.smaller.len()) as f64
    }

    /// Returns the number of reference sweeps with a smaller p-value of at most `smaller`.
    fn as_small(&self, smaller: f64) -> usize {
        let bound = smaller * (1.0 + 1e-12);
        self.smaller.partition_point(|of| *of <= bound)
    }

    /// Returns the p-value of all sweeps together: the share of equally large sets of reference sweeps of which the mean
    /// surprise, the taxel that is constant most often, or the common direction is as unusual.
    pub fn p_of_all(&self, set: &SweepSet<'_>, rng: &mut impl Rng) -> f64 {
        let found = self.statistics_of(set);
        let resamples: Vec<Statistics> = (0..RESAMPLES)
            .map(|_| self.statistics_of_resample(set.distances.len(), rng))
            .collect();
        // Rank by rank, so that the statistics count alike; the resamples say how small the smallest rank is by chance.
        let ranks = |value: fn(&Statistics) -> f64| -> Vec<usize> {
            let mut sorted: Vec<f64> = resamples.iter().map(value).collect();
            sorted.sort_unstable_by(f64::total_cmp);
            let as_large = |of: f64| RESAMPLES - sorted.partition_point(|other| *other < of);
            let all = resamples.iter().map(value).chain([value(&found)]);
            all.map(as_large).collect()
        };
        let ranks = [
            ranks(|of| of.surprise),
            ranks(|of| of.constant),
            ranks(|of| of.agreement),
        ];
        let smaller: Vec<usize> = (0..=RESAMPLES)
            // A resample counts itself.
            .map(|at| {
                ranks.iter().map(|of| of[at]).min().unwrap_or(0) + usize::from(at == RESAMPLES)
            })
            .collect();
        let as_small = smaller[..RESAMPLES]
            .iter()
            .filter(|of| **of <= smaller[RESAMPLES])
            .count();
        (1 + as_small) as f64 / (1 + RESAMPLES) as f64
    }

    fn statistics_of(&self, set: &SweepSet<'_>) -> Statistics {
        let sweeps = set.distances.len() as f64;
        let surprises = set.distances.iter().map(|of| -self.p_of_sweep(of).ln());
        let mean = self.surprises.iter().sum::<f64>() / self.surprises.len() as f64;
        let mut nearest: Vec<usize> = set.distances.iter().map(|of| of.nearest).collect();
        nearest.sort_unstable();
        nearest.dedup();
        let of_material = |label: &usize| self.sweeps.get(label).copied().unwrap_or(0);
        let reference = nearest.iter().map(of_material).sum::<usize>().max(1) as f64;
        // The mean of the reference sweeps is uncertain, too.
        let uncertain = |excess: f64| excess / (1.0 + sweeps / reference).sqrt();
        Statistics {
            surprise: mean + uncertain(surprises.sum::<f64>() / sweeps - mean),
            constant: match largest_mean(set.constant.iter()) {
                score if score > 0.0 => uncertain(score),
                score => score,
            },
            agreement: if self.directions[0].is_empty() {
                0.0
            } else {
                agreement(set.directions.iter()) / (1.0 + sweeps / reference)
            },
        }
    }

    /// Returns the statistics of `sweeps` reference sweeps in random units.
    fn statistics_of_resample(&self, sweeps: usize, rng: &mut impl Rng) -> Statistics {
        let mut drawn = Vec::with_capacity(sweeps);
        while drawn.len() < sweeps {
            let unit = &self.units[rng.random_range(0..self.units.len())];
            let taken = unit.len().min(sweeps - drawn.len());
            let first = rng.random_range(0..=unit.len() - taken);
            drawn.extend_from_slice(&unit[first..first + taken]);
        }
        let surprises = drawn.iter().map(|at| self.surprises[*at]);
        Statistics {
            surprise: surprises.sum::<f64>() / sweeps as f64,
            constant: largest_mean(drawn.iter().map(|at| &self.constant[*at])),
            agreement: agreement(drawn.iter().map(|at| &self.directions[*at])),
        }
    }

    /// Returns the smaller of the p-values of an excess and of the surprise about constant taxels.
    fn smaller_of(&self, excess: f64, stuck: f64) -> f64 {
        let share_above = |sorted: &[f64], value: f64| {
            let below = sorted.partition_point(|of| *of < value);
            (1 + sorted.len() - below) as f64 / (1 + sorted.len()) as f64
        };
        share_above(&self.excess, excess).min(share_above(&self.constant_surprises, stuck))
    }
}

/// Returns the largest over the taxels of the mean score over the sweeps.
fn largest_mean<'a>(scores: impl ExactSizeIterator<Item = &'a Vec<f64>>) -> f64 {
    let sweeps = scores.len() as f64;
    sum_of(scores).into_iter().fold(f64::NEG_INFINITY, f64::max) / sweeps
}

/// Returns the squared length of the sum of directions, over their number.
fn agreement<'a>(directions: impl ExactSizeIterator<Item = &'a Vec<f64>>) -> f64 {
    let sweeps = directions.len() as f64;
    sum_of(directions).iter().map(|sum| sum * sum).sum::<f64>() / sweeps
}

fn sum_of<'a>(rows: impl Iterator<Item = &'a Vec<f64>>) -> Vec<f64> {
    let mut sums: Vec<f64> = Vec::new();
    for row in rows {
        sums.resize(row.len(), 0.0);
        sums.iter_mut()
            .zip(row)
            .for_each(|(sum, value)| *sum += value);
    }
    sums
}

#[cfg(test)]
mod tests {
    use tactnet_data::Seed;

    use super::*;

    const SWEEPS: usize = 200;
    const WIDTH: usize = 5;
    const DISTANCE: Distance = Distance {
        log: 0.0,
        nearest: 0,
        stuck: 0.0,
    };

    /// Returns the vector of length 1 along an axis, or against it.
    fn along(axis: usize, sign: f64) -> Vec<f64> {
        let mut direction = vec![0.0; WIDTH];
        direction[axis] = sign;
        direction
    }

    /// Returns the p-value of sweeps in `directions`, each as far away as every training sweep.
    fn p_of(directions: Vec<Vec<f64>>) -> f64 {
        let sign = |at: usize| {
            if (at / WIDTH).is_multiple_of(2) {
                1.0
            } else {
                -1.0
            }
        };
        let sweep = |at: usize| ReferenceSweep {
            distance: DISTANCE,
            constant: vec![0.0],
            direction: along(at % WIDTH, sign(at)),
            unit: at,
        };
        let scores = ReferenceScores::new((0..SWEEPS).map(sweep).collect());
        let set = SweepSet {
            distances: &vec![DISTANCE; directions.len()],
            constant: vec![vec![0.0]; directions.len()],
            directions,
        };
        scores.p_of_all(&set, &mut Seed(1).rng("directions"))
    }

    #[test]
    fn sweeps_that_differ_in_one_direction_are_unusual_together() {
        let p = p_of(vec![along(2, 1.0); 10]);
        // At most the most unusual of the 999 resamples is as unusual.
        assert!(p <= 0.002, "{p}");
    }

    #[test]
    fn sweeps_that_differ_in_opposite_directions_are_usual() {
        let signs = [1.0, -1.0].into_iter().cycle();
        let p = p_of(signs.take(10).map(|sign| along(2, sign)).collect());
        assert!(p > 0.5, "{p}");
    }
}
