//! `tactnet same`: are two objects of one material?

use std::collections::BTreeSet;
use std::fs::canonicalize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::Args;
use tactnet_pipeline::{ClassifiedSweeps, SameMaterial, quoted};

use super::choices::{DeviceChoice, rate};
use super::run_classifier::RunClassifier;
use crate::output;

#[derive(Args)]
#[command(override_usage = "tactnet same [OPTIONS] <RUN> <FIRST> <SECOND>")]
#[command(after_help = "Examples:\n  \
    tactnet same runs/a cup.npz plate.npz        each file has one or more sweeps of one object\n  \
    tactnet same runs/a cup.csv plates/ --json   a file of one sweep, a folder of them\n\n\
    Bayes's rule on the posteriors of both objects, where same and different are equally likely beforehand. It holds for materials that the run \
    has learnt; after `train --calibrate` it says where one is most likely unknown. Sweeps are taken for independent: more of them make it surer.\n\
    How often it is right: `tactnet experiment run differentiate`.")]
pub struct SameArgs {
    /// A run directory
    #[arg(value_name = "RUN")]
    run: String,
    /// Sweeps of one object: .npz or .npy, .csv, .parquet, a folder of .csv or .npy, or any data set
    #[arg(value_name = "FIRST")]
    first: String,
    /// Sweeps of the other
    #[arg(value_name = "SECOND")]
    second: Option<String>,
    #[arg(
        long = "run",
        value_name = "DIR",
        hide = true,
        conflicts_with = "second"
    )]
    named: Option<PathBuf>,
    /// Frames per second, for data that does not say [default: what the run was trained on]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Only the first N time steps of every sweep [default: as the run was trained]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    steps: Option<u32>,
    /// Runs of Monte Carlo dropout, of a network; 0 for none [default: the recipe's]
    #[arg(long, value_name = "M")]
    mc: Option<u32>,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Print one JSON document instead of lines
    #[arg(long)]
    json: bool,
}

impl SameArgs {
    /// The run directory and the files of both objects: with `--run`, the first two arguments are the files.
    fn places(&self) -> anyhow::Result<(&Path, [&str; 2])> {
        Ok(match (&self.named, &self.second) {
            (Some(run), _) => (run.as_path(), [self.run.as_str(), self.first.as_str()]),
            (None, Some(second)) => (Path::new(&self.run), [self.first.as_str(), second.as_str()]),
            (None, None) => bail!(
                "expected a run and two objects, found two places, {} and {}: `tactnet same RUN FIRST SECOND`",
                quoted(&self.run),
                quoted(&self.first)
            ),
        })
    }
}

/// Refuses a file whose sweeps are of several materials: they are not of one object.
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

/// Returns true if both names lead to one file.
fn is_one_file(first: &str, second: &str) -> bool {
    let real = |data: &str| canonicalize(data).ok();
    first == second || real(first).is_some_and(|first| real(second) == Some(first))
}

/// Runs the command.
pub fn run(arguments: &SameArgs) -> anyhow::Result<ExitCode> {
    let (run, [first, second]) = arguments.places()?;
    let classifier = RunClassifier::open(run, arguments.mc, arguments.device)?;
    let classify = |data: &str| {
        let found = classifier.classify(data, arguments.rate, arguments.steps, true)?;
        refuse_several(data, &found)?;
        anyhow::Ok(found)
    };
    let both = [classify(first)?, classify(second)?];
    let hints: BTreeSet<String> = both.iter().filter_map(ClassifiedSweeps::hint).collect();
    for hint in hints {
        say!("hint: {hint}");
    }
    if is_one_file(first, second) {
        say!("note: `{first}` and `{second}` are the same sweeps");
    }
    let same = SameMaterial::of(both).context("both were classified as one object")?;
    if arguments.json {
        output::print_json(&same)?;
    } else {
        output::print(&same)?;
    }
    Ok(ExitCode::SUCCESS)
}
