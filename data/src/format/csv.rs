//! Text tables: a single `.csv` with one row per frame (see `frame_table.rs`), and the rows of any `.csv`.
//!
//! The separator is a comma, a semicolon or a tab.

use std::path::Path;

use super::frame_table::{Column, FrameTable, is_text};
use super::named_sweeps::{Labels, NamedSweeps};
use super::read_options::ReadOptions;
use super::{folder, taxel_names::is_line_of_names};
use crate::DataError;

/// Reads a file that may contain NaN or infinities.
///
/// - `labels`: if they are optional, a file may be one sweep
///
/// # Errors
/// A file that cannot be read; a row with more or fewer values than the first; a word in place of a number, with file and
/// line; sweeps of different lengths.
pub(super) fn read_with_gaps(
    path: &Path,
    options: &ReadOptions,
    labels: Labels,
) -> Result<NamedSweeps, DataError> {
    let may_be_one = labels == Labels::Optional || options.windows.is_some();
    if may_be_one && !has_line_of_names(path)? {
        return folder::read_one(path, options);
    }
    read_table(path, labels, options)?
        .into_recordings(labels, options)?
        .into_sweeps(options)
}

/// Returns true if the first line of a table contains words.
fn has_line_of_names(path: &Path) -> Result<bool, DataError> {
    let first = Rows::open(path)?.next()?.unwrap_or_default();
    Ok(is_line_of_names(&first))
}

/// Reads all frames of all sweeps of one file; missing columns are reported before invalid lines.
fn read_table<'a>(
    path: &'a Path,
    labels: Labels,
    options: &ReadOptions,
) -> Result<FrameTable<'a>, DataError> {
    let mut rows = Rows::open(path)?;
    let header = rows.next()?.unwrap_or_default();
    let columns = header
        .into_iter()
        .map(|name| {
            let column = if is_text(&name, &options.columns) {
                Column::Words(Vec::new())
            } else {
                Column::Numbers(Vec::new())
            };
            (name, column)
        })
        .collect();
    let mut table = FrameTable {
        path,
        columns,
        lines: Vec::new(),
    };
    if labels == Labels::Needed && options.windows.is_none() {
        table.check_names()?;
    }
    while let Some(row) = rows.next()? {
        table.lines.push(rows.line());
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

/// Rows of a file, all as long as the first.
pub(super) struct Rows<'a> {
    path: &'a Path,
    reader: csv::Reader<std::fs::File>,
    record: csv::StringRecord,
}

impl<'a> Rows<'a> {
    /// Opens a file; its first line shows the separator.
    pub(super) fn open(path: &'a Path) -> Result<Self, DataError> {
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

    /// Returns the cells of the next row; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<Vec<String>>, DataError> {
        match self.reader.read_record(&mut self.record) {
            Ok(false) => Ok(None),
            Ok(true) => Ok(Some(self.record.iter().map(str::to_string).collect())),
            Err(error) => Err(self.refused(&error)),
        }
    }

    /// Returns the number of the last line that was read.
    pub(super) fn line(&self) -> usize {
        let line = self.record.position().map_or(0, csv::Position::line);
        usize::try_from(line).unwrap_or(usize::MAX)
    }

    /// Returns the error of an invalid value.
    ///
    /// - `column`: counted from 0
    pub(super) fn error(&self, expected: &str, column: usize, found: &str) -> DataError {
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
