//! `tactnet eval`: evaluates a trained classifier again, on its own test sweeps or on another data set.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;
use tactnet_channel::percentile;
use tactnet_data::Seed;
use tactnet_models::Compute;
use tactnet_pipeline::{
    Classifier, Evaluation, EvaluationTable, PredictionMethod, RunDir, RuntimeComparison,
    RuntimeKind, TestSweeps, Verdicts, compare_runtime, evaluate_all_ways, serialize_by_method,
};

use super::choices::{DeviceChoice, RuntimeChoice};
use crate::{GIT, output, source};

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
    /// unknown materials [default: the run's own test sweeps]
    #[arg(long, value_name = "FILE|twin")]
    data: Option<String>,
    /// Sweeps of one material that are fused into one decision
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    sweeps: u32,
    /// Runs of Monte Carlo dropout [default: the recipe's, or 100]
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

/// What `--json` prints.
#[derive(Serialize)]
struct EvalResult {
    schema_version: u32,
    run: String,
    git: &'static str,
    seed: Seed,
    split_sha256: String,
    /// False while the run has not ended; the weights are then those of its last checkpoint.
    finished: bool,
    data: String,
    data_sha256: String,
    tested: String,
    n_test: usize,
    #[serde(serialize_with = "serialize_by_method")]
    evaluations: BTreeMap<PredictionMethod, Evaluation>,
    /// By way of predicting; only with `--runtime`.
    #[serde(
        skip_serializing_if = "BTreeMap::is_empty",
        serialize_with = "serialize_by_method"
    )]
    runtimes: BTreeMap<PredictionMethod, RuntimeSummary>,
    /// Only after `train --calibrate`.
    #[serde(skip_serializing_if = "Option::is_none")]
    verdicts: Option<Verdicts>,
}

/// How another form compares with Burn's predictions of whole batches, and how fast it is.
#[derive(Debug, Serialize)]
struct RuntimeSummary {
    runtime: &'static str,
    /// Largest difference of a probability.
    largest_difference: f64,
    /// From the last frame to the probabilities of a sweep that comes alone, microseconds.
    p50_us: f64,
    p99_us: f64,
    max_us: f64,
}

impl RuntimeSummary {
    fn of(kind: RuntimeKind, compared: &RuntimeComparison) -> Self {
        let at = |share| percentile(&compared.microseconds, share).unwrap_or(0.0);
        Self {
            runtime: kind.name(),
            largest_difference: compared.largest_difference,
            p50_us: at(0.5),
            p99_us: at(0.99),
            max_us: at(1.0),
        }
    }
}

impl std::fmt::Display for RuntimeSummary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: probabilities differ from Burn's by at most {:.1e}; {:.0} us after the last frame, 99 % below {:.0}",
            self.runtime, self.largest_difference, self.p50_us, self.p99_us
        )
    }
}

/// Runs the command.
pub fn run(arguments: &EvalArgs) -> anyhow::Result<ExitCode> {
    let run = RunDir::open(&arguments.run)?;
    let config = run.config()?;
    let device = Compute::from(arguments.device).open()?;
    let weights = run.weights()?;
    let finished = run.has_final_weights();
    if !finished {
        eprintln!("this run has not ended: judging the weights of its last checkpoint");
    }
    let classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    let spec = &config.spec;
    let data = arguments.data.as_deref().unwrap_or(&spec.data);
    let dataset = source::load_as(spec, data, spec.label_order)?;
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
