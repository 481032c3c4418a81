//! Sequential decisions: take sweeps until the belief exceeds a threshold, compared with fixed numbers of sweeps.

use serde::{Deserialize, Serialize};
use tactnet_data::{Fold, Scheme, Seed, shuffle};
use tactnet_models::Belief;
use tactnet_pipeline::{PredictionMethod, Predictions};

use super::headline::{Headline, best};
use super::{Ask, Figure, Published, check_counts, check_folds, five, folds, given_or, one};
use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext};
use crate::measure::method_name;
use crate::one_or_many::one_or_many;
use crate::pairs::rows_of_label;
use crate::phrases::in_percent;
use crate::{Measure, Measurement, Part, Row};

/// Probabilities at which a decision stops.
const THRESHOLDS: [f64; 6] = [0.8, 0.9, 0.95, 0.99, 0.999, 0.9999];
/// Default fixed numbers of sweeps.
const FIXED: [usize; 5] = [1, 2, 3, 5, 10];
/// Maximum number of sweeps for one decision.
const MAX_SWEEPS: usize = 10;
/// Number of random orders of each material's sweeps.
const ORDERS: usize = 20;
/// Number of passes of Monte Carlo dropout.
const MC_SAMPLES: usize = 100;

/// Fields of the question about sequential decisions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sequential {
    /// Number of folds of each repeat that are evaluated.
    #[serde(default = "five")]
    pub folds: usize,
    /// Number of repeats of the cross-validation.
    #[serde(default = "one", alias = "runs")]
    pub repeats: usize,
    /// Number of folds to take from the two repeats of five, instead of `folds` and `repeats`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splits: Option<usize>,
    /// Fixed numbers of sweeps for a decision; 1, 2, 3, 5 and 10 by default.
    #[serde(
        default,
        alias = "shots",
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub sweeps: Vec<usize>,
}

impl Ask for Sequential {
    fn validate(&self) -> Result<(), String> {
        check_folds(self.folds, self.repeats, self.splits)?;
        check_counts("sweeps", &self.sweeps)
    }

    fn parts(&self) -> Vec<Part> {
        folds(self.folds, self.repeats, self.splits)
    }

    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        sequential(given_or(&self.sweeps, &FIXED), context)
    }

    fn test_share(&self) -> f64 {
        0.25
    }

    /// The base network of table 4.2 of the thesis.
    fn published(&self, row: &Row) -> Published {
        match (row.measure, row.method.as_str(), row.setting.as_str()) {
            (Measure::Accuracy, "plain", "fixed 1") => Published::robot(0.855),
            (Measure::Accuracy, "plain", "fixed 3") => Published::robot(0.943),
            _ => Published::default(),
        }
    }

    fn headline(&self, rows: &[&Row]) -> Option<Headline> {
        let accuracies = || {
            let rows = rows.iter().copied();
            rows.filter(|row| row.measure == Measure::Accuracy)
        };
        let until = || accuracies().filter(|row| row.setting.starts_with("until "));
        let fixed = |count: usize, method: &str| {
            let setting = format!("fixed {count}");
            accuracies()
                .find(|row| row.setting == setting && row.method == method)
                .map(|row| row.statistic.mean)
        };
        let taken = |of: &Row| {
            let same = |row: &&&Row| (&row.method, &row.setting) == (&of.method, &of.setting);
            let mut sweeps = rows.iter().filter(|row| row.measure == Measure::MeanSweeps);
            sweeps.find(same).map(|row| row.statistic.mean)
        };
        // Select the earliest stop that is as accurate as three fixed sweeps, or else the most accurate.
        let soonest = until()
            .filter(|row| fixed(3, &row.method).is_some_and(|three| row.statistic.mean >= three))
            .filter_map(|row| Some((row, taken(row)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let chosen = soonest.map(|(row, _)| row).or_else(|| best(until()))?;
        let qualifier = match (fixed(3, &chosen.method), fixed(1, &chosen.method)) {
            (Some(three), Some(one)) => format!(
                "Three fixed sweeps reach {}, a single one {}.",
                in_percent(three),
                in_percent(one)
            ),
            _ => format!("No decision takes more than {MAX_SWEEPS} sweeps."),
        };
        let says = format!(
            "of decisions correct after {:.1} sweeps on average, rule: {} ({})",
            taken(chosen)?,
            chosen.setting,
            method_name(&chosen.method)
        );
        Some(Headline::of(chosen, says, qualifier))
    }

    fn figures(&self) -> Vec<Figure> {
        vec![Figure::Sweeps]
    }
}

/// Glossary of the report.
pub(super) const TERMS: [(&str, &str); 1] = [(
    "Until 0.99, fixed 3",
    "Sweeps are fused until the most probable material has this probability, at most ten. Fixed 3: always three sweeps.",
)];

/// Stopping rule of a decision.
#[derive(Clone, Copy)]
enum Rule {
    Until(f64),
    Fixed(usize),
}

impl Rule {
    /// Returns the name of the rule in results.
    fn setting(self) -> String {
        match self {
            Self::Until(probability) => format!("until {probability}"),
            Self::Fixed(sweeps) => format!("fixed {sweeps}"),
        }
    }

    /// Takes sweeps in the order of `rows` until the rule stops, and returns the belief.
    fn decide(self, predictions: &Predictions, rows: &[usize]) -> Belief {
        let most = match self {
            Self::Until(_) => MAX_SWEEPS,
            Self::Fixed(sweeps) => sweeps,
        };
        let mut belief = Belief::flat(predictions.labels.len());
        for row in rows.iter().take(most) {
            belief.fuse(&predictions.sweeps[*row].log_probability);
            let stop = match self {
                Self::Until(sure) => belief.probabilities()[belief.label()] >= sure,
                Self::Fixed(_) => false,
            };
            if stop {
                break;
            }
        }
        belief
    }
}

fn sequential(fixed: &[usize], context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let (repeat, number) = context.part.repeat_and_fold();
    let scheme = Scheme::default();
    let fold = Fold::new(context.dataset, scheme, context.seed, repeat, number)?;
    let seed = context.seed_for("sequential", context.part.stream());
    let classifier = context.trained("classifier", &fold.train, seed)?;
    context.say("beliefs")?;
    let mut measurements = Vec::new();
    let dropout = PredictionMethod::McDropout {
        mc_samples: MC_SAMPLES,
    };
    for method in [PredictionMethod::Plain, dropout] {
        let predictions = classifier.predict(&fold.test, method)?;
        measurements.extend(measured(&predictions, method, fixed, seed));
    }
    Ok(Answer {
        measurements,
        split: format!("repeat {repeat}, fold {number}"),
        split_content: fold.manifest().sha256,
        ..Answer::default()
    })
}

/// Returns accuracy and mean number of sweeps of each rule.
///
/// - `fixed`: fixed numbers of sweeps; those that a material does not have are skipped
fn measured(
    predictions: &Predictions,
    method: PredictionMethod,
    fixed: &[usize],
    seed: Seed,
) -> Vec<Measurement> {
    let labels: Vec<usize> = predictions.sweeps.iter().map(|sweep| sweep.label).collect();
    let of_label = rows_of_label(&labels);
    let fewest = of_label.iter().map(Vec::len).min().unwrap_or(0);
    let fixed = fixed.iter().copied().filter(|sweeps| *sweeps <= fewest);
    let rules = THRESHOLDS
        .map(Rule::Until)
        .into_iter()
        .chain(fixed.map(Rule::Fixed));
    let mut measurements = Vec::new();
    for rule in rules {
        let (mut right, mut taken, mut decisions) = (0, 0, 0);
        for (label, rows) in of_label.iter().enumerate() {
            for order in 0..ORDERS {
                let mut rows = rows.clone();
                shuffle(&mut rows, &mut seed.rng(("order of sweeps", label, order)));
                let belief = rule.decide(predictions, &rows);
                right += usize::from(belief.label() == labels[rows[0]]);
                taken += belief.sweeps();
                decisions += 1;
            }
        }
        for (measure, sum) in [(Measure::Accuracy, right), (Measure::MeanSweeps, taken)] {
            let value = sum as f64 / decisions as f64;
            let measurement = Measurement::new(measure, method.name(), value, decisions);
            measurements.push(measurement.setting(rule.setting()));
        }
    }
    measurements
}
