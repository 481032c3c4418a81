//! The audit of a data set: its best model compared with probes.

use serde::{Deserialize, Serialize};

use crate::data_probes::BlockIdentity;

/// The best model of a data set compared with the probes, which measure information other than texture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Audit {
    /// Name of the data set, with the treatment of levels.
    pub data: String,
    /// Accuracy of guessing: the share of the material with the most test sweeps.
    pub chance: f64,
    /// Accuracy of random guesses that name each material as often as the classifier of permuted labels; absent
    /// without that probe.
    #[serde(default)]
    pub permuted_chance: Option<f64>,
    /// Best contender on random folds, and its accuracy.
    pub best: Option<(String, f64)>,
    /// Contenders on random folds with the same accuracy as the best.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tied: Vec<String>,
    /// Accuracy of the same model with a recording block left out; absent if it was not run.
    pub block_out: Option<f64>,
    /// Accuracy of a nearest neighbour on taxel means.
    pub means: Option<f64>,
    /// Accuracy of a nearest neighbour on the first frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_frame: Option<f64>,
    /// Accuracy of a nearest neighbour on the last frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_frame: Option<f64>,
    /// Accuracy of naming the material of the nearest training sweep in the order of the data set, on random folds; absent if the
    /// data set is sorted by material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording_order: Option<f64>,
    /// Accuracy of naming the material of the training sweep of the most similar length, on random folds; absent if all sweeps have
    /// one length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweep_length: Option<f64>,
    /// Recognition of the recording block within a material, on random folds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub block_identity: Option<BlockIdentity>,
    /// Accuracy with permuted labels.
    pub permuted: Option<f64>,
    /// Standard deviation of guessing, given the number of test sweeps.
    pub chance_sigma: f64,
    /// Interpretation of the differences, in sentences.
    pub verdict: String,
}

/// Share of the lead over guessing above which a score counts as mostly level.
const MOSTLY_LEVEL: f64 = 0.8;
/// Share of the lead over guessing above which a score counts as partly level.
const PARTLY_LEVEL: f64 = 0.3;
/// Number of standard deviations above guessing from which permuted labels indicate a leak.
pub(crate) const TOO_WELL: f64 = 3.0;

/// Share of a score that levels explain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LevelShare {
    /// Levels explain most of it.
    Mostly,
    /// Levels explain a part of it.
    Partly,
    /// Levels explain little of it.
    Little,
}

impl Audit {
    /// Returns the share of an accuracy that taxel means explain; `None` without that probe.
    pub(crate) fn level_share(&self, accuracy: f64) -> Option<LevelShare> {
        let share = (self.means? - self.chance) / (accuracy - self.chance).max(1e-9);
        Some(if share > MOSTLY_LEVEL {
            LevelShare::Mostly
        } else if share > PARTLY_LEVEL {
            LevelShare::Partly
        } else {
            LevelShare::Little
        })
    }

    /// Returns the name and accuracy of the probe besides levels that alone is nearly as accurate as `accuracy`; `None` if none is.
    pub(crate) fn telling_probe(&self, accuracy: f64) -> Option<(&'static str, f64)> {
        let probes = [
            ("first frame", self.first_frame),
            ("last frame", self.last_frame),
            ("order of the sweeps in the file", self.recording_order),
            ("length of the sweeps", self.sweep_length),
        ];
        self.nearly_as_accurate(accuracy, probes)
    }

    /// Returns the most accurate of `probes` if it is nearly as accurate as `accuracy`.
    pub(crate) fn nearly_as_accurate<'a>(
        &self,
        accuracy: f64,
        probes: impl IntoIterator<Item = (&'a str, Option<f64>)>,
    ) -> Option<(&'a str, f64)> {
        let known = probes
            .into_iter()
            .filter_map(|(name, of)| Some((name, of?)));
        let best = known.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let share = (best.1 - self.chance) / (accuracy - self.chance).max(1e-9);
        (share > MOSTLY_LEVEL).then_some(best)
    }

    /// Returns the recognition of blocks if sweeps of one block are clearly more alike than those of different blocks.
    pub(crate) fn alike_blocks(&self) -> Option<BlockIdentity> {
        let lead = |of: &BlockIdentity| (of.accuracy - of.guessing) / (1.0 - of.guessing).max(1e-9);
        self.block_identity.filter(|of| lead(of) > PARTLY_LEVEL)
    }

    /// Returns the accuracy that permuted labels are compared with.
    pub(crate) fn guessed(&self) -> f64 {
        self.permuted_chance.unwrap_or(self.chance)
    }

    /// Returns the accuracy with permuted labels if it is so far above chance that test labels seem to leak into
    /// training.
    pub(crate) fn leak(&self) -> Option<f64> {
        let away = |permuted: f64| (permuted - self.guessed()) / self.chance_sigma;
        self.permuted.filter(|permuted| away(*permuted) > TOO_WELL)
    }
}
