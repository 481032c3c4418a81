//! `tactnet predict`: predicts the material of sweeps, labelled or not.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_data::format::Keep;
use tactnet_pipeline::write_whole;

use super::choices::{DeviceChoice, rate, steps_or_all};
use super::classified_text;
use super::run_choice::RunChoice;
use super::run_classifier::RunClassifier;
use crate::output;
use crate::output::OutputFormat;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet predict runs/a --data new.npz                  `X` alone: [n][steps][taxels] or [n][steps][rows][cols]\n  \
    tactnet predict runs/a --data sweep.csv                one sweep: a row per frame, a column per taxel\n  \
    tactnet predict runs/a --data new/ --one-object        a folder of .csv or .npy files, all of the same object\n  \
    tactnet predict runs/a --data new.npz --dead 3,7       taxels 3 and 7 are broken: predict without them\n  \
    tactnet predict runs/a --data new.npz --out found.csv  all probabilities as a table; found.json: as a JSON document\n\n\
    See also: `tactnet same` compares two objects, `tactnet eval` measures the accuracy on labelled sweeps, `tactnet serve` classifies live.")]
pub struct PredictArgs {
    #[command(flatten)]
    run: RunChoice,
    /// Sweeps: .npz, .npy, .mat, .csv, .parquet, a folder of .csv or .npy, or any data set; labels are optional. Files
    /// without rows and columns (tables, `X` [n][steps][taxels]) take the run's arrangement of taxels
    #[arg(long, value_name = "FILE")]
    data: String,
    /// Sample rate, in Hz; takes precedence over that of the data [default: the run's sample rate]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Number of time steps of each sweep to use, from its start, or `all`, which keeps unequal lengths [default: as in training]
    #[arg(long, value_name = "N|all", value_parser = steps_or_all)]
    steps: Option<Keep>,
    /// Treat all sweeps as one object and add a fused prediction
    #[arg(long)]
    one_object: bool,
    /// Number of Monte Carlo dropout samples of a network; 0 disables dropout [default: the recipe's]
    #[arg(long, value_name = "M")]
    mc: Option<u32>,
    /// Dead taxels, counted from 0 row by row: they are masked, as if they read their typical value in training
    #[arg(long, value_name = "TAXEL,…", value_delimiter = ',')]
    dead: Vec<usize>,
    /// Compute device
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// File for the probabilities of all materials: a table (.csv), or the document of --json (.json). The columns
    /// `unknown` and `prediction_set` need a network or committee of `train --calibrate`, the column `named` labelled sweeps
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite that file
    #[arg(long, requires = "out")]
    force: bool,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// Prints the predictions.
pub fn run(arguments: &PredictArgs) -> anyhow::Result<ExitCode> {
    let out = match &arguments.out {
        None => None,
        Some(out) => Some((out, table_format(out)?)),
    };
    if let Some((out, _)) = out {
        output::refuse_to_overwrite(out, arguments.force)?;
    }
    let mut classifier = RunClassifier::open(arguments.run.dir(), arguments.mc, arguments.device)?;
    classifier.mask(&arguments.dead)?;
    let found = classifier.classify(
        &arguments.data,
        arguments.rate,
        arguments.steps,
        arguments.one_object,
    )?;
    if let Some(contradiction) = classified_text::not_one_object(&found) {
        say!("warning: {contradiction}");
    }
    if let Some(hint) = classified_text::hint(&found) {
        say!("hint: {hint}");
    }
    if let Some((out, format)) = out {
        let text = match format {
            OutputFormat::Table => found.to_csv(),
            OutputFormat::Json => serde_json::to_string_pretty(&found)?,
        };
        write_whole(out, text.as_bytes())?;
        say!("probabilities: {}", out.display());
    }
    OutputFormat::from_flag(arguments.json)
        .report(&found, |found| output::print(classified_text::table(found)))
}

/// Returns the format for a file name.
fn table_format(out: &Path) -> anyhow::Result<OutputFormat> {
    match out.extension().and_then(|extension| extension.to_str()) {
        Some("csv") => Ok(OutputFormat::Table),
        Some("json") => Ok(OutputFormat::Json),
        _ => bail!(
            "--out {}: expected a name that ends in .csv or .json",
            out.display()
        ),
    }
}
