//! `tactnet enroll`: adds a material to a trained classifier from a few sweeps.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;
use tactnet_data::format::Keep;
use tactnet_data::{Dataset, SweepView, known_names, refuse_errors};
use tactnet_models::Compute;
use tactnet_pipeline::{
    Calibration, Classifier, Enrolled, EnrolledMaterial, EnrolmentCost, LeftOutMember, ModelConfig,
    PipelineError, PredictionMethod, RowPrior, RunConfig, RunDir, TestSweeps, Thresholds, enroll,
};

use super::choices::{DeviceChoice, rate, steps_or_all};
use super::run_choice::RunChoice;
use crate::{GIT, output, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet enroll runs/a --data new.h5 --material felt --sweeps 5 --out runs/a-felt     the first five sweeps of the material\n  \
    tactnet enroll runs/a --data new.h5 --material felt --out runs/a-felt-all            all sweeps of the material\n  \
    tactnet eval runs/a-felt --data new.h5                                               evaluate on the remaining sweeps\n\n\
    The network and the other rows of the output layer are unchanged bit for bit. Only sweeps predicted as the new material change their prediction \
    (`tactnet experiment run enrolment` measures how many). After `train --calibrate`, the thresholds for \"unknown\" are fitted again. \
    The run must be a network or committee with completed training. A committee needs its data set again: its networks learn the material as above, \
    its baselines are fitted again, and members with too few sweeps are left out and named. To evaluate an uncalibrated classifier, it must know every material of the file.")]
pub struct EnrollArgs {
    #[command(flatten)]
    run: RunChoice,
    /// Data set with sweeps of the new material; sweeps without labels all count as the new material
    #[arg(long, value_name = "FILE|twin")]
    data: String,
    /// Sample rate, in Hz; takes precedence over that of the data [default: the run's sample rate]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Number of time steps of each sweep to use, from its start, or `all`, which keeps unequal lengths [default: as in training]
    #[arg(long, value_name = "N|all", value_parser = steps_or_all)]
    steps: Option<Keep>,
    /// Name of the new material, as in a labelled data set
    #[arg(long, value_name = "NAME")]
    material: String,
    /// Number of sweeps to enroll, from the first [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    sweeps: Option<u32>,
    /// New folder for the extended classifier
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
struct EnrollResult<'a> {
    schema_version: u32,
    run: String,
    #[serde(flatten)]
    enrolled: &'a EnrolledMaterial,
    materials: usize,
    /// Absent for a committee.
    #[serde(skip_serializing_if = "Option::is_none")]
    prior: Option<RowPrior>,
    /// Members that the new committee lacks.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    left_out: &'a [LeftOutMember],
    /// Present if the run has held-out sweeps of the known materials, from `train --calibrate`.
    #[serde(skip_serializing_if = "Option::is_none")]
    cost: Option<EnrolmentCost>,
    /// The same on the run's test sweeps. Present if no sweeps were held out and the data set is available.
    #[serde(skip_serializing_if = "Option::is_none")]
    test_cost: Option<EnrolmentCost>,
    /// Time for embedding, fitting and writing, in s; loading is not included.
    seconds: f64,
}

/// Enrolls the material.
pub fn run(arguments: &EnrollArgs) -> anyhow::Result<ExitCode> {
    let run = RunDir::open(arguments.run.dir())?;
    let config = run.config()?;
    config.require_network_or_committee(arguments.run.dir(), "learn a new material")?;
    let weights = run.final_weights()?;
    let device = Compute::from(arguments.device).open()?;
    let classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    let (dataset, sweeps) = read_sweeps(arguments, &config)?;
    let begun = Instant::now();
    let view = SweepView::new(&dataset, sweeps);
    let predicted_before = most_predicted(&classifier, &view);
    let (enrolled, thresholds) = extended(&run, &classifier, &view, &arguments.material)
        .map_err(|error| source::in_file(&arguments.data, arguments.rate, error))?;
    let material = EnrolledMaterial::new(&arguments.material, &view, &weights, GIT)?;
    run.create_enrolled(&arguments.out, &enrolled, material.clone(), &view)
        .context("cannot write the new classifier")?;
    let seconds = begun.elapsed().as_secs_f64();
    let test_cost = match (&thresholds, enrolled.cost) {
        (None, None) => cost_on_test_sweeps(&run, &config, &classifier, &enrolled),
        _ => None,
    };
    print_cost(arguments, &enrolled, test_cost, thresholds.as_ref());
    warn_of_known_material(&run, &config, &view, predicted_before);
    print_notes(&enrolled, test_cost);
    let materials = enrolled.config.labels.len();
    if arguments.json {
        output::print_json(&EnrollResult {
            schema_version: 1,
            run: arguments.out.display().to_string(),
            enrolled: &material,
            materials,
            prior: enrolled.prior,
            left_out: &enrolled.left_out,
            cost: enrolled.cost,
            test_cost,
            seconds,
        })?;
    } else {
        output::print(format_args!(
            "`{}` enrolled from {} in {seconds:.2} s; {} knows {materials} materials",
            arguments.material,
            output::counted(material.sweeps.len(), "sweep"),
            arguments.out.display()
        ))?;
    }
    let out = tactnet_pipeline::quoted(&arguments.out.display().to_string());
    say!(
        "next: `tactnet eval {out} --data FILE` evaluates it on other labelled sweeps\n      `tactnet demo --run {out} --data FILE` shows it live"
    );
    Ok(ExitCode::SUCCESS)
}

/// Returns the classifier with the material, and the thresholds of a network before.
fn extended(
    run: &RunDir,
    classifier: &Classifier,
    view: &SweepView<'_>,
    material: &str,
) -> Result<(Enrolled, Option<Thresholds>), PipelineError> {
    if let ModelConfig::Committee(_) = classifier.config().model {
        return Ok((run.enroll_into_committee(classifier, view, material)?, None));
    }
    let (known, thresholds) = (run.train_embeddings()?, run.thresholds(classifier)?);
    let enrolled = enroll(classifier, &known, thresholds.as_ref(), view, material)?;
    Ok((enrolled, thresholds))
}

/// Returns the data set with the indices of the sweeps to enroll.
fn read_sweeps(
    arguments: &EnrollArgs,
    config: &RunConfig,
) -> anyhow::Result<(Dataset, Vec<usize>)> {
    let (data, material) = (&arguments.data, &arguments.material);
    source::announce(data);
    let mut spec = config.spec.clone();
    spec.rate_hz = arguments.rate;
    if let Some(steps) = arguments.steps {
        spec.set_keep(steps);
    }
    let known = &config.classifier;
    let read = spec
        .read_to_classify(data, known)
        .map_err(|error| source::in_file(data, arguments.rate, error))?;
    let dataset = read.dataset;
    source::warn_of_findings(dataset.reading_findings());
    if read.labelled {
        refuse_errors(&dataset, data)?;
    }
    // Without labels all sweeps count as the named material.
    let found = match read.labelled {
        false => Some(0),
        true => dataset.labels().names().position(|name| name == material),
    };
    let Some(label) = found else {
        bail!(
            "{data}: no material `{material}`; it holds {}",
            known_names(material, dataset.labels().names())
        );
    };
    let own = (0..dataset.len()).filter(|index| dataset.records()[*index].label == label);
    let mut sweeps: Vec<usize> = own.collect();
    if let Some(wanted) = arguments.sweeps {
        if sweeps.len() < wanted as usize {
            bail!(
                "{data}: `{material}` has {} sweeps, {wanted} were requested",
                sweeps.len()
            );
        }
        sweeps.truncate(wanted as usize);
    }
    Ok((dataset, sweeps))
}

/// Prints the accuracy change of the known materials, and a warning about unchanged thresholds.
fn print_cost(
    arguments: &EnrollArgs,
    enrolled: &Enrolled,
    test_cost: Option<EnrolmentCost>,
    thresholds: Option<&Thresholds>,
) {
    if let Some(cost) = enrolled.cost.or(test_cost) {
        let kind = match enrolled.cost {
            Some(_) => "held-out sweep",
            None => "test sweep",
        };
        say!(
            "{} of the known materials: {} predicted correctly ({} before), {} predicted as `{}`",
            output::counted(cost.held_out, kind),
            cost.right_after,
            cost.right_before,
            cost.claimed,
            arguments.material
        );
    } else if thresholds.is_none() {
        say!(
            "hint: the effect on the known materials is unknown, because the run's data set is not available; measure it on test sweeps with \
             `tactnet eval {} --data FILE`",
            arguments.out.display()
        );
    }
    if thresholds.is_some_and(|thresholds| thresholds.held_out.is_none()) {
        say!(
            "the thresholds for \"unknown\" are unchanged and probably too strict now, because this run did not keep the sweeps they were fitted to; \
             train again with --calibrate"
        );
    }
}

/// Prints notes about the prior, the cost and the calibration.
fn print_notes(enrolled: &Enrolled, test_cost: Option<EnrolmentCost>) {
    if let Some(note) = enrolled.prior.and_then(RowPrior::note) {
        say!("note: {note}");
    }
    for member in &enrolled.left_out {
        say!(
            "note: the new committee lacks `{}`: {}",
            member.name,
            member.reason
        );
    }
    if let Some(caution) = enrolled.cost.or(test_cost).and_then(|cost| cost.caution()) {
        say!("warning: {caution}");
    }
    if let Some(caution) = enrolled.calibration.as_ref().and_then(Calibration::caution) {
        say!("hint: {caution}");
    }
}

/// Returns the known material predicted for most of the sweeps, and their number.
fn most_predicted(classifier: &Classifier, view: &SweepView<'_>) -> Option<(String, usize)> {
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

/// Prints a hint if nearly all sweeps are predicted as one known material. Only then the training data is read, to warn
/// about training sweeps among them.
fn warn_of_known_material(
    run: &RunDir,
    config: &RunConfig,
    view: &SweepView<'_>,
    predicted: Option<(String, usize)>,
) {
    let Some((known, count)) = predicted.filter(|(_, count)| 5 * count >= 4 * view.len()) else {
        return;
    };
    let all = output::counted(view.len(), "sweep");
    say!("hint: {count} of {all} were predicted as `{known}` before; is it that material?");
    let Ok(manifest) = run.split() else { return };
    let Ok(unseen) = TestSweeps::unseen(view.dataset(), config, &manifest) else {
        return;
    };
    let unseen: BTreeSet<usize> = unseen.view.indices().iter().copied().collect();
    let seen = |index: &&usize| !unseen.contains(index);
    match view.indices().iter().filter(seen).count() {
        0 => {}
        seen => {
            say!("warning: the run was trained on {seen} of these {all} under another label");
        }
    }
}

/// Returns the accuracy change of the known materials on the run's test sweeps; `None` if its data set is not available.
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
