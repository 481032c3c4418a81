//! `tactnet eval`: judges a trained classifier again, on its own test sweeps or on another data set.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;
use tactnet_data::SweepView;
use tactnet_pipeline::{Classifier, Evaluation, PredictionMethod, RunDir};

use crate::train::DeviceChoice;
use crate::{report, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet eval runs/twin-quick-1                       its own test sweeps\n  \
    tactnet eval runs/twin-quick-1 --sweeps 5 --mc 500   five sweeps fused, 500 Monte Carlo runs\n  \
    tactnet eval runs/a --data other.h5                  every sweep of another data set")]
pub struct EvalArgs {
    /// A run directory
    #[arg(value_name = "DIR")]
    run: PathBuf,
    /// Another data set: all of its sweeps are tested [default: the run's own test sweeps]
    #[arg(long, value_name = "FILE|twin")]
    data: Option<String>,
    /// Sweeps of one material that are fused into one decision
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    sweeps: u32,
    /// Runs of Monte Carlo dropout
    #[arg(long, value_name = "M", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    mc: u32,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct EvalResult {
    schema_version: u32,
    run: String,
    data: String,
    data_sha256: String,
    /// `test split of the run` or `every sweep`
    tested: &'static str,
    n_test: usize,
    evaluations: BTreeMap<String, Evaluation>,
}

/// Runs the command.
pub fn run(arguments: EvalArgs) -> anyhow::Result<ExitCode> {
    let run = RunDir::open(&arguments.run)?;
    let config = run.config()?;
    let device = arguments.device.compute().open()?;
    let weights = run.weights()?;
    let classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    let dataset = source::load(arguments.data.as_deref().unwrap_or(&config.data))?;
    let own = dataset.sha256() == config.data_sha256;
    let view = if own {
        SweepView::clone(&run.split()?.fold(&dataset)?.test)
    } else {
        SweepView::all(&dataset)
    };
    let mut evaluations = BTreeMap::new();
    for (name, method) in [
        ("plain", PredictionMethod::Plain),
        (
            "mc_dropout",
            PredictionMethod::McDropout {
                runs: arguments.mc as usize,
            },
        ),
    ] {
        let predictions = classifier.predict(&view, method)?;
        let evaluation = Evaluation::of(&predictions, arguments.sweeps as usize, config.seed);
        evaluations.insert(name.to_string(), evaluation);
    }
    let result = EvalResult {
        schema_version: 1,
        run: arguments.run.display().to_string(),
        data: dataset.name().into(),
        data_sha256: dataset.sha256().into(),
        tested: if own {
            "test split of the run"
        } else {
            "every sweep"
        },
        n_test: view.len(),
        evaluations,
    };
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&result)?);
    } else {
        println!(
            "{}: {} ({} sweeps)",
            result.data, result.tested, result.n_test
        );
        report::print_evaluations(&result.evaluations);
    }
    Ok(ExitCode::SUCCESS)
}
