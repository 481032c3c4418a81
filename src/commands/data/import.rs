//! `tactnet data import`: converts a recording, tables or arrays into a data set.

use std::path::Path;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_data::format::{Format, ReadOptions, read_to_classify, read_with};
use tactnet_data::{DataSource, Dataset};

use super::ConvertArgs;
use crate::{output, source};

#[derive(Args)]
pub struct ImportArgs {
    #[command(flatten)]
    pub(super) convert: ConvertArgs,
    /// Material of the sweeps, for data that does not name it
    #[arg(long, value_name = "NAME")]
    pub(super) material: Option<String>,
    /// Number of time steps of each sweep to keep, from its start [default: all; for a recording the recorded
    /// classifier's, or 1000]
    #[arg(long, value_name = "N")]
    pub(super) steps: Option<usize>,
    /// Sample rate, in Hz [default: from the data; for a recording the recorded classifier's, or by the frames' clock]
    #[arg(long, value_name = "HZ")]
    pub(super) rate: Option<f64>,
    /// Rows and columns of taxels [default: from the data; for a recording the recorded classifier's, or a square]
    #[arg(long, value_name = "RxC", value_parser = shape)]
    pub(super) shape: Option<(usize, usize)>,
}

/// Parses rows and columns, for example `4x4`.
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

/// Reads unlabelled sweeps, all of `material`.
///
/// # Errors
/// Fails as [`read_to_classify`] does, or if the file names its materials.
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
        read_with(path, &ReadOptions::keeping(arguments.steps))?
    };
    if let Some(rate) = arguments.rate {
        let own = dataset.sample_rate_hz();
        if !dataset.is_rate_assumed() && own != rate {
            say!("warning: {data} states {own} Hz, but `--rate {rate}` takes precedence");
        }
        dataset = dataset.with_sample_rate(rate)?;
    }
    if let Some((rows, cols)) = arguments.shape {
        let own = dataset.shape();
        if !dataset.is_patch_assumed() && (own.rows, own.cols) != (rows, cols) {
            say!(
                "warning: {data} states {}x{} taxels, but `--shape {rows}x{cols}` takes precedence",
                own.rows,
                own.cols
            );
        }
        dataset = dataset.with_patch(rows, cols)?;
    }
    source::warn_of_assumed_rate(dataset.is_rate_assumed(), dataset.sample_rate_hz());
    if dataset.is_patch_assumed() && dataset.shape().taxels() > 1 {
        say!(
            "note: the data does not state the arrangement of its {} taxels; they form one row, unless `--shape RxC` is given",
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

/// Converts a recording or a data set.
///
/// # Errors
/// Fails if the input cannot be read or the output format cannot hold it.
pub fn run(arguments: &ImportArgs) -> anyhow::Result<ExitCode> {
    let format = Format::from_extension(&arguments.convert.out)?;
    if !arguments.is_recording() {
        return import_data_set(arguments, format);
    }
    #[cfg(feature = "recording")]
    return super::import_recording::run(arguments, format);
    #[cfg(not(feature = "recording"))]
    bail!(tactnet_models::MissingFeature {
        feature: "recording"
    })
}
