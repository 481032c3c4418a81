//! `tactnet simulate soak`: soak test of the complete system.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::{Args, ValueEnum};
use tactnet_data::DataSource;
use tactnet_data::twin::{self, TwinConfig};
use tactnet_pipeline::RunDir;
use tactnet_simulation::{
    Company, Played, SMALL_MATERIALS, SMALL_SWEEPS, Scheduling, Soak, SoakReport,
    train_small_network,
};

use super::unseen_by;
use crate::output::OutputFormat;
use crate::stop::Stop;
use crate::{GIT, output, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet simulate soak --seconds 30 --json                          trains a small network first\n  \
    tactnet simulate soak --seconds 60 --with catching                 beside the real catching stack\n  \
    tactnet simulate soak --seconds 600 --run runs/twin-committee-fold0-1   ten minutes with a trained network")]
pub struct SoakArgs {
    /// Time with the classifier, in s; as much time without it alternates in windows of at most 10 s
    #[arg(long, value_name = "S", default_value_t = 30.0)]
    seconds: f64,
    /// Run directory of a trained network [default: train a small one]
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Data set of the played sweeps, except the network's training sweeps
    #[arg(long, value_name = "FILE|twin", default_value = "twin")]
    data: String,
    /// Processes that run next to the classifier
    #[arg(long, value_enum, default_value_t)]
    with: CompanyChoice,
    /// Scheduling of the 1 kHz loop, the skin and the classifier
    #[arg(long, value_enum, default_value_t)]
    scheduling: SchedulingChoice,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Values of `--with`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum CompanyChoice {
    /// Packet load of the catching stack, with two 2-megapixel images, almost without computation
    #[default]
    Load,
    /// The catching stack in its simulated world
    Catching,
}

impl CompanyChoice {
    fn company(self) -> anyhow::Result<Company> {
        match self {
            Self::Load => Ok(Company::Load),
            #[cfg(feature = "catching")]
            Self::Catching => Ok(Company::Catching),
            #[cfg(not(feature = "catching"))]
            Self::Catching => bail!(tactnet_models::MissingFeature {
                feature: "catching"
            }),
        }
    }
}

/// Values of `--scheduling`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum SchedulingChoice {
    /// SCHED_FIFO if permitted
    #[default]
    Auto,
    /// SCHED_FIFO, with the loop above the skin and the skin above the classifier
    Fifo,
    /// The default scheduler
    Usual,
}

impl SchedulingChoice {
    fn scheduling(self) -> anyhow::Result<Scheduling> {
        match self {
            Self::Usual => Ok(Scheduling::Usual),
            Self::Fifo => Ok(Scheduling::fifo()?),
            Self::Auto => Ok(Scheduling::fifo().unwrap_or_else(|refused| {
                say!("using the default scheduler instead of SCHED_FIFO: {refused}");
                Scheduling::Usual
            })),
        }
    }
}

/// Runs the test.
pub fn run(arguments: &SoakArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    if !(arguments.seconds > 0.0 && arguments.seconds <= 86_400.0) {
        bail!("--seconds: expected more than 0 and at most a day");
    }
    // Unreadable data is an error before a network is trained.
    let dataset = match DataSource::named(&arguments.data) {
        DataSource::Twin(version) => twin::generate(&TwinConfig {
            version,
            sweeps: SMALL_SWEEPS,
            ..TwinConfig::default()
        })?,
        DataSource::File(_) => source::load(&arguments.data)?,
    };
    let scheduling = arguments.scheduling.scheduling()?;
    let folder = tempfile::tempdir()?;
    let program = std::env::current_exe()?;
    let run = match &arguments.run {
        Some(run) => run.clone(),
        None => {
            say!("training a small network on {SMALL_MATERIALS} materials of the twin …");
            train_small_network(&program, folder.path())?
        }
    };
    let known = RunDir::open(&run)?.config()?.classifier.labels;
    let sweeps = unseen_by(&dataset, &run)?;
    let played = Played::new(&dataset, &sweeps, &known)?;
    let soak = Soak {
        program: &program,
        git: GIT,
        run: &run,
        folder: folder.path(),
        seconds: arguments.seconds,
        company: arguments.with.company()?,
        scheduling,
    };
    let report = soak.run(
        &played,
        |turn, turns| say!("turn {turn} of {turns}"),
        &|| stop.asked(),
    )?;
    OutputFormat::from_flag(arguments.json).report(&report, |report| output::print(summary(report)))
}

/// Returns the main results in one line.
fn summary(report: &SoakReport) -> String {
    let summary = format!(
        "frames: {}, lost: {}; beliefs: {}, after the last frame {:.0} us, 99 % below {:.0} (dropout {:.0}, {:.0}); \
         missed deadlines: {}; allocations per frame: {}; 1 kHz loop with/without: {:.3}",
        report.frames_sent,
        report.frames_lost,
        report.beliefs,
        report.belief_latency_p50_us,
        report.belief_latency_p99_us,
        report.dropout_latency_p50_us,
        report.dropout_latency_p99_us,
        report.deadline_misses,
        report.allocations_per_frame,
        report.loop_p99_ratio
    );
    #[cfg(feature = "catching")]
    if let Some(catching) = &report.catching {
        return format!(
            "{summary}; caught {} of {} catchable balls, {} of {} in total",
            catching.counts.caught,
            catching.counts.catchable,
            catching.counts.caught_of_all,
            catching.balls
        );
    }
    summary
}
