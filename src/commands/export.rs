//! `tactnet export`: writes a trained network or committee in other formats.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use tactnet_pipeline::{
    ModelRecipe, OnnxInputs, RunDir, to_onnx, to_safetensors, weights_sha256, write_whole,
};

use super::network_run::{NetworkUse, network_run};
use super::run_choice::RunChoice;
use crate::GIT;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet export runs/a --out tactnet.onnx            digits in, log-probabilities out, for any ONNX runtime\n  \
    tactnet export runs/a --out tactnet.onnx --masks    with dropout masks as a second input\n  \
    tactnet export runs/a --out tactnet.safetensors     weights and scaling, by name\n\n\
    The ONNX file has the input `digits` [sweeps, steps, taxels] and, with `--masks`, `masks` [samples, features]. A committee of networks is one \
    file with an input `MEMBER/masks` for each member; baselines have no ONNX form. The output `likeness` \
    is the p-value of every sweep against the training data, if the run has one. Its metadata_props hold labels, \
    sample rate, window, thresholds and hashes; its doc_string is a Python program that runs it.")]
pub struct ExportArgs {
    #[command(flatten)]
    run: RunChoice,
    /// Output file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Output format [default: from the file's extension]
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Add dropout masks as a required second input of the ONNX file, for Monte Carlo dropout
    #[arg(long)]
    masks: bool,
    /// Overwrite the file
    #[arg(long)]
    force: bool,
}

/// Output format.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// The complete computation
    Onnx,
    /// Weights and scaling
    Safetensors,
}

/// Writes the file.
pub fn run(arguments: &ExportArgs) -> anyhow::Result<ExitCode> {
    let extension = arguments.out.extension().and_then(|e| e.to_str());
    let format = match (arguments.format, extension) {
        (Some(format), _) => format,
        (None, Some("onnx")) => Format::Onnx,
        (None, Some("safetensors")) => Format::Safetensors,
        (None, _) => bail!(
            "{}: expected the extension .onnx or .safetensors, or `--format`",
            arguments.out.display()
        ),
    };
    if arguments.masks && matches!(format, Format::Safetensors) {
        bail!("--masks: only ONNX files have inputs; safetensors files hold weights only");
    }
    if arguments.out.exists() && !arguments.force {
        bail!(
            "{}: exists already; overwrite it with `--force`",
            arguments.out.display()
        );
    }
    let run = exported(arguments.run.dir())?;
    let config = run.config()?;
    if let (Format::Safetensors, ModelRecipe::Committee(_)) = (format, &config.recipe) {
        bail!(
            "{}: a committee has only an ONNX form; name a file that ends in .onnx",
            arguments.out.display()
        );
    }
    let weights = run.final_weights()?;
    let about = BTreeMap::from([
        ("format".to_owned(), "tactnet 1".to_owned()),
        ("version".into(), env!("CARGO_PKG_VERSION").into()),
        ("git".into(), GIT.into()),
        ("data_sha256".into(), config.data_sha256.clone()),
        ("weights_sha256".into(), weights_sha256(&weights)?),
    ]);
    let calibration = run.calibration()?;
    let bytes = match format {
        Format::Onnx => to_onnx(
            &config.classifier,
            &weights,
            calibration.as_ref(),
            run.likeness()?.as_ref(),
            if arguments.masks {
                OnnxInputs::DigitsAndMasks
            } else {
                OnnxInputs::Digits
            },
            &about,
        )?,
        Format::Safetensors => {
            to_safetensors(&config.classifier, &weights, calibration.as_ref(), &about)?
        }
    };
    write_whole(&arguments.out, &bytes).context("cannot export")?;
    say!(
        "{}: {} materials, {:.1} MB",
        arguments.out.display(),
        config.classifier.labels.len(),
        bytes.len() as f64 / 1e6
    );
    Ok(ExitCode::SUCCESS)
}

/// Returns the run to export: that of its network if a committee has members without an ONNX form.
fn exported(dir: &Path) -> anyhow::Result<RunDir> {
    let run = RunDir::open(dir)?;
    let config = run.config()?;
    config.require_network_or_committee(dir, "be exported")?;
    let ModelRecipe::Committee(committee) = &config.recipe else {
        return Ok(run);
    };
    let is_network = |member: &ModelRecipe| matches!(member, ModelRecipe::Network(_));
    if committee.members.iter().all(is_network) {
        return Ok(run);
    }
    // Without a network, the error of the export names the members.
    Ok(network_run(dir, NetworkUse::Export).unwrap_or(run))
}
