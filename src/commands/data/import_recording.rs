//! `tactnet data import` for recordings: of sweeps, and topics of any program.

use std::path::Path;
use std::process::ExitCode;

use anyhow::bail;
use tactnet_data::Dataset;
use tactnet_data::format::{Format, Keep, ReadOptions};
use tactnet_recording::{
    Recording, SweepSettings, TopicClock, TopicSelection, sweeps, topic_frames,
};

use super::import::ImportArgs;
use crate::output;

fn say_cut(path: &Path, cut: Option<&str>) {
    if let Some(cut) = cut {
        say!("{}: the end is missing ({cut})", path.display());
    }
}

/// Reads the frames of a topic as sweeps.
///
/// # Errors
/// Fails if there is no such topic or field, or its frames have no material.
pub(super) fn read_topic(
    arguments: &ImportArgs,
    topic: &str,
    options: &ReadOptions,
) -> anyhow::Result<Dataset> {
    let path = Path::new(&arguments.convert.data);
    if let Some(column) = options.columns.first() {
        bail!("--columns {column}: expected a table; `--field` names the numbers of a topic");
    }
    let selection = TopicSelection {
        topic: topic.into(),
        fields: arguments.cut.field.clone(),
        label: arguments.cut.label_field.clone(),
    };
    let frames = topic_frames(path, &selection)?;
    say_cut(path, frames.cut.as_deref());
    let times = match frames.clock {
        TopicClock::Stamps => "the stamps of the messages",
        TopicClock::Recorder => "when the messages were recorded",
    };
    say!(
        "{topic}: {} frames of {} ({}); times: {times}",
        frames.series.seconds.len(),
        output::counted(frames.series.taxels.len(), "number"),
        frames.fields.join(", "),
    );
    let sweeps = frames.series.into_sweeps(path, options)?;
    match (&arguments.material, sweeps.labelled) {
        (Some(material), false) => Ok(sweeps.dataset.of_one_material(material)?),
        (Some(material), true) => bail!(
            "--material {material}: `--label-field` or `--intervals` names the materials already"
        ),
        (None, true) => Ok(sweeps.dataset),
        (None, false) => bail!(
            "{}: expected the materials, by `--material NAME`, `--label-field PATH` or `--window` with `--intervals`",
            path.display()
        ),
    }
}

/// Writes the sweeps of a recording as a data set.
///
/// # Errors
/// Fails if the recording cannot be read or the output format cannot hold its sweeps.
pub fn run(arguments: &ImportArgs, format: Format) -> anyhow::Result<ExitCode> {
    let convert_arguments = &arguments.convert;
    let (path, out) = (Path::new(&convert_arguments.data), &convert_arguments.out);
    output::refuse_to_overwrite(out, convert_arguments.force)?;
    let recording = Recording::read(path)?;
    say_cut(path, recording.cut.as_deref());
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
