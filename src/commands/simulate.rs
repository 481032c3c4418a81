//! `tactnet simulate`: simulated robot components on the channels.

mod catching;
pub(super) mod fault;
mod skin;
mod soak;

use std::path::Path;
use std::process::ExitCode;

use clap::Subcommand;
use tactnet_data::{Dataset, known_names};
use tactnet_pipeline::{ClassifierConfig, PipelineError, RunDir, TestSweeps};

#[derive(Subcommand)]
#[command(after_help = "Examples:\n  \
    tactnet simulate skin --table robot.toml --materials wood,cork     alternating sweeps over wood and cork, in real time\n  \
    tactnet simulate catching --table robot.toml --seconds 10          load of cameras, tracker, planner and the 1 kHz loop\n  \
    tactnet simulate soak --seconds 30 --run runs/a --json             all of it together, with measurements")]
pub enum SimulateCommand {
    /// Send sweeps of a data set on the skin's channel in real time, with commands
    Skin(skin::SkinArgs),
    /// Run the message load of the catching stack (thesis, figure 3.2) and measure its 1 kHz loop
    Catching(catching::CatchingArgs),
    /// Run hub, skin, catching stack, classifier and dashboard together and measure their mutual influence
    Soak(soak::SoakArgs),
}

/// Runs the subcommand.
pub fn run(command: SimulateCommand) -> anyhow::Result<ExitCode> {
    match command {
        SimulateCommand::Skin(arguments) => skin::run(&arguments),
        SimulateCommand::Catching(arguments) => catching::run(&arguments),
        SimulateCommand::Soak(arguments) => soak::run(&arguments),
    }
}

/// Refuses sweeps that the classifier of a run would reject, and notes if none of their materials is known.
pub(super) fn check_fit(
    dataset: &Dataset,
    data: &str,
    run: &ClassifierConfig,
) -> Result<(), PipelineError> {
    let describe = |shape, rate: f64| format!("{shape} at {rate} Hz");
    let (own, wanted) = (dataset.shape(), run.shape);
    let alike = (own.rows, own.cols) == (wanted.rows, wanted.cols) && own.steps >= wanted.steps;
    if !alike || dataset.sample_rate_hz() != run.sample_rate_hz {
        return Err(PipelineError::incompatible(
            data,
            format!(
                "sweeps as the run's, {}",
                describe(wanted, run.sample_rate_hz)
            ),
            format!(
                "{}{}{}",
                describe(own, dataset.sample_rate_hz()),
                remedy(dataset, run),
                rate_remedy(dataset, run)
            ),
        ));
    }
    let known = |name: &str| run.labels.names().any(|known| known == name);
    if !dataset.labels().names().any(known) {
        say!(
            "note: the run knows none of the materials of {data} ({}), so no prediction can be correct; it knows {}",
            known_names("", dataset.labels().names()),
            known_names("", run.labels.names())
        );
    }
    Ok(())
}

/// Returns a remedy for sweeps of another shape as a continuation of the message; empty if there is none.
fn remedy(dataset: &Dataset, run: &ClassifierConfig) -> String {
    let (own, wanted) = (dataset.shape(), run.shape);
    if (own.rows, own.cols) != (wanted.rows, wanted.cols) {
        return if (own.rows, own.cols) == (wanted.cols, wanted.rows) {
            "; most likely rows and columns have been exchanged: swap these two axes where the file is written".into()
        } else if own.taxels() == wanted.taxels() {
            format!(
                "; `tactnet data import FILE --out NEW --shape {}x{}` arranges the same taxels",
                wanted.rows, wanted.cols
            )
        } else {
            String::new()
        };
    }
    if own.steps < wanted.steps {
        return format!(
            "; sweeps that are shorter than {} steps cannot be classified by this run (`tactnet train --steps {}` learns from so many)",
            wanted.steps, own.steps
        );
    }
    String::new()
}

/// Returns a remedy for another sample rate as a continuation of the message; empty for the run's rate.
fn rate_remedy(dataset: &Dataset, run: &ClassifierConfig) -> &'static str {
    if dataset.sample_rate_hz() == run.sample_rate_hz {
        ""
    } else if dataset.is_rate_assumed() {
        "; its rate is assumed since the data does not say; `--rate HZ` names it"
    } else {
        "; it has to be recorded at the run's rate"
    }
}

/// Returns the indices of the sweeps that the run has not learned from.
pub(super) fn unseen_by(dataset: &Dataset, run: &Path) -> anyhow::Result<Vec<usize>> {
    let run = RunDir::open(run)?;
    let unseen = TestSweeps::unseen(dataset, &run.config()?, &run.split()?)?;
    if !unseen.training_sweeps_known {
        say!(
            "warning: the run's training data is not available, so these sweeps may include training sweeps"
        );
    }
    let view = unseen.without_enrolled(&run)?.view;
    if view.is_empty() {
        return Err(PipelineError::incompatible(
            dataset.name(),
            "sweeps that the run has not learnt from",
            "none: all of them were trained on or enrolled; `--data FILE` names others",
        )
        .into());
    }
    Ok(view.indices().to_vec())
}
