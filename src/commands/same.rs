//! `tactnet same`: compares the materials of two objects.

use std::collections::BTreeSet;
use std::fs::canonicalize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::Args;
use tactnet_data::format::Keep;
use tactnet_pipeline::{ClassifiedSweeps, SameMaterial, quoted};

use super::choices::{DeviceChoice, rate, steps_or_all};
use super::run_classifier::RunClassifier;
use super::{classified_text, same_text};
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(override_usage = "tactnet same [OPTIONS] <RUN> <FIRST> <SECOND>")]
#[command(after_help = "Examples:\n  \
    tactnet same runs/a cup.npz plate.npz        each file has one or more sweeps of one object\n  \
    tactnet same runs/a cup.csv plates/ --json   a file with one sweep, a folder of sweeps\n\n\
    The result applies Bayes's rule to the posteriors of both objects, with equal priors for same and different. It is valid for trained materials; \
    after `train --calibrate` it also reports an object that is probably unknown. Sweeps count as independent, so more sweeps increase the confidence.\n\
    To measure its accuracy: `tactnet experiment run differentiate`.")]
pub struct SameArgs {
    /// Run directory
    #[arg(value_name = "RUN")]
    run: String,
    /// Sweeps of one object: .npz, .npy, .mat, .csv, .parquet, a folder of .csv or .npy, or any data set
    #[arg(value_name = "FIRST")]
    first: String,
    /// Sweeps of the other object
    #[arg(value_name = "SECOND")]
    second: Option<String>,
    #[arg(
        long = "run",
        value_name = "DIR",
        hide = true,
        conflicts_with = "second"
    )]
    named: Option<PathBuf>,
    /// Sample rate, in Hz; takes precedence over that of the data [default: the run's sample rate]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Number of time steps of each sweep to use, from its start, or `all`, which keeps unequal lengths [default: as in training]
    #[arg(long, value_name = "N|all", value_parser = steps_or_all)]
    steps: Option<Keep>,
    /// Number of Monte Carlo dropout samples of a network; 0 disables dropout [default: the recipe's]
    #[arg(long, value_name = "M")]
    mc: Option<u32>,
    /// Compute device
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Print one JSON document instead of lines
    #[arg(long)]
    json: bool,
}

impl SameArgs {
    /// Returns the run directory and the files of both objects. With `--run`, the first two positional arguments are the files.
    fn places(&self) -> anyhow::Result<(&Path, [&str; 2])> {
        Ok(match (&self.named, &self.second) {
            (Some(run), _) => (run.as_path(), [self.run.as_str(), self.first.as_str()]),
            (None, Some(second)) => (Path::new(&self.run), [self.first.as_str(), second.as_str()]),
            (None, None) => bail!(
                "expected a run and two objects (`tactnet same RUN FIRST SECOND`), found {} and {}",
                quoted(&self.run),
                quoted(&self.first)
            ),
        })
    }
}

/// Refuses a file with sweeps of several materials, which are not one object.
fn refuse_several(data: &str, found: &ClassifiedSweeps) -> anyhow::Result<()> {
    let named = found.sweeps.iter();
    let materials: BTreeSet<&str> = named.filter_map(|sweep| sweep.named.as_deref()).collect();
    if materials.len() > 1 {
        bail!(
            "{data}: expected sweeps of one object, found {} materials; write the sweeps of each object into a file of its own \
             (`X` alone is enough)",
            materials.len()
        );
    }
    Ok(())
}

/// Returns true if both names refer to the same file.
fn is_one_file(first: &str, second: &str) -> bool {
    let real = |data: &str| canonicalize(data).ok();
    first == second || real(first).is_some_and(|first| real(second) == Some(first))
}

/// Prints the comparison.
pub fn run(arguments: &SameArgs) -> anyhow::Result<ExitCode> {
    let (run, [first, second]) = arguments.places()?;
    let classifier = RunClassifier::open(run, arguments.mc, arguments.device)?;
    let classify = |data: &str| {
        let found = classifier.classify(data, arguments.rate, arguments.steps, true)?;
        refuse_several(data, &found)?;
        anyhow::Ok(found)
    };
    let both = [classify(first)?, classify(second)?];
    let hints: BTreeSet<String> = both.iter().filter_map(classified_text::hint).collect();
    for hint in hints {
        say!("hint: {hint}");
    }
    if is_one_file(first, second) {
        say!("note: `{first}` and `{second}` are the same sweeps");
    }
    let same = SameMaterial::of(both).context("both were classified as one object")?;
    OutputFormat::from_flag(arguments.json)
        .report(&same, |same| output::print(same_text::text(same)))
}
