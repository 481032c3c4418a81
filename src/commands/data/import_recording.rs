//! `tactnet data import` for recordings.

use std::path::Path;
use std::process::ExitCode;

use anyhow::bail;
use tactnet_data::format::{Format, Keep};
use tactnet_recording::{Recording, SweepSettings, sweeps};

use super::import::ImportArgs;
use crate::output;

/// Writes the sweeps of a recording as a data set.
///
/// # Errors
/// Fails if the recording cannot be read or the output format cannot hold its sweeps.
pub fn run(arguments: &ImportArgs, format: Format) -> anyhow::Result<ExitCode> {
    let convert_arguments = &arguments.convert;
    let (path, out) = (Path::new(&convert_arguments.data), &convert_arguments.out);
    output::refuse_to_overwrite(out, convert_arguments.force)?;
    let recording = Recording::read(path)?;
    if let Some(cut) = &recording.cut {
        say!("{}: the end is missing ({cut})", path.display());
    }
    if recording.foreign > 0 {
        say!("skipped: {} messages of other types", recording.foreign);
    }
    let steps = match arguments.steps {
        None => None,
        Some(Keep::First(steps)) => Some(steps),
        Some(_) => bail!("--steps: expected a number of frames for a recording"),
    };
    let settings = SweepSettings {
        steps,
        rate_hz: arguments.rate,
        rows_cols: arguments.shape,
    };
    let found = sweeps(path, &recording, arguments.material.as_deref(), settings)?;
    for reason in &found.rejected {
        say!("skipped: {reason}");
    }
    if found.unlabelled > 0 {
        say!(
            "skipped: {} unlabelled sweeps (`--material` names their material)",
            found.unlabelled
        );
    }
    let counts = found.dataset.sweeps_per_label();
    if format == Format::TactMat && counts.iter().any(|count| *count != counts[0]) {
        bail!(
            "{}: an .h5 data set needs the same number of sweeps for every material, this recording has {} to {}; .npz does not",
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
