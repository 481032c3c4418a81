//! `tactnet eval`: evaluates a trained classifier on its test sweeps or on another data set.

use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_data::format::Keep;
use tactnet_models::Compute;
use tactnet_pipeline::{
    Classifier, ModelRecipe, Reevaluation, RunDir, RuntimeKind, TestSweeps, quoted,
};

use super::choices::{DeviceChoice, RuntimeChoice, rate, steps_or_all};
use super::eval_text;
use super::run_choice::RunChoice;
use crate::output::OutputFormat;
use crate::{GIT, output, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet eval runs/twin-committee-fold0-1                       the run's test sweeps\n  \
    tactnet eval runs/twin-committee-fold0-1 --sweeps 5 --mc 500   five fused sweeps, 500 Monte Carlo samples\n  \
    tactnet eval runs/a --data other.h5                       all sweeps of another data set\n  \
    tactnet eval runs/a --runtime online                       frame by frame, as in `tactnet serve`")]
pub struct EvalArgs {
    #[command(flatten)]
    run: RunChoice,
    /// Data set to evaluate, except training and enrolled sweeps; with `train --calibrate` it may contain unknown
    /// materials. Also the new path of the run's own data set [default: the run's test sweeps]
    #[arg(long, value_name = "FILE|twin")]
    data: Option<String>,
    /// Sample rate, in Hz; takes precedence over that of the data [default: the run's setting]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Number of time steps of each sweep to use, from its start, or `all`, which keeps unequal lengths [default: as in training]
    #[arg(long, value_name = "N|all", value_parser = steps_or_all)]
    steps: Option<Keep>,
    /// Number of sweeps of one material fused into one prediction
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    sweeps: u32,
    /// Number of Monte Carlo dropout samples of a network; 0 disables dropout [default: the recipe's, or 100]
    #[arg(long, value_name = "M")]
    mc: Option<u32>,
    /// Runtime of the scores; the result compares it with Burn [default: burn]
    #[arg(long, value_enum)]
    runtime: Option<RuntimeChoice>,
    /// Dead taxels, counted from 0 row by row: they are masked, as if they read their typical value in training
    #[arg(long, value_name = "TAXEL,…", value_delimiter = ',')]
    dead: Vec<usize>,
    /// Compute device
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// Evaluates the classifier.
pub fn run(arguments: &EvalArgs) -> anyhow::Result<ExitCode> {
    let run = RunDir::open(arguments.run.dir())?;
    let config = run.config()?;
    if let (Some(1..), ModelRecipe::Baseline(baseline)) = (arguments.mc, &config.recipe) {
        bail!(
            "--mc: `{}` is a baseline without dropout; leave out --mc",
            baseline.name
        );
    }
    if let (Some(RuntimeChoice::Online | RuntimeChoice::Candle), ModelRecipe::Committee(_)) =
        (arguments.runtime, &config.recipe)
    {
        bail!(
            "--runtime: a committee runs in `burn`, and in `onnxruntime` if all its members are networks"
        );
    }
    let device = Compute::from(arguments.device).open()?;
    let weights = run.weights()?;
    if !run.has_final_weights() {
        say!("this run is incomplete: evaluating the weights of its last checkpoint");
    }
    let mut classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    classifier.mask(&arguments.dead)?;
    let mut spec = config.spec.clone();
    let data = arguments.data.as_deref().unwrap_or(&config.spec.data);
    spec.name_rate_of(data, arguments.rate);
    if let Some(steps) = arguments.steps {
        spec.set_keep(steps);
    }
    source::announce(data);
    let in_file = |error| source::in_file(data, arguments.rate, error);
    let (dataset, arranged) = spec
        .read_sweeps_to_judge(arguments.data.as_deref(), &config.classifier)
        .map_err(in_file)?;
    source::warn_of_findings(dataset.reading_findings());
    if arranged {
        source::note_arranged(config.classifier.taxel_shape());
    }
    let tested = TestSweeps::of_run(&run, &dataset)?;
    if !tested.training_sweeps_known {
        say!("{}: {}", dataset.name(), tested.description);
    }
    if arguments.data.is_none() {
        note_enrolled(arguments, &run)?;
    }
    let evaluation = Reevaluation {
        fused: arguments.sweeps as usize,
        mc_samples: arguments.mc.map(|mc| mc as usize),
        runtime: arguments.runtime.map(RuntimeKind::from),
    };
    let result = evaluation
        .of(&run, &classifier, &dataset, tested, GIT)
        .map_err(in_file)?;
    OutputFormat::from_flag(arguments.json)
        .report(&result, |result| output::print(eval_text::text(result)))
}

/// Notes that the run's test sweeps contain no enrolled material.
fn note_enrolled(arguments: &EvalArgs, run: &RunDir) -> anyhow::Result<()> {
    let enrolled = run.enrolled()?;
    if !enrolled.is_empty() {
        let names: Vec<String> = enrolled
            .iter()
            .map(|of| format!("`{}`", of.material))
            .collect();
        say!(
            "note: {} {} enrolled, and the run has no test sweeps of it; evaluate further sweeps with `tactnet eval {} --data FILE`",
            names.join(", "),
            if names.len() == 1 { "was" } else { "were" },
            quoted(&arguments.run.dir().display().to_string())
        );
    }
    Ok(())
}
