//! Recordings: frames in order of time, as tables and folders contain them, before all have one length.

use std::path::{Path, PathBuf};

use super::frame_table::rate_of;
use super::lengths::settle;
use super::named_sweeps::NamedSweeps;
use super::narrow::{TooWide, narrow};
use super::read_options::ReadOptions;
use super::sweep_file::Patch;
use crate::{DataError, Finding};

/// Frames of one sweep, or of one continuous recording.
pub(super) struct Recording {
    /// Name of the sweep.
    pub(super) name: String,
    /// File that contains it.
    pub(super) file: PathBuf,
    /// Lines of the frames in a text file, from 1: `[frames]`; empty for other files.
    pub(super) lines: Vec<usize>,
    /// Values: `[frames][taxels]`.
    pub(super) values: Vec<f64>,
    /// Times of the frames, in seconds: `[frames]`; empty if the file has none.
    pub(super) seconds: Vec<f64>,
    /// Material, if the file names it.
    pub(super) material: Option<String>,
    /// Block number, if the file has it.
    pub(super) block: Option<u32>,
    /// Test flag, if the file has it.
    pub(super) test: Option<bool>,
}

/// Recordings of one data set.
pub(super) struct Recordings<'a> {
    /// File or folder that the user named.
    pub(super) path: &'a Path,
    /// Arrangement of the taxels in all of them.
    pub(super) patch: Patch,
    /// At least one recording.
    pub(super) recordings: Vec<Recording>,
    /// Findings that only the reader can make.
    pub(super) findings: Vec<Finding>,
}

impl Recording {
    pub(super) fn frames(&self, patch: Patch) -> usize {
        self.values.len() / patch.taxels().max(1)
    }
}

impl Recordings<'_> {
    /// Returns the recordings as sweeps of one length.
    ///
    /// # Errors
    /// Different lengths, if the options do not allow them; times that decrease; values that no element type holds.
    pub(super) fn into_sweeps(mut self, options: &ReadOptions) -> Result<NamedSweeps, DataError> {
        let patch = self.patch;
        let lengths: Vec<usize> = self.recordings.iter().map(|r| r.frames(patch)).collect();
        let shown: Vec<String> = self.recordings.iter().map(|r| self.shown(r)).collect();
        let shown: Vec<&str> = shown.iter().map(String::as_str).collect();
        let (steps, odd_lengths) = settle(self.path, &shown, &lengths, options.keep)?;
        let rate_hz = self.rate(&shown)?;
        self.recordings.retain(|r| r.frames(patch) >= steps);
        let mut values = Vec::with_capacity(self.recordings.len() * steps * patch.taxels());
        for recording in &self.recordings {
            values.extend_from_slice(&recording.values[..steps * patch.taxels()]);
        }
        let samples = narrow(&values).map_err(|TooWide(value)| {
            let expected = "values that a 32-bit float holds";
            DataError::format(self.path, "taxels", expected, value)
        })?;
        let kept = &self.recordings;
        Ok(NamedSweeps {
            name: self.data_set_name(),
            rate_hz,
            shape: patch.shape(steps),
            patch_known: patch.is_known(),
            sweeps: kept.iter().map(|r| r.name.clone()).collect(),
            materials: kept.iter().map(|r| r.material.clone()).collect(),
            blocks: kept.iter().map(|r| r.block).collect(),
            test: kept.iter().map(|r| r.test).collect(),
            samples,
            findings: self.findings,
            odd_lengths,
        })
    }

    /// Returns the sample rate, in Hz; `None` without times.
    fn rate(&self, shown: &[&str]) -> Result<Option<f64>, DataError> {
        let of_each = self.recordings.iter().zip(shown);
        let mut timed = of_each
            .filter(|(recording, _)| !recording.seconds.is_empty())
            .map(|(recording, name)| (*name, recording.seconds.clone()))
            .peekable();
        if timed.peek().is_none() {
            return Ok(None);
        }
        rate_of(self.path, timed).map(Some)
    }

    /// Returns the name of a recording in messages: its file, if the data set has several.
    fn shown(&self, recording: &Recording) -> String {
        if recording.file == self.path {
            recording.name.clone()
        } else {
            recording.file.display().to_string()
        }
    }

    fn data_set_name(&self) -> String {
        if self.path.is_dir() {
            let name = self.path.file_name().unwrap_or_default();
            name.to_string_lossy().into_owned()
        } else {
            super::stem(self.path)
        }
    }
}
