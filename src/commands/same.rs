//! `tactnet same`: are two objects of one material?

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Args;
use tactnet_pipeline::SameMaterial;

use super::choices::{DeviceChoice, rate};
use super::run_classifier::RunClassifier;
use crate::output;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet same runs/a cup.npz plate.npz        each file has one or more sweeps of one object\n  \
    tactnet same runs/a cup.csv plates/ --json   a file of one sweep, a folder of them\n\n\
    Bayes's rule on the posteriors of both objects, where same and different are equally likely beforehand. It holds for materials that the run \
    has learnt; after `train --calibrate` it says where one is most likely unknown. Sweeps are taken for independent: more of them make it surer.\n\
    How often it is right: `tactnet experiment run differentiate`.")]
pub struct SameArgs {
    /// A run directory
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Sweeps of one object: .npz or .npy, .csv, .parquet, a folder of .csv, or any data set
    #[arg(value_name = "FIRST")]
    first: String,
    /// Sweeps of the other
    #[arg(value_name = "SECOND")]
    second: String,
    /// Frames per second, for data that does not say [default: what the run was trained on]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Runs of Monte Carlo dropout, of a network; 0 for none [default: the recipe's]
    #[arg(long, value_name = "M")]
    mc: Option<u32>,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Print one JSON document instead of lines
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &SameArgs) -> anyhow::Result<ExitCode> {
    let classifier = RunClassifier::open(&arguments.run, arguments.mc, arguments.device)?;
    let classify = |data: &str| classifier.classify(data, arguments.rate, None, true);
    let both = [classify(&arguments.first)?, classify(&arguments.second)?];
    let same = SameMaterial::of(both).context("both were classified as one object")?;
    if arguments.json {
        output::print_json(&same)?;
    } else {
        output::print(&same)?;
    }
    Ok(ExitCode::SUCCESS)
}
