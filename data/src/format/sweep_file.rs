//! Files that contain one sweep.
//!
//! | file | holds |
//! |---|---|
//! | `.csv` | one row per frame and one column per taxel (`speed` and `force` are conditions if they are constant in every file), with or without a line of names (or of the numbers from 0); a column `time` (seconds; other names and units in `time_names.rs`) gives the sample rate, a column `frame` or `index` is ignored |
//! | `.npy` | `[steps][taxels]` or `[steps][rows][cols]`, numbers of any type |

use std::fmt;
use std::path::Path;

use super::csv::Rows;
use super::dialect::number;
use super::file_kind;
use super::file_layout::{Axes, read_lines};
use super::frame_table::{Column, MATERIAL, STEP, is_one_of};
use super::narrow::HELD;
use super::npy::Array;
use super::read_options::ReadOptions;
use super::recording::LabelRun;
use super::resolution::check_resolution;
use super::taxel_names::{chosen, doubtful, is_line_of_names, left_out, unlike_the_others};
use super::time_names::{are_times, unused_times};
use super::time_stamps::{Clockwork, time_stamps};
use crate::{Condition, DataError, Finding, SweepShape};

/// Beginnings of the names of text files without sweeps, in lower case.
const NO_SWEEPS: [&str; 4] = ["readme", "license", "licence", "requirements"];

/// Returns true for a file that can contain a sweep, by its name.
pub(super) fn is_sweep_file(path: &Path) -> bool {
    let name = super::stem(path).to_lowercase();
    let is_sweep = |extension: &std::ffi::OsStr| {
        extension == "npy" || super::TABLES.iter().any(|table| extension == *table)
    };
    path.extension().is_some_and(is_sweep) && !NO_SWEEPS.iter().any(|no| name.starts_with(no))
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
    /// Meaning of the stamps, if the file has any.
    pub(super) clockwork: Option<Clockwork>,
    /// Unit of the last digit of all stamps, in seconds; 0 if that is not known.
    pub(super) resolution: f64,
    /// Stretches of one label, if the file is cut by its labels.
    pub(super) labels: Vec<LabelRun>,
    /// Columns with the name of a condition; the value is `None` if it changes. Empty if such columns are taxels.
    pub(super) conditions: Vec<(Condition, Option<f32>)>,
    /// Findings about parts of the file that are not read.
    pub(super) left_out: Vec<Finding>,
}

impl SweepFile {
    /// Reads an array (`.npy`) or a table (any other extension).
    ///
    /// # Errors
    /// A file without frames, or with other values than numbers for taxels.
    pub(super) fn read(
        path: &Path,
        options: &ReadOptions,
        of_conditions: OfConditions,
    ) -> Result<Self, DataError> {
        if path.extension().is_some_and(|e| e == "npy") {
            return Self::read_array(path, options.layout.axes.as_ref());
        }
        if let Some(lines) = options.layout.lines_per_frame {
            let (values, taxels, left_out) = read_lines(path, lines, &options.columns)?;
            return Ok(Self {
                values,
                left_out,
                ..Self::empty(Patch::Taxels(taxels))
            });
        }
        Self::read_table(path, options, of_conditions)
    }

    fn empty(patch: Patch) -> Self {
        Self {
            patch,
            values: Vec::new(),
            lines: Vec::new(),
            time: Vec::new(),
            clockwork: None,
            resolution: 0.0,
            labels: Vec::new(),
            conditions: Vec::new(),
            left_out: Vec::new(),
        }
    }

    fn read_array(path: &Path, axes: Option<&Axes>) -> Result<Self, DataError> {
        /// Expected content, for messages.
        const EXPECTED: &str = "one sweep, numbers [steps][taxels] or [steps][rows][cols] (many sweeps in one array: .npz with `X`, `y`)";
        file_kind::refuse_pretended(path, EXPECTED)?;
        let io = |error| DataError::io(path, "read", error);
        let file = crate::open_file(path).map_err(|error| DataError::io(path, "open", error))?;
        let bytes = file.metadata().map_err(io)?.len();
        let array = Array::read(std::io::BufReader::new(file), bytes)
            .map_err(|found| DataError::format(path, "file", EXPECTED, found))?;
        let shape = array.shape.clone();
        let kind = array.type_name();
        let found = || DataError::format(path, "array", EXPECTED, format!("{shape:?} of {kind}"));
        let patch = match shape[..] {
            [_, taxels] => Patch::Taxels(taxels),
            [_, rows, cols] => Patch::Grid(rows, cols),
            _ => return Err(found()),
        };
        let values = match array.values_f64().ok_or_else(found)? {
            Ok(values) => values,
            Err(too_wide) => {
                let values = array.wide_values().unwrap_or_default();
                check_resolution(path, patch.shape(shape[0]), &values)?;
                return Err(DataError::format(path, "taxels", HELD, too_wide.0));
            }
        };
        let Some(axes) = axes else {
            return Ok(Self {
                values,
                ..Self::empty(patch)
            });
        };
        let turned = axes.steps_first(&shape, &values);
        let (extents, values) = turned.ok_or_else(|| {
            DataError::format(
                path,
                "array",
                "as many axes as are named",
                format!("{shape:?}"),
            )
        })?;
        let patch = match extents[1..] {
            [rows, cols] => Patch::Grid(rows, cols),
            _ => Patch::Taxels(extents[1..].iter().product()),
        };
        Ok(Self {
            values,
            ..Self::empty(patch)
        })
    }

    fn read_table(
        path: &Path,
        options: &ReadOptions,
        of_conditions: OfConditions,
    ) -> Result<Self, DataError> {
        let mut rows = Rows::open(path)?;
        let mut sweep = Self::empty(Patch::Taxels(0));
        let mut columns = Columns::default();
        let mut first = true;
        while let Some(row) = rows.next()? {
            let named = first && is_line_of_names(&row);
            if first {
                if named {
                    columns = Columns::named(path, &row, options, of_conditions)?;
                    sweep.conditions = columns.conditions.clone();
                    sweep.left_out = std::mem::take(&mut columns.findings);
                } else {
                    columns.roles = vec![Role::Taxel; row.len()];
                }
                let taxels = columns.roles.iter().filter(|role| **role == Role::Taxel);
                sweep.patch = Patch::Taxels(taxels.count());
                first = false;
            }
            if named {
                continue;
            }
            sweep.lines.push(rows.line());
            for (column, (cell, role)) in row.into_iter().zip(&columns.roles).enumerate() {
                match role {
                    Role::Taxel => sweep.values.push(rows.number(column, &cell)),
                    Role::Words(place) => {
                        if let (_, Column::Words(words)) = &mut columns.words[*place] {
                            words.push(cell);
                        }
                    }
                    Role::Condition(place) => {
                        let value = number(&cell).map(|value| value as f32);
                        let (_, known) = &mut sweep.conditions[*place];
                        let is_first = sweep.lines.len() == 1;
                        *known = value.filter(|v| v.is_finite() && (is_first || *known == value));
                    }
                    Role::Skipped => {}
                }
            }
        }
        sweep.left_out.extend(rows.finish()?);
        if sweep.values.is_empty() {
            return Err(DataError::format(
                path,
                "file",
                "a row per frame",
                "no frame",
            ));
        }
        if let Some(times) = time_stamps(path, &sweep.lines, &columns.words)? {
            sweep.time = times.seconds;
            sweep.clockwork = Some(times.clockwork);
            sweep.resolution = times.resolution;
            sweep.left_out.extend(times.finding);
        }
        let labels = columns
            .words
            .iter()
            .find(|(name, _)| is_one_of(name, MATERIAL));
        if let Some((_, Column::Words(labels))) = labels {
            sweep.labels = LabelRun::all(labels.iter().map(|label| label.trim()));
        }
        Ok(sweep)
    }
}

/// Meaning of columns with the name of a condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OfConditions {
    /// Numbers that are known for the sweep.
    Known,
    /// Taxels, as columns of any other name: they change during a sweep.
    Taxels,
}

impl OfConditions {
    /// Returns the condition that a column holds; `None` for other columns.
    fn condition(self, name: &str, options: &ReadOptions) -> Option<Condition> {
        let is_taxel = options.columns.iter().any(|of| of.trim() == name.trim());
        let condition = Condition::of_name(name)?;
        (self == Self::Known && !is_taxel).then_some(condition)
    }
}

/// Meaning of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Role {
    Taxel,
    /// Times or labels, by their place among these columns.
    Words(usize),
    /// Number that is known for the sweep, by its place among these columns.
    Condition(usize),
    /// A number of the frame, or a column that is not a taxel by its name.
    Skipped,
}

/// Columns of one file.
#[derive(Default)]
struct Columns {
    roles: Vec<Role>,
    /// Columns of times and labels.
    words: Vec<(String, Column)>,
    conditions: Vec<(Condition, Option<f32>)>,
    findings: Vec<Finding>,
}

impl Columns {
    /// Returns the meanings of columns with these names.
    fn named(
        path: &Path,
        names: &[String],
        options: &ReadOptions,
        of_conditions: OfConditions,
    ) -> Result<Self, DataError> {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let times = are_times(&names);
        let is_label = |name: &str| options.windows.is_some() && is_one_of(name, MATERIAL);
        let mut columns = Self::default();
        // Columns that may be taxels.
        let mut others: Vec<usize> = Vec::new();
        for (place, name) in names.iter().enumerate() {
            columns.roles.push(if times[place] || is_label(name) {
                columns
                    .words
                    .push(((*name).into(), Column::Words(Vec::new())));
                Role::Words(columns.words.len() - 1)
            } else if let Some(condition) = of_conditions.condition(name, options) {
                columns.conditions.push((condition, None));
                Role::Condition(columns.conditions.len() - 1)
            } else {
                if !is_one_of(name, STEP) {
                    others.push(place);
                }
                Role::Skipped
            });
        }
        let of_others: Vec<&str> = others.iter().map(|place| names[*place]).collect();
        let taxels = match &options.columns[..] {
            [] => {
                let unlike = unlike_the_others(&of_others);
                columns.findings = left_out(&of_others, &unlike);
                (0..others.len())
                    .filter(|place| !unlike.contains(place))
                    .collect()
            }
            wanted => {
                let mut taxels = chosen(path, &of_others, wanted)?;
                taxels.sort_unstable();
                taxels
            }
        };
        for place in taxels {
            columns.roles[others[place]] = Role::Taxel;
        }
        columns.findings.extend(unused_times(&names));
        let roles = &columns.roles;
        let is_taxel = |place: usize| roles[place] == Role::Taxel;
        if options.columns.is_empty() {
            columns.findings.extend(doubtful(&names, is_taxel));
        }
        Ok(columns)
    }
}
