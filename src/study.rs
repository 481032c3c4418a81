//! `tactnet study`: one task of an experiment whose question is more than one training. Experiments call it; people call
//! `tactnet experiment run`.

use std::cell::Cell;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::Args;
use tactnet_data::{Seed, refuse_errors};
use tactnet_experiments::{StudyTask, run_study};
use tactnet_models::Compute;
use tactnet_pipeline::{
    BatchReport, LabelOrder, ModelRecipe, Provenance, Recipe, RunDir, write_whole,
};

use crate::commands::choices::{DeviceChoice, LevelsChoice};
use crate::stop::Stop;
use crate::{GIT, failure, output, source};

/// How often progress is told.
const EVERY: Duration = Duration::from_secs(10);

#[derive(Args)]
pub struct StudyArgs {
    /// A data set, or `twin`
    #[arg(long, value_name = "FILE|twin", default_value = source::TWIN)]
    data: String,
    /// How its networks are trained
    #[arg(long, value_name = "NAME|FILE", default_value = "fast")]
    recipe: String,
    /// Whether levels may be used [default: the recipe's]
    #[arg(long, value_enum)]
    levels: Option<LevelsChoice>,
    /// Only the first N time steps of every sweep
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Train this many epochs instead of the recipe's
    #[arg(long, value_name = "N")]
    epochs: Option<usize>,
    /// The question, as JSON
    #[arg(long, value_name = "JSON")]
    task: String,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Folder for result.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Runs the command.
pub fn run(arguments: &StudyArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen()?;
    let task: StudyTask =
        serde_json::from_str(&arguments.task).context("--task: expected a study's task as JSON")?;
    let mut recipe = ModelRecipe::load(&arguments.recipe)?;
    if let Some(levels) = arguments.levels {
        recipe = recipe.with_levels(levels.into());
    }
    let ModelRecipe::TactNet2(mut recipe) = recipe else {
        bail!("recipe `{}`: a study needs a network", arguments.recipe);
    };
    if let Some(epochs) = arguments.epochs {
        recipe.training.epochs = epochs;
        recipe = Recipe::parse("--epochs", &recipe.to_toml())?;
    }
    let device = Compute::from(arguments.device).open()?;
    let _lock = RunDir::lock(&arguments.out)?;
    let dataset = source::load_part(
        &arguments.data,
        arguments.steps,
        LabelOrder::True,
        Seed(task.seed),
    )?;
    refuse_errors(&dataset, &arguments.data)?;
    let told = Cell::new(Instant::now());
    let go_on = |what: &str, batch: Option<&BatchReport>| {
        if batch.is_none() || told.get().elapsed() > EVERY {
            told.set(Instant::now());
            match batch {
                None => eprintln!("{what}"),
                Some(batch) => eprintln!(
                    "{what}: epoch {}, batch {} of {}",
                    batch.epoch + 1,
                    batch.batch + 1,
                    batch.batches
                ),
            }
        }
        !stop.asked()
    };
    let provenance = Provenance::of_this_process(env!("CARGO_PKG_VERSION"), GIT);
    let Some(result) = run_study(&task, &dataset, &recipe, &device, provenance, go_on)? else {
        eprintln!("stopped; the task starts over when it is run again");
        return Ok(ExitCode::from(failure::INTERRUPTED));
    };
    let mut text = serde_json::to_string_pretty(&result).context("cannot write the result")?;
    text.push('\n');
    write_whole(&arguments.out.join("result.json"), text.as_bytes())?;
    output::print(format_args!(
        "{}",
        arguments.out.join("result.json").display()
    ))?;
    Ok(ExitCode::SUCCESS)
}
