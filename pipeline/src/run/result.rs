//! `result.json`: the result of a training run.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize};
use tactnet_data::{DataOrigin, Scheme, Seed, SplitManifest};

use crate::predict::by_method::{deserialize_evaluations, serialize_by_method};
use crate::{
    ConfoundedAccuracy, Estimate, Evaluation, PredictionMethod, Provenance, RandomFold, TrainSpec,
};

/// Result of a training run, with all that is needed to reproduce it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// Version of this layout, [`RunResult::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name of the data set.
    pub data: String,
    /// Origin of its sweeps.
    #[serde(default)]
    pub origin: DataOrigin,
    /// SHA-256 of the data set's content.
    pub data_sha256: String,
    /// Commits of the program, sorted; more than one if another build resumed the run.
    #[serde(deserialize_with = "read_commits")]
    pub git: Vec<String>,
    /// Program and machine of every session.
    pub provenance: Vec<Provenance>,
    /// Command line that reproduces the run, with paths reduced to file names.
    pub command: String,
    /// Seed of every random choice.
    pub seed: Seed,
    /// Name of the recipe.
    pub recipe: String,
    /// SHA-256 of the recipe as TOML.
    pub recipe_sha256: String,
    /// SHA-256 of the split.
    pub split_sha256: String,
    /// Description of the split.
    pub split: String,
    /// Repeat of the cross-validation, counted from 0.
    #[serde(alias = "run")]
    pub repeat: usize,
    /// Fold, counted from 0.
    pub fold: usize,
    /// Number of training sweeps.
    pub n_train: usize,
    /// Number of test sweeps.
    pub n_test: usize,
    /// Number of epochs trained; absent for a baseline.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epochs: Option<usize>,
    /// Settings selected on inner splits of the training sweeps, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub chosen: BTreeMap<String, f64>,
    /// Accuracy on single sweeps with the recipe's prediction method.
    pub accuracy_one_sweep: Estimate,
    /// Accuracy on three fused sweeps (Bayes) with the recipe's prediction method; absent with fewer than three test sweeps of a material.
    pub accuracy_three_sweeps: Option<Estimate>,
    /// Accuracy of the same training on a random fold; absent unless whole blocks were held out and it was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random_fold: Option<RandomFold>,
    /// Accuracy without the materials that coincide with recording blocks, with the recipe's prediction method; absent if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confounded: Option<ConfoundedAccuracy>,
    /// Evaluations by prediction method: plain, and MC dropout if the model has dropout. Files use [`PredictionMethod::name`] as key.
    #[serde(
        serialize_with = "serialize_by_method",
        deserialize_with = "deserialize_evaluations"
    )]
    pub evaluations: BTreeMap<PredictionMethod, Evaluation>,
    /// Time spent in training steps or in fitting, in seconds, without interruptions.
    pub train_seconds: f64,
    /// Training time per epoch, in seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds_per_epoch: Option<f64>,
    /// Peak resident memory of the process that ended the run, in MiB.
    pub peak_rss_mib: Option<f64>,
}

impl RunResult {
    /// Version written by this program. Version 1, which stores several commits in one text, is still readable.
    pub const SCHEMA_VERSION: u32 = 2;

    /// Returns the ratio of test to training sweeps, which corrects variances of resampled folds (Nadeau & Bengio, 2003).
    pub fn test_share(&self) -> f64 {
        self.n_test as f64 / self.n_train as f64
    }
}

/// Reads a list of commits, or the text of version 1, which separates them by spaces.
fn read_commits<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Commits {
        List(Vec<String>),
        Text(String),
    }
    Ok(match Commits::deserialize(deserializer)? {
        Commits::List(commits) => commits,
        Commits::Text(text) => text.split_whitespace().map(String::from).collect(),
    })
}

/// Returns the description of the split of a training, counted from 1: `fold 1 of 5, repeat 2`.
pub fn describe_split(manifest: &SplitManifest, spec: &TrainSpec) -> String {
    let part = manifest.fold + 1;
    let mut text = match manifest.scheme {
        Scheme::StratifiedKFold { folds, .. } => format!("fold {part} of {folds}"),
        Scheme::HoldOut { test_percent, .. } => format!("{test_percent} % held out"),
        Scheme::TestFlag => "the author's test sweeps".into(),
        Scheme::TrainOnAll => "no test sweeps".into(),
        Scheme::LeaveBlockOut => format!("block {part} of every material left out"),
        Scheme::GroupKFold { folds, .. } => format!("fold {part} of {folds}, whole blocks"),
    };
    if manifest.repeat > 0 {
        text.push_str(&format!(", repeat {}", manifest.repeat + 1));
    }
    if let Some(part) = spec.inner {
        text.push_str(&format!(", inner part {}", part + 1));
    }
    if let Some(shots) = spec.shots {
        text.push_str(&format!(", {shots} training sweeps of each material"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commits_are_a_list_and_the_text_of_version_1_is_read() {
        #[derive(Deserialize)]
        struct Document {
            #[serde(deserialize_with = "read_commits")]
            git: Vec<String>,
        }
        for text in [
            r#"{"git":"0a1b 2c3d-dirty"}"#,
            r#"{"git":["0a1b","2c3d-dirty"]}"#,
        ] {
            let document: Document = serde_json::from_str(text).unwrap();
            assert_eq!(document.git, ["0a1b", "2c3d-dirty"]);
        }
    }

    #[test]
    fn a_result_of_version_1_is_read_and_its_evaluations_stay_what_they_are() {
        let text = include_str!("../../../experiments/results/biotac_electrodes_fast.json");
        let result: RunResult = serde_json::from_str(text).unwrap();
        assert_eq!(result.git, ["43fb5bc3a600"]);
        assert_eq!(
            result.test_share(),
            0.25,
            "200 test sweeps of 1000, 800 to train on"
        );
        let dropout = PredictionMethod::McDropout { mc_samples: 100 };
        assert_eq!(
            result.evaluations[&dropout].one_sweep,
            result.accuracy_one_sweep
        );
        let written: serde_json::Value = serde_json::to_value(&result).unwrap();
        let mut before: serde_json::Value = serde_json::from_str(text).unwrap();
        // The field was renamed to `mc_samples`.
        let method = before["evaluations"]["mc_dropout"]["method"]
            .as_object_mut()
            .unwrap();
        let passes = method.remove("runs").unwrap();
        method.insert("mc_samples".into(), passes);
        assert_eq!(written["evaluations"], before["evaluations"]);
    }
}
