//! Parquet tables with one row per frame, as described in `frame_table.rs`. A column of lists of one length holds as many taxels.
//! Needs the feature `parquet`.

use std::path::Path;

use parquet::basic::{LogicalType, TimeUnit};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::frame_table::{Column, FrameTable, may_hold_words};
use super::guarded::guarded;
use super::named_sweeps::{Labels, NamedSweeps};
use super::parquet_footer;
use super::read_options::ReadOptions;
use super::time_names::unit_of;
use crate::DataError;

/// Reads a file that may contain NaN or infinities.
///
/// - `labels`: required columns
///
/// # Errors
/// A file that cannot be read; lists of several lengths, missing values, words in place of numbers; sweeps of different lengths.
pub(super) fn read_with_gaps(
    path: &Path,
    options: &ReadOptions,
    labels: Labels,
) -> Result<NamedSweeps, DataError> {
    let mut table = table(path)?;
    options.rename_blocks(path, table.columns.iter_mut().map(|(name, _)| name))?;
    table.into_recordings(labels, options)?.into_sweeps(options)
}

/// Reads all columns.
///
/// # Errors
/// As [`read_with_gaps`], for a single column.
pub(super) fn table(path: &Path) -> Result<FrameTable<'_>, DataError> {
    guarded(path, "a Parquet table", || read_table(path))
}

fn read_table(path: &Path) -> Result<FrameTable<'_>, DataError> {
    let refused = |error: ParquetError| match error.to_string().rsplit_once("compile time: ") {
        Some((_, codec)) => {
            let expected = "compression with zstd, snappy or gzip, as of `df.to_parquet(file, compression=\"zstd\")`";
            DataError::format(path, "file", expected, codec)
        }
        None => DataError::format(path, "file", "a Parquet table", error.to_string()),
    };
    let file = crate::open_file(path).map_err(|error| DataError::io(path, "open", error))?;
    if !parquet_footer::is_sound(&file).map_err(|error| DataError::io(path, "read", error))? {
        let found = "metadata that is damaged";
        return Err(DataError::format(path, "file", "a Parquet table", found));
    }
    let reader = SerializedFileReader::new(file).map_err(refused)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let mut columns = Vec::new();
    for (index, descriptor) in schema.columns().iter().enumerate() {
        let is_list = descriptor.max_rep_level() > 0;
        let name = match descriptor.path().parts() {
            [name, ..] if is_list => name.clone(),
            _ => descriptor.path().string(),
        };
        let item = || format!("column `{name}`");
        let mut cells = Cells::default();
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group).map_err(refused)?;
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            let column = group.get_column_reader(index).map_err(refused)?;
            let read = cells.read(column, rows, descriptor);
            read.map_err(|error| match error {
                Refused::File(error) => refused(error),
                Refused::Kind => {
                    let expected = "numbers or words; float16 as float32";
                    let found = format!("{:?}", descriptor.physical_type());
                    DataError::format(path, item(), expected, found)
                }
                Refused::Missing(row) => {
                    let found = format!("none in row {}", row + 1);
                    DataError::format(path, item(), "a value in every row", found)
                }
            })?;
        }
        if is_list {
            columns.extend(cells.taxels(&name).map_err(|found| {
                DataError::format(path, item(), "lists of numbers, all of one length", found)
            })?);
        } else {
            columns.push((name.clone(), cells.column(descriptor, &name)));
        }
    }
    Ok(FrameTable {
        path,
        columns,
        lines: Vec::new(),
        findings: Vec::new(),
    })
}

/// Reason why a column cannot be read.
enum Refused {
    /// Damage, in the words of the crate.
    File(ParquetError),
    /// A type that is neither numbers nor words.
    Kind,
    /// A row without a value, counted from 0.
    Missing(usize),
}

impl From<ParquetError> for Refused {
    fn from(error: ParquetError) -> Self {
        Self::File(error)
    }
}

/// Values of a column: numbers or words, one per row or a list per row.
#[derive(Default)]
struct Cells {
    numbers: Vec<f64>,
    words: Vec<String>,
    /// Number of values in each row.
    lengths: Vec<usize>,
}

impl Cells {
    /// Appends the values of a row group.
    fn read(
        &mut self,
        column: ColumnReader,
        rows: usize,
        descriptor: &ColumnDescriptor,
    ) -> Result<(), Refused> {
        let before = self.lengths.len();
        let lengths = &mut self.lengths;
        match column {
            ColumnReader::BoolColumnReader(column) => {
                let found = values(column, rows, descriptor, lengths)?;
                self.numbers.extend(found.into_iter().map(f64::from));
            }
            ColumnReader::Int32ColumnReader(column) => {
                let found = values(column, rows, descriptor, lengths)?;
                self.numbers.extend(found.into_iter().map(f64::from));
            }
            ColumnReader::Int64ColumnReader(column) => {
                let found = values(column, rows, descriptor, lengths)?;
                self.numbers
                    .extend(found.into_iter().map(|value| value as f64));
            }
            ColumnReader::FloatColumnReader(column) => {
                let found = values(column, rows, descriptor, lengths)?;
                self.numbers.extend(found.into_iter().map(f64::from));
            }
            ColumnReader::DoubleColumnReader(column) => {
                self.numbers
                    .extend(values(column, rows, descriptor, lengths)?);
            }
            ColumnReader::ByteArrayColumnReader(column) => {
                let found: Vec<ByteArray> = values(column, rows, descriptor, lengths)?;
                for word in found {
                    self.words.push(word.as_utf8()?.to_string());
                }
            }
            _ => return Err(Refused::Kind),
        }
        if lengths.len() < before + rows {
            return Err(Refused::Missing(lengths.len()));
        }
        Ok(())
    }

    /// Returns a column for each place of the lists: `name[0]`, `name[1]` and so on.
    ///
    /// # Errors
    /// A description of lists that do not hold taxels.
    fn taxels(self, name: &str) -> Result<Vec<(String, Column)>, String> {
        let Some(&width) = self.lengths.first() else {
            return Err("no row".into());
        };
        if !self.words.is_empty() {
            return Err("lists of words".into());
        }
        if width == 0 {
            return Err("an empty list in row 1".into());
        }
        if let Some(odd) = self.lengths.iter().position(|length| *length != width) {
            let found = self.lengths[odd];
            return Err(format!(
                "{width} values in row 1 and {found} in row {}",
                odd + 1
            ));
        }
        let taxel = |place: usize| {
            let values = self.numbers[place..].iter().step_by(width).copied();
            (
                format!("{name}[{place}]"),
                Column::Numbers(values.collect()),
            )
        };
        Ok((0..width).map(taxel).collect())
    }

    /// Returns the column; times are converted to seconds, or to the unit in the column's name.
    fn column(self, descriptor: &ColumnDescriptor, name: &str) -> Column {
        if !self.words.is_empty() {
            return Column::Words(self.words);
        }
        let per_second = match descriptor.logical_type_ref() {
            Some(LogicalType::Timestamp { unit, .. } | LogicalType::Time { unit, .. }) => {
                let per_second = match unit {
                    TimeUnit::MILLIS => 1e3,
                    TimeUnit::MICROS => 1e6,
                    TimeUnit::NANOS => 1e9,
                };
                per_second * unit_of(name).unwrap_or(1.0)
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

/// Returns the values of a row group, and appends the number of values of each row to `lengths`.
///
/// # Errors
/// A row, or an entry of a list, without a value.
fn values<T: DataType>(
    mut column: ColumnReaderImpl<T>,
    rows: usize,
    descriptor: &ColumnDescriptor,
    lengths: &mut Vec<usize>,
) -> Result<Vec<T::T>, Refused> {
    let (mut values, mut present, mut repeated) = (Vec::new(), Vec::new(), Vec::new());
    let end = lengths.len() + rows;
    let mut read_rows = 0;
    while read_rows < rows {
        let left = rows - read_rows;
        let (levels, repeats) = (Some(&mut present), Some(&mut repeated));
        let (read, _, _) = column.read_records(left, levels, repeats, &mut values)?;
        if read == 0 {
            break;
        }
        read_rows += read;
    }
    if descriptor.max_rep_level() == 0 {
        // A column without missing values has no levels.
        if let Some(missing) = present
            .iter()
            .position(|of| *of < descriptor.max_def_level())
        {
            return Err(Refused::Missing(lengths.len() + missing));
        }
        lengths.resize((lengths.len() + values.len()).min(end), 1);
        return Ok(values);
    }
    for (level, repeat) in present.iter().zip(&repeated) {
        if *repeat == 0 {
            lengths.push(0);
        }
        let row = lengths.len().saturating_sub(1);
        // One level less is an empty list or an entry without a value, as the column declares entries optional or not.
        if *level == descriptor.max_def_level() {
            if let Some(last) = lengths.last_mut() {
                *last += 1;
            }
        } else {
            return Err(Refused::Missing(row));
        }
    }
    Ok(values)
}
