//! Schemes that split a data set, and their numbers of folds.

use super::groups::Groups;
use crate::{DataError, Dataset};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Scheme that splits a data set into training and test sweeps.
///
/// ```
/// use tactnet_data::Scheme;
/// use tactnet_data::twin;
///
/// let dataset = twin::small(2, 10, 100)?;
/// assert_eq!(Scheme::default_for(&dataset).folds(&dataset)?, 5);
/// assert_eq!(Scheme::hold_out().folds(&dataset)?, 1);
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
///
/// As TOML (unknown keys are refused):
///
/// ```toml
/// [split]
/// kind = "stratified-k-fold"   # or "group-k-fold" (folds, repeats), "hold-out" (test_percent, repeats); "test-flag", "leave-block-out", "train-on-all" have no settings
/// folds = 5
/// repeats = 2
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "SchemeConfig", into = "SchemeConfig")]
pub enum Scheme {
    /// Splits every material's sweeps at random into `folds` equal parts, anew in each of `repeats` repeats; fold `k`
    /// tests on part `k`. The published numbers use 5 folds in 2 repeats: of 100 sweeps of a material 80 train and 20
    /// test.
    ///
    /// Sweeps of one recording block fall on both sides, so the result holds for *these* recordings.
    StratifiedKFold {
        /// Number of parts, at least 2.
        folds: usize,
        /// Number of repetitions with another random split, at least 1.
        repeats: usize,
    },
    /// Tests on a random share of every material's sweeps, at least one and never all, drawn anew in each of `repeats`
    /// repeats; one fold. Suitable for data sets with too few sweeps for folds.
    HoldOut {
        /// Share of the test sweeps, 1 to 99 %.
        test_percent: usize,
        /// Number of repetitions with another draw, at least 1.
        repeats: usize,
    },
    /// Uses the split that the author of the data set published; one fold.
    TestFlag,
    /// Tests in fold `k` on the `k`-th recording block of every material, in ascending block number.
    ///
    /// No block has sweeps on both sides. Materials with fewer than `k + 1` blocks only train, so every sweep is tested
    /// exactly once over all folds.
    LeaveBlockOut,
    /// Distributes the recording blocks to `folds` parts, anew in each of `repeats` repeats, so that every material has
    /// about the same share in each; fold `k` tests on part `k`. A block is the sweeps of one number, of any material.
    ///
    /// No block has test sweeps of a material and training sweeps of the same one. Materials in a single block only train.
    GroupKFold {
        /// Number of parts, at least 2.
        folds: usize,
        /// Number of repetitions with another order of equal groups, at least 1.
        repeats: usize,
    },
    /// Trains on all sweeps and tests on none; one fold. Suitable for classifiers that are evaluated on another data set.
    TrainOnAll,
}

/// [`Scheme`] in a file; the empty braces make serde refuse unknown keys for these kinds, too.
#[derive(Clone, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum SchemeConfig {
    StratifiedKFold {
        #[serde(default = "published_folds")]
        folds: usize,
        // The hashes of split manifests cover this name.
        #[serde(rename = "runs", alias = "repeats", default = "published_repeats")]
        repeats: usize,
    },
    HoldOut {
        #[serde(default = "usual_test_percent")]
        test_percent: usize,
        #[serde(default = "published_repeats")]
        repeats: usize,
    },
    GroupKFold {
        #[serde(default = "published_folds")]
        folds: usize,
        #[serde(default = "one_repeat")]
        repeats: usize,
    },
    TestFlag {},
    LeaveBlockOut {},
    TrainOnAll {},
}

fn published_folds() -> usize {
    5
}

fn published_repeats() -> usize {
    2
}

fn one_repeat() -> usize {
    1
}

fn usual_test_percent() -> usize {
    20
}

impl Default for Scheme {
    /// Returns the published scheme: 5 folds in 2 repeats.
    fn default() -> Self {
        Self::StratifiedKFold {
            folds: published_folds(),
            repeats: published_repeats(),
        }
    }
}

impl Scheme {
    /// Returns the author's split if the data set has one, otherwise [`Scheme::cross_validation_for`].
    pub fn default_for(dataset: &Dataset) -> Self {
        if dataset.has_test_flag() {
            Self::TestFlag
        } else {
            Self::cross_validation_for(dataset)
        }
    }

    /// Returns folds of whole blocks if the materials were recorded in several, otherwise [`Scheme::folds_for`].
    ///
    /// TactMat and its twins have random folds, as their published numbers do.
    pub fn cross_validation_for(dataset: &Dataset) -> Self {
        let random = Self::folds_for(dataset);
        if dataset.origin().is_comparable_to_published() {
            return random;
        }
        Self::group_folds_of(dataset).unwrap_or(random)
    }

    /// Returns folds of whole blocks, if each material was recorded in at least two and a fold has training sweeps of all.
    pub fn group_folds_of(dataset: &Dataset) -> Option<Self> {
        if !dataset.has_blocks() {
            return None;
        }
        let scheme = Self::group_folds_for(dataset);
        scheme.folds(dataset).is_ok().then_some(scheme)
    }

    /// Returns the published 5 folds in 2 repeats; fewer folds, at least 2, if a material has fewer sweeps.
    pub fn folds_for(dataset: &Dataset) -> Self {
        let fewest = dataset.sweeps_per_label().into_iter().min().unwrap_or(0);
        Self::StratifiedKFold {
            folds: published_folds().min(fewest).max(2),
            repeats: published_repeats(),
        }
    }

    /// Returns 5 folds of whole blocks in 2 repeats; fewer folds, at least 2, if there are fewer blocks.
    pub fn group_folds_for(dataset: &Dataset) -> Self {
        Self::GroupKFold {
            folds: published_folds().min(Groups::of(dataset).len()).max(2),
            repeats: published_repeats(),
        }
    }

    /// Returns a hold-out of a fifth of every material's sweeps, in 2 repeats.
    pub fn hold_out() -> Self {
        Self::HoldOut {
            test_percent: usual_test_percent(),
            repeats: published_repeats(),
        }
    }

    /// Returns the number of repetitions; 1 for schemes without randomness.
    pub fn repeats(self) -> usize {
        match self {
            Self::StratifiedKFold { repeats, .. }
            | Self::GroupKFold { repeats, .. }
            | Self::HoldOut { repeats, .. } => repeats,
            Self::TestFlag | Self::LeaveBlockOut | Self::TrainOnAll => 1,
        }
    }

    /// Returns the number of folds that `dataset` has in one repeat.
    ///
    /// # Errors
    /// Settings out of range; a data set without the `test_flag` or `blocks` that the scheme needs; a material with a
    /// single block, which would leave no training sweep.
    pub fn folds(self, dataset: &Dataset) -> Result<usize, DataError> {
        match self.checked()? {
            Self::StratifiedKFold { folds, .. } => Ok(folds),
            Self::HoldOut { .. } | Self::TrainOnAll => Ok(1),
            Self::TestFlag if dataset.has_test_flag() => Ok(1),
            Self::TestFlag => Err(self.missing(dataset, "test_flag")),
            Self::GroupKFold { folds, .. } if dataset.has_blocks() => {
                match Groups::of(dataset).len() {
                    0 => Err(DataError::inconsistent(
                        format!("blocks of data set `{}`", dataset.name()),
                        format!("a material in at least 2 blocks to {self}"),
                        "each material in a single block",
                    )),
                    groups if groups < folds => Err(DataError::inconsistent(
                        format!("blocks of data set `{}`", dataset.name()),
                        format!("at least {folds} to {self}"),
                        groups.to_string(),
                    )),
                    _ => Ok(folds),
                }
            }
            Self::LeaveBlockOut if dataset.has_blocks() => {
                let blocks = blocks_of_each_label(dataset);
                if let Some(label) = blocks.iter().position(|blocks| blocks.len() < 2) {
                    return Err(DataError::inconsistent(
                        format!("blocks of `{}`", dataset.labels().name(label)),
                        format!("at least 2 to {self}"),
                        blocks[label].len().to_string(),
                    ));
                }
                Ok(blocks.iter().map(BTreeSet::len).max().unwrap_or(0))
            }
            Self::LeaveBlockOut | Self::GroupKFold { .. } => Err(self.missing(dataset, "blocks")),
        }
    }

    fn checked(self) -> Result<Self, DataError> {
        let refused = |item: &str, expected: &str, found: usize| {
            DataError::inconsistent(format!("`{item}`"), expected, found.to_string())
        };
        match self {
            Self::StratifiedKFold { folds, .. } | Self::GroupKFold { folds, .. } if folds < 2 => {
                Err(refused("folds", "at least 2", folds))
            }
            Self::HoldOut { test_percent, .. } if !(1..=99).contains(&test_percent) => {
                Err(refused("test_percent", "1 to 99", test_percent))
            }
            Self::StratifiedKFold { repeats: 0, .. }
            | Self::GroupKFold { repeats: 0, .. }
            | Self::HoldOut { repeats: 0, .. } => Err(refused("repeats", "at least 1", 0)),
            _ => Ok(self),
        }
    }

    fn missing(self, dataset: &Dataset, item: &str) -> DataError {
        DataError::inconsistent(
            format!("`{item}` of data set `{}`", dataset.name()),
            format!("a value for every sweep, in an array or data set of this name, to {self}"),
            "none",
        )
    }
}

impl std::fmt::Display for Scheme {
    /// Writes the action of the scheme, as a verb phrase.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::StratifiedKFold { folds, .. } => {
                write!(f, "split into {folds} stratified folds")
            }
            Self::HoldOut { test_percent, .. } => {
                write!(f, "hold out {test_percent} % of the sweeps")
            }
            Self::GroupKFold { folds, .. } => {
                write!(f, "split into {folds} folds of whole recording blocks")
            }
            Self::TestFlag => f.write_str("split by the author's test flag"),
            Self::LeaveBlockOut => f.write_str("leave one recording block out"),
            Self::TrainOnAll => f.write_str("train on all sweeps and test on none"),
        }
    }
}

impl TryFrom<SchemeConfig> for Scheme {
    type Error = DataError;

    fn try_from(config: SchemeConfig) -> Result<Self, DataError> {
        match config {
            SchemeConfig::StratifiedKFold { folds, repeats } => {
                Self::StratifiedKFold { folds, repeats }.checked()
            }
            SchemeConfig::GroupKFold { folds, repeats } => {
                Self::GroupKFold { folds, repeats }.checked()
            }
            SchemeConfig::HoldOut {
                test_percent,
                repeats,
            } => Self::HoldOut {
                test_percent,
                repeats,
            }
            .checked(),
            SchemeConfig::TestFlag {} => Ok(Self::TestFlag),
            SchemeConfig::LeaveBlockOut {} => Ok(Self::LeaveBlockOut),
            SchemeConfig::TrainOnAll {} => Ok(Self::TrainOnAll),
        }
    }
}

impl From<Scheme> for SchemeConfig {
    fn from(scheme: Scheme) -> Self {
        match scheme {
            Scheme::StratifiedKFold { folds, repeats } => Self::StratifiedKFold { folds, repeats },
            Scheme::GroupKFold { folds, repeats } => Self::GroupKFold { folds, repeats },
            Scheme::HoldOut {
                test_percent,
                repeats,
            } => Self::HoldOut {
                test_percent,
                repeats,
            },
            Scheme::TestFlag => Self::TestFlag {},
            Scheme::LeaveBlockOut => Self::LeaveBlockOut {},
            Scheme::TrainOnAll => Self::TrainOnAll {},
        }
    }
}

/// Returns the block numbers of every label, `[labels]`; empty sets if the data set has no blocks.
pub(super) fn blocks_of_each_label(dataset: &Dataset) -> Vec<BTreeSet<u32>> {
    let mut blocks = vec![BTreeSet::new(); dataset.labels().len()];
    for record in dataset.records() {
        blocks[record.label].extend(record.block);
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scheme_reads_back_what_it_writes() {
        for scheme in [
            Scheme::StratifiedKFold {
                folds: 3,
                repeats: 4,
            },
            Scheme::GroupKFold {
                folds: 4,
                repeats: 2,
            },
            Scheme::hold_out(),
            Scheme::TestFlag,
            Scheme::LeaveBlockOut,
            Scheme::TrainOnAll,
        ] {
            let json = serde_json::to_string(&scheme).unwrap();
            assert_eq!(
                serde_json::from_str::<Scheme>(&json).unwrap(),
                scheme,
                "{json}"
            );
        }
    }

    #[test]
    fn a_scheme_defaults_to_the_published_one() {
        let scheme: Scheme = serde_json::from_str(r#"{"kind": "stratified-k-fold"}"#).unwrap();
        assert_eq!(
            scheme,
            Scheme::StratifiedKFold {
                folds: 5,
                repeats: 2
            }
        );
        assert_eq!(scheme, Scheme::default());
    }

    #[test]
    fn a_scheme_refuses_stray_keys_and_impossible_settings() {
        for (json, complaint) in [
            (
                r#"{"kind": "stratified-k-fold", "fold": 5}"#,
                "unknown field `fold`",
            ),
            (
                r#"{"kind": "test-flag", "folds": 5}"#,
                "unknown field `folds`",
            ),
            (
                r#"{"kind": "leave-block-out", "repeats": 2}"#,
                "unknown field `repeats`",
            ),
            (r#"{"kind": "bootstrap"}"#, "unknown variant `bootstrap`"),
            (
                r#"{"kind": "stratified-k-fold", "folds": 1}"#,
                "`folds`: expected at least 2, found 1",
            ),
            (
                r#"{"kind": "stratified-k-fold", "repeats": 0}"#,
                "`repeats`: expected at least 1, found 0",
            ),
            (
                r#"{"kind": "hold-out", "test_percent": 100}"#,
                "`test_percent`: expected 1 to 99, found 100",
            ),
        ] {
            let error = serde_json::from_str::<Scheme>(json)
                .unwrap_err()
                .to_string();
            assert!(error.contains(complaint), "{json}: {error}");
        }
    }
}
