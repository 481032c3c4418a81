//! `tactnet distill`: makes one network of a committee.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_data::Finding;
use tactnet_pipeline::{
    ModelRecipe, PipelineError, RunDir, RunResult, Session, TrainJob, TrainSpec, quoted,
};

use super::choices::TrainDeviceChoice;
use super::run_choice::RunChoice;
use super::train::{Conclusion, program, resume_command, train_to_end};
use crate::source::{self, Doubts};
use crate::stop::Stop;
use crate::{device_times, output::OutputFormat};

/// Recipe of a network that learns from a committee.
const RECIPE: &str = "distilled";

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet distill runs/floors-committee --out runs/floors-network      train the network\n  \
    tactnet demo --run runs/floors-network                               serve it frame by frame\n  \
    tactnet export runs/floors-network --out floors.onnx                 or export it\n\n\
    The network learns from the labels and from what the committee says of sweeps that it has not seen, so the committee is trained five more \
    times. Data, fold, seed and calibration are those of the run. `tactnet train --recipe distilled` does the same without a run; a copy of that \
    recipe names another teacher.")]
pub struct DistillArgs {
    #[command(flatten)]
    run: RunChoice,
    /// Current path of the run's data set, if it was moved
    #[arg(long, value_name = "FILE|twin")]
    data: Option<String>,
    /// Folder for the network's run [default: runs/DATA-distilled-FOLD-SEED, with a number appended if it exists]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of epochs of all networks instead of the recipes'
    #[arg(long, value_name = "N")]
    epochs: Option<usize>,
    /// Compute device
    #[arg(long, value_enum, default_value_t)]
    device: TrainDeviceChoice,
    /// Print result.json instead of a table
    #[arg(long)]
    json: bool,
}

/// Trains the network.
pub fn run(arguments: &DistillArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen()?;
    let committee = RunDir::open(arguments.run.dir())?;
    let session = begin(arguments, &committee)?;
    let format = OutputFormat::from_flag(arguments.json);
    let Conclusion { code, result } = train_to_end(&session, &stop, format, false)?;
    if let (Some(network), Some(whole)) = (result, committee.result()?) {
        say!("{}", comparison(&whole, &network));
    }
    Ok(code)
}

fn begin(arguments: &DistillArgs, committee: &RunDir) -> anyhow::Result<Session> {
    let config = committee.config()?;
    let folder = quoted(&committee.path().display().to_string());
    let ModelRecipe::Committee(recipe) = &config.recipe else {
        bail!(
            "{folder}: it is no committee, and only committees are distilled; train one with `tactnet train --model committee`"
        );
    };
    let network = ModelRecipe::load(RECIPE)?;
    if network.teacher().map(ModelRecipe::name) != Some(&recipe.name) {
        bail!(
            "{folder}: the recipe `{RECIPE}` has the built-in committee as its teacher, found `{}`; name yours as `teacher` in a copy \
             (`tactnet train --print-recipe {RECIPE}`) and train that",
            recipe.name
        );
    }
    if !committee.has_final_weights() {
        bail!(
            "{folder}: its training has not ended; continue it with `{}`",
            resume_command(committee.path())
        );
    }
    let mut spec = TrainSpec {
        recipe: RECIPE.into(),
        epochs: arguments.epochs.or(config.spec.epochs),
        device: arguments.device.named(),
        ..config.spec
    };
    if arguments.device == TrainDeviceChoice::Auto {
        spec.device = device_times::fastest()?;
    }
    if let Some(data) = &arguments.data {
        spec.data.clone_from(data);
    }
    source::announce(&spec.data);
    let doubts = Doubts {
        axes_are_right: true,
        strict: false,
    };
    let review = |finding: &Finding| source::review(None, finding, doubts);
    let job = TrainJob::try_from(spec)?;
    let session = Session::begin(&job, arguments.out.as_deref(), program(), review)?;
    let found = session.run().config()?.data_sha256;
    if found != config.data_sha256 {
        let reason = "the data set has changed since the committee was trained";
        return Err(PipelineError::run(committee.path(), reason).into());
    }
    Ok(session)
}

/// Returns one line with the accuracies of committee and network.
fn comparison(committee: &RunResult, network: &RunResult) -> String {
    let accuracy = |result: &RunResult| {
        let of_recipe = result.evaluations.first_key_value();
        of_recipe.map_or(f64::NAN, |(_, evaluation)| {
            100.0 * evaluation.one_sweep.mean
        })
    };
    format!(
        "one sweep: {:.1} %, the committee {:.1} %",
        accuracy(network),
        accuracy(committee)
    )
}
