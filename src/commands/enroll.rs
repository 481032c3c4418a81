//! `tactnet enroll`: adds a material to a trained classifier from a few sweeps.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;
use tactnet_data::{SweepView, known_names, refuse_errors};
use tactnet_models::Compute;
use tactnet_pipeline::{
    Calibration, Classifier, Enrolled, EnrolledMaterial, EnrolmentCost, PredictionMethod, RowPrior,
    RunConfig, RunDir, TestSweeps, enroll,
};

use super::choices::{DeviceChoice, rate};
use super::run_choice::RunChoice;
use crate::{GIT, output, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet enroll runs/a --data new.h5 --material felt --sweeps 5 --out runs/a-felt     its first five sweeps in the file\n  \
    tactnet enroll runs/a --data new.h5 --material felt --out runs/a-felt-all            every sweep of it\n  \
    tactnet eval runs/a-felt --data new.h5                                               judge by the file's other sweeps\n\n\
    Network and other rows of the output layer stay bit for bit; only sweeps that the new material now claims change their most probable \
    material (`tactnet experiment run enrolment` measures how many). After `train --calibrate`, thresholds for \"unknown\" are fitted again. \
    RUN must be a network whose training has ended. To be judged, a classifier that is not calibrated must know every material of the file.")]
pub struct EnrollArgs {
    #[command(flatten)]
    run: RunChoice,
    /// A data set that holds sweeps of the new material, or sweeps without materials, which then are all of it
    #[arg(long, value_name = "FILE|twin")]
    data: String,
    /// Frames per second, for data that does not say [default: what the run was trained on]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Only the first N time steps of every sweep [default: as the run was trained]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    steps: Option<u32>,
    /// The new material's name, in that data set where it names materials
    #[arg(long, value_name = "NAME")]
    material: String,
    /// Learn from its first N sweeps only
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    sweeps: Option<u32>,
    /// New folder for the classifier that knows it
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Print one JSON document instead of a line
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct EnrollResult<'a> {
    schema_version: u32,
    run: String,
    #[serde(flatten)]
    enrolled: &'a EnrolledMaterial,
    materials: usize,
    prior: RowPrior,
    /// Only where sweeps of the known materials were set aside, by `train --calibrate`.
    #[serde(skip_serializing_if = "Option::is_none")]
    cost: Option<EnrolmentCost>,
    /// The same on the test sweeps of the run's training; only where none were set aside and its data are at hand.
    #[serde(skip_serializing_if = "Option::is_none")]
    test_cost: Option<EnrolmentCost>,
    /// Embedding, fit and writing, without loading data and network.
    seconds: f64,
}

/// Runs the command.
pub fn run(arguments: &EnrollArgs) -> anyhow::Result<ExitCode> {
    let run = RunDir::open(arguments.run.dir())?;
    let config = run.config()?;
    config.require_network(arguments.run.dir(), "learn a new material")?;
    let weights = run.final_weights()?;
    let known = run.train_embeddings()?;
    let device = Compute::from(arguments.device).open()?;
    let classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    let known_sweeps = &config.classifier;
    source::announce(&arguments.data);
    let mut spec = config.spec.clone();
    spec.rate_hz = arguments.rate;
    if let Some(steps) = arguments.steps {
        spec.steps = Some(steps as usize);
    }
    let in_file = |error| source::in_file(&arguments.data, arguments.rate, error);
    let read = spec
        .read_to_classify(
            &arguments.data,
            known_sweeps.shape,
            known_sweeps.sample_rate_hz,
        )
        .map_err(|error| in_file(error.into()))?;
    let dataset = read.dataset;
    if read.labelled {
        refuse_errors(&dataset, &arguments.data)?;
    }
    // Without labels all sweeps are of the material that was named.
    let found = match read.labelled {
        false => Some(0),
        true => dataset
            .labels()
            .names()
            .position(|name| name == arguments.material),
    };
    let Some(label) = found else {
        bail!(
            "{}: no material `{}`; it holds {}",
            arguments.data,
            arguments.material,
            known_names(&arguments.material, dataset.labels().names())
        );
    };
    let own = (0..dataset.len()).filter(|index| dataset.records()[*index].label == label);
    let sweeps: Vec<usize> = match arguments.sweeps {
        None => own.collect(),
        Some(wanted) => {
            let found = own.clone().count();
            if found < wanted as usize {
                bail!(
                    "{}: `{}` has {found} sweeps, {wanted} were asked for",
                    arguments.data,
                    arguments.material
                );
            }
            own.take(wanted as usize).collect()
        }
    };
    let begun = Instant::now();
    let view = SweepView::new(&dataset, sweeps.clone());
    let thresholds = run.thresholds(&classifier)?;
    let taken_for = taken_for(&classifier, &view);
    let enrolled = enroll(
        &classifier,
        &known,
        thresholds.as_ref(),
        &view,
        &arguments.material,
    )
    .map_err(in_file)?;
    let material = EnrolledMaterial::new(&arguments.material, &view, &weights, GIT)?;
    run.create_enrolled(&arguments.out, &enrolled, material.clone())
        .context("cannot write the new classifier")?;
    let seconds = begun.elapsed().as_secs_f64();
    let test_cost = match &thresholds {
        None => cost_on_test_sweeps(&run, &config, &classifier, &enrolled),
        Some(_) => None,
    };
    if let Some(cost) = enrolled.cost.or(test_cost) {
        say!(
            "of {} of the known materials {} are recognised, {} were before; {} taken for `{}`",
            match enrolled.cost {
                Some(_) => format!("{} set aside", output::counted(cost.held_out, "sweep")),
                None => output::counted(cost.held_out, "test sweep"),
            },
            cost.right_after,
            cost.right_before,
            match cost.claimed {
                1 => "1 is".into(),
                claimed => format!("{claimed} are"),
            },
            arguments.material
        );
    } else if thresholds.is_none() {
        say!(
            "hint: what it costs the known materials is not known, since the run's data are not at hand; `tactnet eval {} --data FILE` counts, on its test sweeps",
            arguments.out.display()
        );
    }
    if thresholds.is_some_and(|thresholds| thresholds.held_out.is_none()) {
        say!(
            "thresholds for \"unknown\" are those from before, and most likely too strict now: this run did not keep the sweeps that they were \
             fitted to; train anew with --calibrate"
        );
    }
    say_what_is_known(&run, &config, &view, taken_for);
    if let Some(note) = enrolled.prior.note() {
        say!("note: {note}");
    }
    if let Some(caution) = enrolled.cost.or(test_cost).and_then(|cost| cost.caution()) {
        say!("warning: {caution}");
    }
    if let Some(caution) = enrolled.calibration.as_ref().and_then(Calibration::caution) {
        say!("hint: {caution}");
    }
    let materials = enrolled.config.labels.len();
    if arguments.json {
        output::print_json(&EnrollResult {
            schema_version: 1,
            run: arguments.out.display().to_string(),
            enrolled: &material,
            materials,
            prior: enrolled.prior,
            cost: enrolled.cost,
            test_cost,
            seconds,
        })?;
    } else {
        output::print(format_args!(
            "`{}` learnt from {} in {seconds:.2} s; {} knows {materials} materials",
            arguments.material,
            output::counted(material.sweeps.len(), "sweep"),
            arguments.out.display()
        ))?;
    }
    let out = tactnet_pipeline::quoted(&arguments.out.display().to_string());
    say!(
        "next: `tactnet eval {out} --data FILE` tests it on other sweeps whose materials are named\n      `tactnet demo --run {out} --data FILE` shows it live on them"
    );
    Ok(ExitCode::SUCCESS)
}

/// Returns the known material that most of the sweeps were taken for, and how many.
fn taken_for(classifier: &Classifier, view: &SweepView<'_>) -> Option<(String, usize)> {
    let found = classifier
        .log_probabilities(view, PredictionMethod::Plain)
        .ok()?;
    let labels = &classifier.config().labels;
    let mut counts = vec![0; labels.len()];
    for of_sweep in found {
        let best = (0..of_sweep.len()).max_by(|&a, &b| of_sweep[a].total_cmp(&of_sweep[b]))?;
        counts[best] += 1;
    }
    let most = (0..counts.len()).max_by_key(|&label| counts[label])?;
    let name = labels.names().nth(most)?;
    Some((name.to_owned(), counts[most]))
}

/// Says where the new material is most likely none: nearly all of its sweeps were taken for a known one. Only then it is worth reading what the
/// run was trained on, to say whether they are training sweeps.
fn say_what_is_known(
    run: &RunDir,
    config: &RunConfig,
    view: &SweepView<'_>,
    taken_for: Option<(String, usize)>,
) {
    let Some((known, count)) = taken_for.filter(|(_, count)| 5 * count >= 4 * view.len()) else {
        return;
    };
    let all = output::counted(view.len(), "sweep");
    say!("hint: {count} of {all} were taken for `{known}` so far; is it that material?");
    let Ok(manifest) = run.split() else { return };
    let Ok(unseen) = TestSweeps::unseen(view.dataset(), config, &manifest) else {
        return;
    };
    let unseen: BTreeSet<usize> = unseen.view.indices().iter().copied().collect();
    let seen = |index: &&usize| !unseen.contains(index);
    match view.indices().iter().filter(seen).count() {
        0 => {}
        seen => {
            say!("warning: the run was trained on {seen} of these {all}, under another name");
        }
    }
}

/// Returns what the known materials lose on the test sweeps of the run's training; `None` where its data set is not at hand.
fn cost_on_test_sweeps(
    run: &RunDir,
    config: &RunConfig,
    classifier: &Classifier,
    enrolled: &Enrolled,
) -> Option<EnrolmentCost> {
    let dataset = config.spec.read_sweeps_of_run(None).ok()?;
    if dataset.sha256() != config.data_sha256 {
        return None;
    }
    let tested = TestSweeps::of_run(run, &dataset).ok()?;
    enrolled.cost_on(classifier, &tested.view).ok()
}
