//! Text tables: a single `.csv` with one row per frame (see `frame_table.rs`), and the rows of any `.csv`.
//!
//! `dialect.rs` describes the texts that are read.

use std::path::Path;

use super::dialect::{Table, clean, decode, number};
use super::file_kind;
use super::frame_table::{Column, FrameTable, is_text, not_taxels};
use super::named_sweeps::{Labels, NamedSweeps};
use super::read_options::ReadOptions;
use super::time_names::is_time;
use super::{folder, taxel_names::is_line_of_names};
use crate::{DataError, Finding, FindingKind, Place, Severity};

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
    let mut header = rows.next()?.unwrap_or_default();
    options.rename_blocks(path, &mut header)?;
    let names: Vec<&str> = header.iter().map(String::as_str).collect();
    let unread = match options.columns[..] {
        [] => not_taxels(&names),
        _ => vec![false; names.len()],
    };
    let columns = header
        .into_iter()
        .zip(unread)
        .map(|(name, is_unread)| {
            let column = if is_unread || is_text(&name, &options.columns) {
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
        findings: Vec::new(),
    };
    if labels == Labels::Needed && options.windows.is_none() {
        table.check_names()?;
    }
    while let Some(row) = rows.next()? {
        table.lines.push(rows.line());
        for (place, (cell, (_, column))) in row.into_iter().zip(&mut table.columns).enumerate() {
            match column {
                Column::Words(words) => words.push(cell),
                Column::Numbers(numbers) => numbers.push(rows.number(place, &cell)),
            }
        }
    }
    table.findings = rows.finish()?;
    Ok(table)
}

/// Rows of a file, all as long as the first.
pub(super) struct Rows<'a> {
    path: &'a Path,
    reader: csv::Reader<std::io::Cursor<Vec<u8>>>,
    record: csv::StringRecord,
    table: Dialect,
    /// Names that are the first row.
    names: Option<Vec<String>>,
    /// Number of the line that begins at `counted` bytes of the text.
    line: usize,
    counted: usize,
    /// Places that cannot be read, the first of them as findings.
    unreadable: Vec<Finding>,
    more: usize,
}

/// Dialect of the rows.
struct Dialect {
    start: usize,
    comment: u8,
    units: Option<Vec<String>>,
    cells: usize,
    preamble: usize,
    rows: usize,
}

/// Maximum number of unreadable places that are listed.
const LISTED: usize = 1000;

impl<'a> Rows<'a> {
    /// Opens a file and finds its dialect.
    ///
    /// # Errors
    /// A file that cannot be read, or that does not contain text.
    pub(super) fn open(path: &'a Path) -> Result<Self, DataError> {
        file_kind::refuse_pretended(path, "a text table")?;
        let bytes = crate::read_file(path).map_err(|error| DataError::io(path, "read", error))?;
        let refused = |found: String| DataError::format(path, "file", "a text table", found);
        let text = decode(bytes).map_err(|found| refused(found.into()))?;
        let table = Table::of(text).map_err(refused)?;
        let mut text = std::io::Cursor::new(table.text.into_bytes());
        text.set_position(table.start as u64);
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(table.separator)
            .comment(Some(table.comment))
            .from_reader(text);
        Ok(Self {
            path,
            reader,
            record: csv::StringRecord::new(),
            names: table.names,
            line: 1,
            counted: 0,
            unreadable: Vec::new(),
            more: 0,
            table: Dialect {
                start: table.start,
                comment: table.comment,
                units: table.units,
                cells: table.cells,
                preamble: table.preamble,
                rows: 0,
            },
        })
    }

    /// Returns the cells of the next row; `None` at the end. Rows of another length are left out and reported by [`Rows::finish`].
    pub(super) fn next(&mut self) -> Result<Option<Vec<String>>, DataError> {
        if let Some(mut names) = self.names.take() {
            // Names decide on the number of columns, as a first row of names does.
            self.settle_length(&names);
            names.truncate(self.table.cells);
            self.table.rows = 1;
            return Ok(Some(names));
        }
        loop {
            match self.reader.read_record(&mut self.record) {
                Ok(false) => return Ok(None),
                Ok(true) => {}
                Err(error) => {
                    let found = error.to_string();
                    return Err(DataError::format(self.path, "file", "a text table", found));
                }
            }
            self.count_lines();
            self.table.rows += 1;
            let mut cells: Vec<String> = self
                .record
                .iter()
                .map(|cell| clean(cell).to_owned())
                .collect();
            if cells.iter().all(String::is_empty) && cells.len() != self.table.cells {
                continue;
            }
            if self.table.rows == 1 {
                self.settle_length(&cells);
                self.name_units(&mut cells);
            }
            if self.table.rows == 2 && self.table.units.is_some() {
                continue;
            }
            // A separator at the end of the line.
            if cells.len() == self.table.cells + 1 && cells.last().is_some_and(String::is_empty) {
                cells.pop();
            }
            if cells.len() == self.table.cells {
                return Ok(Some(cells));
            }
            let message = format!(
                "line {}: expected {} values, as in most lines, found {}",
                self.line,
                self.table.cells,
                cells.len()
            );
            self.note(message, None);
        }
    }

    /// Leaves out an empty last column that a separator at the end of all lines makes.
    fn settle_length(&mut self, first: &[String]) {
        let named = first.len() == self.table.cells && first.last().is_some_and(String::is_empty);
        if self.table.cells > 1 && (named || first.len() + 1 == self.table.cells) {
            self.table.cells -= 1;
        }
    }

    /// Adds the units of a second line to the names of times.
    fn name_units(&self, names: &mut [String]) {
        let units = self.table.units.iter().flatten();
        for (name, unit) in names.iter_mut().zip(units) {
            let with_unit = format!("{name} [{}]", clean(unit));
            if !clean(unit).is_empty() && is_time(name) && is_time(&with_unit) {
                *name = with_unit;
            }
        }
    }

    /// Sets `line` to the line of the row that was read.
    fn count_lines(&mut self) {
        let text = self.reader.get_ref().get_ref();
        let at = self.record.position().map_or(0, csv::Position::byte);
        let mut place = self.table.start + usize::try_from(at).unwrap_or(0);
        // The position may lie before the line ends and comments in front of the row.
        while let Some(byte) = text.get(place) {
            if *byte == self.table.comment {
                let rest = &text[place..];
                place += rest
                    .iter()
                    .position(|b| b"\r\n".contains(b))
                    .unwrap_or(rest.len());
            } else if !b"\r\n".contains(byte) {
                break;
            } else {
                place += 1;
            }
        }
        let place = place.min(text.len()).max(self.counted);
        let passed = &text[self.counted..place];
        let is_end = |at: &usize| match passed[*at] {
            b'\n' => true,
            b'\r' => passed.get(at + 1).or_else(|| text.get(place)) != Some(&b'\n'),
            _ => false,
        };
        self.line += (0..passed.len()).filter(is_end).count();
        self.counted = place;
    }

    /// Returns the number of the last line that was read.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// Returns the number in a cell, NaN for a missing one. Other text is reported by [`Rows::finish`].
    ///
    /// - `column`: counted from 0
    pub(super) fn number(&mut self, column: usize, cell: &str) -> f64 {
        if let Some(number) = number(cell) {
            return number;
        }
        let hint = match cell.contains(',') && cell.contains('.') {
            true => "; write numbers without thousands separators",
            false => "",
        };
        let line = self.line;
        let message = format!(
            "line {line}, column {}: expected a number, found `{cell}`{hint}",
            column + 1
        );
        self.note(message, Some(column));
        f64::NAN
    }

    fn note(&mut self, message: String, column: Option<usize>) {
        if self.unreadable.len() == LISTED {
            self.more += 1;
            return;
        }
        let at = Place {
            file: Some(self.path.into()),
            line: Some(self.line),
            column: column.map(|column| (column + 1).to_string()),
            ..Place::default()
        };
        let finding = Finding::new(Severity::Error, FindingKind::Unreadable, message);
        self.unreadable.push(finding.at(at));
    }

    /// Returns notes on lines that are not part of the table, if all rows and numbers were read.
    ///
    /// # Errors
    /// The places that cannot be read.
    pub(super) fn finish(mut self) -> Result<Vec<Finding>, DataError> {
        if self.more > 0 {
            let message = format!("{} further places cannot be read", self.more);
            self.unreadable.push(Finding::new(
                Severity::Error,
                FindingKind::Unreadable,
                message,
            ));
        }
        if self.unreadable.is_empty() {
            let lines = self.table.preamble;
            let message = format!("lines before the table that are ignored: {lines}");
            return Ok((lines > 0)
                .then(|| Finding::not_read(message))
                .into_iter()
                .collect());
        }
        Err(DataError::Unreadable {
            path: self.path.into(),
            findings: self.unreadable,
        })
    }

    /// Returns the error of an invalid value.
    ///
    /// - `column`: counted from 0
    pub(super) fn error(&self, expected: &str, column: usize, found: &str) -> DataError {
        let item = format!("line {}, column {}", self.line(), column + 1);
        DataError::format(self.path, item, expected, format!("`{found}`"))
    }
}
