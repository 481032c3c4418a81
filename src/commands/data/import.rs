//! `tactnet data import`: a recording or another program's data set becomes a data set of this one.

use std::path::Path;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_data::format::{Format, read_beginning, read_to_classify};
use tactnet_data::{DataSource, Dataset};

use super::ConvertArgs;
use crate::{output, source};

#[derive(Args)]
pub struct ImportArgs {
    #[command(flatten)]
    pub(super) convert: ConvertArgs,
    /// What was swept over, where the data does not say
    #[arg(long, value_name = "NAME")]
    pub(super) material: Option<String>,
    /// Frames of a sweep that are kept [default: all; of a recording those of the recorded classifier, or 1000]
    #[arg(long, value_name = "N")]
    pub(super) steps: Option<usize>,
    /// Frames a second [default: what the data says; of a recording the recorded classifier's, or by the frames' own clock]
    #[arg(long, value_name = "HZ")]
    pub(super) rate: Option<f64>,
    /// Rows and columns of taxels [default: what the data says; of a recording the recorded classifier's, or a square]
    #[arg(long, value_name = "RxC", value_parser = shape)]
    pub(super) shape: Option<(usize, usize)>,
}

/// `4x4`
fn shape(text: &str) -> Result<(usize, usize), String> {
    let parsed = text
        .split_once('x')
        .and_then(|(rows, cols)| Some((rows.parse().ok()?, cols.parse().ok()?)));
    parsed.ok_or_else(|| format!("expected rows and columns like 4x4, found `{text}`"))
}

impl ImportArgs {
    fn is_recording(&self) -> bool {
        Path::new(&self.convert.data)
            .extension()
            .is_some_and(|extension| extension == "mcap")
    }
}

/// Sweeps of a file that says of no material, all of which are of `material`.
///
/// # Errors
/// What [`read_to_classify`] refuses; a file with materials of its own.
fn of_material(path: &Path, steps: Option<usize>, material: &str) -> anyhow::Result<Dataset> {
    let found = read_to_classify(path, steps)?;
    if found.labelled {
        bail!(
            "--material {material}: {} names its materials itself",
            path.display()
        );
    }
    Ok(found.dataset.of_one_material(material)?)
}

/// Another program's data set, in any format that is read.
fn import_data_set(arguments: &ImportArgs, format: Format) -> anyhow::Result<ExitCode> {
    let ConvertArgs { data, out, force } = &arguments.convert;
    output::refuse_to_overwrite(out, *force)?;
    let path = Path::new(data);
    let mut dataset = if DataSource::is_twin(data) || !path.exists() {
        if arguments.material.is_some() {
            bail!("--material: `{data}` names its materials itself");
        }
        let twin = source::load(data)?;
        let steps = arguments.steps.unwrap_or(twin.shape().steps);
        twin.first_steps(steps)?
    } else if let Some(material) = &arguments.material {
        of_material(path, arguments.steps, material)?
    } else {
        read_beginning(path, arguments.steps)?
    };
    if let Some(rate) = arguments.rate {
        let own = dataset.sample_rate_hz();
        if !dataset.is_rate_assumed() && own != rate {
            say!("warning: {data} says {own} Hz; `--rate {rate}` is taken instead");
        }
        dataset = dataset.with_sample_rate(rate)?;
    }
    if let Some((rows, cols)) = arguments.shape {
        let own = dataset.shape();
        if !dataset.is_patch_assumed() && (own.rows, own.cols) != (rows, cols) {
            say!(
                "warning: {data} says {}x{} taxels; `--shape {rows}x{cols}` is taken instead",
                own.rows,
                own.cols
            );
        }
        dataset = dataset.with_patch(rows, cols)?;
    }
    source::warn_of_assumed_rate(dataset.is_rate_assumed(), dataset.sample_rate_hz());
    if dataset.is_patch_assumed() && dataset.shape().taxels() > 1 {
        say!(
            "note: the data does not say how its {} taxels are arranged; they stand in one row, `--shape RxC` names another",
            dataset.shape().taxels()
        );
    }
    format.write(out, &dataset)?;
    say!(
        "{}: {} sweeps of {} ({})",
        out.display(),
        dataset.len(),
        output::counted(dataset.labels().len(), "material"),
        dataset.shape()
    );
    Ok(ExitCode::SUCCESS)
}

/// A recording of the channels, or another program's data set.
///
/// # Errors
/// What cannot be read, or not be written in the format asked for.
pub fn run(arguments: &ImportArgs) -> anyhow::Result<ExitCode> {
    let format = Format::from_extension(&arguments.convert.out)?;
    if !arguments.is_recording() {
        return import_data_set(arguments, format);
    }
    #[cfg(feature = "recording")]
    return super::import_recording::run(arguments, format);
    #[cfg(not(feature = "recording"))]
    bail!(tactnet_models::left_out("recording"))
}
