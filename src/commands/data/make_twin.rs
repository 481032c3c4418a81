//! `tactnet data twin`: makes the synthetic TactMat twin.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use tactnet_data::format::Format;
use tactnet_data::twin::{self, TwinConfig, statistics};

use super::refuse_to_overwrite;
use crate::output;

#[derive(Args)]
pub struct TwinArgs {
    /// Where to write it (.h5 or .npz)
    #[arg(long, value_name = "FILE", required_unless_present = "stats")]
    out: Option<PathBuf>,
    /// Materials, 1 to 36
    #[arg(long, value_name = "N")]
    materials: Option<usize>,
    /// Sweeps of each material
    #[arg(long, value_name = "N")]
    sweeps: Option<usize>,
    /// Time steps of a sweep, at 750 Hz
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Another twin of the same materials
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// How close the materials are
    #[arg(long, value_name = "X")]
    difficulty: Option<f64>,
    /// Print its signal statistics beside those of the real signal
    #[arg(long)]
    stats: bool,
    /// Overwrite the file
    #[arg(long)]
    force: bool,
}

/// Runs the command.
pub fn run(arguments: &TwinArgs) -> anyhow::Result<ExitCode> {
    let default = TwinConfig::default();
    let config = TwinConfig {
        materials: arguments.materials.unwrap_or(default.materials),
        sweeps: arguments.sweeps.unwrap_or(default.sweeps),
        steps: arguments.steps.unwrap_or(default.steps),
        seed: arguments.seed.unwrap_or(default.seed),
        difficulty: arguments.difficulty.unwrap_or(default.difficulty),
    };
    if let Some(out) = &arguments.out {
        refuse_to_overwrite(out, arguments.force)?;
    }
    let twin = twin::generate(&config)?;
    if arguments.stats {
        let measured = statistics::measure(&twin);
        output::print(statistics::Comparison {
            name: "twin",
            measured: &measured,
        })?;
    }
    if let Some(out) = &arguments.out {
        Format::from_extension(out)?.write(out, &twin)?;
        eprintln!(
            "{}: {} synthetic sweeps ({})",
            out.display(),
            twin.len(),
            twin.shape()
        );
    }
    Ok(ExitCode::SUCCESS)
}
