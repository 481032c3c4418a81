//! The `tactnet` command line: results go to stdout, everything else to stderr.

#[macro_use]
mod say;

mod commands;
mod device_times;
mod failure;
mod help;
mod output;
mod source;
mod stop;
mod table;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use commands::{
    adapt, bench, catch, channel, completions, dashboard, data, demo, distill, doctor, enroll,
    eval, experiment, export, man, predict, record, regress, replay, same, serve, simulate, task,
    train, version, view,
};

#[global_allocator]
static ALLOCATOR: tactnet_serving::CountingAllocator = tactnet_serving::CountingAllocator;

/// Commit from which this binary was built.
const GIT: &str = env!("TACTNET_GIT");

/// Tactile material classification: trains classifiers on sweeps of a fingertip and runs them live
#[derive(Parser)]
#[command(
    name = "tactnet",
    bin_name = "tactnet",
    version = version::text(),
    after_help = "Examples:\n  \
        tactnet train                                train on the synthetic TactMat twin\n  \
        tactnet demo                                 classify a simulated fingertip live in the browser\n  \
        tactnet train --data sweeps.h5               train on recorded sweeps\n  \
        tactnet eval runs/twin-committee-fold0-1          evaluate a trained classifier again\n  \
        tactnet predict runs/twin-committee-fold0-1 --data new.npz   predict the material of new sweeps\n  \
        tactnet same runs/twin-committee-fold0-1 cup.npz plate.npz   compare the materials of two objects\n  \
        tactnet enroll runs/twin-committee-fold0-1 --data new.h5 --material felt --out runs/with-felt\n  \
        tactnet adapt runs/twin-committee-fold0-1 --data today.npz --out runs/today\n  \
        tactnet experiment run crossval_baselines    compare models over folds\n  \
        tactnet data info sweeps.h5                  show the contents of a data set\n\n\
        See `tactnet COMMAND --help` or `tactnet help COMMAND` for each command."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Train a classifier and evaluate it on held-out sweeps
    Train(train::TrainArgs),
    /// Evaluate a trained classifier
    Eval(eval::EvalArgs),
    /// Predict the material of sweeps
    Predict(predict::PredictArgs),
    /// Compare the materials of two objects
    Same(same::SameArgs),
    /// Add a material to a trained classifier from a few sweeps
    Enroll(enroll::EnrollArgs),
    /// Adapt a trained classifier to another skin, robot or day
    Adapt(adapt::AdaptArgs),
    /// Make one network of a committee, which classifies frame by frame
    Distill(distill::DistillArgs),
    /// Measure how well speed and force are recovered from the sweeps alone
    Regress(regress::RegressArgs),
    /// Export a trained network or committee: ONNX, safetensors
    Export(export::ExportArgs),
    /// Run cross-validations and other experiments, and write reports
    #[command(subcommand)]
    Experiment(experiment::ExperimentCommand),
    /// Run one task of an experiment; called by experiments
    #[command(hide = true)]
    Task(task::TaskArgs),
    /// Inspect, check, generate, convert and download data sets
    #[command(subcommand)]
    Data(data::DataCommand),
    /// Run, inspect and measure the channels between robot components
    #[command(subcommand)]
    Channel(channel::ChannelCommand),
    /// Classify sweeps on the robot's channels in real time
    Serve(serve::ServeArgs),
    /// Show the running classifier in a browser
    Dashboard(dashboard::DashboardArgs),
    /// Record the channels to an MCAP file
    Record(record::RecordArgs),
    /// Replay a recording on channels
    Replay(replay::ReplayArgs),
    /// Show channels or a recording in the Rerun viewer
    View(view::ViewArgs),
    /// Simulate robot components on the channels: skin, catching stack, or all of them
    #[command(subcommand)]
    Simulate(simulate::SimulateCommand),
    /// Catch balls with two arms in a simulated world, and measure the success rate
    #[command(subcommand)]
    Catch(catch::CatchCommand),
    /// Run benchmarks on this machine
    #[command(subcommand)]
    Bench(bench::BenchCommand),
    /// Run hub, simulated skin, classifier and live page together
    Demo(demo::DemoArgs),
    /// Print shell completions
    Completions(completions::CompletionsArgs),
    /// Print or write manual pages
    Man(man::ManArgs),
    /// Check this machine and give advice
    Doctor(doctor::DoctorArgs),
    /// Print version, commit and optional features of this build
    Version(version::VersionArgs),
}

/// Silences panics of file readers, which become one-line errors.
fn silence_reader_panics() {
    let shown = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !tactnet_data::format::is_reading() {
            shown(panic);
        }
    }));
}

/// Makes the processor Burn's default device unless the environment names another. Burn restores optimisers on the default device,
/// and would otherwise search for a GPU. `--device` selects the device of the computation.
fn use_processor_by_default() {
    if std::env::var_os("BURN_DEVICE").is_none() {
        // SAFETY: no other thread has been started.
        unsafe { std::env::set_var("BURN_DEVICE", "flex") };
    }
}

/// Makes a write beyond the limit of file sizes (`ulimit -f`) an error with a message instead of the end of the process.
#[cfg(unix)]
fn refuse_large_files_in_words() {
    // SAFETY: no other thread has been started, and no handler is installed.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

#[cfg(not(unix))]
fn refuse_large_files_in_words() {}

/// Sets a nonexistent Wayland display if the environment has neither a display nor a runtime folder. Otherwise graphics drivers would
/// print warnings during the search for a GPU.
fn without_wayland() {
    let is_set = |name| std::env::var_os(name).is_some();
    if !is_set("XDG_RUNTIME_DIR") && !is_set("WAYLAND_DISPLAY") {
        // SAFETY: no other thread has been started.
        unsafe { std::env::set_var("WAYLAND_DISPLAY", "/nonexistent/wayland") };
    }
}

/// Parses the command line, with the commands of the main help page in groups.
fn parse() -> Result<Cli, clap::Error> {
    let mut command = help::with_groups(Cli::command());
    let matches = command.try_get_matches_from_mut(std::env::args_os())?;
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

fn main() -> ExitCode {
    use_processor_by_default();
    silence_reader_panics();
    refuse_large_files_in_words();
    let cli = match parse() {
        Ok(cli) => cli,
        Err(error) => return failure::usage(&error),
    };
    // Other commands may open a window: the Rerun viewer or a browser.
    if matches!(
        cli.command,
        Command::Train(_)
            | Command::Distill(_)
            | Command::Task(_)
            | Command::Bench(_)
            | Command::Doctor(_)
    ) {
        without_wayland();
    }
    let outcome = match cli.command {
        Command::Train(arguments) => train::run(&arguments),
        Command::Eval(arguments) => eval::run(&arguments),
        Command::Predict(arguments) => predict::run(&arguments),
        Command::Same(arguments) => same::run(&arguments),
        Command::Enroll(arguments) => enroll::run(&arguments),
        Command::Adapt(arguments) => adapt::run(&arguments),
        Command::Distill(arguments) => distill::run(&arguments),
        Command::Regress(arguments) => regress::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Experiment(command) => experiment::run(command),
        Command::Task(arguments) => task::run(&arguments),
        Command::Data(command) => data::run(command),
        Command::Channel(command) => channel::run(command),
        Command::Serve(arguments) => serve::run(&arguments),
        Command::Dashboard(arguments) => dashboard::run(&arguments),
        Command::Record(arguments) => record::run(&arguments),
        Command::Replay(arguments) => replay::run(&arguments),
        Command::View(arguments) => view::run(&arguments),
        Command::Simulate(command) => simulate::run(command),
        Command::Bench(command) => bench::run(command),
        Command::Catch(command) => catch::run(command),
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Doctor(arguments) => doctor::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Man(arguments) => man::run(&arguments),
        Command::Version(arguments) => version::run(&arguments),
    };
    outcome.unwrap_or_else(|error| failure::report(&error))
}
