//! `tactnet train`: trains and evaluates a classifier in a run directory.

mod arguments;
mod progress;

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::bail;
use tactnet_data::{Finding, shared_within_blocks};
use tactnet_models::{Compute, Trunk};
use tactnet_pipeline::{
    ModelRecipe, PipelineError, Program, Provenance, RunDir, RunResult, Session, SplitKind,
    TrainJob, TrainOutcome, TrainSpec, quoted,
};
use tactnet_skin::packets::unfit;

use super::choices::ModelChoice;
use super::experiment::run_text::{advice, next_steps, run_text};
use crate::output::{self, OutputFormat};
use crate::stop::Stop;
use crate::{GIT, device_times, failure, source};
pub use arguments::TrainArgs;
pub use progress::Progress;

/// Training time below which a run on held-out blocks is repeated on a random fold.
const RANDOM_FOLD_BELOW: Duration = Duration::from_secs(30);

/// Runs the command.
pub fn run(arguments: &TrainArgs) -> anyhow::Result<ExitCode> {
    if let Some(name) = &arguments.print_recipe {
        output::print(ModelRecipe::built_in_text(name)?.trim_end())?;
        return Ok(ExitCode::SUCCESS);
    }
    let stop = Stop::listen()?;
    let session = begin(arguments)?.with_random_fold(RANDOM_FOLD_BELOW);
    let format = OutputFormat::from_flag(arguments.json);
    Ok(train_to_end(&session, &stop, format, arguments.resume.is_some())?.code)
}

/// End of a training.
pub struct Conclusion {
    /// Exit status.
    pub code: ExitCode,
    /// Result, unless the training was stopped.
    pub result: Option<Box<RunResult>>,
}

/// Trains from the current state of the run, and prints warnings before, the result, and next steps.
///
/// - `resumed`: true if another process began the run
pub fn train_to_end(
    session: &Session,
    stop: &Stop,
    format: OutputFormat,
    resumed: bool,
) -> anyhow::Result<Conclusion> {
    let config = session.run().config()?;
    if config.spec.device == Compute::Vulkan
        && let Ok(adapter) = Compute::vulkan_adapter()
        && adapter.software
    {
        say!(
            "warning: {} is a software driver, slower than `--device cpu`",
            adapter.name
        );
    }
    let classifier = config.classifier;
    source::warn_of_assumed_rate(classifier.sample_rate_assumed, classifier.sample_rate_hz);
    let unfit = unfit(classifier.taxel_shape().taxels(), classifier.labels.len());
    if let Some(reason) = &unfit {
        say!("note: `tactnet serve` does not support this classifier: {reason}");
    }
    let (code, result) = train(session, stop, format, resumed)?;
    if let Some(result) = &result {
        say!("{}", next_steps(session, unfit.is_none())?);
        for line in advice(session, result)? {
            say!("hint: {line}");
        }
        if let Some(command) = random_fold_command(session, result)? {
            say!("hint: `{command}` has sweeps of the same recordings in training, for comparison");
        }
    }
    Ok(Conclusion { code, result })
}

/// Begins a run, or continues one with `--resume`.
fn begin(arguments: &TrainArgs) -> anyhow::Result<Session> {
    if let Some(folder) = &arguments.resume {
        if let Some(option) = arguments.named_array() {
            bail!("{option}: expected only for a new run, found --resume");
        }
        let data = arguments.data.as_deref();
        let begun_with = RunDir::open(folder)?.config()?.spec.data;
        source::announce(data.unwrap_or(&begun_with));
        return Ok(Session::resume(folder, data, program())?);
    }
    let mut spec = arguments.spec();
    if arguments.keeps_shortest() {
        spec.steps = Some(source::shortest(&spec)?);
    }
    if arguments.selects_device() {
        spec.device = device_times::fastest()?;
    }
    let job = TrainJob::try_from(spec)?;
    if let Some(model) = arguments.model() {
        refuse_other_model(&job, model)?;
    }
    source::announce(&job.spec().data);
    let doubts = arguments.doubts();
    let review = |finding: &Finding| source::review(None, finding, doubts);
    Ok(Session::begin(&job, arguments.out(), program(), review)?)
}

/// Returns the description of this program for the run directory.
pub fn program() -> Program {
    Program {
        provenance: Provenance::of_this_process(env!("CARGO_PKG_VERSION"), GIT),
        command: arguments::command_line,
    }
}

/// Returns the command that trains on a random fold, if whole blocks were held out and the training took too long to be repeated.
fn random_fold_command(
    session: &Session,
    result: &RunResult,
) -> Result<Option<String>, PipelineError> {
    let (spec, scheme) = (session.run().config()?.spec, session.run().split()?.scheme);
    let is_short = result.train_seconds < RANDOM_FOLD_BELOW.as_secs_f64();
    let is_possible = || shared_within_blocks(session.dataset()).is_empty();
    let holds_out_blocks = SplitKind::of(scheme).holds_out_blocks() && spec.inner.is_none();
    Ok((holds_out_blocks && !is_short && is_possible()).then(|| {
        arguments::command_line(&TrainSpec {
            split: Some(SplitKind::KFold),
            folds: None,
            fold: None,
            repeat: 0,
            ..spec
        })
    }))
}

/// Returns the command that continues the training of a run, as a shell reads it.
pub fn resume_command(run: &Path) -> String {
    format!(
        "tactnet train --resume {}",
        quoted(&run.display().to_string())
    )
}

/// Trains from the current state of the run and prints its result; also returns the result unless the training was stopped.
///
/// - `resumed`: true if another process began the run
pub fn train(
    session: &Session,
    stop: &Stop,
    format: OutputFormat,
    resumed: bool,
) -> anyhow::Result<(ExitCode, Option<Box<RunResult>>)> {
    let mut progress = Progress::new(resumed);
    match session.train(
        |event| progress.show(&event, session.run().path()),
        || stop.asked(),
    )? {
        TrainOutcome::Finished(result) => {
            match format {
                OutputFormat::Json => output::print_json(&result)?,
                OutputFormat::Table => output::print(run_text(session.run(), &result)?)?,
            }
            Ok((ExitCode::SUCCESS, Some(result)))
        }
        TrainOutcome::Stopped => {
            say!(
                "stopped; continue with `{}`",
                resume_command(session.run().path())
            );
            Ok((ExitCode::from(failure::INTERRUPTED), None))
        }
    }
}

fn refuse_other_model(job: &TrainJob, model: ModelChoice) -> anyhow::Result<()> {
    let fits = match job.recipe() {
        ModelRecipe::Network(recipe) => match recipe.network.trunk {
            Trunk::Convolutions(_) => model == ModelChoice::Tactnet2,
            Trunk::Spectra(_) => model == ModelChoice::Spectra,
        },
        other => other.name() == model.recipe(),
    };
    if !fits {
        bail!(
            "recipe `{}` does not train the model `{}`; omit --model or --recipe",
            job.spec().recipe,
            model.recipe()
        );
    }
    Ok(())
}
