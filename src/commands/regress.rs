//! `tactnet regress`: measures how well speed and force are recovered from the sweeps alone.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use tactnet_data::format::{Keep, ReadOptions};
use tactnet_data::{DataSource, Dataset, Quantity, Scheme, Seed};
use tactnet_pipeline::{Interval, Recovery, RegressionReport};

use super::array_names::ArrayNames;
use super::choices::{rate, steps};
use crate::output::{self, OutputFormat};
use crate::source;

/// Quantity that is recovered.
#[derive(Clone, Copy, ValueEnum)]
enum TargetChoice {
    /// Speed of the motion
    Speed,
    /// Contact force
    Force,
}

impl From<TargetChoice> for Quantity {
    fn from(choice: TargetChoice) -> Self {
        match choice {
            TargetChoice::Speed => Self::Speed,
            TargetChoice::Force => Self::Force,
        }
    }
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet regress --data sweeps.npz                  an array `speed` or `force` with a number per sweep\n  \
    tactnet regress --data sweeps.csv --target speed   a column `speed [mm/s]`, constant during each sweep\n\n\
    Ridge regression from mean and logarithmic spectrum of every taxel. Whole recording blocks are held out where the data has them, otherwise folds \
    with equal shares of each material. Intervals are percentiles over 1000 resamples of the held-out blocks or sweeps.")]
pub struct RegressArgs {
    /// Data set (.h5, .npz, .mat, .csv, .parquet, a folder of .csv or .npy) with `speed` or `force` per sweep
    #[arg(long, value_name = "FILE")]
    data: String,
    /// Quantity to recover [default: all that the data has]
    #[arg(long, value_enum)]
    target: Option<TargetChoice>,
    /// Sample rate, in Hz; it takes precedence over that of the data
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Number of time steps of each sweep to use, from its start, or `shortest` [default: all]
    #[arg(long, value_name = "N|shortest", value_parser = steps)]
    steps: Option<Keep>,
    #[command(flatten)]
    arrays: ArrayNames,
    /// Seed of the folds and intervals
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// Prints the errors of the predictions.
pub fn run(arguments: &RegressArgs) -> anyhow::Result<ExitCode> {
    let dataset = load(arguments)?;
    source::warn_of_findings(dataset.reading_findings());
    let target = arguments.target.map(Quantity::from);
    let scheme = Scheme::default_for(&dataset);
    let report = RegressionReport::of(&dataset, target, scheme, Seed(arguments.seed))?;
    OutputFormat::from_flag(arguments.json).report(&report, |report| output::print(text(report)))
}

fn load(arguments: &RegressArgs) -> anyhow::Result<Dataset> {
    source::announce(&arguments.data);
    let options = ReadOptions {
        keep: arguments.steps.unwrap_or(Keep::Equal),
        rate_hz: arguments.rate,
        samples: arguments.arrays.samples.clone(),
        labels: arguments.arrays.labels.clone(),
        blocks: arguments.arrays.blocks.clone(),
        ..ReadOptions::default()
    };
    Ok(DataSource::named(&arguments.data).read_with(&options)?)
}

fn text(report: &RegressionReport) -> String {
    let mut text = format!(
        "{}: recovered from the sweeps alone; {}, seed {}",
        report.data, report.split, report.seed.0
    );
    for of in &report.conditions {
        let unit = of.condition.unit.as_deref();
        let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
        let Recovery {
            r2,
            rmse,
            mean_absolute_error,
            ..
        } = of;
        let _ = write!(
            text,
            "\n{}, {} held-out sweeps{}\n  R^2                  {}\n  RMSE                 {}{unit}   (guessing the mean: {:.4}{unit})\n  mean absolute error  {}{unit}   (guessing the mean: {:.4}{unit})",
            of.condition.quantity.name(),
            of.sweeps,
            match of.units == of.sweeps {
                true => String::new(),
                false => format!(" in {} blocks", of.units),
            },
            with_interval(r2),
            with_interval(rmse),
            of.rmse_of_guessing,
            with_interval(mean_absolute_error),
            of.mean_absolute_error_of_guessing,
        );
    }
    text
}

fn with_interval(of: &Interval) -> String {
    format!("{:.4} [{:.4}, {:.4}]", of.value, of.ci95_low, of.ci95_high)
}
