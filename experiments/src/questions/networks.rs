//! Accuracy of networks under several conditions, and their cost.

use std::fmt;

use serde::{Deserialize, Serialize};
use tactnet_data::twin::{TwinConfig, generate};
use tactnet_data::{DataSource, Dataset, Fold, Scheme, SweepView};
use tactnet_pipeline::{Classifier, Evaluation, PredictionMethod};

use super::headline::{Headline, best};
use super::{Ask, Compared, Figure, check_counts, check_folds, five, folds, one};
use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext};
use crate::one_or_many::one_or_many;
use crate::phrases::in_percent;
use crate::row::NetworkCost;
use crate::{Measure, Measurement, Part, Row};

/// Number of sweeps that are fused into one decision.
const FUSED: usize = 3;
/// Prediction methods under most conditions.
const PLAINLY: [PredictionMethod; 1] = [PredictionMethod::Plain];
/// Prediction methods under the standard condition.
const ALL_WAYS: [PredictionMethod; 2] = [
    PredictionMethod::Plain,
    PredictionMethod::McDropout { mc_samples: 100 },
];
/// Name of the standard condition.
const USUAL: &str = "as trained";

/// Fields of the question about networks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Networks {
    /// Number of folds of each repeat that are evaluated.
    #[serde(default = "five")]
    pub folds: usize,
    /// Number of repeats of the cross-validation.
    #[serde(default = "one", alias = "runs")]
    pub repeats: usize,
    /// Evaluates on a fifth of each fold's training sweeps instead of its test sweeps, for model selection.
    #[serde(default)]
    pub inner: bool,
    /// Numbers of training sweeps of each material, each a separate condition in addition to all sweeps. Numbers that
    /// a fold does not have are skipped.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub sweeps: Vec<usize>,
    /// Factors on the contact force of the test sweeps, which differ from training. Only for twins.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub forces: Vec<f64>,
    /// Factors on the speed of the test sweeps. Only for twins.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub speeds: Vec<f64>,
    /// Also evaluates with a recording block left out, if the data names blocks.
    #[serde(default)]
    pub blocks: bool,
}

impl Ask for Networks {
    fn validate(&self) -> Result<(), String> {
        check_folds(self.folds, self.repeats, None)?;
        check_counts("sweeps", &self.sweeps)?;
        if self.inner && self.blocks {
            return Err("`blocks`: an inner part of a fold has no left-out block; remove `inner` or `blocks`".into());
        }
        for (field, factors) in [("forces", &self.forces), ("speeds", &self.speeds)] {
            if let Some(factor) = factors.iter().find(|f| !(f.is_finite() && **f > 0.0)) {
                return Err(format!(
                    "`{field}`: expected factors above 0, found {factor}"
                ));
            }
        }
        Ok(())
    }

    fn parts(&self) -> Vec<Part> {
        folds(self.folds, self.repeats, None)
    }

    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        networks(self, context)
    }

    fn test_share(&self) -> f64 {
        0.25
    }

    fn compared(&self, measure: Measure) -> Option<Compared> {
        (measure == Measure::Accuracy).then_some(Compared::Networks { sweeps: 1 })
    }

    fn headline(&self, rows: &[&Row]) -> Option<Headline> {
        let accuracies = || {
            let rows = rows.iter().copied();
            rows.filter(|row| row.is_one_sweep_accuracy())
        };
        let chosen = best(accuracies().filter(|row| row.setting == USUAL))?;
        let worst = accuracies()
            .filter(|row| row.method == chosen.method)
            .min_by(|a, b| a.statistic.mean.total_cmp(&b.statistic.mean))?;
        let qualifier = if worst.setting == USUAL {
            String::new()
        } else {
            format!(
                "Under `{}` it is {}.",
                worst.setting,
                in_percent(worst.statistic.mean)
            )
        };
        let says = "of single sweeps recognised under the standard condition".into();
        Some(Headline::of(chosen, says, qualifier))
    }

    fn figures(&self) -> Vec<Figure> {
        vec![Figure::Bars(Measure::Accuracy)]
    }
}

/// Returns the network, condition and cost of each row of single-sweep accuracy, in the order of the rows.
pub(crate) fn costs(rows: &[Row]) -> Vec<Option<NetworkCost>> {
    let of = |row: &Row, measure: Measure| {
        let mut same = rows.iter().filter(|other| {
            (
                &other.data,
                &other.model,
                other.levels,
                other.steps,
                &other.setting,
            ) == (&row.data, &row.model, row.levels, row.steps, &row.setting)
        });
        same.find(|other| other.measure == measure)
            .map(|other| other.statistic.mean)
    };
    let cost = |row: &Row| {
        row.is_one_sweep_accuracy().then(|| NetworkCost {
            network: row.model.clone(),
            condition: row.setting.clone(),
            accuracy: row.statistic.mean,
            multiply_adds: of(row, Measure::MultiplyAdds).map(|millions| millions * 1e6),
            train_seconds: of(row, Measure::TrainSeconds),
        })
    };
    rows.iter().map(cost).collect()
}

/// Glossary of the report.
pub(super) const TERMS: [(&str, &str); 4] = [
    (
        "As trained",
        "Test sweeps under the same conditions as the training sweeps: a fold of the data.",
    ),
    (
        "Force, speed \u{d7} 0.7",
        "The same test sweeps with this factor on the standard force or speed; the network was trained at the standard one. Only for twins.",
    ),
    (
        "10 sweeps a material",
        "The network was trained on this number of sweeps of each material instead of all of the fold.",
    ),
    (
        "Multiply-adds",
        "Of one prediction without dropout; convolutions and Fourier transforms by their definition, biases and normalisation left out.",
    ),
];

fn networks(asked: &Networks, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let (repeat, number) = context.part.repeat_and_fold();
    let dealt = |scheme| -> Result<Fold<'_>, Cancelled> {
        let fold = Fold::new(context.dataset, scheme, context.seed, repeat, number)?;
        Ok(if asked.inner { fold.nested(0)? } else { fold })
    };
    let fold = dealt(Scheme::default())?;
    let seed = context.seed_for("networks", context.part.stream());
    let mut measurements = Vec::new();

    let (classifier, seconds) = context.trained_in(USUAL, &fold.train, seed)?;
    context.say("predictions")?;
    measurements.extend(judged(&classifier, &fold.test, USUAL, &ALL_WAYS, context)?);
    if let Some(seconds) = seconds {
        measurements.push(measured(Measure::TrainSeconds, seconds, fold.test.len()));
    }
    if let Some(count) = multiply_adds(&classifier)? {
        measurements.push(measured(Measure::MultiplyAdds, count, fold.test.len()));
    }

    let forces = asked.forces.iter().copied().map(Contact::Force);
    let speeds = asked.speeds.iter().copied().map(Contact::Speed);
    for contact in forces.chain(speeds) {
        let Some(felt) = felt_again(context, contact)? else {
            continue;
        };
        let setting = contact.to_string();
        context.say(&setting)?;
        let test = SweepView::new(&felt, fold.test.indices().to_vec());
        measurements.extend(judged(&classifier, &test, &setting, &PLAINLY, context)?);
    }
    for &sweeps in &asked.sweeps {
        // Skip the condition if the fold has fewer sweeps.
        let Ok(few) = fold.shots(sweeps) else {
            continue;
        };
        let setting = format!("{sweeps} sweeps a material");
        let classifier = context.trained(&setting, &few.train, seed)?;
        measurements.extend(judged(&classifier, &few.test, &setting, &PLAINLY, context)?);
    }
    // Skip the condition if the data has no blocks or too few of them.
    let without_block = asked.blocks.then(|| dealt(Scheme::LeaveBlockOut).ok());
    if let Some(fold) = without_block.flatten() {
        let setting = "a block left out";
        let classifier = context.trained(setting, &fold.train, seed)?;
        measurements.extend(judged(&classifier, &fold.test, setting, &PLAINLY, context)?);
    }

    // Group the rows of the report by measure.
    measurements.sort_by_key(|measurement| measurement.measure);
    let manifest = fold.manifest();
    let judged_by = if asked.inner { ", inner part 0" } else { "" };
    Ok(Answer {
        measurements,
        split: format!("repeat {repeat}, fold {number}{judged_by}"),
        split_content: format!("{}{judged_by}", manifest.sha256),
        ..Answer::default()
    })
}

/// A change of contact: a factor on the standard force or speed.
#[derive(Clone, Copy)]
enum Contact {
    Force(f64),
    Speed(f64),
}

impl fmt::Display for Contact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Force(factor) => write!(f, "force \u{d7} {factor}"),
            Self::Speed(factor) => write!(f, "speed \u{d7} {factor}"),
        }
    }
}

/// Returns the twin's sweeps at another force or speed; `None` for other data.
fn felt_again(context: &StudyContext<'_>, contact: Contact) -> Result<Option<Dataset>, Cancelled> {
    let DataSource::Twin(version) = DataSource::named(context.data) else {
        return Ok(None);
    };
    let mut config = TwinConfig {
        version,
        ..TwinConfig::default()
    };
    match contact {
        Contact::Force(factor) => config.contact_force = factor,
        Contact::Speed(factor) => config.speed = factor,
    }
    let felt = generate(&config)?.first_steps(context.dataset.shape().steps)?;
    Ok(Some(felt))
}

/// Returns a measurement under the standard condition.
fn measured(measure: Measure, value: f64, decisions: usize) -> Measurement {
    Measurement::new(measure, PredictionMethod::Plain.name(), value, decisions)
        .setting(USUAL)
        .sweeps(1)
}

/// Returns the multiply-adds of one prediction, in millions.
fn multiply_adds(classifier: &Classifier) -> Result<Option<f64>, Cancelled> {
    Ok(classifier.multiply_adds()?.map(|count| count as f64 / 1e6))
}

/// Evaluates the test sweeps with each prediction method.
fn judged(
    classifier: &Classifier,
    test: &SweepView<'_>,
    setting: &str,
    methods: &[PredictionMethod],
    context: &StudyContext<'_>,
) -> Result<Vec<Measurement>, Cancelled> {
    let mut found = Vec::new();
    for &method in methods {
        let predictions = classifier.predict(test, method)?;
        let evaluation = Evaluation::of(&predictions, FUSED, context.seed);
        let mut values = vec![(Measure::Accuracy, 1, evaluation.one_sweep.mean)];
        if let Some(fused) = &evaluation.fused {
            values.push((Measure::Accuracy, FUSED, fused.bayes.mean));
        }
        let gap = evaluation.expected_calibration_error;
        values.extend([
            (
                Measure::NegativeLogLikelihood,
                1,
                evaluation.negative_log_likelihood,
            ),
            (Measure::ExpectedCalibrationError, 1, gap),
        ]);
        found.extend(values.into_iter().map(|(measure, sweeps, value)| {
            Measurement::new(measure, method.name(), value, test.len())
                .setting(setting)
                .sweeps(sweeps)
        }));
    }
    Ok(found)
}
