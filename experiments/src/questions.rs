//! The questions that an experiment can ask. Each file holds a question's recipe fields, computation, published values
//! and report texts.
//!
//! A new question is a file here with a type that implements [`Ask`], an entry in the registry below, and a `mod`
//! line.

mod crossval;
mod differentiate;
mod enrolment;
mod feature_maps;
mod headline;
mod networks;
mod nshot;
mod robustness;
mod sequential;
mod unknown;

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext};
use crate::measure::Measure;
use crate::part::Part;
use crate::row::Row;

pub use nshot::{SampleEfficiency, TransferMethod};

pub(crate) use headline::Headline;
pub(crate) use networks::costs;
pub(crate) use nshot::sample_efficiency;

macro_rules! registry {
    ($($(#[$doc:meta])* $name:literal => $file:ident::$question:ident),+ $(,)?) => {
        $(pub use $file::$question;)+

        /// A question with its fields.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind")]
        pub enum Question {
            $($(#[$doc])* #[serde(rename = $name)] $question($question)),+
        }

        impl Question {
            pub(crate) fn ask(&self) -> &dyn Ask {
                match self {
                    $(Self::$question(fields) => fields),+
                }
            }

            /// Checks the fields of a recipe's `question` against the type of its kind, because errors of a tagged
            /// enum do not name the field.
            ///
            /// # Errors
            /// An unknown or missing field, or a field of another type.
            pub(crate) fn check_fields(question: &Table) -> Result<(), toml::de::Error> {
                let mut fields = question.clone();
                match fields.remove("kind").as_ref().and_then(Value::as_str) {
                    $(Some($name) => fields.try_into::<$question>().map(drop),)+
                    _ => Ok(()),
                }
            }
        }

        $(impl Named for $question {
            fn name(&self) -> &'static str {
                $name
            }

            fn terms(&self) -> &'static [(&'static str, &'static str)] {
                &$file::TERMS
            }
        })+
    };
}

registry! {
    /// Accuracy of classifiers on held-out sweeps.
    "crossval" => crossval::Crossval,
    /// Transfer to new materials from few sweeps (thesis, section 4.6).
    "nshot" => nshot::Nshot,
    /// Decision between same and different material for two sweeps (thesis, sections 4.4.3 and 4.4.4).
    "differentiate" => differentiate::Differentiate,
    /// Detection of unknown materials.
    "unknown" => unknown::Unknown,
    /// Number of sweeps until the decision is certain.
    "sequential" => sequential::Sequential,
    /// Accuracy before and after enrolling one more material.
    "enrolment" => enrolment::Enrolment,
    /// Separation of easy and hard materials in the feature space.
    "feature-maps" => feature_maps::FeatureMaps,
    /// Accuracy of networks under several conditions, and their cost.
    "networks" => networks::Networks,
    /// Accuracy of models on disturbed sweeps.
    "robustness" => robustness::Robustness,
}

impl Question {
    /// Returns the fields of the question without those that only set the number of repetitions.
    pub(crate) fn subject(&self) -> Table {
        let mut fields = Table::try_from(self)
            .unwrap_or_else(|error| panic!("a question is always valid TOML: {error}"));
        for often in [
            "folds",
            "repeats",
            "splits",
            "scratch_folds",
            "probes",
            "groups",
        ] {
            fields.remove(often);
        }
        fields
    }
}

/// The name and the glossary of a question.
pub(crate) trait Named {
    /// Returns the name in recipes and in names of tasks.
    fn name(&self) -> &'static str;

    /// Returns the glossary of the report.
    fn terms(&self) -> &'static [(&'static str, &'static str)];
}

/// The behaviour of a question.
pub(crate) trait Ask: Named {
    /// Checks the fields.
    ///
    /// # Errors
    /// A field out of range, with the expected and found values.
    fn validate(&self) -> Result<(), String>;

    /// Returns the parts of the data, one for each task.
    fn parts(&self) -> Vec<Part>;

    /// Returns the number of new materials; `None` for a question that uses known materials only.
    fn new_materials(&self) -> Option<usize> {
        None
    }

    /// Returns true if the question is also about baselines, false if only about networks.
    fn takes_baselines(&self) -> bool {
        false
    }

    /// Answers the question for the context's part of the data.
    ///
    /// # Errors
    /// A request to stop; a data set that is too small for the question.
    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled>;

    /// Returns the number of test sweeps divided by the number of training sweeps, or 0 if every task draws its own
    /// split of the materials.
    fn test_share(&self) -> f64 {
        0.0
    }

    /// Returns the reference for comparisons by this measure; `None` without comparisons.
    fn compared(&self, _measure: Measure) -> Option<Compared> {
        None
    }

    /// Returns the values published for TactMat, in the measure's unit.
    fn published(&self, _row: &Row) -> Published {
        Published::default()
    }

    /// Returns the headline for one data set and network. Returns `None` without measurements and for
    /// cross-validations, whose contenders the report compares itself.
    ///
    /// - `rows`: all rows of the same data set, levels, steps and network
    fn headline(&self, _rows: &[&Row]) -> Option<Headline> {
        None
    }

    /// Returns the figures of the report.
    fn figures(&self) -> Vec<Figure> {
        Vec::new()
    }
}

/// The reference that a method is compared with, on the same tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compared {
    /// One method of the same network.
    With(&'static str),
    /// All other contenders, at this number of sweeps for each decision.
    WithEachOther {
        /// Sweeps for each decision.
        sweeps: usize,
    },
    /// All other networks with the same method, at this number of sweeps for each decision.
    Networks {
        /// Sweeps for each decision.
        sweeps: usize,
    },
}

/// Values published for TactMat, in the unit of their row.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Published {
    pub(crate) robot: Option<f64>,
    pub(crate) humans: Option<f64>,
}

impl Published {
    fn robot(value: f64) -> Self {
        Self {
            robot: Some(value),
            humans: None,
        }
    }
}

/// A figure of a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Figure {
    /// Accuracy against shots, with one line for each method.
    Shots {
        /// Title of the figure.
        title: &'static str,
        /// Names of the methods.
        methods: &'static [&'static str],
    },
    /// Accuracy against the mean number of sweeps.
    Sweeps,
    /// One bar for each method and condition.
    Bars(Measure),
    /// Accuracy against the strength of a disturbance, with one line for each model.
    Strengths {
        /// Title of the figure.
        title: &'static str,
        /// Name and unit of the strength.
        label: &'static str,
        /// First part of the names of the settings; the strength follows.
        prefix: &'static str,
        /// Name of the setting without disturbance.
        undisturbed: &'static str,
        /// Kind of the strength.
        strength: Strength,
    },
}

/// Kind of the strength of a disturbance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Strength {
    /// A factor, which is 1 without disturbance.
    Factor,
    /// A size, which is 0 without disturbance.
    Size,
}

/// Returns draws of new materials, one for each task.
fn draws(count: usize) -> Vec<Part> {
    (0..count).map(Part::Draw).collect()
}

/// Returns folds of two repeats of five folds: the first `splits` of them, or the first `folds` of each of `repeats`
/// repeats.
fn folds(folds: usize, repeats: usize, splits: Option<usize>) -> Vec<Part> {
    match splits {
        Some(splits) => (0..splits)
            .map(|number| Part::Fold {
                repeat: number / FOLDS,
                fold: number % FOLDS,
            })
            .collect(),
        None => (0..repeats)
            .flat_map(|repeat| (0..folds).map(move |fold| Part::Fold { repeat, fold }))
            .collect(),
    }
}

/// Number of folds of a repeat.
const FOLDS: usize = 5;
/// Maximum number of repeats of the cross-validation.
const REPEATS: usize = 2;

/// Checks that a field is within a range.
fn within(field: &str, value: usize, least: usize, most: usize) -> Result<(), String> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let range = if most == usize::MAX {
        format!("at least {least}")
    } else {
        format!("{least} to {most}")
    };
    Err(format!("`{field}`: expected {range}, found {value}"))
}

/// Checks the numbers of folds, repeats and splits.
fn check_folds(folds: usize, repeats: usize, splits: Option<usize>) -> Result<(), String> {
    within("folds", folds, 1, FOLDS)?;
    within("repeats", repeats, 1, REPEATS)?;
    match splits {
        Some(splits) if !(1..=FOLDS * REPEATS).contains(&splits) => Err(format!(
            "`splits`: expected 1 to 10 (two repeats of five folds), found {splits}"
        )),
        _ => Ok(()),
    }
}

/// Checks that all numbers are above 0.
fn check_counts(field: &str, counts: &[usize]) -> Result<(), String> {
    if counts.contains(&0) {
        return Err(format!("`{field}`: expected numbers above 0, found 0"));
    }
    Ok(())
}

/// Checks that there are numbers of sweeps per material, all above 0.
fn check_shots(shots: &[usize]) -> Result<(), String> {
    if shots.is_empty() {
        return Err("`shots`: expected one or more numbers above 0, found none".into());
    }
    check_counts("shots", shots)
}

/// Returns the requested numbers, or the question's default if there are none.
fn given_or<'a>(given: &'a [usize], own: &'a [usize]) -> &'a [usize] {
    if given.is_empty() { own } else { given }
}

fn one() -> usize {
    1
}

fn five() -> usize {
    5
}

fn six() -> usize {
    6
}
