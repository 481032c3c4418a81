//! Recordings: frames in order of time, as tables and folders contain them, before they become one array.

use std::path::{Path, PathBuf};

use super::lengths::{Keep, Settled, settle};
use super::named_sweeps::NamedSweeps;
use super::pieces;
use super::read_options::ReadOptions;
use super::resolution::narrow_sweeps;
use super::sweep_file::Patch;
use super::time_stamps::Clockwork;
use super::timing::Timing;
use crate::{Condition, ConditionValues, DataError, Finding};

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
    /// Stretches of one label, if the recording is cut by its labels; otherwise empty.
    pub(super) labels: Vec<LabelRun>,
    /// Block number, if the file has it.
    pub(super) block: Option<u32>,
    /// Test flag, if the file has it.
    pub(super) test: Option<bool>,
    /// Value of each of [`Recordings::conditions`].
    pub(super) conditions: Vec<f32>,
}

/// Consecutive frames of one label.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct LabelRun {
    /// First frame; the run ends before the next one.
    pub(super) start: usize,
    pub(super) label: String,
}

impl LabelRun {
    /// Returns the runs of the labels of all frames.
    pub(super) fn all<'a>(
        labels: impl Iterator<Item = &'a (impl AsRef<str> + ?Sized + 'a)>,
    ) -> Vec<Self> {
        let mut runs: Vec<Self> = Vec::new();
        for (start, label) in labels.map(AsRef::as_ref).enumerate() {
            if runs.last().is_none_or(|run| run.label != label) {
                runs.push(Self {
                    start,
                    label: label.into(),
                });
            }
        }
        runs
    }
}

/// Recordings of one data set.
pub(super) struct Recordings<'a> {
    /// File or folder that the user named.
    pub(super) path: &'a Path,
    /// Arrangement of the taxels in all of them.
    pub(super) patch: Patch,
    /// At least one recording.
    pub(super) recordings: Vec<Recording>,
    /// Meaning of the time stamps, if there are any.
    pub(super) clockwork: Option<Clockwork>,
    /// Unit of the last digit of all time stamps, in seconds; 0 if that is not known.
    pub(super) resolution: f64,
    /// Quantities that are known for every recording.
    pub(super) conditions: Vec<Condition>,
    /// Findings that only the reader can make.
    pub(super) findings: Vec<Finding>,
}

impl Recording {
    /// Returns a part of the recording.
    pub(super) fn part(&self, name: String, values: Vec<f64>, block: Option<u32>) -> Self {
        Self {
            name,
            values,
            block,
            file: self.file.clone(),
            lines: Vec::new(),
            seconds: Vec::new(),
            material: self.material.clone(),
            labels: Vec::new(),
            test: self.test,
            conditions: self.conditions.clone(),
        }
    }

    pub(super) fn frames(&self, patch: Patch) -> usize {
        self.values.len() / patch.taxels().max(1)
    }
}

impl Recordings<'_> {
    /// Returns the recordings as sweeps in one array.
    ///
    /// # Errors
    /// Different lengths, if the options do not allow them; time stamps that give no rate; values that no element type holds.
    pub(super) fn into_sweeps(mut self, options: &ReadOptions) -> Result<NamedSweeps, DataError> {
        let timing = if options.cuts() {
            let timing = Timing::of(&self, &[], options)?;
            pieces::cut(&mut self, &timing, options)?;
            timing
        } else {
            let Settled { least, .. } = self.settle(options.keep)?;
            let lengths = self.recordings.iter().map(|r| r.frames(self.patch));
            let mut kept = 0..;
            let index = |frames| (frames >= least).then(|| kept.next()).flatten();
            let indices: Vec<Option<usize>> = lengths.map(index).collect();
            Timing::of(&self, &indices, options)?
        };
        self.findings.extend(timing.findings);
        self.of_one_array(options.keep, options.resample_hz.or(timing.rate_hz))
    }

    /// Returns the recordings as sweeps in one array.
    ///
    /// # Errors
    /// Different lengths, if they are not allowed; values that no element type holds.
    pub(super) fn of_one_array(
        mut self,
        keep: Keep,
        rate_hz: Option<f64>,
    ) -> Result<NamedSweeps, DataError> {
        let patch = self.patch;
        let Settled { steps, least, odd } = self.settle(keep)?;
        self.recordings.retain(|r| r.frames(patch) >= least);
        let taxels = patch.taxels();
        let lengths: Vec<usize> = self
            .recordings
            .iter()
            .map(|r| r.frames(patch).min(steps))
            .collect();
        let mut values = Vec::with_capacity(self.recordings.len() * steps * taxels);
        for (recording, frames) in self.recordings.iter().zip(&lengths) {
            let read = &recording.values[..frames * taxels];
            values.extend_from_slice(read);
            for _ in *frames..steps {
                values.extend_from_slice(&read[read.len() - taxels..]);
            }
        }
        let samples = narrow_sweeps(self.path, patch.shape(steps), &values)?;
        let kept = &self.recordings;
        let conditions = self.conditions.iter().enumerate();
        let conditions = conditions.map(|(place, condition)| ConditionValues {
            condition: condition.clone(),
            values: kept.iter().map(|r| r.conditions[place]).collect(),
        });
        Ok(NamedSweeps {
            name: self.data_set_name(),
            rate_hz,
            shape: patch.shape(steps),
            patch_known: patch.is_known(),
            sweeps: kept.iter().map(|r| r.name.clone()).collect(),
            materials: kept.iter().map(|r| r.material.clone()).collect(),
            blocks: kept.iter().map(|r| r.block).collect(),
            test: kept.iter().map(|r| r.test).collect(),
            conditions: conditions.collect(),
            samples,
            lengths: (least < steps).then_some(lengths),
            findings: self.findings,
            odd_lengths: odd,
        })
    }

    /// Returns the frames of the sweeps that are kept.
    fn settle(&self, keep: Keep) -> Result<Settled, DataError> {
        let lengths = self.recordings.iter().map(|r| r.frames(self.patch));
        let lengths: Vec<usize> = lengths.collect();
        let shown: Vec<String> = self.recordings.iter().map(|r| self.shown(r)).collect();
        let shown: Vec<&str> = shown.iter().map(String::as_str).collect();
        settle(self.path, &shown, &lengths, keep)
    }

    /// Returns the name of a recording in messages: its file, if the data set has several.
    pub(super) fn shown(&self, recording: &Recording) -> String {
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
