//! The questions that an experiment can ask, one file each: its fields in a recipe, its run, its published figures, its words.
//!
//! A new question is a file here with a type that implements [`Ask`], and its line in the registry below (and `mod`).

mod crossval;
mod differentiate;
mod enrolment;
mod feature_maps;
mod headline;
mod networks;
mod nshot;
mod sequential;
mod unknown;

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::context::{Cancelled, StudyContext};
use crate::plan::Grid;
use crate::result::Answer;
use crate::summarise::FinishedTask;
use crate::tasks::ExperimentDir;
use crate::{ExperimentError, Measure, Part, Row, Summary, Task};

pub use crossval::{
    Audit, Contender, FoldRecord, Probe, PublishedContender, ReliabilityBin, RiskCoverage,
};
pub use feature_maps::FeatureMap;
pub use nshot::{SampleEfficiency, TransferMethod};

pub(crate) use crossval::{LevelShare, Scored, few_steps, read_training, scored};
pub(crate) use headline::{Headline, in_percent, interval, listed, rank};

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

            /// Checks the fields of a recipe's `question`. An enum with a tag forgets which field is at fault, the type itself knows.
            ///
            /// # Errors
            /// A field that is unknown, is missing or has another type.
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
        })+
    };
}

registry! {
    /// How accurate are classifiers on sweeps that they were not trained on?
    "crossval" => crossval::Crossval,
    /// How well does transfer learn new materials from few sweeps? (Thesis, section 4.6.)
    "nshot" => nshot::Nshot,
    /// Are two sweeps of one material? (Thesis, sections 4.4.3 and 4.4.4.)
    "differentiate" => differentiate::Differentiate,
    /// Is it a material that was never seen?
    "unknown" => unknown::Unknown,
    /// How many sweeps until the decision is sure?
    "sequential" => sequential::Sequential,
    /// What does a material more cost a trained classifier?
    "enrolment" => enrolment::Enrolment,
    /// How far apart do easy and hard materials lie?
    "feature-maps" => feature_maps::FeatureMaps,
    /// How good is a network under several circumstances, and what does it cost?
    "networks" => networks::Networks,
}

impl Question {
    /// Returns what is asked without how often: the fields but numbers of folds, repeats and draws, probes and groups.
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

/// The name of a question in recipes, in names of tasks and on the command line.
pub(crate) trait Named {
    /// Returns the name.
    fn name(&self) -> &'static str;
}

/// The behaviour of a question.
pub(crate) trait Ask: Named {
    /// Checks its fields.
    ///
    /// # Errors
    /// A field that is out of range, named, with what was expected and found.
    fn validate(&self) -> Result<(), String>;

    /// Plans its tasks: one for each part of the data and each network of the recipe, unless the question says otherwise.
    ///
    /// # Errors
    /// A model that is no network.
    fn tasks(&self, grid: &Grid<'_>) -> Result<Vec<Task>, String> {
        grid.question_tasks(self.name(), &self.parts())
    }

    /// Returns the parts of the data that are asked about, a task each.
    fn parts(&self) -> Vec<Part>;

    /// Returns how many materials of a data set are new; `None` for a question that knows all of them.
    fn new_materials(&self) -> Option<usize> {
        None
    }

    /// Answers the question for the part of the data that the context names.
    ///
    /// # Errors
    /// Somebody asked to stop; data that are too few for the question.
    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled>;

    /// Returns test sweeps over training sweeps where tasks share training sweeps; 0 where every task draws its own split of the
    /// materials.
    fn test_share(&self) -> f64;

    /// Returns whom the methods are compared with by this measure.
    fn compared(&self, measure: Measure) -> Option<Compared>;

    /// Returns what was published for TactMat, in the measure's unit.
    fn published(&self, _row: &Row) -> Published {
        Published::default()
    }

    /// Adds to the summary what this question alone finds.
    ///
    /// # Errors
    /// Files of a task that are damaged.
    fn complete(
        &self,
        _dir: &ExperimentDir,
        _summary: &mut Summary,
        _finished: &[FinishedTask<'_>],
    ) -> Result<(), ExperimentError> {
        Ok(())
    }

    /// Returns what its report says first of one data set and network; `None` before anything was measured, and of cross-validations,
    /// whose contenders the report compares itself.
    ///
    /// - `rows`: all of the same data set, levels, steps and network
    fn headline(&self, _rows: &[&Row]) -> Option<Headline> {
        None
    }

    /// Returns the figures of its report.
    fn figures(&self) -> Vec<Figure> {
        Vec::new()
    }

    /// Returns the words of its report with their meanings.
    fn terms(&self) -> &'static [(&'static str, &'static str)];
}

/// Whom a method is compared with, on the same tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compared {
    /// With one method of the same network.
    With(&'static str),
    /// With every other contender, on this number of sweeps a decision.
    WithEachOther {
        /// Sweeps behind one decision.
        sweeps: usize,
    },
    /// With every other network asked by the same method, on this number of sweeps a decision.
    Networks {
        /// Sweeps behind one decision.
        sweeps: usize,
    },
}

/// Numbers published for TactMat, in the unit of the row beside them.
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
    /// Accuracy against shots, a line for each of some methods.
    Shots {
        /// The methods' common name.
        title: &'static str,
        /// Names of the methods.
        methods: &'static [&'static str],
    },
    /// Accuracy against the mean number of sweeps.
    Sweeps,
    /// A bar for every method and circumstance.
    Bars(Measure),
}

/// Draws of new materials, one task each.
fn draws(count: usize) -> Vec<Part> {
    (0..count).map(Part::Draw).collect()
}

/// Folds of the two times five, one task each: the first `splits` of them, or the first `folds` of each of `repeats` repeats.
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

/// Folds of a repeat.
const FOLDS: usize = 5;
/// Repeats of the cross-validation.
const REPEATS: usize = 2;

/// Checks that a number lies between two.
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

/// Checks numbers of folds.
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

/// Checks numbers of sweeps.
fn check_counts(field: &str, counts: &[usize]) -> Result<(), String> {
    if counts.contains(&0) {
        return Err(format!("`{field}`: expected numbers above 0, found 0"));
    }
    Ok(())
}

/// Returns the numbers that were asked for, or else the question's own.
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
