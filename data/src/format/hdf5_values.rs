//! Values of HDF5 data sets of any shape, with the types of MATLAB 7.3: characters, and cells as references.

use std::collections::BTreeMap;

use super::mismatch::{Mismatch, type_name};
use super::npy::Array;
use hdf5_reader::messages::datatype::{ReferenceType, StringSize, VarLenKind};
use hdf5_reader::{ByteOrder, Dataset, Datatype, Hdf5File};

/// Maximum size of all texts of a data set, in bytes; many references may point to one long text.
const MOST_TEXT: usize = 64 << 20;
/// Name of the attribute with MATLAB's class of a variable.
const CLASS: &str = "MATLAB_class";

/// Returns MATLAB's class of a data set; `None` for other files.
pub(super) fn matlab_class(dataset: &Dataset) -> Option<String> {
    dataset.attribute(CLASS).ok()?.read_string().ok()
}

/// Returns the unit that the attribute `unit` or `units` of a data set names.
pub(super) fn unit(dataset: &Dataset) -> Option<String> {
    let attribute = ["unit", "units"]
        .iter()
        .find_map(|name| dataset.attribute(name).ok())?;
    let unit = attribute.read_string().ok()?;
    let unit = unit.trim_matches(['\0', ' ']);
    (!unit.is_empty()).then(|| unit.to_owned())
}

/// Returns the extents of a data set in the order of the indices; MATLAB's are stored in reverse.
pub(super) fn extents(dataset: &Dataset) -> Vec<usize> {
    let extent = |extent: &u64| usize::try_from(*extent).unwrap_or(usize::MAX);
    let mut extents: Vec<usize> = dataset.shape().iter().map(extent).collect();
    if matlab_class(dataset).is_some() {
        extents.reverse();
    }
    extents
}

/// Returns the type of a data set for messages.
pub(super) fn shown_type(dataset: &Dataset) -> String {
    matlab_class(dataset).unwrap_or_else(|| type_name(dataset.dtype()))
}

/// Reads a data set of numbers or text.
///
/// # Errors
/// A sentence about values that are neither, or cannot be read.
pub(super) fn read(file: &Hdf5File, dataset: &Dataset) -> Result<Array, String> {
    let shape = extents(dataset);
    if shape.contains(&0) || dataset.attribute("MATLAB_empty").is_ok() {
        return Err("no values".into());
    }
    match matlab_class(dataset).as_deref() {
        None => match strings(dataset)? {
            Some(texts) => Ok(Array::of_texts(shape, texts)),
            None => numbers(dataset, shape),
        },
        Some("char") => {
            let texts = characters(dataset)?;
            Ok(Array::of_texts(vec![texts.len()], texts))
        }
        Some("cell") => Ok(Array::of_texts(shape, cells(file, dataset)?)),
        Some(class) if is_number(class) => numbers(dataset, shape).map(Array::with_columns_first),
        Some(class @ ("string" | "categorical")) => Err(format!(
            "a {class} array, which only MATLAB can read; `y = cellstr(y)` makes text of it"
        )),
        Some(class) => Err(format!("an array of class {class}")),
    }
}

/// Returns true for MATLAB's classes of numbers.
fn is_number(class: &str) -> bool {
    let integer = class.trim_start_matches('u').strip_prefix("int");
    let is_integer = integer.is_some_and(|bits| ["8", "16", "32", "64"].contains(&bits));
    is_integer || ["double", "single", "logical"].contains(&class)
}

/// Reads numbers, with the last stored index fastest.
///
/// - `shape`: extents for messages and for the array, in the order of the indices
fn numbers(dataset: &Dataset, shape: Vec<usize>) -> Result<Array, String> {
    let base = match dataset.dtype() {
        Datatype::Enum { base, .. } => base,
        other => other,
    };
    let (kind, size, order) = match *base {
        Datatype::FixedPoint {
            size,
            signed,
            byte_order,
        } => (if signed { 'i' } else { 'u' }, size, byte_order),
        Datatype::FloatingPoint { size, byte_order } => ('f', size, byte_order),
        _ => return Err(type_name(dataset.dtype())),
    };
    if !matches!((kind, size), ('i' | 'u', 1 | 2 | 4 | 8) | ('f', 2 | 4 | 8)) {
        return Err(type_name(dataset.dtype()));
    }
    let bytes = dataset.read_raw_bytes().map_err(|error| words(&error))?;
    Ok(Array::of_bytes(
        kind,
        usize::from(size),
        order,
        shape,
        bytes,
    ))
}

/// Returns the error of the HDF5 crate as a sentence.
fn words(error: &hdf5_reader::error::Error) -> String {
    Mismatch::from_hdf5(error).found
}

/// Reads the texts of a data set of strings; `None` for another type.
fn strings(dataset: &Dataset) -> Result<Option<Vec<String>>, String> {
    let variable = match dataset.dtype() {
        Datatype::String {
            size: StringSize::Fixed(_),
            ..
        } => false,
        Datatype::String { .. }
        | Datatype::VarLen {
            kind: VarLenKind::String,
            ..
        } => true,
        _ => return Ok(None),
    };
    let trimmed = |text: &str| text.trim_end_matches(['\0', ' ']).to_owned();
    if !variable {
        let texts = dataset.read_strings().map_err(|error| words(&error))?;
        return Ok(Some(texts.iter().map(|text| trimmed(text)).collect()));
    }
    let references = dataset.read_raw_bytes().map_err(|error| words(&error))?;
    let mut left = MOST_TEXT;
    let texts = references.chunks_exact(dataset.vlen_reference_size());
    let texts = texts.map(|reference| {
        let text = dataset.resolve_vlen_reference_bytes(reference, 1);
        let text = text.map_err(|error| words(&error))?;
        left = left.checked_sub(text.len()).ok_or_else(too_much)?;
        let text = String::from_utf8(text).map_err(|_| "text that is not UTF-8".to_owned())?;
        Ok(trimmed(&text))
    });
    texts.collect::<Result<_, String>>().map(Some)
}

fn too_much() -> String {
    format!("more than {MOST_TEXT} bytes of text")
}

/// Reads the rows of a char matrix of MATLAB, which is stored column by column as UTF-16.
fn characters(dataset: &Dataset) -> Result<Vec<String>, String> {
    let Datatype::FixedPoint { size: 2, .. } = dataset.dtype() else {
        return Err("characters of another size than 16 bits".into());
    };
    let bytes = dataset.read_raw_bytes().map_err(|error| words(&error))?;
    let (units, _) = bytes.as_chunks();
    let units: Vec<u16> = units.iter().map(|&unit| u16::from_le_bytes(unit)).collect();
    let rows = extents(dataset).first().copied().unwrap_or(1);
    Ok(rows_of(&units, rows))
}

/// Returns the rows of a char matrix that is stored column by column, without blanks at their ends.
pub(super) fn rows_of(units: &[u16], rows: usize) -> Vec<String> {
    let row = |row: usize| {
        let units: Vec<u16> = units
            .iter()
            .skip(row)
            .step_by(rows.max(1))
            .copied()
            .collect();
        String::from_utf16_lossy(&units)
            .trim_end_matches(['\0', ' '])
            .to_owned()
    };
    (0..rows).map(row).collect()
}

/// Reads a cell array of text or single numbers, which refers to one data set per cell.
fn cells(file: &Hdf5File, dataset: &Dataset) -> Result<Vec<String>, String> {
    let Datatype::Reference {
        ref_type: ReferenceType::Object,
        size: 8,
    } = dataset.dtype()
    else {
        return Err(type_name(dataset.dtype()));
    };
    let group = file.group("#refs#").and_then(|group| group.datasets());
    let targets = group.map_err(|error| words(&error))?;
    let targets: BTreeMap<u64, &Dataset> = targets.iter().map(|of| (of.address(), of)).collect();
    let bytes = dataset.read_raw_bytes().map_err(|error| words(&error))?;
    let (references, _) = bytes.as_chunks();
    let mut left = MOST_TEXT;
    let texts = references.iter().enumerate().map(|(number, &reference)| {
        let target = targets.get(&u64::from_le_bytes(reference));
        let target = target.ok_or_else(|| format!("cell {} that refers to nothing", number + 1))?;
        let text = cell(target).map_err(|found| format!("cell {} with {found}", number + 1))?;
        left = left.checked_sub(text.len()).ok_or_else(too_much)?;
        Ok(text)
    });
    texts.collect()
}

/// Reads the text or number of one cell.
fn cell(dataset: &Dataset) -> Result<String, String> {
    match matlab_class(dataset).as_deref() {
        _ if dataset.attribute("MATLAB_empty").is_ok() => Ok(String::new()),
        Some("char") => match characters(dataset)?.as_slice() {
            [text] => Ok(text.clone()),
            rows => Err(format!("{} lines of text", rows.len())),
        },
        Some(class) if is_number(class) => {
            let array = numbers(dataset, extents(dataset))?;
            array.single_text().ok_or_else(|| "no whole number".into())
        }
        _ => Err(shown_type(dataset)),
    }
}

/// Returns a single number as an array.
pub(super) fn scalar(value: f64) -> Array {
    let bytes = value.to_le_bytes().to_vec();
    Array::of_bytes('f', 8, ByteOrder::LittleEndian, Vec::new(), bytes)
}
