//! `result.json`: what a training run found.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize};
use tactnet_data::{DataOrigin, Scheme, Seed, SplitManifest};

use crate::predict::by_method::{deserialize_evaluations, serialize_by_method};
use crate::{Estimate, Evaluation, PredictionMethod, Provenance};

/// What a training run found, with everything needed to find it again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// Version of this layout, [`RunResult::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name of the data set.
    pub data: String,
    /// Where its sweeps come from.
    #[serde(default)]
    pub origin: DataOrigin,
    /// SHA-256 of its content.
    pub data_sha256: String,
    /// Commits of the program, sorted; several where it was resumed by another build.
    #[serde(deserialize_with = "read_commits")]
    pub git: Vec<String>,
    /// Program and machine of every session.
    pub provenance: Vec<Provenance>,
    /// Command line that leads here, paths shortened to file names.
    pub command: String,
    /// Names every random choice.
    pub seed: Seed,
    /// Name of the recipe.
    pub recipe: String,
    /// SHA-256 of the recipe as TOML.
    pub recipe_sha256: String,
    /// SHA-256 of the split.
    pub split_sha256: String,
    /// How the data set was split.
    pub split: String,
    /// Repeat of the cross-validation, counted from 0.
    #[serde(alias = "run")]
    pub repeat: usize,
    /// Fold, counted from 0.
    pub fold: usize,
    /// Sweeps trained on.
    pub n_train: usize,
    /// Sweeps tested on.
    pub n_test: usize,
    /// Epochs trained; absent where the model has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epochs: Option<usize>,
    /// Settings that were chosen on inner splits of the training sweeps, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub chosen: BTreeMap<String, f64>,
    /// One sweep, predicted the recipe's own way.
    pub accuracy_one_sweep: Estimate,
    /// Three sweeps fused (Bayes), predicted the recipe's own way; absent with fewer than three test sweeps a material.
    pub accuracy_three_sweeps: Option<Estimate>,
    /// All ways of predicting: plainly, and by MC dropout where the model has dropout. In files by [`PredictionMethod::name`].
    #[serde(
        serialize_with = "serialize_by_method",
        deserialize_with = "deserialize_evaluations"
    )]
    pub evaluations: BTreeMap<PredictionMethod, Evaluation>,
    /// Time spent in training steps or in fitting, seconds, interruptions left out.
    pub train_seconds: f64,
    /// The same per epoch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds_per_epoch: Option<f64>,
    /// Largest resident memory of the process that ended the run, MiB.
    pub peak_rss_mib: Option<f64>,
}

impl RunResult {
    /// Version written by this program; 1, which names several commits in one text, is read as well.
    pub const SCHEMA_VERSION: u32 = 2;

    /// Returns test sweeps over training sweeps, by which variances of resampled folds are corrected (Nadeau & Bengio, 2003).
    pub fn test_share(&self) -> f64 {
        self.n_test as f64 / self.n_train as f64
    }
}

/// Reads a list of commits, or what version 1 has instead: one text, with spaces between them.
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

/// Returns a split's name for people, who count from 1: `fold 1 of 5, repeat 2`.
///
/// - `inner`: the part of the training sweeps that is tested on instead of the test sweeps
pub fn describe_split(manifest: &SplitManifest, inner: Option<usize>) -> String {
    let part = manifest.fold + 1;
    let mut text = match manifest.scheme {
        Scheme::StratifiedKFold { folds, .. } => format!("fold {part} of {folds}"),
        Scheme::HoldOut { test_percent, .. } => format!("{test_percent} % held out"),
        Scheme::TestFlag => "the author's test sweeps".into(),
        Scheme::TrainOnAll => "no test sweeps".into(),
        Scheme::LeaveBlockOut => format!("block {part} of every material left out"),
    };
    if manifest.repeat > 0 {
        text.push_str(&format!(", repeat {}", manifest.repeat + 1));
    }
    if let Some(part) = inner {
        text.push_str(&format!(", inner part {}", part + 1));
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
        // Called `mc_samples` since.
        let method = before["evaluations"]["mc_dropout"]["method"]
            .as_object_mut()
            .unwrap();
        let passes = method.remove("runs").unwrap();
        method.insert("mc_samples".into(), passes);
        assert_eq!(written["evaluations"], before["evaluations"]);
    }
}
