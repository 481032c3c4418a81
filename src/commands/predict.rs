//! `tactnet predict`: says of what material sweeps are, where nobody needs to know.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_models::Compute;
use tactnet_pipeline::{
    ClassifiedSweeps, Classifier, ModelRecipe, PipelineError, PredictionMethod, RunDir, write_whole,
};

use super::choices::{DeviceChoice, rate};
use super::run_choice::RunChoice;
use crate::{output, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet predict runs/a --data new.npz                  `X` alone: [n][steps][taxels] or [n][steps][rows][cols]\n  \
    tactnet predict runs/a --data sweep.csv                one sweep: a row per frame, a column per taxel\n  \
    tactnet predict runs/a --data new/ --one-object        a folder of .csv, all over the same object\n  \
    tactnet predict runs/a --data new.npz --out found.csv  every probability, for a spreadsheet\n\n\
    `tactnet eval` says how often it is right on sweeps whose materials are named; `tactnet serve` classifies sweeps as they happen.")]
pub struct PredictArgs {
    #[command(flatten)]
    run: RunChoice,
    /// Sweeps: .npz or .npy, .csv, .parquet, a folder of .csv, or any data set; materials need not be named
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
    /// Write a table (.csv) with the probability of every material
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &PredictArgs) -> anyhow::Result<ExitCode> {
    let run = RunDir::open(arguments.run.dir())?;
    let config = run.config()?;
    if let (Some(1..), ModelRecipe::Baseline(baseline)) = (arguments.mc, &config.recipe) {
        bail!(
            "--mc: `{}` is a baseline without dropout, and predicts one way only; leave out --mc",
            baseline.name
        );
    }
    let method = match arguments.mc {
        None => config.recipe.method(),
        Some(0) => PredictionMethod::Plain,
        Some(mc) => PredictionMethod::McDropout {
            mc_samples: mc as usize,
        },
    };
    let device = Compute::from(arguments.device).open()?;
    let classifier = Classifier::new(config.classifier.clone(), &run.final_weights()?, &device)?;
    source::announce(&arguments.data);
    let mut spec = config.spec.clone();
    spec.rate_hz = arguments.rate;
    if let Some(steps) = arguments.steps {
        spec.steps = Some(steps as usize);
    }
    let known = &config.classifier;
    let sweeps = spec.read_to_classify(&arguments.data, known.shape, known.sample_rate_hz)?;
    let calibration = match run.calibration()? {
        None => None,
        Some(calibration) => Some((calibration, run.train_embeddings()?)),
    };
    let found = ClassifiedSweeps::of(
        &sweeps,
        &classifier,
        calibration.as_ref().map(|(bounds, known)| (bounds, known)),
        method,
        arguments.one_object,
    )
    .map_err(|error| match error {
        PipelineError::Incompatible {
            item,
            expected,
            found,
        } if item == "sweeps" => PipelineError::Incompatible {
            item: arguments.data.clone(),
            expected,
            found,
        },
        other => other,
    })?;
    if let Some(out) = &arguments.out {
        write_whole(out, found.to_csv().as_bytes())?;
        say!("probabilities: {}", out.display());
    }
    if arguments.json {
        output::print_json(&found)?;
    } else {
        output::print(&found)?;
    }
    Ok(ExitCode::SUCCESS)
}
