//! `tactnet task`: one task of an experiment, as the plan in the experiment's folder says. Experiments call it; people call
//! `tactnet experiment run`.

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::bail;
use clap::Args;
use tactnet_data::refuse_errors;
use tactnet_experiments::{ExperimentDir, Job, QuestionTask, Start, answer_question};
use tactnet_pipeline::{
    BatchReport, LabelOrder, ModelRecipe, Provenance, RunDir, Session, TrainJob,
};

use super::train::train;
use crate::output::OutputFormat;
use crate::stop::Stop;
use crate::{GIT, failure, output, source};

/// How often progress is told.
const EVERY: Duration = Duration::from_secs(10);

#[derive(Args)]
pub struct TaskArgs {
    /// Folder of an experiment
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Name of a task
    #[arg(value_name = "ID")]
    id: String,
}

/// Runs the command.
pub fn run(arguments: &TaskArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen()?;
    let dir = ExperimentDir::open(&arguments.dir)?;
    let task = dir.task(&arguments.id)?;
    let folder = dir.task_dir(task);
    let program = Provenance::of_this_process(env!("CARGO_PKG_VERSION"), GIT);
    match dir.begin(task)? {
        Start::Resume => {
            source::announce(&RunDir::open(&folder)?.config()?.spec.data);
            let session = Session::resume(&folder, None, program)?;
            Ok(train(&session, &stop, OutputFormat::Table, true)?.0)
        }
        Start::Begin(job) => match *job {
            Job::Train(spec) => {
                let job = TrainJob::try_from(spec)?;
                source::announce(&job.spec().data);
                let session = Session::begin(&job, Some(&folder), program, |_| Ok(()))?;
                Ok(train(&session, &stop, OutputFormat::Table, false)?.0)
            }
            Job::Question(task) => answer(&task, &folder, program, &stop),
        },
    }
}

fn answer(
    task: &QuestionTask,
    folder: &Path,
    program: Provenance,
    stop: &Stop,
) -> anyhow::Result<ExitCode> {
    let job = TrainJob::try_from(task.networks.clone())?;
    let spec = job.spec();
    let ModelRecipe::TactNet2(recipe) = job.recipe() else {
        bail!("recipe `{}`: a question needs a network", spec.recipe);
    };
    let _lock = RunDir::lock(folder)?;
    let dataset = source::load_as(spec, &spec.data, LabelOrder::True)?;
    refuse_errors(&dataset, &spec.data)?;
    let told = Cell::new(Instant::now());
    let go_on = |what: &str, batch: Option<&BatchReport>| {
        if batch.is_none() || told.get().elapsed() > EVERY {
            told.set(Instant::now());
            match batch {
                None => say!("{what}"),
                Some(batch) => say!(
                    "{what}: epoch {}, batch {} of {}",
                    batch.epoch + 1,
                    batch.batch + 1,
                    batch.batches
                ),
            }
        }
        !stop.asked()
    };
    if answer_question(task, &dataset, recipe, folder, program, &go_on)?.is_none() {
        say!("stopped; the task goes on with its next network when it is run again");
        return Ok(ExitCode::from(failure::INTERRUPTED));
    }
    output::print(folder.join("result.json").display())?;
    Ok(ExitCode::SUCCESS)
}
