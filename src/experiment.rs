//! `tactnet experiment`: cross-validations and their like, as tasks that run anywhere, and a page made from what they left.

mod study_table;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use tactnet_experiments::{
    Event, ExperimentDir, ExperimentRecipe, LocalPool, Row, SlurmArray, Statistic, Summary, Task,
    TaskState, export_mlflow, run_locally, run_on_slurm, run_task, summarise, to_html,
};

use crate::stop::Stop;
use crate::{failure, output};

/// What can be done with experiments.
#[derive(Subcommand)]
pub enum ExperimentCommand {
    /// Run an experiment, or go on with it; then report
    Run(RunArgs),
    /// Where the tasks of an experiment stand
    #[command(
        after_help = "Example:\n  tactnet experiment status experiments-out/crossval_baselines"
    )]
    Status(DirArgs),
    /// Make table, summary.json and report.html from what has ended
    #[command(after_help = "Example:\n  \
        tactnet experiment report experiments-out/crossval_baselines     then open report.html in that folder")]
    Report(DirArgs),
    /// Write what has ended for other tools
    Export(ExportArgs),
    /// Experiments that ship with tactnet
    #[command(after_help = "Example:\n  tactnet experiment list")]
    List,
    /// Print an experiment's recipe, to start one's own from
    Show(ShowArgs),
    /// Run one task: what a Slurm job calls
    #[command(hide = true)]
    Task(TaskArgs),
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet experiment run crossval_baselines                           on the twin\n  \
    tactnet experiment run crossval_tactnet2 --set data=sweeps.h5       on recorded sweeps\n  \
    tactnet experiment run crossval_baselines --set folds=2 --set 'models=[\"minirocket\"]'\n  \
    tactnet experiment run nshot --set splits=3 --set 'shots=[1,10]'    n-shot transfer\n  \
    tactnet experiment run my.toml --engine slurm --out /shared/my      on a cluster\n\n\
    The same call goes on where it was stopped; tasks that have ended are not run again.\n\n\
    Fields for --set: data, models, levels, steps, split, probes (a value or a list), folds (how many of the five random folds are \
    trained), runs (1 or 2), groups, seed, epochs, search.trials; of studies: splits (draws of new materials, or of the 2 x 5 folds), shots (sweeps that nshot and enrolment learn from, or behind a decision of the others), methods (nshot: nk, ol, ol-fcl, ol-mean, nn, siamese, simpleshot, lda, tuned-ol, whitened-ol). `tactnet experiment show NAME` prints a whole recipe.\n\n\
    With --engine slurm, folder and program must lie under the same path on every node.")]
pub struct RunArgs {
    /// A built-in experiment (see `tactnet experiment list`) or a TOML file
    #[arg(value_name = "NAME|FILE")]
    recipe: String,
    /// Folder for tasks and report [default: experiments-out/NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Set a field of the recipe anew; may be repeated
    #[arg(long = "set", value_name = "FIELD=VALUE")]
    settings: Vec<String>,
    /// Where tasks run
    #[arg(long, value_enum, default_value_t)]
    engine: Engine,
    /// Tasks at once [default: one for every core; with Slurm: 100]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    jobs: Option<u32>,
    /// With Slurm: cores of each task
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    cores: u32,
    /// With Slurm: a further argument of sbatch, such as --partition=gpu; may be repeated
    #[arg(long = "sbatch", value_name = "ARG", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// Print summary.json instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
pub struct DirArgs {
    /// Folder of an experiment
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
#[command(after_help = "Example:\n  tactnet experiment show crossval_baselines > my.toml")]
pub struct ShowArgs {
    /// A built-in experiment
    #[arg(value_name = "NAME")]
    name: String,
}

#[derive(Args)]
#[command(after_help = "Example:\n  \
    tactnet experiment export experiments-out/crossval_baselines --mlflow mlruns\n  \
    mlflow ui --backend-store-uri mlruns")]
pub struct ExportArgs {
    /// Folder of an experiment
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// New folder in the layout of MLflow's tracking store
    #[arg(long, value_name = "DIR")]
    mlflow: PathBuf,
}

#[derive(Args)]
pub struct TaskArgs {
    dir: PathBuf,
    index: usize,
    #[arg(long, default_value_t = 1)]
    threads: usize,
}

/// Where tasks run.
#[derive(Clone, Copy, Default, ValueEnum)]
enum Engine {
    /// Processes on this machine
    #[default]
    Local,
    /// A Slurm array job
    Slurm,
}

/// Runs the command.
pub fn run(command: ExperimentCommand) -> anyhow::Result<ExitCode> {
    match command {
        ExperimentCommand::Run(arguments) => run_experiment(&arguments),
        ExperimentCommand::Status(arguments) => status(&arguments),
        ExperimentCommand::Report(arguments) => {
            report(&ExperimentDir::open(&arguments.dir)?, arguments.json)?;
            Ok(ExitCode::SUCCESS)
        }
        ExperimentCommand::Export(arguments) => {
            let dir = ExperimentDir::open(&arguments.dir)?;
            let runs = export_mlflow(&dir, &arguments.mlflow)?;
            output::print(format_args!(
                "{runs} runs in {0}; look at them with `mlflow ui --backend-store-uri {0}`",
                arguments.mlflow.display()
            ))?;
            Ok(ExitCode::SUCCESS)
        }
        ExperimentCommand::List => list(),
        ExperimentCommand::Show(arguments) => {
            output::print(ExperimentRecipe::built_in_text(&arguments.name)?.trim_end())?;
            Ok(ExitCode::SUCCESS)
        }
        ExperimentCommand::Task(arguments) => {
            let dir = ExperimentDir::open(&arguments.dir)?;
            let stop = Stop::listen()?;
            let stopped = || stop.asked();
            run_task(
                &dir,
                &this_program()?,
                arguments.index,
                arguments.threads,
                stopped,
            )?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

fn this_program() -> anyhow::Result<PathBuf> {
    std::env::current_exe().context("cannot find this program's own file")
}

fn run_experiment(arguments: &RunArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen()?;
    let recipe = ExperimentRecipe::load(&arguments.recipe, &arguments.settings)?;
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => Path::new("experiments-out").join(&recipe.name),
    };
    let dir = ExperimentDir::create(&out, &recipe, &command_line(arguments))?;
    let program = this_program()?;
    let mut progress = Progress::new();
    let tell = |event: Event<'_>| progress.show(&event);
    let outcome = match arguments.engine {
        Engine::Local => {
            let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
            let pool = match arguments.jobs {
                None => LocalPool::for_cores(cores, dir.plan.tasks.len()),
                Some(jobs) => LocalPool::with_jobs(jobs as usize, cores),
            };
            run_locally(&dir, &program, pool, || stop.asked(), tell)
        }
        Engine::Slurm => {
            let array = SlurmArray {
                cores: arguments.cores as usize,
                jobs: arguments.jobs.unwrap_or(100) as usize,
                arguments: arguments.sbatch.clone(),
                poll: Duration::from_secs(1),
            };
            run_on_slurm(&dir, &program, &array, || stop.asked(), tell)
        }
    };
    progress.end();
    if stop.asked() {
        eprintln!(
            "stopped; the same call goes on with {}",
            dir.path().display()
        );
        return Ok(ExitCode::from(failure::INTERRUPTED));
    }
    // Tasks that failed are reported after what the others found.
    report(&dir, arguments.json)?;
    outcome?;
    Ok(ExitCode::SUCCESS)
}

/// The call, with file names only.
fn command_line(arguments: &RunArgs) -> String {
    let name = |path: &str| {
        Path::new(path).file_name().map_or_else(
            || path.to_string(),
            |name| name.to_string_lossy().into_owned(),
        )
    };
    let mut line = format!("tactnet experiment run {}", name(&arguments.recipe));
    for setting in &arguments.settings {
        let shown = match setting.split_once('=') {
            Some(("data", value)) if !value.starts_with(['[', '"']) => {
                format!("data={}", name(value))
            }
            _ => setting
                .split('"')
                .map(|part| {
                    if part.contains('/') {
                        name(part)
                    } else {
                        part.to_string()
                    }
                })
                .collect::<Vec<_>>()
                .join("\""),
        };
        line.push_str(&format!(" --set '{shown}'"));
    }
    line
}

/// What `status --json` prints.
#[derive(Serialize)]
struct Status<'a> {
    schema_version: u32,
    name: &'a str,
    tasks: Vec<TaskStatus<'a>>,
}

#[derive(Serialize)]
struct TaskStatus<'a> {
    id: &'a str,
    state: TaskState,
}

fn status(arguments: &DirArgs) -> anyhow::Result<ExitCode> {
    let dir = ExperimentDir::open(&arguments.dir)?;
    let states: Vec<(&Task, TaskState)> = dir
        .plan
        .tasks
        .iter()
        .map(|task| (task, dir.state(task)))
        .collect();
    if arguments.json {
        let tasks = states.iter().map(|(task, state)| TaskStatus {
            id: &task.id,
            state: *state,
        });
        output::print_json(&Status {
            schema_version: 1,
            name: &dir.plan.recipe.name,
            tasks: tasks.collect(),
        })?;
        return Ok(ExitCode::SUCCESS);
    }
    let count = |wanted: TaskState| states.iter().filter(|(_, state)| *state == wanted).count();
    output::print(format_args!(
        "{}: {} tasks, {} done, {} running, {} interrupted, {} open",
        dir.plan.recipe.name,
        states.len(),
        count(TaskState::Done),
        count(TaskState::Running),
        count(TaskState::Interrupted),
        count(TaskState::Open)
    ))?;
    for (task, state) in &states {
        let note = match state {
            TaskState::Done | TaskState::Open => continue,
            TaskState::Running => "running: ",
            TaskState::Interrupted => "interrupted: ",
        };
        output::print(format_args!(
            "  {}: {note}{}",
            task.id,
            dir.last_words(task)
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn list() -> anyhow::Result<ExitCode> {
    for recipe in ExperimentRecipe::built_in() {
        output::print(format_args!(
            "{}\n    {}\n    takes {}",
            recipe.name, recipe.title, recipe.takes
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes `summary.json` and `report.html` and prints what was found.
fn report(dir: &ExperimentDir, json: bool) -> anyhow::Result<()> {
    let summary = summarise(dir)?;
    dir.write_json("summary.json", &summary)?;
    dir.write("report.html", to_html(&summary).as_bytes())?;
    if json {
        return output::print_json(&summary);
    }
    print_table(&summary)?;
    output::print(format_args!(
        "report: {}",
        dir.path().join("report.html").display()
    ))
}

fn print_table(summary: &Summary) -> anyhow::Result<()> {
    output::print(format_args!("{}\n{}", summary.title, summary.command))?;
    if summary.tasks_done < summary.tasks {
        output::print(format_args!(
            "only {} of {} tasks have ended",
            summary.tasks_done, summary.tasks
        ))?;
    }
    if let Some(study) = &summary.study {
        study_table::print(study)?;
    }
    let mut setting = None;
    for probe in [false, true] {
        for row in summary.rows.iter().filter(|row| row.probe == probe) {
            let own = (&row.data, &row.levels, &row.split, row.steps);
            if setting != Some(own) {
                setting = Some(own);
                output::print(format_args!(
                    "\n{}, {}, levels {}, {} steps, chance {:.1} %\n{:<44} {:>5} {:>24} {:>16} {:>6} {:>6} {:>9} {:>11}",
                    row.data,
                    row.split,
                    row.levels,
                    row.steps,
                    100.0 / row.materials.len() as f64,
                    "model",
                    "folds",
                    "1 sweep [%], sd, 95 %",
                    "3 sweeps [%], sd",
                    "NLL",
                    "ECE",
                    "train [s]",
                    "published"
                ))?;
            }
            print_row(row)?;
        }
    }
    for audit in &summary.audits {
        output::print(format_args!("\n{}: {}", audit.data, audit.verdict))?;
    }
    Ok(())
}

fn print_row(row: &Row) -> anyhow::Result<()> {
    let percent = |statistic: &Statistic| {
        let sd = statistic
            .sd
            .map_or(String::new(), |sd| format!(" ({:.1})", 100.0 * sd));
        format!("{:.1}{sd}", 100.0 * statistic.mean)
    };
    let interval = row.one_sweep.ci95.map_or(String::new(), |[low, high]| {
        format!(" {:.1} to {:.1}", 100.0 * low, 100.0 * high)
    });
    let way = if row.prediction == "plain" {
        ""
    } else {
        ", MC dropout"
    };
    output::print(format_args!(
        "{:<44} {:>5} {:>24} {:>16} {:>6.3} {:>6.3} {:>9.1} {:>11}",
        format!("{}{way}", row.model),
        row.folds.len(),
        format!("{}{interval}", percent(&row.one_sweep)),
        row.three_sweeps.as_ref().map_or("-".into(), percent),
        row.negative_log_likelihood.mean,
        row.expected_calibration_error.mean,
        row.train_seconds.mean,
        row.published.as_ref().map_or(String::new(), |p| format!(
            "{:.1} / {:.1}",
            p.one_sweep, p.three_sweeps
        )),
    ))
}

/// A bar over tasks on a terminal, a line per task elsewhere.
struct Progress {
    bar: Option<ProgressBar>,
    begun: Instant,
    done_before: usize,
    done: usize,
    all: usize,
}

impl Progress {
    fn new() -> Self {
        Self {
            bar: None,
            begun: Instant::now(),
            done_before: 0,
            done: 0,
            all: 0,
        }
    }

    fn show(&mut self, event: &Event<'_>) {
        match event {
            Event::Begun { done, all } => {
                (self.done_before, self.done, self.all) = (*done, *done, *all);
                self.bar = std::io::stderr().is_terminal().then(|| bar(*done, *all));
                if self.bar.is_none() {
                    eprintln!("{all} tasks, {done} done");
                }
            }
            Event::Started { task } => {
                if let Some(bar) = &self.bar {
                    bar.set_message(task.id.clone());
                }
            }
            Event::Done { task, seconds } => {
                self.done += 1;
                match &self.bar {
                    Some(bar) => bar.inc(1),
                    None => {
                        let spent = self.begun.elapsed();
                        let here = (self.done - self.done_before) as f64;
                        let left = spent.mul_f64((self.all - self.done) as f64 / here);
                        eprintln!(
                            "{}/{} {} in {seconds:.0} s, {} to go",
                            self.done,
                            self.all,
                            task.id,
                            HumanDuration(left)
                        );
                    }
                }
            }
            Event::Failed {
                task,
                attempt,
                reason,
            } => {
                let line = format!("{} failed (attempt {attempt}): {reason}", task.id);
                match &self.bar {
                    Some(bar) => bar.println(line),
                    None => eprintln!("{line}"),
                }
            }
        }
    }

    fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn bar(done: usize, all: usize) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(all as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template(
        "{pos}/{len} tasks [{bar:30}] {elapsed} gone, {eta} to go, {msg}",
    ) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_position(done as u64);
    bar.reset_eta();
    bar.enable_steady_tick(Duration::from_secs(1));
    bar
}
