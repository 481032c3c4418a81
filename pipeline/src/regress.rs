//! Recovery of conditions: how well speed and force follow from the sweeps alone.
//!
//! Ridge regression from mean and logarithmic spectrum of every taxel, with features standardised and the penalty chosen on
//! the training sweeps of each fold. Every number is about sweeps that were held out.

use std::collections::BTreeMap;

use rand::RngExt;
use serde::Serialize;
use tactnet_data::{Condition, ConditionValues, Dataset, Fold, Quantity, Scheme, Seed, SweepView};
use tactnet_models::{Features, RidgeRegression, default_penalties};

use crate::features::extractor::Extractor;
use crate::features::scaler::Scaler;
use crate::{DeadTaxels, FeatureSet, MeanRemoval, PipelineError};

/// Number of resamples behind the intervals.
const RESAMPLES: usize = 1000;

/// How well each condition of a data set is recovered from its sweeps.
#[derive(Debug, Clone, Serialize)]
pub struct RegressionReport {
    /// Version of this layout.
    pub schema_version: u32,
    /// Name of the data set.
    pub data: String,
    /// Checksum of the data set.
    pub data_sha256: String,
    /// Split into training and test sweeps, of which the first repeat is used.
    pub split: Scheme,
    /// Seed of the folds and of the intervals.
    pub seed: Seed,
    /// One entry for each condition.
    pub conditions: Vec<Recovery>,
}

/// Errors of a condition that was predicted for held-out sweeps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recovery {
    /// Quantity and unit.
    #[serde(flatten)]
    pub condition: Condition,
    /// Number of predicted sweeps.
    pub sweeps: usize,
    /// Number of independent units behind the intervals: blocks that were held out, or sweeps.
    pub units: usize,
    /// Share of the squared error of guessing the mean of the training sweeps that the prediction removes.
    pub r2: Interval,
    /// Root mean squared error, in the unit of the condition.
    pub rmse: Interval,
    /// Mean absolute error, in the unit of the condition.
    pub mean_absolute_error: Interval,
    /// Root mean squared error of guessing the mean of the training sweeps.
    pub rmse_of_guessing: f64,
    /// Mean absolute error of guessing the mean of the training sweeps.
    pub mean_absolute_error_of_guessing: f64,
}

/// Number with its 95 % interval: percentiles over 1000 resamples of the units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The number.
    pub value: f64,
    /// Lower end of the interval.
    pub ci95_low: f64,
    /// Upper end of the interval.
    pub ci95_high: f64,
}

impl RegressionReport {
    /// Predicts the conditions of `dataset` for held-out sweeps.
    ///
    /// - `target`: the quantity; `None`: all of the data set
    /// - `scheme`: split, of which the first repeat is used; see [`Scheme::default_for`]
    ///
    /// # Errors
    /// A data set without conditions, or with one that has the same value in all sweeps; sweeps too short for a spectrum; a split that the
    /// data set does not have.
    pub fn of(
        dataset: &Dataset,
        target: Option<Quantity>,
        scheme: Scheme,
        seed: Seed,
    ) -> Result<Self, PipelineError> {
        let is_target = |of: &ConditionValues| target.is_none_or(|is| of.condition.quantity == is);
        let mut known = dataset.condition_values();
        known.retain(is_target);
        if known.is_empty() {
            return Err(PipelineError::incompatible(
                "conditions",
                match target {
                    None => "`speed` or `force`, a number per sweep".to_owned(),
                    Some(target) => format!("`{}`, a number per sweep", target.name()),
                },
                "none",
            ));
        }
        let bare = dataset.without_conditions();
        let features = features(&bare)?;
        let conditions = known.into_iter().map(|of| {
            let values: Vec<f64> = of.values.iter().map(|value| f64::from(*value)).collect();
            if values.iter().all(|value| *value == values[0]) {
                return Err(PipelineError::incompatible(
                    of.condition.quantity.name(),
                    "different values",
                    format!("{} in every sweep", values[0]),
                ));
            }
            let predicted = held_out(&bare, &features, &values, scheme, seed)?;
            Ok(Recovery::of(of.condition, &predicted, seed))
        });
        Ok(Self {
            schema_version: 1,
            data: dataset.name().into(),
            data_sha256: dataset.sha256().into(),
            split: scheme,
            seed,
            conditions: conditions.collect::<Result<_, PipelineError>>()?,
        })
    }
}

/// Returns mean and logarithmic spectrum of every taxel of every sweep.
fn features(bare: &Dataset) -> Result<Features, PipelineError> {
    let (shape, rate) = (bare.shape(), bare.sample_rate_hz());
    let extractor = Extractor::unfitted(FeatureSet::LogSpectra, MeanRemoval::None, shape, rate)?;
    Ok(extractor.features(&SweepView::all(bare), &DeadTaxels::default()))
}

/// Value of a held-out sweep and its predictions.
struct HeldOut {
    /// Unit that is resampled as a whole.
    unit: usize,
    truth: f64,
    predicted: f64,
    /// Mean of the training sweeps.
    guess: f64,
}

/// Returns the predictions of all test sweeps of the first repeat.
fn held_out(
    bare: &Dataset,
    features: &Features,
    values: &[f64],
    scheme: Scheme,
    seed: Seed,
) -> Result<Vec<HeldOut>, PipelineError> {
    let by_block = matches!(scheme, Scheme::GroupKFold { .. } | Scheme::LeaveBlockOut);
    let mut found = Vec::new();
    for number in 0..scheme.folds(bare)? {
        let fold = Fold::new(bare, scheme, seed, 0, number)?;
        let of = |indices: &[usize]| -> Vec<f64> { indices.iter().map(|&at| values[at]).collect() };
        let mut train = features.select(fold.train.indices());
        let mut test = features.select(fold.test.indices());
        let scaler = Scaler::fit(&train, 0);
        scaler.apply(&mut train);
        scaler.apply(&mut test);
        let known = of(fold.train.indices());
        let regression = RidgeRegression::fit(&train, &known, &default_penalties())?;
        let guess = known.iter().sum::<f64>() / known.len() as f64;
        found.extend(test.rows().zip(fold.test.indices()).map(|(row, &index)| {
            let block = bare.records()[index].block.filter(|_| by_block);
            HeldOut {
                unit: block.map_or(index, |block| block as usize),
                truth: values[index],
                predicted: regression.predict(row),
                guess,
            }
        }));
    }
    Ok(found)
}

/// Sums over held-out sweeps.
#[derive(Clone, Copy, Default)]
struct Sums {
    sweeps: f64,
    squares: f64,
    absolute: f64,
    guess_squares: f64,
    guess_absolute: f64,
}

impl Sums {
    fn add(&mut self, of: &HeldOut) {
        let (error, guess) = (of.predicted - of.truth, of.guess - of.truth);
        self.sweeps += 1.0;
        self.squares += error * error;
        self.absolute += error.abs();
        self.guess_squares += guess * guess;
        self.guess_absolute += guess.abs();
    }

    fn join(&mut self, other: &Self) {
        self.sweeps += other.sweeps;
        self.squares += other.squares;
        self.absolute += other.absolute;
        self.guess_squares += other.guess_squares;
        self.guess_absolute += other.guess_absolute;
    }

    /// Returns R^2, root mean squared error and mean absolute error.
    fn measures(&self) -> [f64; 3] {
        [
            1.0 - self.squares / self.guess_squares,
            (self.squares / self.sweeps).sqrt(),
            self.absolute / self.sweeps,
        ]
    }
}

impl Recovery {
    fn of(condition: Condition, held_out: &[HeldOut], seed: Seed) -> Self {
        let mut units = BTreeMap::<usize, Sums>::new();
        for of in held_out {
            units.entry(of.unit).or_default().add(of);
        }
        let units: Vec<Sums> = units.into_values().collect();
        let mut all = Sums::default();
        units.iter().for_each(|unit| all.join(unit));
        let mut rng = seed.rng("regression, resamples");
        let resamples: Vec<[f64; 3]> = (0..RESAMPLES)
            .map(|_| {
                let mut drawn = Sums::default();
                for _ in 0..units.len() {
                    drawn.join(&units[rng.random_range(0..units.len())]);
                }
                drawn.measures()
            })
            .collect();
        let [r2, rmse, mean_absolute_error] = std::array::from_fn(|measure| {
            let mut drawn: Vec<f64> = resamples.iter().map(|of| of[measure]).collect();
            drawn.sort_by(f64::total_cmp);
            Interval {
                value: all.measures()[measure],
                ci95_low: drawn[RESAMPLES / 40],
                ci95_high: drawn[RESAMPLES - 1 - RESAMPLES / 40],
            }
        });
        Self {
            condition,
            sweeps: held_out.len(),
            units: units.len(),
            r2,
            rmse,
            mean_absolute_error,
            rmse_of_guessing: (all.guess_squares / all.sweeps).sqrt(),
            mean_absolute_error_of_guessing: all.guess_absolute / all.sweeps,
        }
    }
}
