//! `tactnet bench`: benchmarks of this machine and of the catching stack.

#[cfg(feature = "catching")]
mod catch_detect;
#[cfg(feature = "catching")]
mod catch_plan;
#[cfg(feature = "catching")]
mod catch_safety;
#[cfg(feature = "catching")]
mod catch_throw;
#[cfg(feature = "catching")]
mod catch_track;
mod device;

use std::process::ExitCode;

use clap::Subcommand;

#[derive(Subcommand)]
#[command(after_help = "Examples:\n  \
    tactnet bench device                             time training on every device of this machine\n  \
    tactnet bench device --json                      the same as a JSON document\n  \
    tactnet bench catch-plan --problems 1000         time and accuracy of the catch planner (feature `catching`)")]
pub enum BenchCommand {
    /// Time training on every device of this machine
    Device(device::DeviceArgs),
    /// Measure the catch planner on random problems, compared with a dense grid
    #[cfg(feature = "catching")]
    CatchPlan(catch_plan::PlanBenchArgs),
    /// Measure the ball tracker on throws seen from a fixed head
    #[cfg(feature = "catching")]
    CatchTrack(catch_track::TrackBenchArgs),
    /// Measure the self-collision monitor on random motions that it brakes
    #[cfg(feature = "catching")]
    CatchSafety(catch_safety::SafetyBenchArgs),
    /// Measure throws of maximum distance, planned and in the simulated world
    #[cfg(feature = "catching")]
    CatchThrow(catch_throw::ThrowBenchArgs),
    /// Measure the ball detector on rendered images of throws
    #[cfg(feature = "catching")]
    CatchDetect(catch_detect::DetectBenchArgs),
    /// A benchmark that this build does not include.
    #[cfg(not(feature = "catching"))]
    #[command(external_subcommand)]
    Missing(Vec<String>),
}

/// Runs the benchmark.
pub fn run(command: BenchCommand) -> anyhow::Result<ExitCode> {
    match command {
        BenchCommand::Device(arguments) => device::run(&arguments),
        #[cfg(feature = "catching")]
        BenchCommand::CatchPlan(arguments) => catch_plan::run(&arguments),
        #[cfg(feature = "catching")]
        BenchCommand::CatchTrack(arguments) => catch_track::run(&arguments),
        #[cfg(feature = "catching")]
        BenchCommand::CatchSafety(arguments) => catch_safety::run(&arguments),
        #[cfg(feature = "catching")]
        BenchCommand::CatchThrow(arguments) => catch_throw::run(&arguments),
        #[cfg(feature = "catching")]
        BenchCommand::CatchDetect(arguments) => catch_detect::run(&arguments),
        #[cfg(not(feature = "catching"))]
        BenchCommand::Missing(words) => match words.first() {
            Some(name) if name.starts_with("catch-") => {
                anyhow::bail!(tactnet_models::MissingFeature {
                    feature: "catching"
                })
            }
            name => anyhow::bail!(
                "unrecognized subcommand `{}`; see `tactnet bench --help`",
                name.map_or("", String::as_str)
            ),
        },
    }
}
