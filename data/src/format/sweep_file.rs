//! Files that contain one sweep.
//!
//! | file | holds |
//! |---|---|
//! | `.csv` | one row per frame and one column per taxel, with or without a line of names (or of the numbers from 0); a column `time` (seconds, or `t_ms`, `time [ns]`) gives the sample rate, a column `frame` or `index` is ignored |
//! | `.npy` | `[steps][taxels]` or `[steps][rows][cols]`, numbers of any type |

use std::fmt;
use std::path::Path;

use super::csv::Rows;
use super::frame_table::{STEP, is_one_of, time_unit};
use super::npy::Array;
use super::taxel_names::{is_line_of_names, left_out, unlike_the_others};
use crate::{DataError, Finding, SweepShape};

/// Returns true for a file that can contain a sweep, by its extension.
pub(super) fn is_sweep_file(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "csv" || e == "npy")
}

/// Arrangement of the taxels in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Patch {
    /// Number of taxels; the arrangement is not known.
    Taxels(usize),
    /// Rows and columns of taxels.
    Grid(usize, usize),
}

impl Patch {
    pub(super) fn taxels(self) -> usize {
        match self {
            Self::Taxels(taxels) => taxels,
            Self::Grid(rows, cols) => rows * cols,
        }
    }

    pub(super) fn is_known(self) -> bool {
        matches!(self, Self::Grid(..))
    }

    pub(super) fn shape(self, steps: usize) -> SweepShape {
        let (rows, cols) = match self {
            Self::Taxels(taxels) => (1, taxels),
            Self::Grid(rows, cols) => (rows, cols),
        };
        SweepShape { steps, rows, cols }
    }
}

impl fmt::Display for Patch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Taxels(taxels) => write!(f, "{taxels} taxels"),
            Self::Grid(rows, cols) => write!(f, "{rows}x{cols} taxels"),
        }
    }
}

/// Content of the file of one sweep.
pub(super) struct SweepFile {
    pub(super) patch: Patch,
    /// Values, `[frames][taxels]`.
    pub(super) values: Vec<f64>,
    /// Lines of the frames in a text file, from 1: `[frames]`; empty for other files.
    pub(super) lines: Vec<usize>,
    /// Times, `[frames]`, in seconds; empty if the file has none.
    pub(super) time: Vec<f64>,
    /// Findings about parts of the file that are not read.
    pub(super) left_out: Vec<Finding>,
}

impl SweepFile {
    /// Reads an array (`.npy`) or a table (any other extension).
    ///
    /// # Errors
    /// A file without frames, or with other values than numbers for taxels.
    pub(super) fn read(path: &Path) -> Result<Self, DataError> {
        if path.extension().is_some_and(|e| e == "npy") {
            return Self::read_array(path);
        }
        Self::read_table(path)
    }

    fn read_array(path: &Path) -> Result<Self, DataError> {
        /// Expected content, for messages.
        const EXPECTED: &str = "one sweep, numbers [steps][taxels] or [steps][rows][cols] (many sweeps in one array: .npz with `X`, `y`)";
        let io = |error| DataError::io(path, "read", error);
        let file = crate::open_file(path).map_err(|error| DataError::io(path, "open", error))?;
        let bytes = file.metadata().map_err(io)?.len();
        let array = Array::read_samples(std::io::BufReader::new(file), bytes)
            .map_err(|found| DataError::format(path, "file", EXPECTED, found))?;
        let shape = array.shape.clone();
        let kind = array.type_name();
        let found = || DataError::format(path, "array", EXPECTED, format!("{shape:?} of {kind}"));
        let patch = match shape[..] {
            [_, taxels] => Patch::Taxels(taxels),
            [_, rows, cols] => Patch::Grid(rows, cols),
            _ => return Err(found()),
        };
        let samples = array.into_numbers().ok_or_else(found)?.map_err(|wide| {
            DataError::format(path, "taxels", "values that a 32-bit float holds", wide.0)
        })?;
        let mut values = vec![0.0; samples.len()];
        samples.copy_to(0, &mut values);
        Ok(Self {
            patch,
            values: values.into_iter().map(f64::from).collect(),
            lines: Vec::new(),
            time: Vec::new(),
            left_out: Vec::new(),
        })
    }

    fn read_table(path: &Path) -> Result<Self, DataError> {
        let mut rows = Rows::open(path)?;
        let mut sweep = Self {
            patch: Patch::Taxels(0),
            values: Vec::new(),
            lines: Vec::new(),
            time: Vec::new(),
            left_out: Vec::new(),
        };
        // Index of the time column, and its unit in seconds.
        let mut time: Option<(usize, f64)> = None;
        // Columns that count frames, and columns that are not taxels by their name.
        let mut skipped: Vec<bool> = Vec::new();
        let mut first = true;
        while let Some(row) = rows.next()? {
            let named = first && is_line_of_names(&row);
            if first {
                if named {
                    time = row
                        .iter()
                        .enumerate()
                        .find_map(|(column, name)| Some((column, time_unit(name)?)));
                    skipped = row.iter().map(|name| is_one_of(name, STEP)).collect();
                    let is_taxel =
                        |at: &usize| !skipped[*at] && time.is_none_or(|(time, _)| time != *at);
                    let taxels: Vec<usize> = (0..row.len()).filter(is_taxel).collect();
                    let names: Vec<&str> = taxels.iter().map(|at| row[*at].as_str()).collect();
                    let unlike = unlike_the_others(&names);
                    sweep.left_out = left_out(&names, &unlike);
                    unlike
                        .iter()
                        .for_each(|place| skipped[taxels[*place]] = true);
                }
                let numbers = skipped.iter().filter(|skipped| **skipped).count();
                sweep.patch = Patch::Taxels(row.len() - numbers - usize::from(time.is_some()));
                first = false;
            }
            if named {
                continue;
            }
            sweep.lines.push(rows.line());
            for (column, cell) in row.iter().enumerate() {
                let value: f64 = cell
                    .trim()
                    .parse()
                    .map_err(|_| rows.error("a number", column, cell))?;
                match time {
                    Some((at, unit)) if at == column => sweep.time.push(unit * value),
                    _ if skipped.get(column) == Some(&true) => {}
                    _ => sweep.values.push(value),
                }
            }
        }
        if sweep.values.is_empty() {
            return Err(DataError::format(
                path,
                "file",
                "a row per frame",
                "no frame",
            ));
        }
        Ok(sweep)
    }
}
