//! `tactnet eval`: evaluates a trained classifier again, on its own test sweeps or on another data set.

use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_models::Compute;
use tactnet_pipeline::{
    Classifier, ModelRecipe, Reevaluation, RunDir, RuntimeKind, TestSweeps, quoted,
};

use super::choices::{DeviceChoice, RuntimeChoice, rate};
use super::run_choice::RunChoice;
use crate::{GIT, output, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet eval runs/twin-fast-fold0-1                       its own test sweeps\n  \
    tactnet eval runs/twin-fast-fold0-1 --sweeps 5 --mc 500   five sweeps fused, 500 Monte Carlo runs\n  \
    tactnet eval runs/a --data other.h5                  every sweep of another data set\n  \
    tactnet eval runs/a --runtime online                  frame by frame, as `tactnet serve` does")]
pub struct EvalArgs {
    #[command(flatten)]
    run: RunChoice,
    /// Another data set: all of its sweeps are tested, but for training and enrolled sweeps; after `train --calibrate` it may hold
    /// unknown materials. Or where the run's own data set is now, if it was moved [default: the run's own test sweeps]
    #[arg(long, value_name = "FILE|twin")]
    data: Option<String>,
    /// Frames per second, for data that does not say [default: what the run was given]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Only the first N time steps of every sweep [default: as the run was trained]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    steps: Option<u32>,
    /// Sweeps of one material that are fused into one decision
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    sweeps: u32,
    /// Runs of Monte Carlo dropout, of a network; 0 for none [default: the recipe's, or 100]
    #[arg(long, value_name = "M")]
    mc: Option<u32>,
    /// What computes the scores; others than Burn are compared with it
    #[arg(long, value_enum)]
    runtime: Option<RuntimeChoice>,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &EvalArgs) -> anyhow::Result<ExitCode> {
    let run = RunDir::open(arguments.run.dir())?;
    let config = run.config()?;
    if let (Some(1..), ModelRecipe::Baseline(baseline)) = (arguments.mc, &config.recipe) {
        bail!(
            "--mc: `{}` is a baseline without dropout, and predicts one way only; leave out --mc",
            baseline.name
        );
    }
    let device = Compute::from(arguments.device).open()?;
    let weights = run.weights()?;
    if !run.has_final_weights() {
        say!("this run has not ended: judging the weights of its last checkpoint");
    }
    let classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    let mut spec = config.spec.clone();
    spec.rate_hz = arguments.rate.or(spec.rate_hz);
    if let Some(steps) = arguments.steps {
        spec.steps = Some(steps as usize);
    }
    let data = arguments.data.as_deref().unwrap_or(&spec.data);
    source::announce(data);
    let in_file = |error| source::in_file(data, arguments.rate, error);
    let shape = config.classifier.shape;
    let (dataset, arranged) = spec
        .read_sweeps_to_judge(arguments.data.as_deref(), shape)
        .map_err(in_file)?;
    if arranged {
        source::note_arranged(shape);
    }
    let tested = TestSweeps::of_run(&run, &dataset)?;
    if !tested.training_sweeps_known {
        say!("{}: {}", dataset.name(), tested.description);
    }
    let enrolled = run.enrolled()?;
    if arguments.data.is_none() && !enrolled.is_empty() {
        let names: Vec<String> = enrolled
            .iter()
            .map(|of| format!("`{}`", of.material))
            .collect();
        say!(
            "note: {} {} enrolled, and none of the run's test sweeps is of it; `tactnet eval {} --data FILE` judges it by further sweeps",
            names.join(", "),
            if names.len() == 1 { "was" } else { "were" },
            quoted(&arguments.run.dir().display().to_string())
        );
    }
    let how = Reevaluation {
        fused: arguments.sweeps as usize,
        mc_samples: arguments.mc.map(|mc| mc as usize),
        runtime: arguments.runtime.map(RuntimeKind::from),
    };
    let result = how
        .of(&run, &classifier, &dataset, tested, GIT)
        .map_err(in_file)?;
    if arguments.json {
        output::print_json(&result)?;
    } else {
        output::print(result)?;
    }
    Ok(ExitCode::SUCCESS)
}
