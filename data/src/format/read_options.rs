//! Options of reading.

use std::path::Path;

use super::file_layout::FileLayout;
use super::in_file;
use super::lengths::Keep;
use super::named_sweeps::some_names;
use super::pieces;
use super::recording::{Recording, Recordings};
use super::sweep_file::Patch;
use super::timing::Timing;
use super::windows::Windows;
use crate::{DataError, Dataset};

/// Options of reading a data set.
///
/// ```
/// use tactnet_data::format::{Keep, ReadOptions, Span, Windows};
///
/// // The first 100 frames of every sweep.
/// let options = ReadOptions { keep: Keep::First(100), ..ReadOptions::default() };
/// assert_eq!(options, ReadOptions::keeping(Some(100)));
///
/// // Windows of one second at 100 Hz from continuous recordings.
/// let options = ReadOptions {
///     resample_hz: Some(100.0),
///     windows: Some(Windows::of(Span::Seconds(1.0))),
///     ..ReadOptions::default()
/// };
/// assert_eq!(options.keep, Keep::Equal);
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// Frames of each sweep that are read.
    pub keep: Keep,
    /// Sample rate in Hz that the caller names; it takes precedence over that of the data.
    pub rate_hz: Option<f64>,
    /// Names of the columns of a table that are taxels, in order; empty: all columns without another meaning.
    pub columns: Vec<String>,
    /// Rate in Hz to which all sweeps are resampled.
    pub resample_hz: Option<f64>,
    /// Windows that are cut from continuous recordings; `None`: every recording is one sweep.
    pub windows: Option<Windows>,
    /// Name or path of the samples in a file that holds several arrays or features.
    pub samples: Option<String>,
    /// Name or path of the materials of the sweeps, names or numbers, in a file that holds several arrays.
    pub labels: Option<String>,
    /// Name of the column or array that holds the block of each sweep: a recording, session, day or subject, as numbers or
    /// words; `None`: `block`, `session`, `day` and similar columns, or the array `blocks`.
    pub blocks: Option<String>,
    /// Layout of the files in a folder.
    pub layout: FileLayout,
}

impl ReadOptions {
    /// Returns options that keep the first `steps` frames of every sweep; `None`: all.
    pub fn keeping(steps: Option<usize>) -> Self {
        Self {
            keep: steps.into(),
            ..Self::default()
        }
    }

    /// Succeeds if no array is named.
    ///
    /// - `found`: data that has no named arrays
    ///
    /// # Errors
    /// A named array of samples or labels.
    pub(super) fn refuse_arrays(&self, path: &Path, found: &str) -> Result<(), DataError> {
        let item = match (&self.samples, &self.labels) {
            (Some(_), _) => "samples",
            (None, Some(_)) => "labels",
            (None, None) => return Ok(()),
        };
        let expected = "a file with named arrays (.npz, .h5, .mat)";
        Err(DataError::format(path, item, expected, found))
    }

    /// Renames the column that the caller named as that of the blocks to `block`; another one of this name is not read.
    ///
    /// # Errors
    /// No column has the name.
    pub(super) fn rename_blocks<'a>(
        &self,
        path: &Path,
        columns: impl IntoIterator<Item = &'a mut String>,
    ) -> Result<(), DataError> {
        let Some(blocks) = self.blocks.as_ref().map(|name| name.trim()) else {
            return Ok(());
        };
        let (mut is_found, mut found) = (false, Vec::new());
        for column in columns {
            found.push(column.trim().to_string());
            match column.trim() {
                name if name == blocks => {
                    is_found = true;
                    *column = "block".into();
                }
                // Also a name of blocks, but not the first choice.
                "block" => *column = "group".into(),
                _ => {}
            }
        }
        if is_found {
            return Ok(());
        }
        let expected = format!("a column `{blocks}` for the blocks");
        let found = some_names(found.iter().map(String::as_str));
        Err(DataError::format(path, "columns", expected, found))
    }

    /// Succeeds if no blocks are named.
    ///
    /// # Errors
    /// Named blocks in a folder without a table of labels.
    pub(super) fn refuse_blocks(&self, path: &Path) -> Result<(), DataError> {
        let Some(blocks) = &self.blocks else {
            return Ok(());
        };
        let expected =
            format!("labels.csv with a column `{blocks}`, or a pattern of names with {{block}}");
        Err(DataError::format(path, "folder", expected, "no labels.csv"))
    }

    /// Returns true if recordings are cut or resampled.
    pub(super) fn cuts(&self) -> bool {
        self.windows.is_some() || self.resample_hz.is_some()
    }

    /// Returns a data set of arrays with these options applied.
    ///
    /// # Errors
    /// Options that the data set does not allow.
    pub(super) fn apply_to(&self, path: &Path, dataset: Dataset) -> Result<Dataset, DataError> {
        if !self.columns.is_empty() {
            let expected = "a table, whose columns have names";
            return Err(DataError::format(path, "columns", expected, "arrays"));
        }
        let dataset = dataset.with_named_rate(self.rate_hz)?;
        let dataset = match self.cuts() {
            true => self.cut(path, &dataset)?,
            false => dataset,
        };
        let steps = match self.keep {
            Keep::First(steps) => steps,
            Keep::Shortest => dataset.shortest(),
            Keep::Equal | Keep::All | Keep::Most => return Ok(dataset),
        };
        dataset
            .first_steps(steps)
            .map_err(|error| in_file(path, error))
    }

    /// Returns the windows of all sweeps, or resampled sweeps.
    fn cut(&self, path: &Path, dataset: &Dataset) -> Result<Dataset, DataError> {
        let shape = dataset.shape();
        let recording = |index: usize| Recording {
            name: index.to_string(),
            file: path.into(),
            lines: Vec::new(),
            values: dataset.sweep(index).into_iter().map(f64::from).collect(),
            seconds: Vec::new(),
            material: Some(dataset.labels().name(dataset.records()[index].label).into()),
            labels: Vec::new(),
            block: dataset.records()[index].block,
            test: dataset.records()[index].test,
            // They are columns of the values.
            conditions: Vec::new(),
        };
        let mut recordings = Recordings {
            path,
            patch: Patch::Grid(shape.rows, shape.cols),
            recordings: (0..dataset.len()).map(recording).collect(),
            clockwork: None,
            resolution: 0.0,
            conditions: Vec::new(),
            findings: Vec::new(),
        };
        let known = (!dataset.is_rate_assumed()).then(|| dataset.sample_rate_hz());
        let timing = Timing {
            rate_hz: known,
            clocks: vec![None; dataset.len()],
            odd_hz: vec![None; dataset.len()],
            findings: Vec::new(),
        };
        pieces::cut(&mut recordings, &timing, self)?;
        let rate_hz = self.resample_hz.or(known);
        let states_lengths = dataset.lengths().is_some();
        let keep = match self.keep {
            Keep::Equal | Keep::Most if states_lengths && self.windows.is_none() => Keep::All,
            keep => keep,
        };
        let sweeps = recordings.of_one_array(keep, rate_hz)?;
        dataset
            .with_sweeps(sweeps)
            .map_err(|error| in_file(path, error))
    }
}
