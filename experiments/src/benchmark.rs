//! Comparison of models over several data sets: errors, ranks, and the model that the rule for the default selects.

mod default_model;

use std::fmt;

use serde::{Serialize, Serializer};

use crate::plan::LeftOut;
use crate::ranks::ranks;
use crate::scored::Scored;
pub use default_model::{Candidate, DefaultModel, Objection};

/// Comparison of models over several data sets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Benchmark {
    /// Results under each condition; the first is the headline.
    pub conditions: Vec<ConditionScores>,
    /// Model that the rule for the default selects.
    pub default: DefaultModel,
}

/// Condition under which models are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Condition {
    /// Held-out groups of the data sets that have groups, random folds of the others.
    Headline,
    /// Held-out groups of the data sets that have groups.
    HeldOutGroups,
    /// Random folds.
    RandomFolds,
    /// This number of training sweeps of each material, on the folds of the headline.
    Shots(usize),
}

impl Condition {
    /// Returns the number of training sweeps of each material; `None` for all of the fold.
    pub(crate) fn shots(self) -> Option<usize> {
        match self {
            Self::Shots(shots) => Some(shots),
            _ => None,
        }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Headline => f.write_str("headline"),
            Self::HeldOutGroups => f.write_str("held-out groups"),
            Self::RandomFolds => f.write_str("random folds"),
            Self::Shots(1) => f.write_str("1 sweep a material"),
            Self::Shots(shots) => write!(f, "{shots} sweeps a material"),
        }
    }
}

impl Serialize for Condition {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Results of all models on all data sets under one condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConditionScores {
    /// The condition.
    pub condition: Condition,
    /// Means over the data sets, one entry for each model.
    pub models: Vec<ModelScore>,
    /// Results on each data set.
    pub sets: Vec<SetScores>,
}

/// Means of a model over the data sets on which every model has a result or is left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelScore {
    /// Name of the model.
    pub model: String,
    /// Number of data sets that the means of error and time are taken over, which are those that the model is not left out on.
    pub sets: usize,
    /// Mean error of single sweeps; absent without data sets.
    pub mean_error: Option<f64>,
    /// Mean rank, 1 for the best; a model that is left out has the last rank.
    pub mean_rank: Option<f64>,
    /// Mean training time of a fold, in seconds.
    pub train_seconds: Option<f64>,
}

/// Results of all models on one data set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetScores {
    /// Name of the data set.
    pub data: String,
    /// Description of the split.
    pub split: String,
    /// Number of materials.
    pub materials: usize,
    /// Number of tested sweeps.
    pub sweeps: usize,
    /// Time steps of a sweep.
    pub steps: usize,
    /// Accuracy of always naming the material with the most test sweeps.
    pub chance: f64,
    /// Results in the order of [`ConditionScores::models`].
    pub models: Vec<SetResult>,
}

/// Result of one model on one data set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetResult {
    /// Name of the model.
    pub model: String,
    /// Accuracy and training time; absent if the model is left out or has not ended.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub score: Option<Score>,
    /// Reason why the model is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
    /// Rank among the models, 1 for the best; absent until every model has a result or is left out.
    pub rank: Option<f64>,
}

/// Accuracy and training time of a model on one data set, with the prediction method of its recipe.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// Accuracy of single sweeps, mean over folds.
    pub accuracy: f64,
    /// 95 % interval of the accuracy; absent with one fold, and if all folds are equal.
    pub ci95: Option<[f64; 2]>,
    /// Balanced accuracy of single sweeps.
    pub balanced_accuracy: Option<f64>,
    /// 95 % interval of the balanced accuracy.
    pub balanced_ci95: Option<[f64; 2]>,
    /// Mean training time of a fold, in seconds.
    pub train_seconds: f64,
    /// Number of folds.
    pub folds: usize,
}

impl Benchmark {
    /// Returns the comparison; `None` with fewer than two data sets or models.
    ///
    /// - `left_out`: models that data sets do not allow
    pub(crate) fn of(rows: &[Scored<'_>], left_out: &[LeftOut]) -> Option<Self> {
        let contends = |row: &&Scored<'_>| !row.probe && row.own_method && row.inner.is_none();
        let rows: Vec<&Scored<'_>> = rows.iter().filter(contends).collect();
        let data = unique(rows.iter().map(|row| row.data.as_str()));
        let others = left_out.iter().map(|of| of.model.as_str());
        let others = others.filter(|model| !model.starts_with("probe"));
        let models = unique(rows.iter().map(|row| row.model.as_str()).chain(others));
        if data.len() < 2 || models.len() < 2 {
            return None;
        }
        let table = Table {
            rows: &rows,
            data: &data,
            models: &models,
            left_out,
        };
        let mut shots: Vec<usize> = rows.iter().filter_map(|row| row.shots).collect();
        shots.sort_unstable();
        shots.dedup();
        let conditions = [
            Condition::Headline,
            Condition::HeldOutGroups,
            Condition::RandomFolds,
        ];
        let conditions: Vec<ConditionScores> = conditions
            .into_iter()
            .chain(shots.into_iter().map(Condition::Shots))
            .map(|condition| table.under(condition))
            .filter(|scores| !scores.sets.is_empty())
            .collect();
        let is_committee = |model: &str| rows.iter().any(|row| row.committee && row.model == model);
        Some(Self {
            default: DefaultModel::of(conditions.first()?, is_committee),
            conditions,
        })
    }

    /// Returns the results under a condition; `None` if no data set has any.
    pub fn under(&self, condition: Condition) -> Option<&ConditionScores> {
        self.conditions
            .iter()
            .find(|scores| scores.condition == condition)
    }
}

impl ConditionScores {
    /// Returns the model with the least mean error; the one with the better mean rank of several.
    pub fn best(&self) -> Option<&ModelScore> {
        let all_sets = self.models.iter().map(|of| of.sets).max()?;
        let everywhere = self.models.iter().filter(|of| of.sets == all_sets);
        let key = |of: &&ModelScore| (of.mean_error, of.mean_rank);
        let known = everywhere.filter(|of| of.mean_error.is_some());
        known.min_by(|a, b| {
            key(a)
                .partial_cmp(&key(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        })
    }
}

impl SetScores {
    /// Returns true if every model has a result or is left out.
    pub(crate) fn is_complete(&self) -> bool {
        self.models.iter().all(|result| result.rank.is_some())
    }

    /// Returns the highest accuracy.
    pub fn highest(&self) -> Option<f64> {
        let scores = self.models.iter().filter_map(|of| of.score.as_ref());
        scores.map(|score| score.accuracy).max_by(f64::total_cmp)
    }
}

/// Contenders with the data sets and models to compare.
struct Table<'a> {
    rows: &'a [&'a Scored<'a>],
    data: &'a [&'a str],
    models: &'a [&'a str],
    left_out: &'a [LeftOut],
}

impl Table<'_> {
    fn under(&self, condition: Condition) -> ConditionScores {
        let sets = self.data.iter();
        let sets: Vec<SetScores> = sets.filter_map(|data| self.set(condition, data)).collect();
        let models = self.models.iter().enumerate();
        ConditionScores {
            condition,
            models: models.map(|(k, model)| mean(k, model, &sets)).collect(),
            sets,
        }
    }

    /// Returns the results on one data set; `None` if there are none under the condition.
    fn set(&self, condition: Condition, data: &str) -> Option<SetScores> {
        let own = || self.rows.iter().filter(|row| row.data == data);
        let has_groups = own().any(|row| row.split_kind.holds_out_blocks());
        let belongs = |row: &&&Scored<'_>| {
            let grouped = row.split_kind.holds_out_blocks();
            let is_asked = match condition {
                Condition::Headline => grouped == has_groups,
                Condition::HeldOutGroups => grouped,
                Condition::RandomFolds => !grouped,
                Condition::Shots(_) => true,
            };
            is_asked && row.shots == condition.shots()
        };
        let rows: Vec<&&Scored<'_>> = own().filter(belongs).collect();
        let first = rows.first()?;
        let reason = |model: &str| {
            let mut own = self.left_out.iter();
            own.find(|of| of.model == model && of.data == data && of.shots == condition.shots())
                .map(|of| of.reason.clone())
        };
        let mut models: Vec<SetResult> = self
            .models
            .iter()
            .map(|model| SetResult {
                model: (*model).into(),
                score: rows
                    .iter()
                    .find(|row| row.model == *model)
                    .map(|row| score(row)),
                left_out: reason(model),
                rank: None,
            })
            .collect();
        let is_known = |of: &SetResult| of.score.is_some() || of.left_out.is_some();
        if models.iter().all(is_known) {
            let accuracies: Vec<Option<f64>> = models
                .iter()
                .map(|of| of.score.as_ref().map(|score| score.accuracy))
                .collect();
            let ranked = models.iter_mut().zip(ranks(&accuracies));
            ranked.for_each(|(result, rank)| result.rank = Some(rank));
        }
        Some(SetScores {
            data: data.into(),
            split: first.split.clone(),
            materials: first.materials.len(),
            sweeps: first.confusion.iter().flatten().sum::<usize>() / first.repeats(),
            steps: first.steps,
            chance: first.guessing(),
            models,
        })
    }
}

fn score(row: &Scored<'_>) -> Score {
    Score {
        accuracy: row.one_sweep.mean,
        ci95: row.one_sweep.ci95,
        balanced_accuracy: row.balanced.map(|of| of.mean),
        balanced_ci95: row.balanced.and_then(|of| of.ci95),
        train_seconds: row.train_seconds.mean,
        folds: row.folds.len(),
    }
}

/// Returns the means of the `k`-th model over the complete data sets.
fn mean(k: usize, model: &str, sets: &[SetScores]) -> ModelScore {
    let complete = || sets.iter().filter(|set| set.is_complete());
    let scores: Vec<&Score> = complete()
        .filter_map(|set| set.models[k].score.as_ref())
        .collect();
    let ranks: Vec<f64> = complete().filter_map(|set| set.models[k].rank).collect();
    let mean = |values: Vec<f64>| {
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    ModelScore {
        model: model.into(),
        sets: scores.len(),
        mean_error: mean(scores.iter().map(|of| 1.0 - of.accuracy).collect()),
        mean_rank: mean(ranks),
        train_seconds: mean(scores.iter().map(|of| of.train_seconds).collect()),
    }
}

/// Returns each name once, in the order of their first occurrence.
fn unique<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut found: Vec<&str> = Vec::new();
    for name in names {
        if !found.contains(&name) {
            found.push(name);
        }
    }
    found
}

#[cfg(test)]
pub(crate) mod tests;
