//! `tactnet eval`: judges a trained classifier again, on its own test sweeps or on another data set.

mod runtime;
mod verdicts;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use serde::Serialize;
use tactnet_data::{Dataset, Seed, SplitManifest, SweepView};
use tactnet_pipeline::{
    Classifier, Evaluation, RunConfig, RunDir, evaluate_all_ways, without_sweeps_of,
};

use crate::train::DeviceChoice;
use crate::{GIT, output, report, source};
use runtime::{Compared, RuntimeChoice, compare};
use verdicts::{Verdicts, by_known_material};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet eval runs/twin-fast-fold0-1                       its own test sweeps\n  \
    tactnet eval runs/twin-fast-fold0-1 --sweeps 5 --mc 500   five sweeps fused, 500 Monte Carlo runs\n  \
    tactnet eval runs/a --data other.h5                  every sweep of another data set\n  \
    tactnet eval runs/a --runtime online                  frame by frame, as `tactnet serve` does")]
pub struct EvalArgs {
    /// A run directory
    #[arg(value_name = "DIR")]
    run: PathBuf,
    /// Another data set: all of its sweeps are tested, but for training and enrolled sweeps; after `train --calibrate` it may hold
    /// unknown materials [default: the run's own test sweeps]
    #[arg(long, value_name = "FILE|twin")]
    data: Option<String>,
    /// Sweeps of one material that are fused into one decision
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    sweeps: u32,
    /// Runs of Monte Carlo dropout [default: the recipe's, or 100]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..))]
    mc: Option<u32>,
    /// What computes the scores; others than Burn are compared with it
    #[arg(long, value_enum)]
    runtime: Option<RuntimeChoice>,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct EvalResult {
    schema_version: u32,
    run: String,
    git: &'static str,
    seed: Seed,
    split_sha256: String,
    /// False while the run has not ended; the weights are then those of its last checkpoint.
    finished: bool,
    data: String,
    data_sha256: String,
    tested: String,
    n_test: usize,
    evaluations: BTreeMap<String, Evaluation>,
    /// By way of predicting; only with another runtime than Burn.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    runtimes: BTreeMap<String, Compared>,
    /// Only after `train --calibrate`.
    #[serde(skip_serializing_if = "Option::is_none")]
    verdicts: Option<Verdicts>,
}

/// Runs the command.
pub fn run(arguments: EvalArgs) -> anyhow::Result<ExitCode> {
    let run = RunDir::open(&arguments.run)?;
    let config = run.config()?;
    let manifest = run.split()?;
    let device = arguments.device.compute().open()?;
    let weights = run.weights()?;
    let finished = run.has_final_weights();
    if !finished {
        eprintln!("this run has not ended: judging the weights of its last checkpoint");
    }
    let classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    let data = arguments.data.as_deref().unwrap_or(&config.data);
    let dataset = source::load_part(data, config.steps, config.label_order, config.seed)?;
    let (view, tested) = if dataset.sha256() == config.data_sha256 {
        let test = manifest.fold(&dataset)?.test;
        (SweepView::clone(&test), "test split of the run".to_string())
    } else {
        unseen_sweeps(&dataset, &config, &manifest)?
    };
    let enrolled: Vec<usize> = run
        .enrolled()?
        .into_iter()
        .filter(|material| material.data_sha256 == dataset.sha256())
        .flat_map(|material| material.sweeps)
        .collect();
    let left = view
        .indices()
        .iter()
        .copied()
        .filter(|index| !enrolled.contains(index));
    let (view, tested) = match view.len() - left.clone().count() {
        0 => (view, tested),
        dropped => (
            SweepView::new(&dataset, left.collect()),
            format!("{tested}, but {dropped} that were enrolled"),
        ),
    };
    if view.is_empty() {
        bail!(
            "{}: no sweep that the classifier has not been trained on",
            dataset.name()
        );
    }
    let mc_samples = arguments
        .mc
        .map_or(config.recipe.method().mc_samples_or(100), |mc| mc as usize);
    let sweeps = arguments.sweeps as usize;
    let (known, unknown) = by_known_material(&classifier, &view);
    let verdicts = Verdicts::of(&run, &classifier, &known, &unknown)?;
    // Materials that it does not know are an error unless it can say so.
    let judged = if verdicts.is_some() { &known } else { &view };
    let mut runtimes = BTreeMap::new();
    let evaluations = if judged.is_empty() {
        BTreeMap::new()
    } else {
        evaluate_all_ways(&classifier, judged, mc_samples, sweeps, config.seed)?
            .into_iter()
            .map(|(name, burn, evaluation)| {
                let evaluation = match arguments.runtime {
                    None => evaluation,
                    Some(runtime) => {
                        let (found, compared) = compare(runtime, &classifier, judged, &burn)?;
                        runtimes.insert(name.to_string(), compared);
                        Evaluation::of(&found, sweeps, config.seed)
                    }
                };
                Ok((name.to_string(), evaluation))
            })
            .collect::<anyhow::Result<_>>()?
    };
    let result = EvalResult {
        schema_version: 1,
        run: arguments.run.display().to_string(),
        git: GIT,
        seed: config.seed,
        split_sha256: manifest.sha256,
        finished,
        data: dataset.name().into(),
        data_sha256: dataset.sha256().into(),
        tested,
        n_test: view.len(),
        evaluations,
        runtimes,
        verdicts,
    };
    if arguments.json {
        output::print_json(&result)?;
    } else {
        output::print(format_args!(
            "{}: {} ({} sweeps)",
            result.data, result.tested, result.n_test
        ))?;
        report::print_evaluations(&result.evaluations)?;
        for (way, compared) in &result.runtimes {
            output::print(format_args!("{way}: {compared}"))?;
        }
        if let Some(verdicts) = &result.verdicts {
            verdicts.print()?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The sweeps of a data set without those that the classifier was trained on, and what they are.
pub(crate) fn unseen_sweeps<'a>(
    dataset: &'a Dataset,
    config: &RunConfig,
    manifest: &SplitManifest,
) -> anyhow::Result<(SweepView<'a>, String)> {
    let all = SweepView::all(dataset);
    let own = source::load_part(&config.data, config.steps, config.label_order, config.seed)
        .ok()
        .filter(|own| own.sha256() == config.data_sha256);
    let Some(own) = own else {
        let note =
            "every sweep; the training data is not at hand, so training sweeps may be among them";
        eprintln!("{}: {note}", dataset.name());
        return Ok((all, note.into()));
    };
    let (unseen, dropped) = without_sweeps_of(&all, &manifest.fold(&own)?.train);
    Ok((
        unseen,
        format!("every sweep but {dropped} of the training set"),
    ))
}
