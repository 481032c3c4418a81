//! `tactnet task`: runs one task of an experiment, from the plan in the experiment's folder. Experiments call it;
//! people call `tactnet experiment run`.

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::Args;
use tactnet_data::refuse_errors;
use tactnet_experiments::{ExperimentDir, Job, QuestionTask, Start, Task, answer_question};
use tactnet_pipeline::{
    BatchReport, LabelOrder, Provenance, RunDir, Session, TrainEvent, TrainJob, TrainOutcome,
    train_together,
};

use super::train::{Progress, program, train};
use crate::output::OutputFormat;
use crate::stop::Stop;
use crate::{failure, output, source};

/// Minimum interval between two progress lines.
const REPORT_INTERVAL: Duration = Duration::from_secs(10);

#[derive(Args)]
pub struct TaskArgs {
    /// Folder of an experiment
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// IDs of tasks: one, or several network trainings that a GPU runs together
    #[arg(value_name = "ID", required = true)]
    ids: Vec<String>,
    /// Maximum number of networks trained together [default: limited by memory]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100))]
    at_once: Option<u32>,
}

/// Runs the tasks.
pub fn run(arguments: &TaskArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen()?;
    let dir = ExperimentDir::open(&arguments.dir)?;
    let [id] = &arguments.ids[..] else {
        return train_at_once(&dir, arguments, &stop);
    };
    let task = dir.task(id)?;
    let folder = dir.task_dir(task);
    match dir.begin(task)? {
        Start::Resume => {
            source::announce(&RunDir::open(&folder)?.config()?.spec.data);
            let session = Session::resume(&folder, None, program())?;
            average_or_train(&dir, task, &session, &stop, true)
        }
        Start::Begin(job) => match *job {
            Job::Train(spec) => {
                let job = TrainJob::try_from(spec)?;
                source::announce(&job.spec().data);
                let session = Session::begin(&job, Some(&folder), program(), |_| Ok(()))?;
                average_or_train(&dir, task, &session, &stop, false)
            }
            Job::Question(task) => answer(&task, &folder, program().provenance, &stop),
        },
    }
}

/// Averages a committee whose members have been trained by other tasks; trains every other model.
///
/// - `resumed`: true if another process began the run
fn average_or_train(
    dir: &ExperimentDir,
    task: &Task,
    session: &Session,
    stop: &Stop,
    resumed: bool,
) -> anyhow::Result<ExitCode> {
    let members = dir.members(task)?;
    if !members.is_empty() {
        if session.average(members)?.is_some() {
            say!("averaged the predictions of its members");
            output::print(session.run().path().display())?;
            return Ok(ExitCode::SUCCESS);
        }
        say!("its members were trained otherwise than it asks for: training all of them");
    }
    Ok(train(session, stop, OutputFormat::Table, resumed)?.0)
}

/// Trains the networks of several tasks together. The failure of one is written to its log.
fn train_at_once(
    dir: &ExperimentDir,
    arguments: &TaskArgs,
    stop: &Stop,
) -> anyhow::Result<ExitCode> {
    let mut failures = Vec::new();
    let (mut tasks, mut sessions) = (Vec::new(), Vec::new());
    for id in &arguments.ids {
        let task = dir.task(id)?;
        match session_of(dir, task) {
            Ok(session) => {
                tasks.push(task);
                sessions.push(session);
            }
            Err(error) => failures.push((task, error)),
        }
    }
    let Some(first) = sessions.first() else {
        return Err(first_of(dir, failures)?);
    };
    source::announce(&first.run().config()?.spec.data);
    say!(
        "training {} networks, as many together as memory allows; progress of the first:",
        sessions.len()
    );
    let mut shown = Progress::new(false);
    let ended = train_together(
        &sessions,
        arguments.at_once.map(|networks| networks as usize),
        |index, event| {
            let path = sessions[index].run().path();
            match event {
                TrainEvent::Begun { .. } | TrainEvent::Batch { .. } if index > 0 => {}
                event => shown.show(&event, path),
            }
        },
        || stop.asked(),
    );
    let mut stopped = false;
    for ((task, session), ended) in tasks.into_iter().zip(&sessions).zip(ended) {
        match ended {
            Ok(TrainOutcome::Finished(_)) => output::print(session.run().path().display())?,
            Ok(TrainOutcome::Stopped) => stopped = true,
            Err(error) => failures.push((task, error.into())),
        }
    }
    if !failures.is_empty() {
        return Err(first_of(dir, failures)?);
    }
    if stopped {
        say!("stopped; running the tasks again resumes them");
        return Ok(ExitCode::from(failure::INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

fn session_of(dir: &ExperimentDir, task: &Task) -> anyhow::Result<Session> {
    let folder = dir.task_dir(task);
    let job = match dir.begin(task)? {
        Start::Resume => return Ok(Session::resume(&folder, None, program())?),
        Start::Begin(job) => *job,
    };
    let Job::Train(spec) = job else {
        bail!("task `{}` is no training; run it alone", task.id);
    };
    let job = TrainJob::try_from(spec)?;
    Ok(Session::begin(&job, Some(&folder), program(), |_| Ok(()))?)
}

/// Writes each failure to its task's log, and returns the first.
fn first_of(
    dir: &ExperimentDir,
    failures: Vec<(&Task, anyhow::Error)>,
) -> anyhow::Result<anyhow::Error> {
    for (task, error) in &failures {
        dir.note(task, &format!("error: {error:#}"))?;
    }
    let first = failures.into_iter().next();
    first.map(|(_, error)| error).context("a task has failed")
}

fn answer(
    task: &QuestionTask,
    folder: &Path,
    program: Provenance,
    stop: &Stop,
) -> anyhow::Result<ExitCode> {
    let job = TrainJob::try_from(task.networks.clone())?;
    let spec = job.spec();
    let _lock = RunDir::lock(folder)?;
    let dataset = source::load_as(spec, &spec.data, LabelOrder::True)?;
    refuse_errors(&dataset, &spec.data)?;
    let reported = Cell::new(Instant::now());
    let go_on = |what: &str, batch: Option<&BatchReport>| {
        if batch.is_none() || reported.get().elapsed() > REPORT_INTERVAL {
            reported.set(Instant::now());
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
    if answer_question(task, &dataset, job.recipe(), folder, program, &go_on)?.is_none() {
        say!("stopped; running the task again resumes it with its next network");
        return Ok(ExitCode::from(failure::INTERRUPTED));
    }
    output::print(folder.join("result.json").display())?;
    Ok(ExitCode::SUCCESS)
}
