//! Arguments of `tactnet train`: every option of a training is declared, converted and printed here.

use std::path::PathBuf;

use clap::Args;
use tactnet_data::Seed;
use tactnet_data::format::Keep;
use tactnet_models::Compute;
use tactnet_pipeline::{CalibrationTarget, LabelOrder, SweepLengths, TrainSpec, quoted};

use crate::commands::array_names::ArrayNames;
use crate::commands::choices::{
    LevelsChoice, ModelChoice, SplitChoice, TrainDeviceChoice, share, steps,
};
use crate::source::Doubts;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet train                                        a committee of six models on the twin, in minutes\n  \
    tactnet train --recipe fast                          its network alone, in about a minute and a half\n  \
    tactnet train --recipe thesis --out runs/thesis      TactNet-II as published\n  \
    tactnet train --recipe spectra                       a small network on spectra, in seconds\n  \
    tactnet train --model minirocket                     a baseline on the same fold\n  \
    tactnet train --data sweeps.h5 --fold 3 --seed 7     the fourth of five folds\n  \
    tactnet train --calibrate                            a network (or committee) that detects unknown materials\n  \
    tactnet train --resume runs/thesis                   continue after Ctrl-C or a crash\n  \
    tactnet train --print-recipe fast >my.toml           a copy to edit, for --recipe my.toml\n\n\
    Without --fold, the file's own `test_flag` selects the test sweeps if it has one; else fold 0 of 5 (or of as many folds as there are sweeps or blocks).")]
pub struct TrainArgs {
    /// Data set (.h5, .npz, .mat, .csv, .parquet, a folder of .csv or .npy), or `twin` [default: twin]
    #[arg(long, value_name = "FILE|twin")]
    pub data: Option<String>,
    /// The axes are in the right order although there are more taxels than time steps
    #[arg(long)]
    axes_are_right: bool,
    /// Refuse data with warnings, such as materials that were recorded in one session each
    #[arg(long, conflicts_with = "resume")]
    strict: bool,
    #[command(flatten)]
    arrays: ArrayNames,
    #[command(flatten)]
    options: TrainOptions,
    /// Continue an interrupted run with its own settings; --data names the current path of its data set, if that was moved
    #[arg(long, value_name = "DIR", conflicts_with = "ArrayNames")]
    pub resume: Option<PathBuf>,
    /// Print a built-in recipe, as a template, and train nothing
    #[arg(long, value_name = "NAME", exclusive = true)]
    pub print_recipe: Option<String>,
    /// Print result.json instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Options of a new run.
#[derive(Args)]
#[group(conflicts_with = "resume")]
struct TrainOptions {
    /// Model to train [default: committee]
    #[arg(long, value_enum, ignore_case = true)]
    model: Option<ModelChoice>,
    /// Built-in recipe (fast, spectra, thesis, robust, distilled) or TOML file [default: committee, or the recipe of --model]
    #[arg(long, value_name = "NAME|FILE")]
    recipe: Option<String>,
    /// Keep or remove each taxel's mean over the sweep [default: the recipe's choice]
    #[arg(long, value_enum)]
    levels: Option<LevelsChoice>,
    /// Frames per second; takes precedence over the sample rate of the data
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Only the first N time steps of every sweep, or as many as the shortest sweep has; `all` keeps sweeps of unequal length
    #[arg(long, value_name = "N|shortest|all", value_parser = steps)]
    steps: Option<Keep>,
    /// Permute the labels at random first, as a control: a sound experiment then scores chance
    #[arg(long)]
    permute_labels: bool,
    /// Split into training and test sweeps [default: the file's test flag, else whole blocks if materials were recorded in several, else k-fold]
    #[arg(long, value_enum)]
    split: Option<SplitChoice>,
    /// Number of folds of a split into folds [default: 5, or as many as the material with the fewest sweeps has]
    #[arg(long, value_name = "N")]
    folds: Option<usize>,
    /// Fold to test on, counted from 0 (results call it `fold 1 of 5`) [default: 0]
    #[arg(long, value_name = "K")]
    fold: Option<usize>,
    /// Repeat of the cross-validation, counted from 0; every repeat has other folds
    #[arg(long, alias = "run", value_name = "R", default_value_t = 0)]
    repeat: usize,
    /// Test on part I of the fold's training sweeps instead of its test sweeps, and train on the other parts: for model selection
    #[arg(long, value_name = "I")]
    inner: Option<usize>,
    /// Train on N sweeps of each material, drawn from the fold's training sweeps
    #[arg(long, value_name = "N")]
    shots: Option<usize>,
    /// Set a fifth of the training sweeps aside for calibration: thresholds for unknown materials and for prediction sets
    #[arg(long)]
    calibrate: bool,
    /// Share of sweeps of known materials that may be called unknown [default: 0.05]
    #[arg(long, value_name = "SHARE", requires = "calibrate", value_parser = share)]
    false_alarms: Option<f64>,
    /// Share of sweeps whose material must be in the prediction set [default: 0.9]
    #[arg(long, value_name = "SHARE", requires = "calibrate", value_parser = share)]
    coverage: Option<f64>,
    /// Folder for the run [default: runs/DATA-RECIPE-FOLD-SEED, with a number appended if it exists]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of every random choice: folds, weights, order, dropout
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of epochs instead of the recipe's
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    epochs: Option<usize>,
    /// Record the accuracy on clean and adversarial test sweeps in metrics.jsonl after every epoch of a network, for inspection only
    #[arg(long)]
    watch_test: bool,
    /// Compute device
    #[arg(long, value_enum, default_value_t)]
    device: TrainDeviceChoice,
}

impl TrainArgs {
    /// Returns true if every sweep keeps as many time steps as the shortest has; [`TrainArgs::spec`] does not contain
    /// their number.
    pub fn keeps_shortest(&self) -> bool {
        self.options.steps == Some(Keep::Shortest)
    }

    /// Returns the settings of the training, not validated.
    pub fn spec(&self) -> TrainSpec {
        let default = TrainSpec::default();
        let options = &self.options;
        let recipe_of_model = options.model.map(|model| model.recipe().to_string());
        let target = CalibrationTarget::default();
        TrainSpec {
            data: self.data.clone().unwrap_or(default.data),
            recipe: options
                .recipe
                .clone()
                .or(recipe_of_model)
                .unwrap_or(default.recipe),
            mean_removal: options.levels.map(Into::into),
            rate_hz: options.rate,
            steps: match options.steps {
                Some(Keep::First(steps)) => Some(steps),
                _ => None,
            },
            lengths: match options.steps {
                Some(Keep::All) => SweepLengths::Own,
                _ => SweepLengths::Equal,
            },
            samples: self.arrays.samples.clone(),
            labels: self.arrays.labels.clone(),
            blocks: self.arrays.blocks.clone(),
            label_order: match options.permute_labels {
                true => LabelOrder::Permuted,
                false => LabelOrder::True,
            },
            split: options.split.map(Into::into),
            folds: options.folds,
            fold: options.fold,
            repeat: options.repeat,
            inner: options.inner,
            shots: options.shots,
            calibration: options.calibrate.then(|| CalibrationTarget {
                false_alarms: options.false_alarms.unwrap_or(target.false_alarms),
                coverage: options.coverage.unwrap_or(target.coverage),
            }),
            watch_test: options.watch_test,
            seed: Seed(options.seed),
            epochs: options.epochs,
            device: options.device.named(),
        }
    }

    /// Returns the doubts about the data that the arguments settle.
    pub fn doubts(&self) -> Doubts {
        Doubts {
            axes_are_right: self.axes_are_right,
            strict: self.strict,
        }
    }

    /// Returns the option that names an array, if one is set.
    pub fn named_array(&self) -> Option<&'static str> {
        self.arrays.first()
    }

    /// Returns the model to train, if it was named.
    pub fn model(&self) -> Option<ModelChoice> {
        self.options.model
    }

    /// Returns the folder for the run, if it was named.
    pub fn out(&self) -> Option<&std::path::Path> {
        self.options.out.as_deref()
    }

    /// Returns true if the fastest device is to be selected.
    pub fn selects_device(&self) -> bool {
        self.options.device == TrainDeviceChoice::Auto
    }
}

/// Returns the command that trains with the settings of `spec`, as a shell reads it.
pub fn command_line(spec: &TrainSpec) -> String {
    let TrainSpec {
        data,
        recipe,
        mean_removal,
        rate_hz,
        steps,
        lengths,
        samples,
        labels,
        blocks,
        label_order,
        split,
        folds,
        fold,
        repeat,
        inner,
        shots,
        calibration,
        watch_test,
        seed,
        epochs,
        device,
    } = spec;
    let mut command = String::from("tactnet train");
    let mut option = |name: &str, value: Option<String>| {
        let Some(value) = value else { return };
        command.push_str(&format!(" --{name}"));
        if !value.is_empty() {
            command.push_str(&format!(" {value}"));
        }
    };
    let text = |number: &Option<usize>| number.map(|number| number.to_string());
    // A flag has an empty value.
    let flag = |is_set: bool| is_set.then(String::new);
    option("data", Some(quoted(data)));
    option("rate", rate_hz.map(|rate| rate.to_string()));
    let own_lengths = (*lengths == SweepLengths::Own).then(|| "all".to_owned());
    option("steps", text(steps).or(own_lengths));
    option("samples", samples.as_deref().map(quoted));
    option("labels", labels.as_deref().map(quoted));
    option("blocks", blocks.as_deref().map(quoted));
    option("permute-labels", flag(*label_order == LabelOrder::Permuted));
    option("recipe", Some(quoted(recipe)));
    option("epochs", text(epochs));
    option("levels", mean_removal.map(|levels| levels.name().into()));
    option("split", split.map(|split| split.name().into()));
    option("folds", text(folds));
    option("repeat", Some(repeat.to_string()));
    option("fold", text(fold));
    option("inner", text(inner));
    option("shots", text(shots));
    option("calibrate", flag(calibration.is_some()));
    option(
        "false-alarms",
        calibration.map(|target| target.false_alarms.to_string()),
    );
    option(
        "coverage",
        calibration.map(|target| target.coverage.to_string()),
    );
    option("watch-test", flag(*watch_test));
    option("seed", Some(seed.0.to_string()));
    let device = match device {
        Compute::Cpu => "cpu",
        Compute::Vulkan => "vulkan",
        Compute::Cuda => "cuda",
    };
    option("device", Some(device.into()));
    command
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use tactnet_pipeline::{MeanRemoval, SplitKind};

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        train: TrainArgs,
    }

    fn everything() -> TrainSpec {
        TrainSpec {
            data: "somewhere/wood,cork.h5".into(),
            recipe: "own.toml".into(),
            mean_removal: Some(MeanRemoval::PerSweep),
            rate_hz: Some(100.0),
            steps: Some(250),
            lengths: SweepLengths::Equal,
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
    fn a_printed_command_parses_to_the_same_settings() {
        assert_eq!(
            command_line(&TrainSpec::default()),
            "tactnet train --data twin --recipe committee --repeat 0 --seed 1 --device cpu"
        );
        let spaced = TrainSpec {
            data: "some where/wood, cork.h5".into(),
            ..everything()
        };
        assert_eq!(
            command_line(&spaced),
            "tactnet train --data 'some where/wood, cork.h5' --rate 100 --steps 250 --samples recorded/skin --labels recorded/material --blocks session --permute-labels --recipe own.toml --epochs 4 \
             --levels removed --split leave-block-out --folds 4 --repeat 1 --fold 3 --inner 2 --shots 5 --calibrate --false-alarms 0.05 --coverage 0.9 \
             --watch-test --seed 7 --device cuda"
        );
        let unequal = TrainSpec {
            lengths: SweepLengths::Own,
            ..TrainSpec::default()
        };
        for spec in [TrainSpec::default(), everything(), unequal] {
            let command = command_line(&spec);
            let words = command.split(' ').skip(1);
            assert_eq!(Command::try_parse_from(words).unwrap().train.spec(), spec);
        }
    }

    #[test]
    fn settings_of_a_resumed_run_cannot_be_changed() {
        for other in [
            ["--epochs", "3"],
            ["--seed", "2"],
            ["--out", "new"],
            ["--labels", "y"],
        ] {
            let words = ["train", "--resume", "run"].into_iter().chain(other);
            assert!(Command::try_parse_from(words).is_err(), "{other:?}");
        }
        let moved = ["train", "--resume", "run", "--data", "moved.h5"];
        assert!(Command::try_parse_from(moved).is_ok());
    }
}
