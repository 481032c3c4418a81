//! The `tactnet` command line: one verb a subcommand, results on stdout, everything else on stderr.

#[macro_use]
mod say;

mod commands;
mod device_times;
mod failure;
mod output;
mod source;
mod stop;
mod table;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use commands::{
    bench, catch, channel, completions, dashboard, data, demo, doctor, enroll, eval, experiment,
    export, man, predict, record, replay, same, serve, simulate, task, train, version, view,
};

#[global_allocator]
static ALLOCATOR: tactnet_serving::CountingAllocator = tactnet_serving::CountingAllocator;

/// The commit this binary was built from.
const GIT: &str = env!("TACTNET_GIT");

/// Tactile material classification: which material did the fingertip sweep over, and how sure is that?
#[derive(Parser)]
#[command(
    name = "tactnet",
    bin_name = "tactnet",
    version = version::text(),
    after_help = "Examples:\n  \
        tactnet train                                train on the synthetic TactMat twin\n  \
        tactnet demo                                 a simulated fingertip, classified live in the browser\n  \
        tactnet train --data sweeps.h5               train on recorded sweeps\n  \
        tactnet eval runs/twin-fast-fold0-1          judge a trained classifier again\n  \
        tactnet predict runs/twin-fast-fold0-1 --data new.npz   of what material are these?\n  \
        tactnet same runs/twin-fast-fold0-1 cup.npz plate.npz   of one material?\n  \
        tactnet enroll runs/twin-fast-fold0-1 --data new.h5 --material felt --out runs/with-felt\n  \
        tactnet experiment run crossval_baselines    compare models over folds\n  \
        tactnet data info sweeps.h5                  look at a data set\n\n\
        `tactnet COMMAND --help` or `tactnet help COMMAND` says more about each command."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Train a classifier and judge it on sweeps it has never seen
    Train(train::TrainArgs),
    /// Judge a trained classifier
    Eval(eval::EvalArgs),
    /// Say of what material sweeps are
    Predict(predict::PredictArgs),
    /// Say whether two objects are of one material
    Same(same::SameArgs),
    /// Add a material to a trained classifier from a few sweeps
    Enroll(enroll::EnrollArgs),
    /// Write a trained network for other programs: ONNX, safetensors
    Export(export::ExportArgs),
    /// Run cross-validations and their like, and report
    #[command(subcommand)]
    Experiment(experiment::ExperimentCommand),
    /// Run one task of an experiment: what experiments call
    #[command(hide = true)]
    Task(task::TaskArgs),
    /// Look at, check, make, convert and fetch data sets
    #[command(subcommand)]
    Data(data::DataCommand),
    /// Hold, look at and measure the channels between robot components
    #[command(subcommand)]
    Channel(channel::ChannelCommand),
    /// Classify sweeps on the robot's channels as they happen
    Serve(serve::ServeArgs),
    /// Look on in a browser while it serves
    Dashboard(dashboard::DashboardArgs),
    /// Record what travels on the tactile channels, as MCAP
    Record(record::RecordArgs),
    /// Put a recording back onto channels
    Replay(replay::ReplayArgs),
    /// Look at channels or a recording in the Rerun viewer
    View(view::ViewArgs),
    /// Put what a robot would on the channels: skin, catching stack, or everything at once
    #[command(subcommand)]
    Simulate(simulate::SimulateCommand),
    /// Catch balls with two arms in a simulated world, and measure how well
    #[command(subcommand)]
    Catch(catch::CatchCommand),
    /// Time this machine
    #[command(subcommand)]
    Bench(bench::BenchCommand),
    /// Hub, simulated skin, classifier and dashboard together, for a first look
    Demo(demo::DemoArgs),
    /// Print what bash, zsh, fish, elvish or PowerShell needs to complete commands and options
    Completions(completions::CompletionsArgs),
    /// Print or write manual pages
    Man(man::ManArgs),
    /// Look at this machine: what works, what does not, what to do about it
    Doctor(doctor::DoctorArgs),
    /// Print version, commit and the optional features of this build
    Version(version::VersionArgs),
}

/// Keeps quiet about panics that become an error of one line.
fn quiet_readers() {
    let shown = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if std::thread::current().name() != Some(tactnet_data::format::READING) {
            shown(panic);
        }
    }));
}

/// Makes the processor Burn's default device unless somebody chose another: an optimiser is restored on the default device, and a GPU would be
/// looked for on machines without one. What computes is named by `--device`.
fn restore_on_the_processor() {
    if std::env::var_os("BURN_DEVICE").is_none() {
        // SAFETY: no other thread has been started.
        unsafe { std::env::set_var("BURN_DEVICE", "flex") };
    }
}

/// Names a Wayland display that is nowhere, where there is no folder to look for one in: graphics drivers would complain of that on stderr
/// whenever a GPU is looked for.
fn without_wayland() {
    let is_set = |name| std::env::var_os(name).is_some();
    if !is_set("XDG_RUNTIME_DIR") && !is_set("WAYLAND_DISPLAY") {
        // SAFETY: no other thread has been started.
        unsafe { std::env::set_var("WAYLAND_DISPLAY", "/nonexistent/wayland") };
    }
}

fn main() -> ExitCode {
    restore_on_the_processor();
    quiet_readers();
    tracing_subscriber::fmt()
        .with_env_filter(tracing_subscriber::EnvFilter::from_default_env())
        .with_writer(std::io::stderr)
        .with_ansi(false)
        .init();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return failure::usage(&error),
    };
    // Only where no window is opened, by the Rerun viewer or a browser.
    if matches!(
        cli.command,
        Command::Train(_) | Command::Task(_) | Command::Bench(_) | Command::Doctor(_)
    ) {
        without_wayland();
    }
    let outcome = match cli.command {
        Command::Train(arguments) => train::run(&arguments),
        Command::Eval(arguments) => eval::run(&arguments),
        Command::Predict(arguments) => predict::run(&arguments),
        Command::Same(arguments) => same::run(&arguments),
        Command::Enroll(arguments) => enroll::run(&arguments),
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
