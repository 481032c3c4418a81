//! `tactnet eval`: evaluates a trained classifier again, on its own test sweeps or on another data set.

mod document;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_models::Compute;
use tactnet_pipeline::{
    Classifier, Evaluation, EvaluationTable, ModelRecipe, RunDir, RuntimeKind, TestSweeps,
    Verdicts, compare_runtime, evaluate_all_ways,
};

use super::choices::{DeviceChoice, RuntimeChoice};
use crate::{GIT, output, source};
use document::{EvalResult, RuntimeSummary};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet eval runs/twin-fast-fold0-1                       its own test sweeps\n  \
    tactnet eval runs/twin-fast-fold0-1 --sweeps 5 --mc 500   five sweeps fused, 500 Monte Carlo runs\n  \
    tactnet eval runs/a --data other.h5                  every sweep of another data set\n  \
    tactnet eval runs/a --runtime online                  frame by frame, as `tactnet serve` does")]
pub struct EvalArgs {
    /// A run directory
    #[arg(value_name = "DIR")]
    run: PathBuf,
    /// Another data set: all of its sweeps are tested, but for training and enrolled sweeps; after `train --calibrate` it may hold
    /// unknown materials. Or where the run's own data set is now, if it was moved [default: the run's own test sweeps]
    #[arg(long, value_name = "FILE|twin")]
    data: Option<String>,
    /// Sweeps of one material that are fused into one decision
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    sweeps: u32,
    /// Runs of Monte Carlo dropout, of a network [default: the recipe's, or 100]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..))]
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
    let run = RunDir::open(&arguments.run)?;
    let config = run.config()?;
    if let (Some(_), ModelRecipe::Baseline(baseline)) = (arguments.mc, &config.recipe) {
        bail!(
            "--mc: `{}` is a baseline without dropout, and predicts one way only; leave out --mc",
            baseline.name
        );
    }
    let device = Compute::from(arguments.device).open()?;
    let weights = run.weights()?;
    let finished = run.has_final_weights();
    if !finished {
        eprintln!("this run has not ended: judging the weights of its last checkpoint");
    }
    let classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    let spec = &config.spec;
    let data = arguments.data.as_deref().unwrap_or(&spec.data);
    source::announce(data);
    let dataset = spec.read_sweeps_of_run(arguments.data.as_deref())?;
    let tested = TestSweeps::of_run(&run, &dataset)?;
    if !tested.training_sweeps_known {
        eprintln!("{}: {}", dataset.name(), tested.description);
    }
    let mc_samples = arguments
        .mc
        .map_or(config.recipe.method().mc_samples_or(100), |mc| mc as usize);
    let fused = arguments.sweeps as usize;
    let (known, unknown) = classifier.by_known_material(&tested.view);
    let verdicts = match run.calibration()? {
        None => None,
        Some(calibration) => Some(Verdicts::of(
            &calibration,
            &run.train_embeddings()?,
            &classifier,
            &known,
            &unknown,
        )?),
    };
    // Materials that it does not know are an error unless it can say so.
    let view = if verdicts.is_some() {
        &known
    } else {
        &tested.view
    };
    let (mut evaluations, mut runtimes) = (BTreeMap::new(), BTreeMap::new());
    if !view.is_empty() {
        let ways = evaluate_all_ways(&classifier, view, mc_samples, fused, spec.seed)?;
        for (burn, mut evaluation) in ways {
            if let Some(kind) = arguments.runtime.map(RuntimeKind::from) {
                let compared = compare_runtime(kind, &classifier, view, &burn)?;
                evaluation = Evaluation::of(&compared.predictions, fused, spec.seed);
                runtimes.insert(burn.method, RuntimeSummary::of(kind, &compared));
            }
            evaluations.insert(burn.method, evaluation);
        }
    }
    let result = EvalResult {
        schema_version: 1,
        run: arguments.run.display().to_string(),
        git: GIT,
        seed: spec.seed,
        split_sha256: run.split()?.sha256,
        finished,
        data: dataset.name().into(),
        data_sha256: dataset.sha256().into(),
        n_test: tested.view.len(),
        tested: tested.description,
        evaluations,
        runtimes,
        verdicts,
    };
    if arguments.json {
        output::print_json(&result)?;
        return Ok(ExitCode::SUCCESS);
    }
    output::print(format_args!(
        "{}: {} ({} sweeps)",
        result.data, result.tested, result.n_test
    ))?;
    output::print(EvaluationTable(&result.evaluations))?;
    for (method, compared) in &result.runtimes {
        output::print(format_args!("{}: {compared}", method.name()))?;
    }
    if let Some(verdicts) = &result.verdicts {
        output::print(verdicts)?;
    }
    Ok(ExitCode::SUCCESS)
}
