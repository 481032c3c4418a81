//! `tactnet view`: live channels or a recording in the viewer.

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::bail;
use tactnet_channel::{Bus, Domain};
use tactnet_recording::Recording;
use tactnet_recording::view::{Target, Viewed, show_channels, show_recording};

use super::ViewArgs;
use super::arguments::TargetArgs;
use crate::output;
use crate::stop::Stop;
use crate::table;

impl TargetArgs {
    /// Returns the output of the viewer data.
    pub(super) fn target(&self) -> Target {
        match (&self.save, &self.connect) {
            (Some(path), _) => Target::File { path: path.clone() },
            (None, Some(url)) => Target::Connect { url: url.clone() },
            (None, None) => Target::Viewer {
                memory_limit: self.memory_limit.clone(),
            },
        }
    }

    /// Returns `what` with the output file, if there is one.
    pub(super) fn describe(&self, what: &str) -> String {
        match &self.save {
            Some(path) => format!("{}: {what}; `rerun {0}` shows it", path.display()),
            None => what.into(),
        }
    }
}

/// Shows the channels or the recording.
pub fn run(arguments: &ViewArgs) -> anyhow::Result<ExitCode> {
    let seconds = arguments.seconds.unwrap_or(f64::INFINITY);
    if seconds.is_nan() || seconds <= 0.0 {
        bail!("--seconds: expected more than 0, found {seconds}");
    }
    let target = arguments.target.target();
    let viewed = match (&arguments.file, &arguments.table) {
        (Some(file), _) => view_recording(file, &target)?,
        (None, Some(table)) => view_channels(table, &target, seconds)?,
        (None, None) => bail!("expected a recording, or `--table` for live channels"),
    };
    if let Some(gone) = &viewed.gone {
        say!("{gone}");
    }
    if arguments.target.json {
        output::print_json(&viewed)?;
    } else {
        output::print(arguments.target.describe(&summary(&viewed)))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn view_recording(file: &Path, target: &Target) -> anyhow::Result<Viewed> {
    let recording = Recording::read(file)?;
    if let Some(cut) = &recording.cut {
        say!("{}: the end is missing ({cut})", file.display());
    }
    let title = file.display().to_string();
    Ok(show_recording(&recording, &title, target)?)
}

fn view_channels(path: &Path, target: &Target, seconds: f64) -> anyhow::Result<Viewed> {
    let stop = Stop::listen_saying("ending")?;
    let table = table::load(path)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let on_ready = || {
        say!("showing live channels; Ctrl-C ends");
        // A reader that has closed the output does not need the line.
        let _ = output::print(format_args!("ready"));
    };
    let time = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    Ok(show_channels(
        &bus,
        &table,
        target,
        time,
        on_ready,
        &|| stop.asked(),
    )?)
}

/// Returns the counts in one line.
fn summary(viewed: &Viewed) -> String {
    let mut text = format!("{} frames, {} beliefs", viewed.frames, viewed.beliefs);
    if viewed.lost > 0 {
        text.push_str(&format!(", {} lost", viewed.lost));
    }
    if viewed.left_out > 0 {
        text.push_str(&format!(", {} left out for a slow viewer", viewed.left_out));
    }
    text
}
