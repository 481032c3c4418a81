//! `tactnet adapt`: adapts a trained classifier to another skin, robot or day.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;
use tactnet_data::{Dataset, SweepView};
use tactnet_models::Compute;
use tactnet_pipeline::{
    AdaptRisk, Adaptation, Adapted, Classifier, ModelConfig, NewSweeps, RiskPolicy, RunConfig,
    RunDir, adapt,
};

use super::choices::{DeviceChoice, rate};
use super::run_choice::RunChoice;
use crate::output::OutputFormat;
use crate::{GIT, output, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet adapt runs/a --data today.npz --out runs/today                        unlabelled sweeps of the new skin\n  \
    tactnet adapt runs/a --labelled five.npz --per-material 5 --out runs/five     five labelled sweeps of each material\n  \
    tactnet adapt runs/a --data today.npz --labelled five.npz --out runs/both     both\n  \
    tactnet eval runs/today --data labelled.npz                                   evaluate it on the new skin\n\n\
    Unlabelled sweeps set the scaling and the running statistics of a network, or the scaling of a baseline's features; a change counts as far as it \
    exceeds chance. The sweeps must be of all materials in about equal numbers, 16 or more. Fewer than 8, or sweeps of few materials, are refused: \
    what is special about these materials would be taken for a change of the skin. Sweeps like another recording on the skin of training are \
    refused, too: on such sweeps only labels help.\n\n\
    Labelled sweeps also fit the output layer of a network, of linear discriminants or of a ridge classifier, with the old layer as prior. \
    All other weights are unchanged bit for bit. The members of a committee adapt one by one; those that cannot are left out and named.")]
pub struct AdaptArgs {
    #[command(flatten)]
    run: RunChoice,
    /// Sweeps of the new skin, robot or day; labels are ignored
    #[arg(long, value_name = "FILE", required_unless_present = "labelled")]
    data: Option<String>,
    /// Labelled sweeps of the new skin, robot or day
    #[arg(long, value_name = "FILE")]
    labelled: Option<String>,
    /// Number of labelled sweeps of each material to use, from the first [default: all]
    #[arg(long, value_name = "N", requires = "labelled", value_parser = clap::value_parser!(u32).range(1..))]
    per_material: Option<u32>,
    /// Sample rate, in Hz; takes precedence over that of the data [default: the run's sample rate]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Number of time steps of each sweep to use, from its start [default: as in training]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    steps: Option<u32>,
    /// Adapt to few sweeps, to sweeps of few materials, or to another recording on the same skin
    #[arg(long)]
    accept_risk: bool,
    /// New folder for the adapted classifier
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Compute device
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Print one JSON document instead of a line
    #[arg(long)]
    json: bool,
}

/// Document of `--json`.
#[derive(Serialize)]
struct AdaptResult<'a> {
    schema_version: u32,
    run: String,
    #[serde(flatten)]
    adaptation: &'a Adaptation,
}

/// Adapts the classifier.
pub fn run(arguments: &AdaptArgs) -> anyhow::Result<ExitCode> {
    let run = RunDir::open(arguments.run.dir())?;
    let config = run.config()?;
    let weights = run.final_weights()?;
    let device = Compute::from(arguments.device).open()?;
    let classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    let unlabelled = arguments.data.as_deref();
    let unlabelled = unlabelled
        .map(|data| read(arguments, &config, data))
        .transpose()?;
    let labelled = arguments.labelled.as_deref();
    let labelled = labelled
        .map(|data| read_labelled(arguments, &config, data))
        .transpose()?;
    let views = [&unlabelled, &labelled].map(|sweeps| {
        let sweeps = sweeps.as_ref();
        sweeps.map(|(dataset, indices)| SweepView::new(dataset, indices.clone()))
    });
    let new = NewSweeps {
        unlabelled: views[0].as_ref(),
        labelled: views[1].as_ref(),
    };
    let policy = match arguments.accept_risk {
        true => RiskPolicy::Accept,
        false => RiskPolicy::Refuse,
    };
    let first = arguments.data.as_ref().or(arguments.labelled.as_ref());
    let adapted = adapt(&classifier, run.likeness()?.as_ref(), new, policy).map_err(|error| {
        let file = first.map_or("", String::as_str);
        source::in_file(file, arguments.rate, error)
    })?;
    let adaptation = Adaptation::new(&adapted, new, &weights, GIT)?;
    print_notes(&adapted, &run, &views[1])?;
    run.create_adapted(&arguments.out, adapted, adaptation.clone())
        .context("cannot write the new classifier")?;
    let result = AdaptResult {
        schema_version: 1,
        run: arguments.out.display().to_string(),
        adaptation: &adaptation,
    };
    let code = OutputFormat::from_flag(arguments.json)
        .report(&result, |result| output::print(text(result, &config)))?;
    let out = tactnet_pipeline::quoted(&arguments.out.display().to_string());
    say!("next: `tactnet eval {out} --data FILE` evaluates it on labelled sweeps of the new skin");
    Ok(code)
}

/// Returns the lines of the result.
fn text(result: &AdaptResult<'_>, config: &RunConfig) -> String {
    let Adaptation {
        presence, shift, ..
    } = result.adaptation;
    let first = match &config.classifier.model {
        ModelConfig::Committee(members) => members.first().map(|member| &member.model),
        model => Some(model),
    };
    let what = match first {
        Some(ModelConfig::Network(_)) => "the taxels",
        _ => "the features",
    };
    let seen = match result.adaptation.unlabelled {
        Some(_) => "predicted",
        None => "labelled",
    };
    let diversity = presence.diversity.map_or(String::new(), |share| {
        let percent = 100.0 * share.clamp(0.0, 1.0);
        format!("; they show {percent:.0} % of the differences between materials")
    });
    format!(
        "{} adapted to {}: {what} shifted by {:.2} training spreads, their spreads by a factor of {:.2} (root mean square, beyond chance)\n\
         {} of {} materials {seen}, the most frequent in {:.0} % of the sweeps{diversity}",
        result.run,
        output::counted(presence.sweeps, "sweep"),
        shift.level,
        shift.spread.exp(),
        presence.materials,
        presence.known,
        100.0 * presence.largest_share,
    )
}

/// Prints warnings, and what the new run lacks.
fn print_notes(
    adapted: &Adapted,
    run: &RunDir,
    labelled: &Option<SweepView<'_>>,
) -> anyhow::Result<()> {
    for risk in &adapted.risks {
        say!("warning: {risk}");
        if let AdaptRisk::FewSweeps { .. } = risk {
            say!("hint: sweeps without labels can be added with --data");
        }
    }
    for member in &adapted.left_out {
        say!(
            "note: the adapted committee lacks `{}`: {}",
            member.name,
            member.reason
        );
    }
    if let Some(labelled) = labelled {
        let own = labelled.dataset().labels();
        let named: Vec<&str> = labelled.labels().map(|label| own.name(label)).collect();
        let known = adapted.config.labels.names();
        let missing: Vec<&str> = known.filter(|name| !named.contains(name)).collect();
        if !missing.is_empty() {
            say!(
                "warning: no labelled sweep of {}; predictions of {} become rarer",
                missing.join(", "),
                if missing.len() == 1 { "it" } else { "these" }
            );
        }
    }
    if run.calibration()?.is_some() {
        say!(
            "note: the thresholds for \"unknown\" are left out, because they were fitted to sweeps of the training skin"
        );
    }
    Ok(())
}

/// Returns all sweeps of a file.
fn read(
    arguments: &AdaptArgs,
    config: &RunConfig,
    data: &str,
) -> anyhow::Result<(Dataset, Vec<usize>)> {
    let (dataset, _) = read_to_classify(arguments, config, data)?;
    let all = (0..dataset.len()).collect();
    Ok((dataset, all))
}

/// Returns the labelled sweeps to use.
fn read_labelled(
    arguments: &AdaptArgs,
    config: &RunConfig,
    data: &str,
) -> anyhow::Result<(Dataset, Vec<usize>)> {
    let (dataset, labelled) = read_to_classify(arguments, config, data)?;
    if !labelled {
        bail!("{data}: --labelled expects a material for every sweep; --data takes sweeps without");
    }
    let mut counts = vec![0; dataset.labels().len()];
    let wanted = arguments.per_material.unwrap_or(u32::MAX);
    let is_used = |index: &usize| {
        let count: &mut u32 = &mut counts[dataset.records()[*index].label];
        *count = count.saturating_add(1);
        *count <= wanted
    };
    let used = (0..dataset.len()).filter(is_used).collect();
    Ok((dataset, used))
}

/// Reads a file; also returns true if it names the materials.
fn read_to_classify(
    arguments: &AdaptArgs,
    config: &RunConfig,
    data: &str,
) -> anyhow::Result<(Dataset, bool)> {
    source::announce(data);
    let mut spec = config.spec.clone();
    spec.rate_hz = arguments.rate;
    if let Some(steps) = arguments.steps {
        spec.steps = Some(steps as usize);
    }
    let known = &config.classifier;
    let read = spec
        .read_to_classify(data, known)
        .map_err(|error| source::in_file(data, arguments.rate, error))?;
    source::warn_of_findings(read.dataset.reading_findings());
    Ok((read.dataset, read.labelled))
}
