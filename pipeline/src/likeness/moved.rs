//! Descriptions of training sweeps, moved to sweeps of another skin, robot or day.

use tactnet_data::SweepView;
use tactnet_models::Features;

use super::constant_taxels::constant_taxels;
use super::descriptor::DescriptionPart;
use super::distances::{Distance, Distances};
use super::{Likeness, MIN_SWEEPS, MOVED, PARTS, flags, matrix, vector};
use crate::PipelineError;
use crate::adapt::shift::{Moment, believed};

/// Minimum variance between materials, in variances within them, of a value that tells how many materials are present.
const INFORMATIVE: f64 = 0.25;
/// Standard error of the share of the differences between materials, as if values were independent, above which it says too little.
const UNCERTAIN: f64 = 0.75;

impl Likeness {
    /// Returns the share of the differences between materials that sweeps show: about 0 for one material, 1 for all in equal numbers; `None` if
    /// the sweeps are too few for the differences to exceed chance.
    ///
    /// It is the median over all values of a description that no gain changes (spreads, changes and spectrum are logarithms) of the variance
    /// over the sweeps beyond that within a material, as a share of the variance between materials.
    pub(crate) fn diversity(&self, sweeps: &SweepView<'_>) -> Option<f64> {
        let found = moments_over(&self.descriptor.of_view(sweeps));
        let known = moments_over(&self.descriptions());
        if sweeps.len() < 2 {
            return None;
        }
        let within = self
            .distances
            .scale()
            .iter()
            .map(|of| f64::from(*of).powi(2));
        let all = known.iter().zip(&found).zip(within).enumerate();
        let log = all.filter(|(at, _)| self.descriptor.part(*at) != DescriptionPart::Level);
        let shares = log.map(|(_, ((known, found), within))| {
            let between = known.variance - within;
            (between / within, (found.variance - within) / between)
        });
        let shares: Vec<(f64, f64)> = shares.filter(|(_, share)| share.is_finite()).collect();
        let informative: Vec<(f64, f64)> = shares
            .into_iter()
            .filter(|(ratio, _)| *ratio > INFORMATIVE)
            .collect();
        // Of a variance of n values, the relative standard error is the square root of 2 / (n - 1).
        let error = (2.0 / (sweeps.len() - 1) as f64).sqrt();
        let errors = informative
            .iter()
            .map(|(ratio, _)| error * (1.0 + ratio) / ratio);
        let count = informative.len() as f64;
        if errors.sum::<f64>() / count / count.sqrt() > UNCERTAIN {
            return None;
        }
        let mut of_values: Vec<f64> = informative.iter().map(|(_, share)| *share).collect();
        of_values.sort_unstable_by(f64::total_cmp);
        of_values.get(of_values.len() / 2).copied()
    }

    /// Returns the description of sweeps like `sweeps`, whose labels are ignored.
    ///
    /// The training descriptions move by mean and spread of every value, as far as they differ beyond chance. From 20 sweeps on, the sweeps
    /// themselves say how far a sweep of their kind may lie from the moved descriptions: each tenth is compared with those moved to the others.
    ///
    /// # Errors
    /// A covariance without eigenvalues.
    pub(crate) fn moved_to(&self, sweeps: &SweepView<'_>) -> Result<Self, PipelineError> {
        let known = self.descriptions();
        let new = self.descriptor.of_view(sweeps);
        let mut weights = self.weights.clone();
        let mut set = |name: &str, tensor| weights.0.insert(name.into(), tensor);
        set("descriptions", matrix(&moved(&known, &new)));
        if new.len() >= MIN_SWEEPS {
            let scores = self.scores_of_moved(&known, &new)?;
            let of = |value: fn(&(usize, Distance)) -> f64| {
                vector(scores.iter().map(|of| value(of) as f32).collect())
            };
            set("constant", flags(&constant_taxels(sweeps)));
            set("within.distance", of(|(_, of)| of.log));
            set("within.nearest", of(|(_, of)| of.nearest as f64));
            for name in ["within.sweep", "within.unit"] {
                set(name, of(|(at, _)| *at as f64));
            }
            // The scored sweeps are not those of the descriptions.
            set(MOVED, vector(vec![1.0]));
            for name in ["distance", "nearest", "sweep", "unit"] {
                weights.0.remove(&format!("between.{name}"));
            }
        }
        Self::from_weights(weights, self.descriptor.shape())
            .map_err(|reason| PipelineError::incompatible("description", "sound tensors", reason))
    }

    /// Returns the distances of new sweeps from the training descriptions, moved to the other new sweeps, with the positions of the sweeps.
    fn scores_of_moved(
        &self,
        known: &Features,
        new: &Features,
    ) -> Result<Vec<(usize, Distance)>, PipelineError> {
        let labels = &self.weights.0["labels"].values;
        let labels: Vec<usize> = labels.iter().map(|label| *label as usize).collect();
        let mut scores = Vec::with_capacity(new.len());
        for part in 0..PARTS {
            let (own, others): (Vec<usize>, Vec<usize>) =
                (0..new.len()).partition(|at| at % PARTS == part);
            let distances = Distances::fit(&moved(known, &new.select(&others)), &labels)?;
            let own_distances = distances.of(&new.select(&own));
            scores.extend(own.into_iter().zip(own_distances));
        }
        Ok(scores)
    }

    fn descriptions(&self) -> Features {
        let values = self.weights.0["descriptions"].values.clone();
        Features::new(self.descriptor.width(), values)
    }
}

/// Returns `known` with the means and spreads of `new`, as far as they differ beyond chance.
fn moved(known: &Features, new: &Features) -> Features {
    let before = moments_over(known);
    let sweeps: Vec<Vec<Moment>> = new
        .rows()
        .map(|row| row.iter().map(|value| Moment::of_value(*value)).collect())
        .collect();
    let (after, _) = believed(&before, &sweeps);
    let values = known.rows().flat_map(|row| {
        let own = row.iter().zip(before.iter().zip(&after));
        own.map(|(value, (before, after))| {
            let ratio = if before.variance > 0.0 {
                (after.variance / before.variance).sqrt()
            } else {
                1.0
            };
            (after.mean + (f64::from(*value) - before.mean) * ratio) as f32
        })
    });
    Features::new(known.width(), values.collect())
}

/// Returns mean and variance of every value over all rows.
fn moments_over(rows: &Features) -> Vec<Moment> {
    let count = rows.len() as f64;
    let mut moments = vec![
        Moment {
            mean: 0.0,
            variance: 0.0
        };
        rows.width()
    ];
    for row in rows.rows() {
        let own = moments.iter_mut().zip(row);
        own.for_each(|(of, value)| of.mean += f64::from(*value) / count);
    }
    for row in rows.rows() {
        for (of, value) in moments.iter_mut().zip(row) {
            of.variance += (f64::from(*value) - of.mean).powi(2) / (count - 1.0).max(1.0);
        }
    }
    moments
}
