//! Parquet tables with one row per frame, as described in `frame_table.rs`. Needs the feature `parquet`.

use std::path::Path;

use parquet::basic::{LogicalType, TimeUnit};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::frame_table::{Column, FrameTable, may_hold_words};
use super::named_sweeps::{Labels, NamedSweeps};
use super::parquet_footer;
use super::read_options::ReadOptions;
use crate::DataError;

/// Reads a file that may contain NaN or infinities.
///
/// - `labels`: required columns
///
/// # Errors
/// A file that cannot be read; nested columns, missing values, words in place of numbers; sweeps of different lengths.
pub(super) fn read_with_gaps(
    path: &Path,
    options: &ReadOptions,
    labels: Labels,
) -> Result<NamedSweeps, DataError> {
    // The crate panics on some damaged files; the panic then ends only this thread.
    let read = || {
        std::thread::scope(|scope| {
            let thread = std::thread::Builder::new().name(super::READING.into());
            let thread = thread.spawn_scoped(scope, || table(path))?;
            Ok(thread.join())
        })
    };
    let table = read()
        .map_err(|error| DataError::io(path, "read", error))?
        .unwrap_or_else(|_| {
            Err(DataError::format(
                path,
                "file",
                "a Parquet table",
                "one that is damaged",
            ))
        })?;
    table.into_recordings(labels, options)?.into_sweeps(options)
}

fn table(path: &Path) -> Result<FrameTable<'_>, DataError> {
    let refused =
        |error: ParquetError| DataError::format(path, "file", "a Parquet table", error.to_string());
    let file = crate::open_file(path).map_err(|error| DataError::io(path, "open", error))?;
    if !parquet_footer::is_sound(&file).map_err(|error| DataError::io(path, "read", error))? {
        let found = "metadata that is damaged";
        return Err(DataError::format(path, "file", "a Parquet table", found));
    }
    let reader = SerializedFileReader::new(file).map_err(refused)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let mut columns = Vec::new();
    for (index, descriptor) in schema.columns().iter().enumerate() {
        let name = descriptor.path().string();
        let item = || format!("column `{name}`");
        if descriptor.max_rep_level() > 0 {
            let expected = "a number or a word per frame (a row per frame, a column per taxel)";
            return Err(DataError::format(path, item(), expected, "lists"));
        }
        // pandas stores its index in the file.
        if name.starts_with("__index_level_") {
            continue;
        }
        let mut cells = Cells::default();
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group).map_err(refused)?;
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            let before = cells.len();
            let column = group.get_column_reader(index).map_err(refused)?;
            if !cells.read(column, rows).map_err(refused)? {
                let expected = "numbers or words; float16 as float32";
                let found = format!("{:?}", descriptor.physical_type());
                return Err(DataError::format(path, item(), expected, found));
            }
            if cells.len() != before + rows {
                let found = format!("{} missing", rows + before - cells.len());
                return Err(DataError::format(
                    path,
                    item(),
                    "a value in every row",
                    found,
                ));
            }
        }
        columns.push((name.clone(), cells.column(descriptor, &name)));
    }
    Ok(FrameTable {
        path,
        columns,
        lines: Vec::new(),
    })
}

/// Values of a column: numbers or words.
#[derive(Default)]
struct Cells {
    numbers: Vec<f64>,
    words: Vec<String>,
}

impl Cells {
    fn len(&self) -> usize {
        self.numbers.len() + self.words.len()
    }

    /// Appends the values of a row group; returns false for another type.
    fn read(&mut self, column: ColumnReader, rows: usize) -> Result<bool, ParquetError> {
        match column {
            ColumnReader::BoolColumnReader(column) => self
                .numbers
                .extend(values(column, rows)?.into_iter().map(f64::from)),
            ColumnReader::Int32ColumnReader(column) => self
                .numbers
                .extend(values(column, rows)?.into_iter().map(f64::from)),
            ColumnReader::Int64ColumnReader(column) => self
                .numbers
                .extend(values(column, rows)?.into_iter().map(|value| value as f64)),
            ColumnReader::FloatColumnReader(column) => self
                .numbers
                .extend(values(column, rows)?.into_iter().map(f64::from)),
            ColumnReader::DoubleColumnReader(column) => self.numbers.extend(values(column, rows)?),
            ColumnReader::ByteArrayColumnReader(column) => {
                let found: Vec<ByteArray> = values(column, rows)?;
                for word in found {
                    self.words.push(word.as_utf8()?.to_string());
                }
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Returns the column; times are converted to seconds.
    fn column(self, descriptor: &ColumnDescriptor, name: &str) -> Column {
        if !self.words.is_empty() {
            return Column::Words(self.words);
        }
        let per_second = match descriptor.logical_type_ref() {
            Some(LogicalType::Timestamp { unit, .. } | LogicalType::Time { unit, .. }) => {
                match unit {
                    TimeUnit::MILLIS => 1e3,
                    TimeUnit::MICROS => 1e6,
                    TimeUnit::NANOS => 1e9,
                }
            }
            _ => 1.0,
        };
        let numbers = self.numbers.into_iter().map(|value| value / per_second);
        if may_hold_words(name) {
            Column::Words(numbers.map(|number| number.to_string()).collect())
        } else {
            Column::Numbers(numbers.collect())
        }
    }
}

/// Returns the values of a row group that are present.
fn values<T: DataType>(
    mut column: ColumnReaderImpl<T>,
    rows: usize,
) -> Result<Vec<T::T>, ParquetError> {
    let (mut values, mut present) = (Vec::new(), Vec::new());
    while present.len() < rows {
        let left = rows - present.len();
        let (read, _, levels) = column.read_records(left, Some(&mut present), None, &mut values)?;
        if read == 0 {
            break;
        }
        // A column without missing values has no levels.
        if levels == 0 {
            present.resize(present.len() + read, 0);
        }
    }
    Ok(values)
}
