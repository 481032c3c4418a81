//! Arguments of `tactnet train`.

use std::path::PathBuf;

use clap::Args;
use tactnet_data::Seed;
use tactnet_pipeline::{CalibrationTarget, LabelOrder, TrainSpec};

use crate::commands::choices::{LevelsChoice, ModelChoice, SplitChoice, TrainDeviceChoice, share};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet train                                        the twin, about a minute and a half\n  \
    tactnet train --recipe thesis --out runs/thesis      TactNet-II as published\n  \
    tactnet train --recipe spectra                       a small network on spectra, in seconds\n  \
    tactnet train --model minirocket                     a baseline on the same fold\n  \
    tactnet train --data sweeps.h5 --fold 3 --seed 7     the fourth of five folds\n  \
    tactnet train --calibrate                            can say that it does not know a material\n  \
    tactnet train --resume runs/thesis                   go on after Ctrl-C or a crash\n  \
    tactnet train --print-recipe fast >my.toml           a copy to change, for --recipe my.toml\n\n\
    Without --fold the file's own `test_flag` decides what is tested, where it has one; else fold 0 of 5 (or of as many as every material has sweeps).")]
pub struct TrainArgs {
    /// A data set (.h5, .npz, .csv, .parquet, a folder of .csv or .npy), or `twin` [default: twin]
    #[arg(long, value_name = "FILE|twin")]
    pub data: Option<String>,
    /// What to train [default: tactnet2]
    #[arg(long, value_enum, ignore_case = true)]
    pub model: Option<ModelChoice>,
    /// How to train it: a built-in recipe (fast, spectra, thesis) or a TOML file [default: fast, or the model's only one]
    #[arg(long, value_name = "NAME|FILE")]
    recipe: Option<String>,
    /// Whether a taxel's mean over the sweep may be used [default: the recipe's]
    #[arg(long, value_enum)]
    levels: Option<LevelsChoice>,
    /// Frames per second, for data that does not say
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// The axes are in their order although there are more taxels than time steps
    #[arg(long)]
    pub axes_are_right: bool,
    /// Only the first N time steps of every sweep
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Deal the labels anew at random first: a sound experiment then scores chance
    #[arg(long)]
    permute_labels: bool,
    /// How to split into training and test sweeps [default: the file's test flag, else k-fold]
    #[arg(long, value_enum)]
    split: Option<SplitChoice>,
    /// Parts of a k-fold split [default: 5, or as many as the material with the fewest sweeps has]
    #[arg(long, value_name = "N")]
    folds: Option<usize>,
    /// Fold to test on, counted from 0 (results call it `fold 1 of 5`) [default: 0]
    #[arg(long, value_name = "K")]
    fold: Option<usize>,
    /// Repeat of the cross-validation, counted from 0; every repeat deals its folds anew
    #[arg(long, alias = "run", value_name = "R", default_value_t = 0)]
    repeat: usize,
    /// Judge by part I of the fold's training sweeps instead of its test sweeps, and train on the other parts: for choosing settings
    #[arg(long, value_name = "I")]
    inner: Option<usize>,
    /// Set a fifth of the training sweeps aside to calibrate: when to say "unknown", and how many materials to name to be sure
    #[arg(long)]
    calibrate: bool,
    /// Share of sweeps of known materials that may be called unknown [default: 0.05]
    #[arg(long, value_name = "SHARE", requires = "calibrate", value_parser = share)]
    false_alarms: Option<f64>,
    /// Share of sweeps whose material is to be in the prediction set [default: 0.9]
    #[arg(long, value_name = "SHARE", requires = "calibrate", value_parser = share)]
    coverage: Option<f64>,
    /// Folder for the run [default: runs/DATA-RECIPE-FOLD-SEED, numbered on if taken]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Decides every random choice: folds, weights, order, dropout
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Train this many epochs instead of the recipe's
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    epochs: Option<usize>,
    /// Note in metrics.jsonl after every epoch of a network how many test sweeps it recognises, and how many adversarial ones made of them; to look at, nothing is chosen by it
    #[arg(long)]
    watch_test: bool,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    pub device: TrainDeviceChoice,
    /// Continue an interrupted run with its own settings; --data says where its data set is now, if it was moved
    #[arg(long, value_name = "DIR", conflicts_with_all = ["model", "recipe", "levels", "rate", "steps", "permute_labels", "inner", "calibrate", "split", "folds", "fold", "repeat", "out", "seed", "epochs", "watch_test", "device"])]
    pub resume: Option<PathBuf>,
    /// Print a recipe that ships with tactnet, to start one's own from, and train nothing
    #[arg(long, value_name = "NAME", exclusive = true)]
    pub print_recipe: Option<String>,
    /// Print result.json instead of a table
    #[arg(long)]
    pub json: bool,
}

impl TrainArgs {
    /// Returns what is asked for, unchecked.
    pub fn spec(&self) -> TrainSpec {
        let usual = TrainSpec::default();
        let target = CalibrationTarget::default();
        let own = self.model.map(|model| model.recipe().to_string());
        TrainSpec {
            data: self.data.clone().unwrap_or(usual.data),
            recipe: self.recipe.clone().or(own).unwrap_or(usual.recipe),
            mean_removal: self.levels.map(Into::into),
            rate_hz: self.rate,
            steps: self.steps,
            label_order: if self.permute_labels {
                LabelOrder::Permuted
            } else {
                LabelOrder::True
            },
            split: self.split.map(Into::into),
            folds: self.folds,
            fold: self.fold,
            repeat: self.repeat,
            inner: self.inner,
            calibration: self.calibrate.then(|| CalibrationTarget {
                false_alarms: self.false_alarms.unwrap_or(target.false_alarms),
                coverage: self.coverage.unwrap_or(target.coverage),
            }),
            watch_test: self.watch_test,
            seed: Seed(self.seed),
            epochs: self.epochs,
            device: self.device.named(),
        }
    }
}
