//! `tactnet data import` of a recording of the channels.

use std::path::Path;
use std::process::ExitCode;

use anyhow::bail;
use tactnet_data::format::Format;
use tactnet_recording::{Recording, SweepSettings, sweeps};

use super::import::ImportArgs;
use crate::output;

/// Writes the sweeps of a recording as a data set.
///
/// # Errors
/// A recording that cannot be read; sweeps that the format cannot hold.
pub fn run(arguments: &ImportArgs, format: Format) -> anyhow::Result<ExitCode> {
    let convert_arguments = &arguments.convert;
    let (path, out) = (Path::new(&convert_arguments.data), &convert_arguments.out);
    output::refuse_to_overwrite(out, convert_arguments.force)?;
    let recording = Recording::read(path)?;
    if let Some(cut) = &recording.cut {
        say!("{}: the end is missing ({cut})", path.display());
    }
    if recording.foreign > 0 {
        say!(
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
        say!("left out: {reason}");
    }
    if found.unlabelled > 0 {
        say!(
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
    say!(
        "{}: {} sweeps of {} ({})",
        out.display(),
        found.dataset.len(),
        output::counted(found.dataset.labels().len(), "material"),
        found.dataset.shape()
    );
    Ok(ExitCode::SUCCESS)
}
