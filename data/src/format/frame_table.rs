//! Tables with one row per frame: sweep, material and one column per taxel.
//!
//! | column | holds |
//! |---|---|
//! | `sweep` | number or name of the sweep; its frames are in order |
//! | `material` (or `y`, `label`, `class`) | material, the same in every frame of a sweep |
//! | `time` (or `t`, `timestamp`, `Zeit [ms]`, `sec` and `nanosec`), optional | seconds, another unit by the name, Unix time or dates; gives the sample rate, see `time_names.rs` |
//! | `step` (or `frame`, `index`), `test`, optional | step is ignored; test as in [`tactmat`](super::tactmat) |
//! | `block` (or `session`, `bout`, `day`, `subject`, `group`), optional | sweeps that were recorded together, by number or name |
//! | `speed`, `force` (`Force [N]`), constant during every sweep; optional | a condition: a number per sweep that the robot knows |
//! | every other | one taxel, in the order of the columns; if most are numbered alike (`t0`, `t1`, ...), only those: see `taxel_names.rs` |

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use super::dialect::number;
use super::named_sweeps::{Labels, block_numbers, some_of};
use super::read_options::ReadOptions;
use super::recording::{LabelRun, Recording, Recordings};
use super::sweep_file::Patch;
use super::taxel_names::{chosen, doubtful, left_out, unlike_the_others};
use super::time_names::{are_times, is_time, unused_times};
use super::time_stamps::{TimeStamps, time_stamps};
use crate::{Condition, DataError, Finding, Remedy};

/// Columns of a table, by name; the values of a column are numbers or words.
pub(super) struct FrameTable<'a> {
    pub(super) path: &'a Path,
    pub(super) columns: Vec<(String, Column)>,
    /// Lines of the frames in a text file, from 1: `[frames]`; empty for other files.
    pub(super) lines: Vec<usize>,
    /// Findings of the reader of the file.
    pub(super) findings: Vec<Finding>,
}

/// Values of one column.
pub(super) enum Column {
    Numbers(Vec<f64>),
    Words(Vec<String>),
}

/// Column that holds a condition.
struct ConditionColumn {
    /// Place among the columns.
    place: usize,
    condition: Condition,
    /// Value of each sweep.
    values: Vec<f32>,
}

impl Column {
    /// Returns the numbers; `None` if a word is not a number.
    fn numbers(&self) -> Option<Cow<'_, [f64]>> {
        match self {
            Self::Numbers(numbers) => Some(Cow::Borrowed(numbers)),
            Self::Words(words) => words.iter().map(|word| number(word)).collect(),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Numbers(numbers) => numbers.len(),
            Self::Words(words) => words.len(),
        }
    }

    fn words(&self) -> Vec<String> {
        match self {
            Self::Numbers(numbers) => numbers.iter().map(f64::to_string).collect(),
            Self::Words(words) => words.iter().map(|word| word.trim().to_string()).collect(),
        }
    }
}

/// Returns true if a column of this name has words if its values are not numbers.
pub(super) fn may_hold_words(name: &str) -> bool {
    [SWEEP, MATERIAL, BLOCK]
        .iter()
        .any(|names| is_one_of(name, names))
}

/// Returns true if a column of this name need not hold numbers, because it is not a taxel.
///
/// - `taxels`: names of the columns that are taxels; empty if all others are
pub(super) fn is_text(name: &str, taxels: &[String]) -> bool {
    let left_out = !taxels.is_empty() && !taxels.iter().any(|taxel| taxel.trim() == name.trim());
    may_hold_words(name) || is_time(name) || (left_out && !is_one_of(name, TEST))
}

/// Returns true for the columns that are not read since their names differ from those of all taxels: `[columns]`.
pub(super) fn not_taxels(names: &[&str]) -> Vec<bool> {
    let known = [SWEEP, MATERIAL, STEP, BLOCK, TEST].concat();
    let times = are_times(names);
    let may_be_taxel = |place: &usize| !times[*place] && !is_one_of(names[*place], &known);
    let places: Vec<usize> = (0..names.len()).filter(may_be_taxel).collect();
    let of_places: Vec<&str> = places.iter().map(|place| names[*place]).collect();
    let mut unread = vec![false; names.len()];
    for unlike in unlike_the_others(&of_places) {
        unread[places[unlike]] = true;
    }
    unread
}

pub(super) fn is_one_of(name: &str, names: &[&str]) -> bool {
    names.contains(&name.trim().to_ascii_lowercase().as_str())
}

/// Names of the column of sweeps.
const SWEEP: &[&str] = &["sweep", "sweep_id", "episode_index"];
/// Names of the column of materials.
pub(super) const MATERIAL: &[&str] = &["material", "y", "label", "class", "task"];
/// Names of columns that probably hold the sweeps under a wrong name.
pub(super) const MEANT_AS_SWEEP: &[&str] = &[
    "episode",
    "id",
    "recording",
    "run",
    "sample",
    "sweep_number",
    "sweeps",
    "trial",
];
/// Names of columns that probably hold the materials under a wrong name.
pub(super) const MEANT_AS_MATERIAL: &[&str] = &[
    "classes",
    "labels",
    "materials",
    "object",
    "surface",
    "target",
    "texture",
];
/// Names of columns that count frames; the empty name is pandas' index.
pub(super) const STEP: &[&str] = &["step", "frame", "frame_index", "index", "", "unnamed: 0"];
/// Names of the column of blocks: sweeps of one block were recorded together.
pub(super) const BLOCK: &[&str] = &[
    "block",
    "session",
    "session_id",
    "bout",
    "day",
    "subject",
    "group",
];
/// Names of the column of test flags.
const TEST: &[&str] = &["test", "test_flag"];

impl<'a> FrameTable<'a> {
    /// Returns the sweeps in the order of their first frames.
    ///
    /// - `labels`: if they are optional, so is the column `sweep`: without it all frames are one sweep
    ///
    /// # Errors
    /// A column that is missing or has words instead of numbers; a sweep of two materials.
    pub(super) fn into_recordings(
        self,
        labels: Labels,
        options: &ReadOptions,
    ) -> Result<Recordings<'a>, DataError> {
        let (sweep_of, material_of) = self.sweeps_and_materials(labels, options)?;
        let (order, frames) = frames_of_sweeps(&sweep_of);
        let conditions = self.conditions(&order, &frames, &options.columns);
        let (taxels, mut findings) = self.taxels(&options.columns, &conditions)?;
        if let Some(material_of) = material_of.as_ref().filter(|_| options.windows.is_none()) {
            self.refuse_changing_material(&frames, material_of)?;
        }
        let firsts: Vec<usize> = order.iter().map(|sweep| frames[sweep][0]).collect();
        let blocks = self.blocks(&firsts);
        let test = self.per_sweep(TEST, &firsts, |value| value != 0.0)?;
        let times = time_stamps(self.path, &self.lines, &self.columns)?;
        let of_sweep = |(place, sweep): (usize, &&str)| {
            let rows = &frames[*sweep];
            let values = rows
                .iter()
                .flat_map(|&row| taxels.iter().map(move |column| column[row]));
            Recording {
                name: (*sweep).to_string(),
                file: self.path.into(),
                lines: match self.lines[..] {
                    [] => Vec::new(),
                    _ => rows.iter().map(|&row| self.lines[row]).collect(),
                },
                values: values.collect(),
                seconds: times.as_ref().map_or_else(Vec::new, |times| {
                    rows.iter().map(|&row| times.seconds[row]).collect()
                }),
                material: material_of.as_ref().map(|of| of[rows[0]].clone()),
                labels: match (&material_of, &options.windows) {
                    (Some(of), Some(_)) => LabelRun::all(rows.iter().map(|&row| &of[row])),
                    _ => Vec::new(),
                },
                block: blocks.as_ref().map(|blocks| blocks[place]),
                test: test.as_ref().map(|test| test[place]),
                conditions: conditions.iter().map(|of| of.values[place]).collect(),
            }
        };
        let recordings: Vec<Recording> = order.iter().enumerate().map(of_sweep).collect();
        findings.extend(times.as_ref().and_then(|times| times.finding.clone()));
        findings.extend(self.findings.iter().cloned());
        Ok(Recordings {
            path: self.path,
            patch: Patch::Taxels(taxels.len()),
            recordings,
            clockwork: times
                .as_ref()
                .map(|TimeStamps { clockwork, .. }| *clockwork),
            resolution: times.as_ref().map_or(0.0, |times| times.resolution),
            conditions: conditions.into_iter().map(|of| of.condition).collect(),
            findings,
        })
    }

    /// Returns sweep and material of each frame. A continuous recording that is cut into windows needs neither.
    fn sweeps_and_materials(
        &self,
        labels: Labels,
        options: &ReadOptions,
    ) -> Result<(Vec<String>, Option<Vec<String>>), DataError> {
        if labels == Labels::Needed && options.windows.is_none() {
            let sweeps = self.required(SWEEP)?.words();
            return Ok((sweeps, Some(self.required(MATERIAL)?.words())));
        }
        let is_cut = options.windows.is_some();
        let meant = |names: &[&str]| is_cut && self.find(names).is_some();
        let sweep_of = match self.find(SWEEP) {
            Some(column) => column.words(),
            // A column that separates recordings under another name would be read as a taxel.
            None if meant(MEANT_AS_SWEEP) => self.required(SWEEP)?.words(),
            None => match self.find_blocks().filter(|_| is_cut) {
                Some(column) => column.words(),
                None => vec![super::stem(self.path); self.frames()],
            },
        };
        let material_of = match self.find(MATERIAL) {
            Some(column) => Some(column.words()),
            None if meant(MEANT_AS_MATERIAL) => Some(self.required(MATERIAL)?.words()),
            None => None,
        };
        Ok((sweep_of, material_of))
    }

    /// Returns the number of frames.
    fn frames(&self) -> usize {
        self.columns.first().map_or(0, |(_, column)| column.len())
    }

    /// Returns an error if the material changes within a sweep.
    fn refuse_changing_material(
        &self,
        frames: &BTreeMap<&str, Vec<usize>>,
        material_of: &[String],
    ) -> Result<(), DataError> {
        let changes = frames.iter().filter_map(|(sweep, rows)| {
            let first = &material_of[*rows.first()?];
            let row = rows.iter().find(|&&row| material_of[row] != *first)?;
            Some((*row, sweep, first))
        });
        match changes.min() {
            None => Ok(()),
            Some((row, sweep, first)) => {
                let found = format!("`{first}` and `{}`", material_of[row]);
                let item = format!("sweep `{sweep}`, row {}", row + 1);
                let error = self.error(item, "one material", found);
                Err(error.with_remedy(Remedy::CutWindows))
            }
        }
    }

    fn error(
        &self,
        item: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> DataError {
        DataError::format(self.path, item, expected, found)
    }

    fn find(&self, names: &[&str]) -> Option<&Column> {
        let found = self.columns.iter().find(|(name, _)| is_one_of(name, names));
        found.map(|(_, column)| column)
    }

    /// Returns the column of the blocks: `block`, else the first of the other names.
    fn find_blocks(&self) -> Option<&Column> {
        self.find(&["block"]).or_else(|| self.find(BLOCK))
    }

    /// Succeeds if the table has the columns of sweeps and materials.
    ///
    /// # Errors
    /// A missing column.
    pub(super) fn check_names(&self) -> Result<(), DataError> {
        self.required(SWEEP)?;
        self.required(MATERIAL)?;
        Ok(())
    }

    fn required(&self, names: &[&str]) -> Result<&Column, DataError> {
        let is_labelled = self.find(MATERIAL).is_some();
        self.find(names).ok_or_else(|| {
            let there = || self.columns.iter().map(|(name, _)| name.as_str());
            // Columns that are not taxels come first, since messages list only a few columns.
            let known = [SWEEP, MATERIAL, MEANT_AS_SWEEP, MEANT_AS_MATERIAL].concat();
            let (mut shown, taxels): (Vec<&str>, Vec<&str>) =
                there().partition(|name| is_one_of(name, &known));
            shown.extend(taxels);
            let quoted = |name: &str| match is_one_of(name, MATERIAL) && name != MATERIAL[0] {
                true => format!("`{name}` (read as `{}`)", MATERIAL[0]),
                false => format!("`{name}`"),
            };
            let mut found = some_of(shown.into_iter().map(quoted).collect());
            let usual = match names {
                SWEEP => MEANT_AS_SWEEP,
                _ => MEANT_AS_MATERIAL,
            };
            if let Some(meant) = there().find(|name| is_one_of(name, usual)) {
                let name = names[0];
                found.push_str(&format!(
                    "; rename `{meant}` to `{name}`, if that is what it holds"
                ));
            }
            let error = self.error(
                format!("column `{}`", names[0]),
                "a table with columns `sweep`, `material` and one per taxel",
                format!("only {found}"),
            );
            match names == SWEEP && is_labelled {
                // A recording with a label in each frame.
                true => error.with_remedy(Remedy::CutWindows),
                false => error,
            }
        })
    }

    /// Returns the columns of the taxels, `[taxels][frames]`, and findings about columns that are not read.
    ///
    /// - `wanted`: names of the taxels; empty: all columns without another meaning
    /// - `conditions`: columns that are none
    fn taxels(
        &self,
        wanted: &[String],
        conditions: &[ConditionColumn],
    ) -> Result<(Vec<&[f64]>, Vec<Finding>), DataError> {
        let known = [SWEEP, MATERIAL, STEP, BLOCK, TEST].concat();
        let all: Vec<&str> = self.columns.iter().map(|(name, _)| name.as_str()).collect();
        let times = are_times(&all);
        let (mut columns, mut place_of) = (Vec::new(), Vec::new());
        for (place, (name, column)) in self.columns.iter().enumerate() {
            // pandas stores its index in Parquet files.
            let is_index = name.starts_with("__index_level_");
            let is_condition = conditions.iter().any(|of| of.place == place);
            if is_index || is_condition || is_one_of(name, &known) || times[place] {
                continue;
            }
            columns.push((name.as_str(), column));
            place_of.push(place);
        }
        if columns.is_empty() {
            return Err(self.error("columns", "one per taxel", "none"));
        }
        let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
        let (places, mut findings) = match wanted {
            [] => {
                let unlike = unlike_the_others(&names);
                let places = (0..names.len()).filter(|place| !unlike.contains(place));
                let places: Vec<usize> = places.collect();
                let mut findings = left_out(&names, &unlike);
                let is_taxel = |place: usize| places.iter().any(|&taxel| place_of[taxel] == place);
                findings.extend(doubtful(&all, is_taxel));
                findings.extend(second_of_a_kind(&all));
                (places, findings)
            }
            wanted => (chosen(self.path, &names, wanted)?, Vec::new()),
        };
        findings.extend(unused_times(&all));
        let numbers = |place: usize| match columns[place] {
            (_, Column::Numbers(numbers)) => Ok(numbers.as_slice()),
            (name, Column::Words(_)) => {
                Err(self.error(format!("column `{name}`"), "a taxel's numbers", "words"))
            }
        };
        let taxels: Result<Vec<&[f64]>, DataError> = places.into_iter().map(numbers).collect();
        Ok((taxels?, findings))
    }

    /// Returns the block number of each sweep, by its first frame.
    fn blocks(&self, firsts: &[usize]) -> Option<Vec<u32>> {
        let words = self.find_blocks()?.words();
        let of_sweep: Vec<String> = firsts.iter().map(|&row| words[row].clone()).collect();
        Some(block_numbers(&of_sweep))
    }

    /// Returns the columns with the name of a condition, except named taxels, that have one number during every sweep.
    ///
    /// - `order`: names of the sweeps
    /// - `frames`: frames of each
    fn conditions(
        &self,
        order: &[&str],
        frames: &BTreeMap<&str, Vec<usize>>,
        taxels: &[String],
    ) -> Vec<ConditionColumn> {
        let mut found: Vec<ConditionColumn> = Vec::new();
        for (place, (name, column)) in self.columns.iter().enumerate() {
            let is_taxel = taxels.iter().any(|taxel| taxel.trim() == name.trim());
            let Some(condition) = Condition::of_name(name).filter(|_| !is_taxel) else {
                continue;
            };
            let is_second = |of: &ConditionColumn| of.condition.quantity == condition.quantity;
            let values = column.numbers().and_then(|numbers| {
                let of_sweep = order.iter().map(|sweep| {
                    let mut rows = frames[sweep].iter().map(|&row| numbers[row] as f32);
                    let first = rows.next().filter(|first| first.is_finite())?;
                    rows.all(|other| other == first).then_some(first)
                });
                of_sweep.collect::<Option<Vec<f32>>>()
            });
            if let Some(values) = values.filter(|_| !found.iter().any(is_second)) {
                found.push(ConditionColumn {
                    place,
                    condition,
                    values,
                });
            }
        }
        found
    }

    /// Returns one value per sweep: that of its first frame.
    fn per_sweep<T>(
        &self,
        names: &[&str],
        firsts: &[usize],
        convert: impl Fn(f64) -> T,
    ) -> Result<Option<Vec<T>>, DataError> {
        match self.find(names) {
            None => Ok(None),
            Some(Column::Numbers(numbers)) => {
                let of_sweep = firsts.iter().map(|&row| numbers[row]);
                if let Some(odd) = of_sweep.clone().find(|v| *v < 0.0 || v.fract() != 0.0) {
                    let item = format!("column `{}`", names[0]);
                    return Err(self.error(item, "whole numbers from 0", odd.to_string()));
                }
                Ok(Some(of_sweep.map(convert).collect()))
            }
            Some(Column::Words(_)) => {
                let item = format!("column `{}`", names[0]);
                Err(self.error(item, "whole numbers from 0", "words"))
            }
        }
    }
}

/// Returns notes on columns with a meaning that an earlier column already has, such as `class` after `material`.
fn second_of_a_kind(names: &[&str]) -> Vec<Finding> {
    let mut notes = Vec::new();
    for kind in [SWEEP, MATERIAL, BLOCK, TEST] {
        let mut of_kind = names.iter().filter(|name| is_one_of(name, kind));
        if let Some(first) = of_kind.next() {
            notes.extend(of_kind.map(|second| {
                Finding::not_read(format!(
                    "`{second}`: not read, since `{first}` has its meaning"
                ))
            }));
        }
    }
    notes
}

/// Returns the sweeps in the order of their first frames, and the frames of each.
fn frames_of_sweeps(sweep_of: &[String]) -> (Vec<&str>, BTreeMap<&str, Vec<usize>>) {
    let mut order: Vec<&str> = Vec::new();
    let mut frames: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (row, sweep) in sweep_of.iter().enumerate() {
        let rows = frames.entry(sweep).or_insert_with(|| {
            order.push(sweep);
            Vec::new()
        });
        rows.push(row);
    }
    (order, frames)
}
