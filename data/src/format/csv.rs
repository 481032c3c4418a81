//! Text tables: a folder of one `.csv` per sweep, or a single `.csv` with a row per frame of every sweep.
//!
//! | layout | material of a sweep |
//! |---|---|
//! | `FOLDER/labels.csv` with columns `file`, `material` or `label` (optional `block`, `test`) | as the table says |
//! | `FOLDER/felt/*.csv`, `FOLDER/cork/*.csv` | the name of its folder |
//! | `sweeps.csv` with columns `sweep`, `material` | see `frame_table.rs` |
//!
//! A sweep's file has a row per frame and a column per taxel, with or without a line of names (or of the numbers from 0); a column `time` (seconds, or `t_ms`, `time [ns]`) gives the
//! sample rate, a column `frame` or `index` is not read. Commas, semicolons and tabs separate.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::frame_table::{
    Column, FrameTable, MATERIAL, STEP, common_length, is_one_of, may_hold_words, rate_of,
    time_unit,
};
use super::named_sweeps::{Labels, NamedSweeps, some_names};
use super::narrow::{TooWide, narrow};
use super::taxel_names::{is_line_of_names, left_out, unlike_the_others};
use crate::{DataError, SweepShape};

/// The table of a folder's labels.
const LABELS: &str = "labels.csv";

/// Reads a folder or a file that may hold NaN or infinities.
///
/// - `steps`: frames of every sweep that are kept, from its beginning; `None`: all, and all sweeps must be equally long
/// - `labels`: where they are optional, a file may be one sweep
///
/// # Errors
/// What cannot be read; a row with more or fewer values than the first; a word where a number belongs, with file and line; sweeps of
/// different lengths or numbers of taxels.
pub(super) fn read_with_gaps(
    path: &Path,
    steps: Option<usize>,
    labels: Labels,
) -> Result<NamedSweeps, DataError> {
    if path.is_dir() {
        if path.join(LABELS).is_file() {
            let entries = listed(&path.join(LABELS))?;
            let unlisted = unlisted(path, &entries)?;
            let mut sweeps = read_files(path, entries, steps)?;
            sweeps.left_out.extend(unlisted);
            return Ok(sweeps);
        }
        let (entries, empty) = files_by_folder(path)?;
        let mut sweeps = read_files(path, entries, steps)?;
        if !empty.is_empty() {
            let names = some_names(empty.iter().map(String::as_str));
            sweeps
                .left_out
                .push(format!("folders without a .csv file: {names}"));
        }
        return Ok(sweeps);
    }
    if labels == Labels::Optional && !has_line_of_names(path)? {
        return read_files(path, vec![Entry::unlabelled(path.into())], steps);
    }
    read_table(path, labels)?.into_sweeps(steps, labels)
}

/// Reads the `.csv` files that lie in a folder itself, each a sweep, in the order of their names; `None` where there is none.
///
/// # Errors
/// As [`read_with_gaps`].
pub(super) fn read_flat_folder(
    path: &Path,
    steps: Option<usize>,
) -> Result<Option<NamedSweeps>, DataError> {
    let entries: Vec<Entry> = tables_in(path)?.map(Entry::unlabelled).collect();
    if entries.is_empty() {
        return Ok(None);
    }
    read_files(path, entries, steps).map(Some)
}

/// Returns true if the first line of a table holds more than numbers.
fn has_line_of_names(path: &Path) -> Result<bool, DataError> {
    let first = Rows::open(path)?.next()?.unwrap_or_default();
    Ok(is_line_of_names(&first))
}

/// Returns true if a folder looks like one of sweeps: it has a table of labels or folders with `.csv` files.
pub fn is_folder_of_sweeps(path: &Path) -> bool {
    path.join(LABELS).is_file() || files_by_folder(path).is_ok_and(|(files, _)| !files.is_empty())
}

/// A sweep's file, and what is known of it.
struct Entry {
    file: PathBuf,
    material: Option<String>,
    block: Option<u32>,
    test: Option<bool>,
}

impl Entry {
    fn unlabelled(file: PathBuf) -> Self {
        Self {
            file,
            material: None,
            block: None,
            test: None,
        }
    }
}

/// Reads the files of sweeps.
///
/// - `path`: what people named, a folder or one file
fn read_files(
    path: &Path,
    entries: Vec<Entry>,
    steps: Option<usize>,
) -> Result<NamedSweeps, DataError> {
    if entries.is_empty() {
        let expected =
            format!("{LABELS} with columns file, material; or a folder of .csv files per material");
        return Err(DataError::format(path, "folder", expected, "neither"));
    }
    let sweeps: Vec<SweepFile> = entries
        .par_iter()
        .map(|entry| SweepFile::read(&entry.file))
        .collect::<Result<_, _>>()?;
    let taxels = sweeps[0].taxels;
    if let Some(odd) = sweeps.iter().position(|sweep| sweep.taxels != taxels) {
        return Err(DataError::format(
            &entries[odd].file,
            "columns",
            format!("{taxels} taxels, as {}", entries[0].file.display()),
            sweeps[odd].taxels.to_string(),
        ));
    }
    let names: Vec<String> = entries
        .iter()
        .map(|entry| entry.file.display().to_string())
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let lengths: Vec<usize> = sweeps.iter().map(SweepFile::frames).collect();
    let steps = common_length(path, &names, &lengths, steps)?;
    let mut values = Vec::with_capacity(sweeps.len() * steps * taxels);
    for sweep in &sweeps {
        values.extend_from_slice(&sweep.values[..steps * taxels]);
    }
    let timed = || {
        names
            .iter()
            .zip(&sweeps)
            .filter(|(_, sweep)| !sweep.time.is_empty())
    };
    let rate_hz = if timed().next().is_none() {
        None
    } else {
        let times = timed().map(|(name, sweep)| (*name, sweep.time.clone()));
        Some(rate_of(path, times)?)
    };
    // Files of one set have the same columns.
    let left_out = sweeps[0].left_out.clone();
    let samples = narrow(&values).map_err(|TooWide(value)| {
        DataError::format(path, "taxels", "values that a 32-bit float holds", value)
    })?;
    Ok(NamedSweeps {
        name: if path.is_dir() {
            let name = path.file_name().unwrap_or_default();
            name.to_string_lossy().into_owned()
        } else {
            super::stem(path)
        },
        rate_hz,
        shape: SweepShape {
            steps,
            rows: 1,
            cols: taxels,
        },
        blocks: entries.iter().map(|entry| entry.block).collect(),
        test: entries.iter().map(|entry| entry.test).collect(),
        sweeps: sweep_names(&entries),
        materials: entries.into_iter().map(|entry| entry.material).collect(),
        samples,
        left_out,
    })
}

/// The files' names, with those of their folders where some would be the same.
fn sweep_names(entries: &[Entry]) -> Vec<String> {
    let names = || entries.iter().map(|entry| super::stem(&entry.file));
    let different: std::collections::HashSet<String> = names().collect();
    if different.len() == entries.len() {
        return names().collect();
    }
    let folder = |entry: &Entry| entry.file.parent().map(super::stem);
    names()
        .zip(entries)
        .map(|(name, entry)| format!("{}/{name}", folder(entry).unwrap_or_default()))
        .collect()
}

/// The files that a table of labels lists, in its order.
fn listed(table: &Path) -> Result<Vec<Entry>, DataError> {
    let folder = table.parent().unwrap_or(Path::new("."));
    let mut rows = Rows::open(table)?;
    let header = rows.next()?.unwrap_or_default();
    let column = |names: &[&str]| header.iter().position(|found| is_one_of(found, names));
    let (Some(file), Some(material)) = (column(&["file"]), column(MATERIAL)) else {
        return Err(DataError::format(
            table,
            "first line",
            "the columns file, material",
            some_names(header.iter().map(String::as_str)),
        ));
    };
    let (block, test) = (column(&["block"]), column(&["test"]));
    let mut entries = Vec::new();
    while let Some(row) = rows.next()? {
        let number = |at: Option<usize>| match at.map(|at| (at, row[at].trim().parse::<u32>())) {
            None => Ok(None),
            Some((_, Ok(value))) => Ok(Some(value)),
            Some((at, Err(_))) => Err(rows.error("a whole number from 0", at, &row[at])),
        };
        entries.push(Entry {
            file: folder.join(row[file].trim()),
            material: Some(row[material].trim().to_string()),
            block: number(block)?,
            test: number(test)?.map(|flag| flag != 0),
        });
    }
    Ok(entries)
}

/// Says which `.csv` files of a folder a table of labels does not list.
fn unlisted(folder: &Path, listed: &[Entry]) -> Result<Option<String>, DataError> {
    let files: Vec<PathBuf> = tables_in(folder)?
        .filter(|file| listed.iter().all(|entry| entry.file != *file))
        .collect();
    if files.is_empty() {
        return Ok(None);
    }
    let names: Vec<String> = files.iter().map(|file| super::stem(file)).collect();
    let names = some_names(names.iter().map(String::as_str));
    Ok(Some(format!("files that {LABELS} does not list: {names}")))
}

/// The `.csv` files of the folders in `path`, folder by folder in the order of their names, and the names of folders without any.
fn files_by_folder(path: &Path) -> Result<(Vec<Entry>, Vec<String>), DataError> {
    let (mut entries, mut empty) = (Vec::new(), Vec::new());
    for folder in list(path)?.into_iter().filter(|path| path.is_dir()) {
        let material = folder.file_name().unwrap_or_default().to_string_lossy();
        let before = entries.len();
        entries.extend(tables_in(&folder)?.map(|file| Entry {
            material: Some(material.to_string()),
            ..Entry::unlabelled(file)
        }));
        // What begins with a dot is a program's own.
        if entries.len() == before && !material.starts_with('.') {
            empty.push(material.into_owned());
        }
    }
    Ok((entries, empty))
}

/// Returns true if there are single arrays of NumPy in a folder, or in the folders in it.
pub(super) fn holds_arrays(folder: &Path) -> bool {
    let is_array = |path: &PathBuf| path.extension().is_some_and(|e| e == "npy");
    list(folder).is_ok_and(|paths| {
        let mut within = paths.iter().filter(|path| path.is_dir());
        paths.iter().any(is_array)
            || within.any(|path| list(path).is_ok_and(|paths| paths.iter().any(is_array)))
    })
}

/// What lies in a folder, in the order of names.
fn list(folder: &Path) -> Result<Vec<PathBuf>, DataError> {
    let io = |error| DataError::io(folder, "list", error);
    let entries = std::fs::read_dir(folder).map_err(io)?;
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()
        .map_err(io)?;
    paths.sort();
    Ok(paths)
}

/// The `.csv` files of sweeps in a folder.
fn tables_in(folder: &Path) -> Result<impl Iterator<Item = PathBuf>, DataError> {
    let is_table =
        |file: &PathBuf| file.extension().is_some_and(|e| e == "csv") && !file.ends_with(LABELS);
    Ok(list(folder)?.into_iter().filter(is_table))
}

/// One sweep as its file has it.
struct SweepFile {
    taxels: usize,
    /// `[frames][taxels]`
    values: Vec<f32>,
    /// `[frames]` seconds, empty without a column of them
    time: Vec<f64>,
    left_out: Vec<String>,
}

impl SweepFile {
    fn frames(&self) -> usize {
        self.values.len() / self.taxels.max(1)
    }

    fn read(path: &Path) -> Result<Self, DataError> {
        let mut rows = Rows::open(path)?;
        let mut sweep = Self {
            taxels: 0,
            values: Vec::new(),
            time: Vec::new(),
            left_out: Vec::new(),
        };
        // Column and seconds of its unit.
        let mut time: Option<(usize, f64)> = None;
        // Numbers of frames, and what is no taxel by its name.
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
                sweep.taxels = row.len() - numbers - usize::from(time.is_some());
                first = false;
            }
            if named {
                continue;
            }
            for (column, cell) in row.iter().enumerate() {
                let value: f64 = cell
                    .trim()
                    .parse()
                    .map_err(|_| rows.error("a number", column, cell))?;
                match time {
                    Some((at, unit)) if at == column => sweep.time.push(unit * value),
                    _ if skipped.get(column) == Some(&true) => {}
                    _ => sweep.values.push(value as f32),
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

/// All frames of all sweeps in one file; what its columns lack is said before what its lines hold.
fn read_table(path: &Path, labels: Labels) -> Result<FrameTable<'_>, DataError> {
    let mut rows = Rows::open(path)?;
    let header = rows.next()?.unwrap_or_default();
    let columns = header
        .into_iter()
        .map(|name| {
            let column = if may_hold_words(&name) {
                Column::Words(Vec::new())
            } else {
                Column::Numbers(Vec::new())
            };
            (name, column)
        })
        .collect();
    let mut table = FrameTable { path, columns };
    if labels == Labels::Needed {
        table.check_names()?;
    }
    while let Some(row) = rows.next()? {
        for (place, (cell, (_, column))) in row.into_iter().zip(&mut table.columns).enumerate() {
            match column {
                Column::Words(words) => words.push(cell),
                Column::Numbers(numbers) => {
                    let number = cell.trim().parse();
                    numbers.push(number.map_err(|_| rows.error("a number", place, &cell))?);
                }
            }
        }
    }
    Ok(table)
}

/// The rows of a file, all as long as the first.
struct Rows<'a> {
    path: &'a Path,
    reader: csv::Reader<std::fs::File>,
    record: csv::StringRecord,
}

impl<'a> Rows<'a> {
    fn open(path: &'a Path) -> Result<Self, DataError> {
        let open = || crate::open_file(path).map_err(|error| DataError::io(path, "open", error));
        let mut head = [0; 4096];
        let filled = std::io::Read::read(&mut open()?, &mut head)
            .map_err(|error| DataError::io(path, "read", error))?;
        let line = head[..filled].split(|&byte| byte == b'\n').next();
        let line = line.unwrap_or_default();
        let separators = *b";\t,";
        let separator = separators.into_iter().find(|s| line.contains(s));
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .delimiter(separator.unwrap_or(b','))
            .comment(Some(b'#'))
            .from_reader(open()?);
        Ok(Self {
            path,
            reader,
            record: csv::StringRecord::new(),
        })
    }

    fn next(&mut self) -> Result<Option<Vec<String>>, DataError> {
        match self.reader.read_record(&mut self.record) {
            Ok(false) => Ok(None),
            Ok(true) => Ok(Some(self.record.iter().map(str::to_string).collect())),
            Err(error) => Err(self.refused(&error)),
        }
    }

    /// The line that was read last.
    fn line(&self) -> u64 {
        self.record.position().map_or(0, csv::Position::line)
    }

    /// - `column`: counted from 0
    fn error(&self, expected: &str, column: usize, found: &str) -> DataError {
        let item = format!("line {}, column {}", self.line(), column + 1);
        let has_comma =
            found.contains(',') && found.trim().replace(',', ".").parse::<f64>().is_ok();
        let hint = if has_comma {
            "; decimals are written with a point"
        } else {
            ""
        };
        DataError::format(self.path, item, expected, format!("`{found}`{hint}"))
    }

    fn refused(&self, error: &csv::Error) -> DataError {
        match error.kind() {
            csv::ErrorKind::UnequalLengths {
                pos,
                expected_len,
                len,
            } => {
                let line = pos.as_ref().map_or(0, csv::Position::line);
                let expected = format!("{expected_len} values, as in the first line");
                DataError::format(self.path, format!("line {line}"), expected, len.to_string())
            }
            csv::ErrorKind::Utf8 { .. } => {
                DataError::format(self.path, "file", "a text table", "bytes that are no text")
            }
            _ => DataError::format(self.path, "file", "a text table", error.to_string()),
        }
    }
}
