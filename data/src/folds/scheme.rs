//! The ways to split a data set, and how many folds each of them has.

use crate::{DataError, Dataset};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// How a data set is split into training and test sweeps.
///
/// As TOML (unknown keys are refused):
///
/// ```toml
/// [split]
/// kind = "stratified-k-fold"   # or "hold-out" (test_percent, repeats); "test-flag", "leave-block-out", "train-on-all" have no settings
/// folds = 5
/// repeats = 2
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "SchemeConfig", into = "SchemeConfig")]
pub enum Scheme {
    /// Every material's sweeps are dealt at random into `folds` equal parts, afresh in each of
    /// `repeats` repeats; fold `k` tests on part `k`. The published numbers use 5 folds in 2 repeats: of 100
    /// sweeps of a material 80 train and 20 test.
    ///
    /// Sweeps of one recording block fall on both sides, so this measures how well *these*
    /// recordings are told apart.
    StratifiedKFold {
        /// Parts, at least 2.
        folds: usize,
        /// Repetitions with another random deal, at least 1.
        repeats: usize,
    },
    /// A random share of every material's sweeps is tested on, at least one and never all, drawn afresh in each of `repeats` repeats; one
    /// fold. For data sets with too few sweeps for folds.
    HoldOut {
        /// Share of the sweeps, 1 to 99.
        test_percent: usize,
        /// Repetitions with another draw, at least 1.
        repeats: usize,
    },
    /// The split that the author of the data set published; one fold.
    TestFlag,
    /// Fold `k` tests on the `k`-th recording block of every material, in ascending block number.
    ///
    /// No block has sweeps on both sides. Of materials with fewer than `k + 1` blocks every sweep
    /// trains, so that over all folds each sweep is tested exactly once.
    LeaveBlockOut,
    /// Every sweep trains and none tests; one fold. For a classifier that is judged elsewhere, by sweeps that are not in this data set.
    TrainOnAll,
}

/// [`Scheme`] as written; the empty braces make serde refuse stray keys for these kinds too.
#[derive(Clone, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum SchemeConfig {
    StratifiedKFold {
        #[serde(default = "published_folds")]
        folds: usize,
        // The name that the hashes of split manifests cover.
        #[serde(rename = "runs", alias = "repeats", default = "published_repeats")]
        repeats: usize,
    },
    HoldOut {
        #[serde(default = "usual_test_percent")]
        test_percent: usize,
        #[serde(default = "published_repeats")]
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

fn usual_test_percent() -> usize {
    20
}

impl Default for Scheme {
    /// The published one: 5 folds in 2 repeats.
    fn default() -> Self {
        Self::StratifiedKFold {
            folds: published_folds(),
            repeats: published_repeats(),
        }
    }
}

impl Scheme {
    /// The author's own split where the data set has one, else [`Scheme::folds_for`].
    pub fn default_for(dataset: &Dataset) -> Self {
        if dataset.has_test_flag() {
            Self::TestFlag
        } else {
            Self::folds_for(dataset)
        }
    }

    /// The published 5 folds in 2 repeats; where a material has fewer sweeps, as many folds as it has, at least 2.
    pub fn folds_for(dataset: &Dataset) -> Self {
        let fewest = dataset.sweeps_per_label().into_iter().min().unwrap_or(0);
        Self::StratifiedKFold {
            folds: published_folds().min(fewest).max(2),
            repeats: published_repeats(),
        }
    }

    /// A fifth of every material's sweeps, in 2 repeats.
    pub fn hold_out() -> Self {
        Self::HoldOut {
            test_percent: usual_test_percent(),
            repeats: published_repeats(),
        }
    }

    /// How often the whole data set is split anew; 1 where nothing is random.
    pub fn repeats(self) -> usize {
        match self {
            Self::StratifiedKFold { repeats, .. } | Self::HoldOut { repeats, .. } => repeats,
            Self::TestFlag | Self::LeaveBlockOut | Self::TrainOnAll => 1,
        }
    }

    /// Number of folds that `dataset` has in one repeat.
    ///
    /// # Errors
    /// Settings out of range; no `test_flag` or `blocks` in the data set where the scheme needs
    /// them; a material with fewer than two blocks (leaving one out would leave nothing to learn
    /// from).
    pub fn folds(self, dataset: &Dataset) -> Result<usize, DataError> {
        match self.checked()? {
            Self::StratifiedKFold { folds, .. } => Ok(folds),
            Self::HoldOut { .. } | Self::TrainOnAll => Ok(1),
            Self::TestFlag if dataset.has_test_flag() => Ok(1),
            Self::TestFlag => Err(self.missing(dataset, "test_flag")),
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
            Self::LeaveBlockOut => Err(self.missing(dataset, "blocks")),
        }
    }

    fn checked(self) -> Result<Self, DataError> {
        let refused = |item: &str, expected: &str, found: usize| {
            DataError::inconsistent(format!("`{item}`"), expected, found.to_string())
        };
        match self {
            Self::StratifiedKFold { folds, .. } if folds < 2 => {
                Err(refused("folds", "at least 2", folds))
            }
            Self::HoldOut { test_percent, .. } if !(1..=99).contains(&test_percent) => {
                Err(refused("test_percent", "1 to 99", test_percent))
            }
            Self::StratifiedKFold { repeats: 0, .. } | Self::HoldOut { repeats: 0, .. } => {
                Err(refused("repeats", "at least 1", 0))
            }
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
    /// Returns what the scheme does, as a verb phrase.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::StratifiedKFold { folds, .. } => {
                write!(f, "split into {folds} stratified folds")
            }
            Self::HoldOut { test_percent, .. } => {
                write!(f, "hold out {test_percent} % of the sweeps")
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

/// The block numbers of every label: `[labels]`; none where the data set knows no blocks.
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
