//! `tactnet data import`: a recording or another program's data set becomes an HDF5 data set.

use std::path::Path;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_data::format::Format;
use tactnet_recording::{Recording, SweepSettings, sweeps};

use super::{ConvertArgs, convert, refuse_to_overwrite};

#[derive(Args)]
pub struct ImportArgs {
    #[command(flatten)]
    convert: ConvertArgs,
    /// Of a recording: what was swept over, where start commands do not name it
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// Of a recording: frames of a sweep [default: those of the recorded classifier, or 1000]
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Of a recording: frames a second [default: the recorded classifier's, or by the frames' own clock]
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Of a recording: rows and columns of taxels [default: the recorded classifier's, or a square]
    #[arg(long, value_name = "RxC", value_parser = shape)]
    shape: Option<(usize, usize)>,
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

/// A recording of the channels, or another program's data set.
///
/// # Errors
/// What cannot be read, or not be written in the format asked for.
pub fn run(arguments: &ImportArgs) -> anyhow::Result<ExitCode> {
    let convert_arguments = &arguments.convert;
    let (path, out) = (Path::new(&convert_arguments.data), &convert_arguments.out);
    let format = Format::from_extension(out)?;
    if format != Format::TactMat && !(arguments.is_recording() && format == Format::Npz) {
        bail!(
            "{}: `import` writes .h5 (of recordings also .npz); for other formats use `tactnet data export`",
            out.display()
        );
    }
    if !arguments.is_recording() {
        let of_a_recording = [
            arguments.material.is_some(),
            arguments.steps.is_some(),
            arguments.rate.is_some(),
            arguments.shape.is_some(),
        ];
        if of_a_recording.contains(&true) {
            bail!("--material, --steps, --rate, --shape: only for recordings (.mcap)");
        }
        return convert(convert_arguments);
    }
    refuse_to_overwrite(out, convert_arguments.force)?;
    let recording = Recording::read(path)?;
    if let Some(cut) = &recording.cut {
        eprintln!("{}: the end is missing ({cut})", path.display());
    }
    if recording.foreign > 0 {
        eprintln!(
            "left out: {} messages that are none of ours",
            recording.foreign
        );
    }
    let settings = SweepSettings {
        steps: arguments.steps,
        rate_hz: arguments.rate,
        rows_cols: arguments.shape,
    };
    let found = sweeps(path, &recording, arguments.material.as_deref(), settings)?;
    for reason in &found.rejected {
        eprintln!("left out: {reason}");
    }
    if found.unlabelled > 0 {
        eprintln!(
            "left out: {} sweeps of which nobody said what was swept over (`--material` names it)",
            found.unlabelled
        );
    }
    let counts = found.dataset.sweeps_per_label();
    if format == Format::TactMat && counts.iter().any(|count| *count != counts[0]) {
        bail!(
            "{}: an .h5 data set has equally many sweeps of every material, this recording has {} to {}; .npz holds any number",
            out.display(),
            counts.iter().min().unwrap_or(&0),
            counts.iter().max().unwrap_or(&0)
        );
    }
    format.write(out, &found.dataset)?;
    eprintln!(
        "{}: {} sweeps of {} materials ({})",
        out.display(),
        found.dataset.len(),
        found.dataset.labels().len(),
        found.dataset.shape()
    );
    Ok(ExitCode::SUCCESS)
}
