//! Accuracy when the test sweeps are disturbed: dead taxels, gain, offset, drift, speed. Models are trained once a fold.

use std::collections::BTreeMap;
use std::fmt;

use rand::RngExt;
use serde::{Deserialize, Serialize};
use tactnet_data::{Dataset, Fold, Samples, Scheme, SweepView, shuffle};
use tactnet_pipeline::{
    Classifier, DeadTaxels, Disturbance, Normalizer, PredictionMethod, Predictions, Scaling,
};

use super::Strength::{self, Factor, Size};
use super::headline::Headline;
use super::{Ask, Compared, FOLDS, Figure, check_folds, five, folds, one};
use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext};
use crate::one_or_many::one_or_many;
use crate::phrases::in_percent;
use crate::{Measure, Measurement, Part, Row};

/// Number of draws of dead taxels; each applies to an equal share of the test sweeps.
const DRAWS: usize = 16;
/// Name of the undisturbed condition.
const CLEAN: &str = "clean";

/// Fields of the question about robustness.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Robustness {
    /// Number of folds of each repeat that are evaluated.
    #[serde(default = "five")]
    pub folds: usize,
    /// Number of repeats of the cross-validation.
    #[serde(default = "one", alias = "runs")]
    pub repeats: usize,
    /// Shares of dead taxels, rounded up to whole taxels.
    #[serde(default, deserialize_with = "one_or_many")]
    pub dead: Vec<f64>,
    /// Factors on the distance of every taxel from its mean over the training sweeps.
    #[serde(default, deserialize_with = "one_or_many")]
    pub gains: Vec<f64>,
    /// Factors on the speed.
    #[serde(default, deserialize_with = "one_or_many")]
    pub speeds: Vec<f64>,
    /// Offsets of every taxel, up or down, in standard deviations of the taxel over the training sweeps.
    #[serde(default, deserialize_with = "one_or_many")]
    pub offsets: Vec<f64>,
    /// Drifts of every taxel from the first frame to the last, up or down, in the same unit.
    #[serde(default, deserialize_with = "one_or_many")]
    pub drifts: Vec<f64>,
}

impl Ask for Robustness {
    fn validate(&self) -> Result<(), String> {
        check_folds(self.folds, self.repeats, None)?;
        let share = |value: f64| value > 0.0 && value < 1.0;
        let positive = |value: f64| value.is_finite() && value > 0.0;
        for (field, values, is_right, expected) in [
            (
                "dead",
                &self.dead,
                &share as &dyn Fn(f64) -> bool,
                "shares between 0 and 1",
            ),
            ("gains", &self.gains, &positive, "factors above 0"),
            ("speeds", &self.speeds, &positive, "factors above 0"),
            ("offsets", &self.offsets, &positive, "numbers above 0"),
            ("drifts", &self.drifts, &positive, "numbers above 0"),
        ] {
            if let Some(value) = values.iter().find(|value| !is_right(**value)) {
                return Err(format!("`{field}`: expected {expected}, found {value}"));
            }
        }
        Ok(())
    }

    fn parts(&self) -> Vec<Part> {
        folds(self.folds, self.repeats, None)
    }

    fn takes_baselines(&self) -> bool {
        true
    }

    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        robustness(self, context)
    }

    fn test_share(&self) -> f64 {
        0.25
    }

    fn compared(&self, measure: Measure) -> Option<Compared> {
        (measure == Measure::Accuracy).then_some(Compared::Networks { sweeps: 1 })
    }

    fn headline(&self, rows: &[&Row]) -> Option<Headline> {
        let accuracies = || {
            rows.iter()
                .copied()
                .filter(|row| row.is_one_sweep_accuracy())
        };
        let clean = accuracies().find(|row| row.setting == CLEAN)?;
        let disturbed = accuracies().filter(|row| row.setting != CLEAN);
        let worst = disturbed.min_by(|a, b| a.statistic.mean.total_cmp(&b.statistic.mean))?;
        let fewest = |kind: &'static str| {
            accuracies()
                .find(|row| row.setting.starts_with(kind))
                .map(|row| in_percent(row.statistic.mean))
        };
        let dead = match (fewest(DEAD), fewest(MASKED)) {
            (Some(unknown), Some(masked)) => format!(
                "With the fewest dead taxels it is {unknown}, and {masked} if these are masked. "
            ),
            _ => String::new(),
        };
        let qualifier = format!(
            "{dead}Lowest: {} under `{}`.",
            in_percent(worst.statistic.mean),
            worst.setting
        );
        let says = format!("of undisturbed sweeps recognised by {}", clean.model);
        Some(Headline::of(clean, says, qualifier))
    }

    fn figures(&self) -> Vec<Figure> {
        FIGURES.to_vec()
    }
}

/// First words of the names of conditions; the strength follows.
const DEAD: &str = "dead taxels ";
const MASKED: &str = "masked taxels ";
const GAIN: &str = "gain \u{d7} ";
const SPEED: &str = "speed \u{d7} ";
const OFFSET: &str = "offset \u{b1} ";
const DRIFT: &str = "drift \u{b1} ";

/// Figures of the report: one for each kind of disturbance.
const FIGURES: [Figure; 6] = [
    strengths("Dead taxels that read 0", "dead taxels", DEAD, Size),
    strengths("Dead taxels that are masked", "masked taxels", MASKED, Size),
    strengths("Gain of all taxels", "factor on the gain", GAIN, Factor),
    strengths("Speed", "factor on the speed", SPEED, Factor),
    strengths("Offset", "offset, standard deviations", OFFSET, Size),
    strengths(
        "Drift over a sweep",
        "drift, standard deviations",
        DRIFT,
        Size,
    ),
];

const fn strengths(
    title: &'static str,
    label: &'static str,
    prefix: &'static str,
    strength: Strength,
) -> Figure {
    Figure::Strengths {
        title,
        label,
        prefix,
        undisturbed: CLEAN,
        strength,
    }
}

/// Glossary of the report.
pub(super) const TERMS: [(&str, &str); 4] = [
    (
        "Dead, masked taxels",
        "This number of taxels, drawn at random for each sixteenth of the test sweeps, reads 0. Masked: the classifier is told which, and \
         sees their training mean instead.",
    ),
    (
        "Gain",
        "The distance of every taxel from its mean over the training sweeps is multiplied by this factor.",
    ),
    (
        "Speed",
        "Sweeps are stretched in time by linear interpolation. A faster one ends early and repeats its last frame; a slower one is cut.",
    ),
    (
        "Offset, drift",
        "Every taxel is moved up or down at random, by this number of its standard deviations over the training sweeps: all frames equally, \
         or linearly from the first frame to the last.",
    ),
];

/// State of the test sweeps.
#[derive(Clone, Copy)]
enum Condition {
    Clean,
    Dead(usize),
    Masked(usize),
    Gain(f64),
    Speed(f64),
    Offset(f64),
    Drift(f64),
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Clean => f.write_str(CLEAN),
            Self::Dead(taxels) => write!(f, "{DEAD}{taxels}"),
            Self::Masked(taxels) => write!(f, "{MASKED}{taxels}"),
            Self::Gain(factor) => write!(f, "{GAIN}{factor}"),
            Self::Speed(factor) => write!(f, "{SPEED}{factor}"),
            Self::Offset(deviations) => write!(f, "{OFFSET}{deviations}"),
            Self::Drift(deviations) => write!(f, "{DRIFT}{deviations}"),
        }
    }
}

impl Robustness {
    /// Returns all conditions for sweeps of this number of taxels.
    fn conditions(&self, taxels: usize) -> Vec<Condition> {
        let count = |share: &f64| ((share * taxels as f64).ceil() as usize).max(1);
        let mut dead: Vec<usize> = self.dead.iter().map(count).collect();
        dead.retain(|count| *count < taxels);
        dead.dedup();
        let mut conditions = vec![Condition::Clean];
        conditions.extend(dead.iter().copied().map(Condition::Dead));
        conditions.extend(dead.into_iter().map(Condition::Masked));
        conditions.extend(self.gains.iter().copied().map(Condition::Gain));
        conditions.extend(self.speeds.iter().copied().map(Condition::Speed));
        conditions.extend(self.offsets.iter().copied().map(Condition::Offset));
        conditions.extend(self.drifts.iter().copied().map(Condition::Drift));
        conditions
    }
}

fn robustness(asked: &Robustness, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let (repeat, number) = context.part.repeat_and_fold();
    let scheme = scheme_of(context.dataset);
    let fold = Fold::new(context.dataset, scheme, context.seed, repeat, number)?;
    let seed = context.seed_for("robustness", context.part.stream());
    let mut classifier = context.fitted("classifier", &fold.train, seed)?;
    let disturbed = Disturbed {
        context,
        test: &fold.test,
        scales: Normalizer::fit(Scaling::PerTaxel, Default::default(), &fold.train),
    };
    let mut measurements = Vec::new();
    for condition in asked.conditions(fold.test.shape().taxels()) {
        let setting = condition.to_string();
        context.say(&setting)?;
        let predictions = disturbed.predictions(&mut classifier, condition)?;
        for (measure, value) in [
            (Measure::Accuracy, predictions.accuracy()),
            (
                Measure::ExpectedCalibrationError,
                predictions.expected_calibration_error(),
            ),
        ] {
            let plain = PredictionMethod::Plain.name();
            let found = Measurement::new(measure, plain, value, fold.test.len());
            measurements.push(found.setting(&setting).sweeps(1));
        }
    }
    // Group the rows of the report by measure.
    measurements.sort_by_key(|measurement| measurement.measure);
    Ok(Answer {
        measurements,
        split: format!("repeat {repeat}, fold {number}, {scheme}"),
        split_content: fold.manifest().sha256,
        ..Answer::default()
    })
}

/// Returns folds of whole recording blocks where the data allows five, and random folds else and for TactMat and its twin, whose published
/// numbers have random folds.
fn scheme_of(dataset: &Dataset) -> Scheme {
    Scheme::group_folds_of(dataset)
        .filter(|_| !dataset.origin().is_comparable_to_published())
        .filter(|scheme| scheme.folds(dataset).is_ok_and(|folds| folds == FOLDS))
        .unwrap_or_default()
}

/// The test sweeps of a fold, with the scales of the training sweeps.
struct Disturbed<'a> {
    context: &'a StudyContext<'a>,
    test: &'a SweepView<'a>,
    /// Mean and standard deviation of every taxel.
    scales: Normalizer,
}

impl Disturbed<'_> {
    /// Returns the predictions of all test sweeps under a condition.
    fn predictions(
        &self,
        classifier: &mut Classifier,
        condition: Condition,
    ) -> Result<Predictions, Cancelled> {
        let Condition::Masked(count) = condition else {
            let sweeps = self.sweeps(condition)?;
            return Ok(classifier.predict(&SweepView::all(&sweeps), PredictionMethod::Plain)?);
        };
        let sweeps = self.sweeps(Condition::Dead(count))?;
        let mut all: Option<Predictions> = None;
        for draw in 0..DRAWS.min(sweeps.len()) {
            classifier.mask(&self.dead(count, draw))?;
            let own = SweepView::new(&sweeps, (draw..sweeps.len()).step_by(DRAWS).collect());
            let found = classifier.predict(&own, PredictionMethod::Plain)?;
            match &mut all {
                None => all = Some(found),
                Some(all) => all.sweeps.extend(found.sweeps),
            }
        }
        classifier.mask(&[])?;
        Ok(all.unwrap_or_else(|| panic!("a fold has test sweeps")))
    }

    /// Returns the dead taxels of a draw; more of them include the fewer ones.
    fn dead(&self, count: usize, draw: usize) -> Vec<usize> {
        let mut taxels: Vec<usize> = (0..self.scales.taxels()).collect();
        let stream = ("dead taxels", self.context.part.stream(), draw);
        shuffle(&mut taxels, &mut self.context.seed.rng(stream));
        taxels.truncate(count);
        taxels
    }

    /// Returns the disturbed test sweeps.
    fn sweeps(&self, condition: Condition) -> Result<Dataset, Cancelled> {
        let (test, dataset) = (self.test, self.test.dataset());
        let shape = test.shape();
        let mut values = vec![0.0; test.len() * shape.values()];
        for (position, sweep) in values.chunks_exact_mut(shape.values()).enumerate() {
            test.copy_batch(&[position], sweep);
            if let Some(disturbance) = self.drawn(condition, position) {
                disturbance.apply(sweep, shape.taxels());
            }
        }
        let records = test
            .indices()
            .iter()
            .map(|&at| dataset.records()[at].clone());
        Ok(Dataset::new(
            dataset.name(),
            dataset.sample_rate_hz(),
            shape,
            dataset.labels().clone(),
            records.collect(),
            Samples::F32(values),
        )?)
    }

    /// Draws the disturbance of the test sweep at a position; `None` for clean sweeps.
    fn drawn(&self, condition: Condition, position: usize) -> Option<Disturbance> {
        let taxels = self.scales.taxels();
        let moved = |stream: &str, deviations: f64| -> Vec<f32> {
            let index = self.test.indices()[position];
            let mut rng = self.context.seed.rng((stream, index));
            let digits = self.scales.gain().iter().map(|gain| {
                let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
                sign * deviations as f32 / gain
            });
            digits.collect()
        };
        match condition {
            Condition::Clean => None,
            Condition::Dead(count) | Condition::Masked(count) => {
                let dead = self.dead(count, position % DRAWS).into_iter();
                let readings: BTreeMap<usize, f32> = dead.map(|taxel| (taxel, 0.0)).collect();
                Some(Disturbance::Dead(DeadTaxels(readings)))
            }
            Condition::Gain(factor) => Some(Disturbance::Gain {
                factors: vec![factor as f32; taxels],
                about: self.scales.offset().to_vec(),
            }),
            Condition::Speed(factor) => Some(Disturbance::Speed(factor)),
            Condition::Offset(size) => Some(Disturbance::Offset(moved("offset", size))),
            Condition::Drift(size) => Some(Disturbance::Drift(moved("drift", size))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_dead_taxels_are_rounded_up_and_leave_one_alive() {
        let asked = Robustness {
            folds: 1,
            repeats: 1,
            dead: vec![1.0 / 16.0, 0.125, 0.25],
            gains: vec![2.0],
            speeds: Vec::new(),
            offsets: Vec::new(),
            drifts: Vec::new(),
        };
        let names = |taxels| -> Vec<String> {
            let conditions = asked.conditions(taxels).into_iter();
            conditions.map(|condition| condition.to_string()).collect()
        };
        assert_eq!(
            names(16)[1..4],
            ["dead taxels 1", "dead taxels 2", "dead taxels 4"]
        );
        assert_eq!(
            names(3),
            ["clean", "dead taxels 1", "masked taxels 1", "gain \u{d7} 2"]
        );
        assert_eq!(names(1), ["clean", "gain \u{d7} 2"]);
    }

    #[test]
    fn sizes_out_of_range_are_named() {
        for (fields, named) in [
            (r#"{"dead": [1.0]}"#, "dead"),
            (r#"{"gains": [0.0]}"#, "gains"),
            (r#"{"drifts": [-1.0]}"#, "drifts"),
        ] {
            let asked: Robustness = serde_json::from_str(fields).unwrap();
            let refused = asked.validate().unwrap_err();
            assert!(refused.contains(named), "{refused}");
        }
    }
}
