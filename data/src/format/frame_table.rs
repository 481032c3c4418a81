//! Tables with one row per frame: sweep, material and one column per taxel.
//!
//! | column | holds |
//! |---|---|
//! | `sweep` | number or name of the sweep; its frames are in order |
//! | `material` (or `y`, `label`, `class`) | material, the same in every frame of a sweep |
//! | `time` (or `t`, `timestamp`), optional | seconds, or the unit at the end of the name (`t_ms`, `time [ns]`); gives the sample rate |
//! | `step` (or `frame`, `index`), `block`, `test`, optional | step is ignored; block and test as in [`tactmat`](super::tactmat) |
//! | every other | one taxel, in the order of the columns; if most are numbered alike (`t0`, `t1`, ...), only those: see `taxel_names.rs` |

use std::collections::BTreeMap;
use std::path::Path;

use super::named_sweeps::{Labels, some_of};
use super::recording::{Recording, Recordings};
use super::sweep_file::Patch;
use super::taxel_names::{left_out, unlike_the_others};
use crate::{DataError, Finding};

/// Columns of a table, by name; the values of a column are numbers or words.
pub(super) struct FrameTable<'a> {
    pub(super) path: &'a Path,
    pub(super) columns: Vec<(String, Column)>,
    /// Lines of the frames in a text file, from 1: `[frames]`; empty for other files.
    pub(super) lines: Vec<usize>,
}

/// Values of one column.
pub(super) enum Column {
    Numbers(Vec<f64>),
    Words(Vec<String>),
}

impl Column {
    fn words(&self) -> Vec<String> {
        match self {
            Self::Numbers(numbers) => numbers.iter().map(f64::to_string).collect(),
            Self::Words(words) => words.iter().map(|word| word.trim().to_string()).collect(),
        }
    }
}

/// Returns true if a column of this name has words if its values are not numbers.
pub(super) fn may_hold_words(name: &str) -> bool {
    is_one_of(name, SWEEP) || is_one_of(name, MATERIAL)
}

pub(super) fn is_one_of(name: &str, names: &[&str]) -> bool {
    names.contains(&name.trim().to_ascii_lowercase().as_str())
}

/// Returns the unit of a time column in seconds, by its name (`time`, `t_ms`, `Time [ns]`); `None` for any other column.
pub(super) fn time_unit(name: &str) -> Option<f64> {
    let name = name.trim().to_lowercase();
    let mut words = name.split(|c: char| c.is_whitespace() || "_[]()/".contains(c));
    let is_time = words.next().is_some_and(|word| TIME.contains(&word));
    let mut units = words.filter(|word| !word.is_empty());
    match (is_time, units.next(), units.next()) {
        (true, None, _) => Some(1.0),
        (true, Some(unit), None) => UNITS
            .iter()
            .find(|(known, _)| *known == unit)
            .map(|(_, seconds)| *seconds),
        _ => None,
    }
}

/// Names of the column of sweeps.
const SWEEP: &[&str] = &["sweep", "sweep_id"];
/// Names of the column of materials.
pub(super) const MATERIAL: &[&str] = &["material", "y", "label", "class"];
/// Names of columns that probably hold the sweeps under a wrong name.
const MEANT_AS_SWEEP: &[&str] = &[
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
const MEANT_AS_MATERIAL: &[&str] = &[
    "classes",
    "labels",
    "materials",
    "object",
    "surface",
    "target",
    "texture",
];
/// Names of the column of times, without their unit.
const TIME: &[&str] = &["time", "t", "timestamp", "timestamps"];
/// Units of time, with their length in seconds.
const UNITS: &[(&str, f64)] = &[
    ("s", 1.0),
    ("sec", 1.0),
    ("seconds", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("µs", 1e-6),
    ("ns", 1e-9),
];
/// Names of columns that count frames; the empty name is pandas' index.
pub(super) const STEP: &[&str] = &["step", "frame", "index", "", "unnamed: 0"];
/// Names of the column of block numbers.
const BLOCK: &[&str] = &["block"];
/// Names of the column of test flags.
const TEST: &[&str] = &["test", "test_flag"];

impl<'a> FrameTable<'a> {
    /// Returns the sweeps in the order of their first frames.
    ///
    /// - `labels`: if they are optional, so is the column `sweep`: without it all frames are one sweep
    ///
    /// # Errors
    /// A column that is missing or has words instead of numbers; a sweep of two materials.
    pub(super) fn into_recordings(self, labels: Labels) -> Result<Recordings<'a>, DataError> {
        let (taxels, findings) = self.taxels()?;
        let (sweep_of, material_of) = match labels {
            Labels::Needed => (
                self.required(SWEEP)?.words(),
                Some(self.required(MATERIAL)?.words()),
            ),
            Labels::Optional => {
                let one = || vec![super::stem(self.path); taxels[0].len()];
                let sweep_of = self.find(SWEEP).map_or_else(one, Column::words);
                (sweep_of, self.find(MATERIAL).map(Column::words))
            }
        };
        let mut order: Vec<&str> = Vec::new();
        let mut frames: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (row, sweep) in sweep_of.iter().enumerate() {
            let rows = frames.entry(sweep).or_insert_with(|| {
                order.push(sweep);
                Vec::new()
            });
            if let Some(&first) = rows.first()
                && let Some(material_of) = &material_of
                && material_of[first] != material_of[row]
            {
                let found = format!("`{}` and `{}`", material_of[first], material_of[row]);
                let item = format!("sweep `{sweep}`, row {}", row + 1);
                return Err(self.error(item, "one material", found));
            }
            rows.push(row);
        }
        let firsts: Vec<usize> = order.iter().map(|sweep| frames[sweep][0]).collect();
        let blocks = self.per_sweep(BLOCK, &firsts, |value| value as u32)?;
        let test = self.per_sweep(TEST, &firsts, |value| value != 0.0)?;
        let time = self.times();
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
                seconds: time.map_or_else(Vec::new, |(time, unit)| {
                    rows.iter().map(|&row| unit * time[row]).collect()
                }),
                material: material_of.as_ref().map(|of| of[rows[0]].clone()),
                block: blocks.as_ref().map(|blocks| blocks[place]),
                test: test.as_ref().map(|test| test[place]),
            }
        };
        let recordings: Vec<Recording> = order.iter().enumerate().map(of_sweep).collect();
        Ok(Recordings {
            path: self.path,
            patch: Patch::Taxels(taxels.len()),
            recordings,
            findings,
        })
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
            self.error(
                format!("column `{}`", names[0]),
                "a table with columns `sweep`, `material` and one per taxel",
                format!("only {found}"),
            )
        })
    }

    /// Returns the columns of the taxels, `[taxels][frames]`, and findings about columns that are not read.
    fn taxels(&self) -> Result<(Vec<&[f64]>, Vec<Finding>), DataError> {
        let known = [SWEEP, MATERIAL, STEP, BLOCK, TEST].concat();
        let mut columns = Vec::new();
        for (name, column) in &self.columns {
            if is_one_of(name, &known) || time_unit(name).is_some() {
                continue;
            }
            columns.push((name.as_str(), column));
        }
        if columns.is_empty() {
            return Err(self.error("columns", "one per taxel", "none"));
        }
        let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
        let unlike = unlike_the_others(&names);
        let mut taxels = Vec::new();
        for (place, (name, column)) in columns.iter().enumerate() {
            match column {
                _ if unlike.contains(&place) => {}
                Column::Numbers(numbers) => taxels.push(numbers.as_slice()),
                Column::Words(_) => {
                    let item = format!("column `{name}`");
                    return Err(self.error(item, "a taxel's numbers", "words"));
                }
            }
        }
        Ok((taxels, left_out(&names, &unlike)))
    }

    /// Returns the column of times, with its unit in seconds.
    fn times(&self) -> Option<(&[f64], f64)> {
        self.columns.iter().find_map(|(name, column)| {
            let Column::Numbers(time) = column else {
                return None;
            };
            Some((time.as_slice(), time_unit(name)?))
        })
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

/// Maximum relative difference between the frame periods of sweeps of one rate.
const OTHER_RATE: f64 = 0.1;

/// Returns the sample rate in Hz from the times of frames, in seconds.
///
/// - `sweeps`: name and times of each
///
/// # Errors
/// Times that decrease or repeat; sweeps of different rates.
pub(super) fn rate_of<'a>(
    path: &Path,
    sweeps: impl Iterator<Item = (&'a str, Vec<f64>)>,
) -> Result<f64, DataError> {
    let grow = "seconds that grow from frame to frame";
    let mut all = Vec::new();
    // Name, mean and median period of each sweep.
    let mut periods = Vec::new();
    for (name, times) in sweeps {
        let mut between: Vec<f64> = times.array_windows().map(|&[a, b]| b - a).collect();
        if let Some(at) = between.iter().position(|&seconds| seconds < 0.0) {
            let item = format!("column `time`, sweep `{name}`");
            let found = format!(
                "{} s after {} s (frame {})",
                times[at + 1],
                times[at],
                at + 1
            );
            return Err(DataError::format(path, item, grow, found));
        }
        all.extend_from_slice(&between);
        between.sort_by(f64::total_cmp);
        if let Some(&median) = between.get(between.len() / 2) {
            let mean = between.iter().sum::<f64>() / between.len() as f64;
            periods.push((name, [mean, median]));
        }
    }
    all.sort_by(f64::total_cmp);
    let period = match all.get(all.len() / 2) {
        Some(&period) if period.is_finite() && period > 0.0 => period,
        other => {
            let found = other.map_or("a single frame".into(), |period| {
                format!("{period} s between frames")
            });
            return Err(DataError::format(path, "column `time`", grow, found));
        }
    };
    // A pause changes a sweep's mean period, and rounded times change its median; another rate changes both.
    let is_other = |value: &f64| (value / period - 1.0).abs() > OTHER_RATE;
    if let Some((name, [_, median])) = periods.iter().find(|(_, both)| both.iter().all(is_other)) {
        let hz = |period: f64| (100.0 / period).round() / 100.0;
        let expected = format!("{} Hz, as of most frames", hz(period));
        let found = format!("{} Hz", hz(*median));
        return Err(DataError::format(
            path,
            format!("sweep `{name}`"),
            expected,
            found,
        ));
    }
    // Files contain rounded times: a rate within a thousandth of a whole number is that number.
    let rate = 1.0 / period;
    let whole = rate.round();
    Ok(if (rate - whole).abs() < 1e-3 * rate {
        whole
    } else {
        rate
    })
}
