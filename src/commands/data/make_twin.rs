//! `tactnet data twin`: generates the synthetic TactMat twin.

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use serde::Serialize;
use tactnet_data::format::Format;
use tactnet_data::twin::{
    self, Construction, Target, TargetSource, TwinConfig, TwinVersion, measure,
};

use crate::{GIT, output};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet data twin --out twin.h5                         3600 sweeps of 36 materials\n  \
    tactnet data twin --materials 5 --sweeps 20 --out small.h5\n  \
    tactnet data twin --contact-force 1.3 --out harder.h5   the same sweeps with more pressure\n  \
    tactnet data twin --stats                               compare its signal statistics with TactMat\n  \
    tactnet data twin --twin-version 1 --out twin1.h5       the same as `--data twin1`")]
pub struct TwinArgs {
    /// Output file (.h5 or .npz)
    #[arg(long, value_name = "FILE", required_unless_present = "stats")]
    out: Option<PathBuf>,
    /// Number of materials, 1 to 36 [default: 36]
    #[arg(long, value_name = "N")]
    materials: Option<usize>,
    /// Number of sweeps per material [default: 100]
    #[arg(long, value_name = "N")]
    sweeps: Option<usize>,
    /// Number of time steps of a sweep, at 750 Hz [default: 1000]
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Similarity of the materials
    #[arg(long, value_name = "X")]
    difficulty: Option<f64>,
    /// Contact force, relative to the normal force [default: 1]
    #[arg(long, value_name = "X")]
    contact_force: Option<f64>,
    /// Speed of the stroke, relative to 3 cm/s [default: 1]
    #[arg(long, value_name = "X")]
    speed: Option<f64>,
    /// Version of the twin [default: the newest]
    #[arg(long, value_name = "1|2", value_parser = version)]
    twin_version: Option<TwinVersion>,
    /// JSON file with fields of `Construction` that replace the version's numbers, for calibration
    #[arg(long, value_name = "FILE")]
    construction: Option<PathBuf>,
    /// Print signal statistics compared with those of TactMat
    #[arg(long)]
    stats: bool,
    /// With --stats: print one JSON document instead of a table
    #[arg(long, requires = "stats")]
    json: bool,
    /// Overwrite the file
    #[arg(long)]
    force: bool,
}

/// Document of `--stats --json`.
#[derive(Serialize)]
struct Statistics<'a> {
    schema_version: u32,
    git: &'static str,
    config: &'a TwinConfig,
    construction: &'a Construction,
    data_sha256: &'a str,
    targets: &'a [Target],
}

fn version(text: &str) -> Result<TwinVersion, String> {
    let number: u8 = text.parse().map_err(|_| "expected 1 or 2".to_string())?;
    TwinVersion::try_from(number)
}

/// Returns the version's numbers, with replacements from a file.
fn construction_in(file: &Path, version: TwinVersion) -> anyhow::Result<Construction> {
    let text = std::fs::read_to_string(file)
        .with_context(|| format!("{}: cannot read", file.display()))?;
    let mut numbers = serde_json::to_value(Construction::of(version))?;
    let other: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(&text).with_context(|| format!("{}", file.display()))?;
    for (name, value) in other {
        numbers[name] = value;
    }
    serde_json::from_value(numbers).with_context(|| format!("{}", file.display()))
}

/// Generates the twin.
pub fn run(arguments: &TwinArgs) -> anyhow::Result<ExitCode> {
    let default = TwinConfig::default();
    let config = TwinConfig {
        version: arguments.twin_version.unwrap_or(default.version),
        materials: arguments.materials.unwrap_or(default.materials),
        sweeps: arguments.sweeps.unwrap_or(default.sweeps),
        steps: arguments.steps.unwrap_or(default.steps),
        seed: arguments.seed.unwrap_or(default.seed),
        difficulty: arguments.difficulty.unwrap_or(default.difficulty),
        contact_force: arguments.contact_force.unwrap_or(default.contact_force),
        speed: arguments.speed.unwrap_or(default.speed),
    };
    if let Some(out) = &arguments.out {
        output::refuse_to_overwrite(out, arguments.force)?;
    }
    let construction = match &arguments.construction {
        None => Construction::of(config.version),
        Some(file) => construction_in(file, config.version)?,
    };
    let twin = twin::generate_with(&config, &construction)?;
    if arguments.stats {
        let mut targets = Target::of_signal(&measure(&twin));
        targets.extend(Target::of_training(twin.sha256())?);
        if arguments.json {
            output::print_json(&Statistics {
                schema_version: 1,
                git: GIT,
                config: &config,
                construction: &construction,
                data_sha256: twin.sha256(),
                targets: &targets,
            })?;
        } else {
            output::print(TargetTable {
                name: twin.name(),
                targets: &targets,
            })?;
        }
    }
    if let Some(out) = &arguments.out {
        Format::from_extension(out)?.write(out, &twin)?;
        say!(
            "{}: {} synthetic sweeps ({})",
            out.display(),
            twin.len(),
            twin.shape()
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// Table of targets, one a line; a missed one is marked `*`.
struct TargetTable<'a> {
    /// Name of the measured data set, which is the column's heading.
    name: &'a str,
    targets: &'a [Target],
}

impl fmt::Display for TargetTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heading = |f: &mut fmt::Formatter<'_>, title, target| {
            write!(f, "{title:<50}{target:>10}{:>10}{:>10}", "+-", self.name)
        };
        heading(f, "", "TactMat")?;
        let trained = |target: &Target| target.source == TargetSource::Recorded;
        let first_trained = self.targets.iter().position(trained);
        for (number, target) in self.targets.iter().enumerate() {
            if Some(number) == first_trained {
                f.write_str("\n")?;
                // Not all of these targets are published.
                heading(f, "trained classifiers, means of those recorded", "wanted")?;
            }
            let mark = if target.met { "" } else { " *" };
            write!(
                f,
                "\n{:<50}{:>10.3}{:>10.3}{:>10.3}{mark}",
                target.name,
                target.target,
                target.tolerance,
                target.value.unwrap_or(f64::NAN)
            )?;
        }
        Ok(())
    }
}
