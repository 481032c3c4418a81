//! Writer of numpy archives.

use std::io::{Cursor, Write};
use std::path::Path;

use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

use super::arrays::LENGTHS;
use super::npy;
use super::tactmat::{RATE_ATTRIBUTE, SYNTHETIC_ATTRIBUTE};
use crate::{ConditionValues, DataError, Dataset, LabelSet, Samples, write_whole};

/// Writes `dataset` with five dimensions if it is ordered by material with equally many sweeps of each, otherwise with
/// four and `labels`.
///
/// # Errors
/// A file that cannot be written.
pub fn write(path: &Path, dataset: &Dataset) -> Result<(), DataError> {
    let bytes = archive(dataset).map_err(|error| DataError::io(path, "write", error.into()))?;
    write_whole(path, &bytes)
}

/// Returns true if the sweeps are ordered by material, `sweeps` of each.
fn is_in_order(dataset: &Dataset, sweeps: usize) -> bool {
    dataset.len() == dataset.labels().len() * sweeps
        && dataset
            .records()
            .iter()
            .enumerate()
            .all(|(i, r)| r.label == i / sweeps && r.sweep == i % sweeps)
}

/// Returns the little-endian bytes of some numbers.
fn bytes_of(numbers: impl Iterator<Item = u32>) -> Vec<u8> {
    numbers.flat_map(u32::to_le_bytes).collect()
}

/// Returns the names as numpy's text of fixed width: the number of characters, and the UTF-32 bytes.
fn fixed_width(labels: &LabelSet) -> (usize, Vec<u8>) {
    let names: Vec<Vec<char>> = labels.names().map(|n| n.chars().collect()).collect();
    let width = names.iter().map(Vec::len).max().unwrap_or(1);
    let text = names
        .iter()
        .flat_map(|name| (0..width).map(|i| name.get(i).map_or(0, |&letter| letter as u32)));
    (width, bytes_of(text))
}

fn archive(dataset: &Dataset) -> zip::result::ZipResult<Vec<u8>> {
    let conditions = dataset.condition_values();
    let dataset = dataset.without_conditions();
    let dataset = dataset.as_ref();
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .large_file(true);
    let mut add = |name: &str, descr: &str, shape: &[usize], values: &[u8]| {
        zip.start_file(format!("{name}.npy"), options)?;
        zip.write_all(&npy::encode(descr, shape, values))
            .map_err(zip::result::ZipError::from)
    };
    let records = dataset.records();
    let materials = dataset.labels().len();
    let sweeps = dataset.len() / materials;
    let in_order = is_in_order(dataset, sweeps);
    let leading = if in_order {
        vec![materials, sweeps]
    } else {
        vec![dataset.len()]
    };
    let sweep = dataset.shape();
    let shape = [leading.as_slice(), &[sweep.steps, sweep.rows, sweep.cols]].concat();
    let descr = match dataset.samples() {
        Samples::U8(_) => "|u1",
        Samples::U16(_) => "<u2",
        Samples::F32(_) => "<f4",
    };
    let mut values = Vec::with_capacity(dataset.samples().bytes());
    dataset
        .samples()
        .for_each_le_chunk(|chunk| values.extend_from_slice(chunk));
    add("samples", descr, &shape, &values)?;
    let (width, text) = fixed_width(dataset.labels());
    add("materials", &format!("<U{width}"), &[materials], &text)?;
    if !in_order {
        let labels = records.iter().map(|r| r.label as u32);
        add("labels", "<u4", &leading, &bytes_of(labels))?;
    }
    if dataset.has_blocks() {
        let blocks = records.iter().filter_map(|r| r.block);
        add("blocks", "<u4", &leading, &bytes_of(blocks))?;
    }
    if dataset.has_test_flag() {
        let flags: Vec<u8> = records
            .iter()
            .filter_map(|r| r.test)
            .map(u8::from)
            .collect();
        add("test_flag", "|b1", &leading, &flags)?;
    }
    if let Some(lengths) = dataset.lengths() {
        let lengths = lengths.iter().map(|steps| *steps as u32);
        add(LENGTHS, "<u4", &leading, &bytes_of(lengths))?;
    }
    for ConditionValues { condition, values } in conditions {
        let bytes: Vec<u8> = values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        add(&condition.to_string(), "<f4", &leading, &bytes)?;
    }
    if let Some(version) = dataset.origin().twin_version() {
        let mark = f64::from(version.number()).to_le_bytes();
        add(SYNTHETIC_ATTRIBUTE, "<f8", &[], &mark)?;
    }
    if !dataset.is_rate_assumed() {
        let rate = dataset.sample_rate_hz().to_le_bytes();
        add(RATE_ATTRIBUTE, "<f8", &[], &rate)?;
    }
    Ok(zip.finish()?.into_inner())
}
