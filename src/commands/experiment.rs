//! `tactnet experiment`: runs experiments as tasks, locally or on a cluster, and reports their results.

mod arguments;
mod progress;
pub mod run_text;
mod status_text;
mod table;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context;
use clap::Subcommand;
use tactnet_data::{DataSource, FindingKind};
use tactnet_experiments::{
    AssumedRate, Event, ExperimentDir, ExperimentError, ExperimentRecipe, LocalPool, SlurmArray,
    Status, export_mlflow, run_locally, run_on_slurm, run_task, summarise, to_html,
};
use tactnet_models::Compute;

use crate::output::OutputFormat;
use crate::source::Doubts;
use crate::stop::Stop;
use crate::{failure, output, source};
use arguments::{DirArgs, Engine, ExportArgs, RunArgs, ShowArgs, TaskArgs};
use progress::Progress;
use status_text::StatusText;
use table::{assumed_rate_text, to_table};

/// Subcommands of `tactnet experiment`.
#[derive(Subcommand)]
pub enum ExperimentCommand {
    /// Run or resume an experiment, then report
    Run(RunArgs),
    /// Show the states of an experiment's tasks
    #[command(
        after_help = "Example:\n  tactnet experiment status experiments-out/crossval_baselines"
    )]
    Status(DirArgs),
    /// Write summary.json and report.html from the finished tasks, and print a table
    #[command(after_help = "Example:\n  \
        tactnet experiment report experiments-out/crossval_baselines     then open report.html in that folder")]
    Report(DirArgs),
    /// Export finished tasks for other tools
    Export(ExportArgs),
    /// List the built-in experiments
    #[command(after_help = "Example:\n  tactnet experiment list")]
    List,
    /// Print the recipe of a built-in experiment or of a file, as a starting point
    Show(ShowArgs),
    /// Run one task, as Slurm jobs do
    #[command(hide = true)]
    Task(TaskArgs),
}

/// Runs the command.
pub fn run(command: ExperimentCommand) -> anyhow::Result<ExitCode> {
    match command {
        ExperimentCommand::Run(arguments) => run_experiment(&arguments),
        ExperimentCommand::Status(arguments) => {
            let status = Status::of(&ExperimentDir::open(&arguments.dir)?);
            match OutputFormat::from_flag(arguments.json) {
                OutputFormat::Json => output::print_json(&status)?,
                OutputFormat::Table => output::print(StatusText(&status))?,
            }
            Ok(ExitCode::SUCCESS)
        }
        ExperimentCommand::Report(arguments) => {
            let dir = ExperimentDir::open(&arguments.dir)?;
            report(&dir, OutputFormat::from_flag(arguments.json))?;
            Ok(ExitCode::SUCCESS)
        }
        ExperimentCommand::Export(arguments) => {
            let dir = ExperimentDir::open(&arguments.dir)?;
            let runs = export_mlflow(&dir, &arguments.mlflow)?;
            output::print(format_args!(
                "{runs} runs in {0}; view them with `mlflow ui --backend-store-uri {0}`",
                arguments.mlflow.display()
            ))?;
            Ok(ExitCode::SUCCESS)
        }
        ExperimentCommand::List => list(),
        ExperimentCommand::Show(arguments) => {
            output::print(ExperimentRecipe::text(&arguments.name)?.trim_end())?;
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
    let dir = match arguments.started()? {
        Some(dir) => ExperimentDir::open(dir)?,
        None => begin(arguments)?,
    };
    let program = this_program()?;
    let mut progress = Progress::new();
    let tell = |event: Event<'_>| progress.show(&event);
    let outcome = match arguments.engine {
        Engine::Local => {
            let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
            let on_gpu = dir.plan.recipe.device != Compute::Cpu;
            let pool = match arguments.jobs {
                Some(jobs) => LocalPool::with_jobs(jobs as usize, cores),
                // Parallel processes slow each other down on a GPU.
                None if on_gpu => LocalPool::with_jobs(1, cores),
                None => LocalPool::for_cores(cores, dir.plan.tasks.len()),
            };
            let pool = pool.at_once(arguments.at_once.map(|networks| networks as usize));
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
        say!(
            "stopped; resume with `tactnet experiment run {}`",
            tactnet_pipeline::quoted(&dir.path().display().to_string())
        );
        return Ok(ExitCode::from(failure::INTERRUPTED));
    }
    // Neither can the report be written to a full disk.
    if let Err(error @ ExperimentError::DiskFull { .. }) = outcome {
        return Err(error.into());
    }
    // Failed tasks are reported after the results of the others.
    report(&dir, OutputFormat::from_flag(arguments.json))?;
    outcome?;
    Ok(ExitCode::SUCCESS)
}

/// Creates the folder of an experiment, or opens one with the same recipe.
fn begin(arguments: &RunArgs) -> anyhow::Result<ExperimentDir> {
    arguments.check()?;
    let mut recipe = ExperimentRecipe::load(&arguments.recipe, &arguments.settings())?;
    recipe.open_folders();
    for data in &mut recipe.data {
        *data = DataSource::from_anywhere(data);
    }
    recipe.measure_lengths()?;
    let recipe = recipe.with_data()?;
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => ExperimentDir::place_in(Path::new("experiments-out"), &recipe)?,
    };
    recipe.review(|dataset, finding| {
        let name = dataset.name();
        if finding.kind == FindingKind::AssumedRate {
            let rate_hz = dataset.sample_rate_hz();
            say!(
                "warning: {}",
                assumed_rate_text(AssumedRate {
                    data: name,
                    rate_hz
                })
            );
        }
        let doubts = Doubts {
            axes_are_right: arguments.axes_are_right,
            strict: false,
        };
        source::review(Some(name), finding, doubts)
    })?;
    let dir = ExperimentDir::create(&out, &recipe, &arguments.command_line())?;
    for left_out in &dir.plan.left_out {
        say!("note: {left_out}");
    }
    Ok(dir)
}

fn list() -> anyhow::Result<ExitCode> {
    for recipe in ExperimentRecipe::built_in() {
        output::print(format_args!(
            "{}\n    {}\n    with data = {}: {}",
            recipe.name,
            recipe.title,
            recipe.data.join(", "),
            recipe.takes
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes `summary.json` and `report.html` and prints the results.
fn report(dir: &ExperimentDir, format: OutputFormat) -> anyhow::Result<()> {
    let summary = summarise(dir)?;
    dir.write_json("summary.json", &summary)?;
    dir.write("report.html", to_html(&summary).as_bytes())?;
    if let OutputFormat::Json = format {
        return output::print_json(&summary);
    }
    output::print(to_table(&summary).trim_end())?;
    output::print(format_args!(
        "report: {}",
        dir.path().join("report.html").display()
    ))
}
