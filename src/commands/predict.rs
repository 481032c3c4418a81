//! `tactnet predict`: says of what material sweeps are, where nobody needs to know.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_pipeline::write_whole;

use super::choices::{DeviceChoice, rate};
use super::run_choice::RunChoice;
use super::run_classifier::RunClassifier;
use crate::output;
use crate::output::OutputFormat;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet predict runs/a --data new.npz                  `X` alone: [n][steps][taxels] or [n][steps][rows][cols]\n  \
    tactnet predict runs/a --data sweep.csv                one sweep: a row per frame, a column per taxel\n  \
    tactnet predict runs/a --data new/ --one-object        a folder of .csv or .npy, all over the same object\n  \
    tactnet predict runs/a --data new.npz --out found.csv  every probability, for a spreadsheet; found.json: as --json prints it\n\n\
    `tactnet same` says whether two objects are of one material; `tactnet eval` how often the run is right on sweeps whose materials are named; `tactnet serve` classifies sweeps as they happen.")]
pub struct PredictArgs {
    #[command(flatten)]
    run: RunChoice,
    /// Sweeps: .npz or .npy, .csv, .parquet, a folder of .csv or .npy, or any data set; materials need not be named. Taxels of a file without rows and
    /// columns (tables, `X` [n][steps][taxels]) are arranged as the run's
    #[arg(long, value_name = "FILE")]
    data: String,
    /// Frames per second, for data that does not say [default: what the run was trained on]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Only the first N time steps of every sweep [default: as the run was trained]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    steps: Option<u32>,
    /// All sweeps are over the same object: fuse them, too
    #[arg(long)]
    one_object: bool,
    /// Runs of Monte Carlo dropout, of a network; 0 for none [default: the recipe's]
    #[arg(long, value_name = "M")]
    mc: Option<u32>,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Write the probability of every material: a table (.csv) or what --json prints (.json). In the table, `unknown` and `prediction_set` are
    /// filled for networks of `train --calibrate` alone, `named` where the file names materials
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite that file
    #[arg(long, requires = "out")]
    force: bool,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &PredictArgs) -> anyhow::Result<ExitCode> {
    let out = match &arguments.out {
        None => None,
        Some(out) => Some((out, table_format(out)?)),
    };
    if let Some((out, _)) = out {
        output::refuse_to_overwrite(out, arguments.force)?;
    }
    let classifier = RunClassifier::open(arguments.run.dir(), arguments.mc, arguments.device)?;
    let found = classifier.classify(
        &arguments.data,
        arguments.rate,
        arguments.steps,
        arguments.one_object,
    )?;
    if let Some(contradiction) = found.not_one_object() {
        say!("warning: {contradiction}");
    }
    if let Some(hint) = found.hint() {
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
    if arguments.json {
        output::print_json(&found)?;
    } else {
        output::print(&found)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns how a file of this name is written.
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
