//! Scores of held-out training sweeps, from which p-values follow.

use std::collections::BTreeMap;

use rand::{Rng, RngExt};

use super::distances::Distance;

/// Number of sweeps of a material for which its own typical distance counts as much as that of all materials.
const SHRUNK_SWEEPS: f64 = 3.0;
/// Number of resampled sets of sweeps behind a p-value.
const RESAMPLES: usize = 999;

/// Scores of held-out training sweeps.
pub(super) struct ReferenceScores {
    /// Typical logarithmic distance by nearest material.
    typical: BTreeMap<usize, f64>,
    /// Typical logarithmic distance over all materials.
    typical_of_all: f64,
    /// Logarithmic distances relative to the typical one, ascending.
    excess: Vec<f64>,
    /// Surprises about constant taxels, ascending.
    stuck: Vec<f64>,
    /// Smaller p-value of the two, ascending.
    smaller: Vec<f64>,
    /// Negative logarithms of p-values, by unit that is resampled as a whole.
    units: Vec<Vec<f64>>,
    /// Number of sweeps by nearest material.
    sweeps: BTreeMap<usize, usize>,
}

impl ReferenceScores {
    /// - `units`: unit of every sweep, whose sweeps are resampled together
    pub fn new(distances: Vec<Distance>, units: Vec<usize>) -> Self {
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
            stuck: sorted(distances.iter().map(|of| of.stuck).collect()),
            smaller: Vec::new(),
            units: Vec::new(),
            sweeps: sums.into_iter().map(|(label, (_, n))| (label, n)).collect(),
        };
        let of_both = excess.iter().zip(&distances);
        let smaller: Vec<f64> = of_both
            .map(|(excess, distance)| scores.smaller_of(*excess, distance.stuck))
            .collect();
        scores.smaller = sorted(smaller.clone());
        let mut by_unit: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for (smaller, unit) in smaller.into_iter().zip(units) {
            // Counts the sweep itself in place of the one that is added to those of a further sweep.
            let p = scores.as_small(smaller) as f64 / (1 + scores.smaller.len()) as f64;
            by_unit.entry(unit).or_default().push(-p.ln());
        }
        scores.units = by_unit.into_values().collect();
        scores
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

    /// Returns the p-value of all sweeps together: the share of equally large sets of reference sweeps whose mean surprise
    /// is as large.
    pub fn p_of_all(&self, distances: &[Distance], rng: &mut impl Rng) -> f64 {
        let sweeps = distances.len() as f64;
        let surprises = distances.iter().map(|of| -self.p_of_sweep(of).ln());
        let found = surprises.sum::<f64>() / sweeps;
        let all = || self.units.iter().flatten();
        let mean = all().sum::<f64>() / all().count() as f64;
        let mut nearest: Vec<usize> = distances.iter().map(|of| of.nearest).collect();
        nearest.sort_unstable();
        nearest.dedup();
        let of_material = |label: &usize| self.sweeps.get(label).copied().unwrap_or(0);
        let reference = nearest.iter().map(of_material).sum::<usize>().max(1) as f64;
        // The mean of the reference sweeps is uncertain, too.
        let found = mean + (found - mean) / (1.0 + sweeps / reference).sqrt();
        let as_large = (0..RESAMPLES)
            .filter(|_| self.resampled_mean(distances.len(), rng) >= found)
            .count();
        (1 + as_large) as f64 / (1 + RESAMPLES) as f64
    }

    /// Returns the mean surprise of `sweeps` reference sweeps in random units.
    fn resampled_mean(&self, sweeps: usize, rng: &mut impl Rng) -> f64 {
        let (mut sum, mut left) = (0.0, sweeps);
        while left > 0 {
            let unit = &self.units[rng.random_range(0..self.units.len())];
            let taken = unit.len().min(left);
            let first = rng.random_range(0..=unit.len() - taken);
            sum += unit[first..first + taken].iter().sum::<f64>();
            left -= taken;
        }
        sum / sweeps as f64
    }

    /// Returns the smaller of the p-values of an excess and of the surprise about constant taxels.
    fn smaller_of(&self, excess: f64, stuck: f64) -> f64 {
        let share_above = |sorted: &[f64], value: f64| {
            let below = sorted.partition_point(|of| *of < value);
            (1 + sorted.len() - below) as f64 / (1 + sorted.len()) as f64
        };
        share_above(&self.excess, excess).min(share_above(&self.stuck, stuck))
    }
}
