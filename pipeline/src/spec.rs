//! Settings of one training, shared by the command line, the plans of experiments and child processes.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tactnet_data::format::Keep;
use tactnet_data::{DataError, Dataset, Fold, Scheme, Seed};
use tactnet_models::Compute;

use crate::{CalibrationTarget, Device, LabelOrder, MeanRemoval, ModelRecipe, PipelineError};

/// Settings of one training, not yet validated.
///
/// As JSON or TOML every field may be absent and then has the value of [`TrainSpec::default`]. Converting the settings into a [`TrainJob`]
/// validates them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainSpec {
    /// Path of the data set, or `twin`.
    pub data: String,
    /// Name of a built-in recipe, or path of a recipe file.
    pub recipe: String,
    /// Removal of each taxel's mean over a sweep; absent: the recipe's.
    #[serde(rename = "levels", skip_serializing_if = "Option::is_none")]
    pub mean_removal: Option<MeanRemoval>,
    /// Sample rate in frames per second, for data that does not name it; absent: the data's own rate, or an assumed one.
    #[serde(rename = "rate", skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Number of time steps kept from the beginning of every sweep; absent: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Lengths of the sweeps if all steps are kept.
    #[serde(skip_serializing_if = "is_default")]
    pub lengths: SweepLengths,
    /// Name or path of the samples in a file that holds several arrays; absent: the usual names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<String>,
    /// Name or path of the materials of the sweeps in a file that holds several arrays; absent: the usual names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub labels: Option<String>,
    /// Name of the column or array with the block of each sweep; absent: the usual names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blocks: Option<String>,
    /// Order of the labels: as in the data set, or permuted at random.
    #[serde(skip_serializing_if = "is_default")]
    pub label_order: LabelOrder,
    /// Split into training and test sweeps; absent: the data set's own test sweeps unless a fold is set, else folds of whole
    /// blocks if its materials were recorded in several, else k-fold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<SplitKind>,
    /// Number of folds of a k-fold split; absent: 5, or the sweep count of the smallest material if that is fewer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub folds: Option<usize>,
    /// Index of the fold that is tested on, from 0; absent: 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fold: Option<usize>,
    /// Index of the repeat of the cross-validation, from 0.
    #[serde(skip_serializing_if = "is_default")]
    pub repeat: usize,
    /// Index of the part of the training sweeps that replaces the test sweeps, from 0; absent: the test sweeps are used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inner: Option<usize>,
    /// Number of training sweeps of each material, drawn from the fold's; absent: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shots: Option<usize>,
    /// Rates for which a fifth of the training sweeps is set aside to calibrate; absent: no calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationTarget>,
    /// True if the test accuracy is recorded after every epoch of a network. Nothing is chosen by it.
    #[serde(skip_serializing_if = "is_default")]
    pub watch_test: bool,
    /// Seed of every random choice.
    pub seed: Seed,
    /// Passes over the training sweeps; absent: the recipe's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub epochs: Option<usize>,
    /// Compute device.
    #[serde(skip_serializing_if = "is_default")]
    pub device: Compute,
}

impl Default for TrainSpec {
    /// Returns the settings for the committee on the twin with seed 1.
    fn default() -> Self {
        Self {
            data: "twin".into(),
            recipe: "committee".into(),
            mean_removal: None,
            rate_hz: None,
            steps: None,
            lengths: SweepLengths::default(),
            samples: None,
            labels: None,
            blocks: None,
            label_order: LabelOrder::default(),
            split: None,
            folds: None,
            fold: None,
            repeat: 0,
            inner: None,
            shots: None,
            calibration: None,
            watch_test: false,
            seed: Seed(1),
            epochs: None,
            device: Compute::default(),
        }
    }
}

/// Lengths of the sweeps of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SweepLengths {
    /// All sweeps have one length, unless the file states the length of each.
    #[default]
    Equal,
    /// Every sweep has its own length.
    Own,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Named ways to split a data set: each is a [`Scheme`] with the published number of folds and repeats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SplitKind {
    /// Stratified k-fold cross-validation.
    #[default]
    KFold,
    /// A fifth of every material's sweeps is tested on, drawn at random.
    HoldOut,
    /// The test sweeps that the data set names.
    TestFlag,
    /// Fold k tests on the k-th recording block.
    LeaveBlockOut,
    /// Whole recording blocks are held out, in folds with about equal shares of every material.
    GroupKFold,
    /// All sweeps are trained on.
    TrainOnAll,
}

impl SplitKind {
    /// Returns the name used in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::KFold => "k-fold",
            Self::HoldOut => "hold-out",
            Self::TestFlag => "test-flag",
            Self::LeaveBlockOut => "leave-block-out",
            Self::GroupKFold => "group-k-fold",
            Self::TrainOnAll => "train-on-all",
        }
    }

    /// Returns the scheme for `dataset`.
    fn scheme(self, dataset: &Dataset) -> Scheme {
        match self {
            Self::KFold => Scheme::folds_for(dataset),
            Self::HoldOut => Scheme::hold_out(),
            Self::TestFlag => Scheme::TestFlag,
            Self::LeaveBlockOut => Scheme::LeaveBlockOut,
            Self::GroupKFold => Scheme::group_folds_for(dataset),
            Self::TrainOnAll => Scheme::TrainOnAll,
        }
    }

    /// Returns true if no recording block has sweeps on both sides.
    pub fn holds_out_blocks(self) -> bool {
        matches!(self, Self::LeaveBlockOut | Self::GroupKFold)
    }

    /// Returns the kind of `scheme`, ignoring its numbers of folds and repeats.
    pub fn of(scheme: Scheme) -> Self {
        match scheme {
            Scheme::StratifiedKFold { .. } => Self::KFold,
            Scheme::HoldOut { .. } => Self::HoldOut,
            Scheme::TestFlag => Self::TestFlag,
            Scheme::LeaveBlockOut => Self::LeaveBlockOut,
            Scheme::GroupKFold { .. } => Self::GroupKFold,
            Scheme::TrainOnAll => Self::TrainOnAll,
        }
    }
}

impl TrainSpec {
    /// Returns the frames of every sweep that are read.
    pub fn keep(&self) -> Keep {
        match (self.steps, self.lengths) {
            (Some(steps), _) => Keep::First(steps),
            (None, SweepLengths::Equal) => Keep::Equal,
            (None, SweepLengths::Own) => Keep::All,
        }
    }

    /// Sets the frames of every sweep that are read.
    pub fn set_keep(&mut self, keep: Keep) {
        (self.steps, self.lengths) = match keep {
            Keep::First(steps) => (Some(steps), SweepLengths::Equal),
            Keep::All => (None, SweepLengths::Own),
            Keep::Equal | Keep::Shortest | Keep::Most => (None, SweepLengths::Equal),
        };
    }

    /// Returns the lengths with which other data is read for a classifier trained on `dataset`.
    pub fn lengths_in(&self, dataset: &Dataset) -> SweepLengths {
        match dataset.lengths() {
            Some(_) => SweepLengths::Own,
            None => self.lengths,
        }
    }

    /// Returns the fold of the training: that of its number, or a part of its training sweeps, with all training sweeps or a few of each material.
    ///
    /// # Errors
    /// A fold that does not exist; too few sweeps.
    pub fn fold_of<'a>(&self, dataset: &'a Dataset) -> Result<Fold<'a>, DataError> {
        let (scheme, number) = (self.scheme(dataset), self.fold.unwrap_or(0));
        let fold = Fold::new(dataset, scheme, self.seed, self.repeat, number)?;
        let fold = match self.inner {
            None => fold,
            Some(part) => fold.nested(part)?,
        };
        match self.shots {
            None => Ok(fold),
            Some(shots) => fold.shots(shots),
        }
    }

    /// Returns the scheme that splits `dataset`.
    pub fn scheme(&self, dataset: &Dataset) -> Scheme {
        let scheme = match (self.split, self.fold, self.folds) {
            (Some(split), _, _) => split.scheme(dataset),
            (None, None, None) => Scheme::default_for(dataset),
            (None, _, _) => match Scheme::default_for(dataset) {
                groups @ Scheme::GroupKFold { .. } => groups,
                _ => Scheme::folds_for(dataset),
            },
        };
        match (scheme, self.folds) {
            (Scheme::StratifiedKFold { repeats, .. }, Some(folds)) => {
                Scheme::StratifiedKFold { folds, repeats }
            }
            (Scheme::GroupKFold { repeats, .. }, Some(folds)) => {
                Scheme::GroupKFold { folds, repeats }
            }
            (scheme, _) => scheme,
        }
    }

    /// Returns a copy whose paths of data set and recipe are reduced to file names, for published results.
    pub fn without_folders(mut self) -> Self {
        for path in [&mut self.data, &mut self.recipe] {
            if let Some(name) = Path::new(path.as_str()).file_name() {
                *path = name.to_string_lossy().into_owned();
            }
        }
        self
    }
}

/// Returns `word` quoted for a POSIX shell: in single quotes unless it consists of letters, digits and `-_./:,+@=`.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:,+@=".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_string()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// Validated settings of one training, with the recipe loaded and the device open. The recipe includes the settings' `levels` and `epochs`.
#[derive(Debug, Clone)]
pub struct TrainJob {
    spec: TrainSpec,
    recipe: ModelRecipe,
    device: Device,
}

impl TrainJob {
    /// Returns the settings from which the job was made.
    pub fn spec(&self) -> &TrainSpec {
        &self.spec
    }

    /// Returns the recipe of the classifier.
    pub fn recipe(&self) -> &ModelRecipe {
        &self.recipe
    }

    /// Returns the open device, without autodiff.
    pub fn device(&self) -> &Device {
        &self.device
    }
}

impl TryFrom<TrainSpec> for TrainJob {
    type Error = PipelineError;

    /// # Errors
    /// An unknown or invalid recipe; epochs or a calibration for a baseline; a number out of range; a device that this build lacks.
    fn try_from(spec: TrainSpec) -> Result<Self, PipelineError> {
        let mut recipe = ModelRecipe::load(&spec.recipe)?;
        if let Some(levels) = spec.mean_removal {
            recipe = recipe.with_levels(levels);
        }
        spec.validate(&recipe)?;
        if let Some(epochs) = spec.epochs {
            recipe = recipe.with_epochs(epochs);
        }
        let device = spec.device.open()?;
        Ok(Self {
            spec,
            recipe,
            device,
        })
    }
}

impl TrainSpec {
    fn validate(&self, recipe: &ModelRecipe) -> Result<(), PipelineError> {
        let refused = |setting: &'static str, expected: &str, found: String| {
            Err(PipelineError::Spec {
                setting,
                expected: expected.into(),
                found,
            })
        };
        if self.epochs == Some(0) {
            return refused("epochs", "at least 1", "0".into());
        }
        if !matches!(recipe, ModelRecipe::Network(_)) {
            let is_baseline = matches!(recipe, ModelRecipe::Baseline(_));
            let either = "the recipe of a network or committee";
            let only = [
                ("epochs", is_baseline && self.epochs.is_some(), either),
                ("watch-test", self.watch_test, "the recipe of a network"),
                (
                    "calibrate",
                    is_baseline && self.calibration.is_some(),
                    either,
                ),
            ];
            if let Some((setting, _, expected)) = only.into_iter().find(|(_, is_set, _)| *is_set) {
                let kind = if is_baseline { "baseline" } else { "committee" };
                let found = format!("the {kind} `{}`", recipe.name());
                return refused(setting, expected, found);
            }
        }
        if let Some(rate) = self.rate_hz
            && !(rate.is_finite() && rate > 0.0)
        {
            return refused("rate", "a positive number of Hz", rate.to_string());
        }
        if let Some(folds @ ..2) = self.folds {
            return refused("folds", "at least 2", folds.to_string());
        }
        if let (Some(_), Some(split)) = (self.folds, self.split)
            && !matches!(split, SplitKind::KFold | SplitKind::GroupKFold)
        {
            let found = format!("the split `{}`", split.name());
            return refused("folds", "a split `k-fold` or `group-k-fold`", found);
        }
        if self.split == Some(SplitKind::TrainOnAll) {
            let found = "all sweeps to train on".into();
            return refused("split", "a split with test sweeps", found);
        }
        for (setting, count) in [("steps", self.steps), ("shots", self.shots)] {
            if count == Some(0) {
                return refused(setting, "at least 1", "0".into());
            }
        }
        if let Some(target) = self.calibration {
            let shares = [
                ("false-alarms", target.false_alarms),
                ("coverage", target.coverage),
            ];
            let invalid = |(_, share): &(&str, f64)| !(*share > 0.0 && *share < 1.0);
            if let Some((setting, share)) = shares.into_iter().find(invalid) {
                return refused(setting, "a number between 0 and 1", share.to_string());
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn everything() -> TrainSpec {
        TrainSpec {
            data: "some where/wood, cork.h5".into(),
            recipe: "own.toml".into(),
            mean_removal: Some(MeanRemoval::PerSweep),
            rate_hz: Some(100.0),
            steps: Some(250),
            lengths: SweepLengths::Own,
            samples: Some("recorded/skin".into()),
            labels: Some("recorded/material".into()),
            blocks: Some("session".into()),
            label_order: LabelOrder::Permuted,
            split: Some(SplitKind::LeaveBlockOut),
            folds: Some(4),
            fold: Some(3),
            repeat: 1,
            inner: Some(2),
            shots: Some(5),
            calibration: Some(CalibrationTarget::default()),
            watch_test: true,
            seed: Seed(7),
            epochs: Some(4),
            device: Compute::Cuda,
        }
    }

    #[test]
    fn published_specs_name_files_without_folders() {
        assert_eq!(everything().without_folders().data, "wood, cork.h5");
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }

    #[test]
    fn json_is_short_and_comes_back() {
        let text = serde_json::to_string(&TrainSpec::default()).unwrap();
        assert_eq!(text, r#"{"data":"twin","recipe":"committee","seed":1}"#);
        for spec in [TrainSpec::default(), everything()] {
            let text = serde_json::to_string(&spec).unwrap();
            assert_eq!(serde_json::from_str::<TrainSpec>(&text).unwrap(), spec);
        }
        let given: TrainSpec =
            serde_json::from_str(r#"{"split": "test-flag", "levels": "removed"}"#).unwrap();
        assert_eq!(given.split, Some(SplitKind::TestFlag));
        assert_eq!(given.mean_removal, Some(MeanRemoval::PerSweep));
        assert!(serde_json::from_str::<TrainSpec>(r#"{"epoch": 3}"#).is_err());
    }

    #[test]
    fn a_job_has_the_settings_of_its_spec() {
        let job = TrainJob::try_from(TrainSpec {
            recipe: "fast".into(),
            epochs: Some(3),
            mean_removal: Some(MeanRemoval::PerSweep),
            ..TrainSpec::default()
        })
        .unwrap();
        let ModelRecipe::Network(recipe) = job.recipe() else {
            panic!("`fast` is a network");
        };
        assert_eq!(recipe.training.epochs, 3);
        assert_eq!(recipe.input.levels, MeanRemoval::PerSweep);
    }

    #[test]
    fn invalid_settings_are_refused_by_name() {
        let usual = TrainSpec::default;
        let share = |false_alarms| CalibrationTarget {
            false_alarms,
            ..CalibrationTarget::default()
        };
        let baseline = || TrainSpec {
            recipe: "svm-h".into(),
            ..usual()
        };
        for (spec, named) in [
            (
                TrainSpec {
                    recipe: "fats".into(),
                    ..usual()
                },
                "fats",
            ),
            (
                TrainSpec {
                    epochs: Some(0),
                    ..usual()
                },
                "`epochs`",
            ),
            (
                TrainSpec {
                    epochs: Some(2),
                    ..baseline()
                },
                "svm-h",
            ),
            (
                TrainSpec {
                    steps: Some(0),
                    ..usual()
                },
                "`steps`",
            ),
            (
                TrainSpec {
                    shots: Some(0),
                    ..usual()
                },
                "`shots`",
            ),
            (
                TrainSpec {
                    calibration: Some(share(0.1)),
                    ..baseline()
                },
                "`calibrate`",
            ),
            (
                TrainSpec {
                    calibration: Some(share(1.0)),
                    ..usual()
                },
                "`false-alarms`",
            ),
        ] {
            let refused = TrainJob::try_from(spec).unwrap_err().to_string();
            assert!(refused.contains(named), "{refused}");
        }
    }
}
