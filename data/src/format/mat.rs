//! MATLAB files of version 5 to 7.2 (`save` without `-v7.3`): a variable holds the sweeps, another one the labels.
//!
//! | variable | shape | holds |
//! |---|---|---|
//! | `X`, `samples`, `data`, ... | `[n][steps][taxels]`, `[n][steps][rows][cols]` or `[materials][sweeps][steps][rows][cols]` | numbers of any class |
//! | `y`, `labels`, `label`, `class`, ... | `[n]` | names as a cell array or a char matrix, or numbers |
//! | `rate`, `fs`, `sample_rate`, ... | a single number | frames per second |
//!
//! Variables may be fields of a struct. Format: "MAT-File Format", MathWorks, R2023b, level 5. No published crate fits:
//! `matfile` and `mat5` read no text and no cells, `matio-rs` needs a C library, `matrw` panics on damaged files; none
//! bounds the memory that a packed variable takes.

mod element;
mod matrix;

use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

use super::DEFLATE_LIMIT;
use super::arrays::{Arrays, Container, Other, Roles};
use super::named_sweeps::Labels;
use super::read_options::ReadOptions;
use crate::{DataError, Dataset};
use element::{Element, Elements, MATRIX, PACKED};
use hdf5_reader::ByteOrder;
use matrix::Matrix;

/// Length of the text and version in front, in bytes.
const HEADER: usize = 128;
/// Number of unpacked bytes that contain class, shape and name of a variable.
const PEEKED: u64 = 4096;
/// Maximum number of structs in each other.
const DEEPEST: usize = 16;
/// Maximum number of variables and fields.
const MOST: usize = 100_000;

/// Reads sweeps, and returns true if the file names their materials.
///
/// # Errors
/// A damaged file; a variable that is missing or of the wrong shape or class.
pub(super) fn read_arrays(
    path: &Path,
    labels: Labels,
    options: &ReadOptions,
) -> Result<(Dataset, bool), DataError> {
    let bytes = crate::read_file(path).map_err(|error| DataError::io(path, "read", error))?;
    let damaged = |found: String| DataError::format(path, "file", "a MATLAB file", found);
    let variables = variables(&bytes).map_err(damaged)?;
    let names: Vec<&str> = variables.iter().map(|of| of.head.name.as_str()).collect();
    let roles = Roles::of_paths(Container::Mat, &names, options);
    let is_here = |name: &String| names.contains(&name.as_str());
    // Structs are unpacked only if the sweeps or labels may be in one.
    let in_struct = !roles.samples.iter().any(is_here) || !roles.labels.iter().any(is_here);
    let arrays = Arrays::new(path, Container::Mat, roles);
    let unpacked: Vec<Option<Cow<'_, [u8]>>> = variables
        .iter()
        .map(|of| {
            let needed = arrays.is_known(&of.head.name) || in_struct && of.head.is_struct();
            needed.then(|| of.unpack()).transpose()
        })
        .collect::<Result<_, _>>()
        .map_err(damaged)?;
    let mut entries = Vec::new();
    for (variable, unpacked) in variables.iter().zip(&unpacked) {
        let whole = match unpacked {
            Some(bytes) => Matrix::of(Elements::new(bytes, variable.order)).map_err(damaged)?,
            None => variable.head.clone(),
        };
        let is_whole = unpacked.is_some();
        let entry = Entry {
            path: whole.name.clone(),
            matrix: whole,
            is_whole,
        };
        entry.list(&mut entries, 0).map_err(damaged)?;
    }
    arrays_of(path, &entries, options)?.into_sweeps(labels)
}

/// Reads the variables that are needed.
fn arrays_of<'a>(
    path: &'a Path,
    entries: &[Entry<'_>],
    options: &ReadOptions,
) -> Result<Arrays<'a>, DataError> {
    let paths: Vec<&str> = entries.iter().map(|entry| entry.path.as_str()).collect();
    let roles = Roles::of_paths(Container::Mat, &paths, options);
    let mut arrays = Arrays::new(path, Container::Mat, roles);
    for Entry {
        path,
        matrix,
        is_whole,
    } in entries
    {
        if arrays.is_known(path) && *is_whole {
            let is_samples = arrays.is_samples(path);
            let array = matrix.array();
            // MATLAB has no arrays of one dimension.
            let array = array.map(|array| if is_samples { array } else { array.into_list() });
            arrays.insert(path.clone(), array)?;
        } else {
            arrays.add_other(Other {
                name: path.clone(),
                shape: Some(matrix.shape.clone()),
                type_name: Some(matrix.class()),
            });
        }
    }
    Ok(arrays)
}

/// Variable, or field of a struct.
struct Entry<'a> {
    /// Names of the structs around it and its own, separated by slashes.
    path: String,
    matrix: Matrix<'a>,
    /// True if the values are there, not only class, shape and name.
    is_whole: bool,
}

impl<'a> Entry<'a> {
    /// Appends the variable, or the fields of a struct.
    fn list(self, entries: &mut Vec<Entry<'a>>, depth: usize) -> Result<(), String> {
        let is_open = self.is_whole && self.matrix.is_struct() && depth < DEEPEST;
        if entries.len() > MOST {
            return Err(format!("more than {MOST} variables and fields"));
        }
        if !is_open {
            entries.push(self);
            return Ok(());
        }
        for field in self.matrix.fields()? {
            let entry = Entry {
                path: format!("{}/{}", self.path, field.name),
                matrix: field,
                is_whole: true,
            };
            entry.list(entries, depth + 1)?;
        }
        Ok(())
    }
}

/// Stored form of a variable.
struct Variable<'a> {
    element: Element<'a>,
    order: ByteOrder,
    /// Class, shape and name.
    head: Matrix<'a>,
}

/// Returns the variables of a file.
fn variables(bytes: &[u8]) -> Result<Vec<Variable<'_>>, String> {
    let header = bytes.get(..HEADER).ok_or("a header that is cut short")?;
    let (version, order) = match &header[124..] {
        [low, high, b'I', b'M'] => ([*low, *high], ByteOrder::LittleEndian),
        [high, low, b'M', b'I'] => ([*low, *high], ByteOrder::BigEndian),
        _ => return Err("a header without byte order".into()),
    };
    if version != [0, 1] {
        return Err(format!("version {}, or one cut short", version[1]));
    }
    let mut elements = Elements::new(&bytes[HEADER..], order);
    let mut variables = Vec::new();
    while !elements.is_empty() {
        let element = elements.next()?;
        let head = match element.kind {
            MATRIX => Matrix::of(Elements::new(element.data, order))?,
            PACKED => peek(element.data, order)?,
            other => return Err(format!("an element of type {other} in place of a variable")),
        };
        // MATLAB keeps the contents of its objects in a variable without a name.
        if !head.name.is_empty() {
            variables.push(Variable {
                element,
                order,
                head,
            });
        }
    }
    Ok(variables)
}

/// Returns class, shape and name of a packed variable.
fn peek(packed: &[u8], order: ByteOrder) -> Result<Matrix<'static>, String> {
    let mut start = Vec::new();
    let mut unpacked = flate2::read::ZlibDecoder::new(packed).take(PEEKED);
    unpacked
        .read_to_end(&mut start)
        .map_err(|_| "a packed variable that is damaged")?;
    let Element { kind, data } = Elements::of_start(&start, order).next()?;
    match kind {
        MATRIX => Matrix::of(Elements::of_start(data, order)).map(Matrix::head),
        _ => Err("a packed element that is no variable".into()),
    }
}

impl<'a> Variable<'a> {
    /// Returns the elements of the array.
    ///
    /// # Errors
    /// A sentence about damage, or about more bytes than zlib can pack into the file.
    fn unpack(&self) -> Result<Cow<'a, [u8]>, String> {
        let Element { kind, data } = self.element;
        if kind == MATRIX {
            return Ok(Cow::Borrowed(data));
        }
        let damaged = |_| "a packed variable that is damaged".to_owned();
        let mut unpacked = flate2::read::ZlibDecoder::new(data);
        let mut tag = [0; 8];
        unpacked.read_exact(&mut tag).map_err(damaged)?;
        let mut words = tag.as_chunks::<4>().0.iter();
        let mut word = || {
            words
                .next()
                .map_or(0, |word| element::number(*word, self.order))
        };
        let (_, length) = (word(), u64::from(word()));
        let room = (data.len() as u64).saturating_mul(DEFLATE_LIMIT);
        if length > room {
            return Err(format!("{} bytes that unpack to {length}", data.len()));
        }
        let mut bytes = Vec::new();
        let read = unpacked.by_ref().take(length).read_to_end(&mut bytes);
        if read.map_err(damaged)? as u64 != length {
            return Err("a packed variable that is cut short".into());
        }
        // The end of the stream has the checksum.
        match unpacked.read(&mut [0]).map_err(damaged)? {
            0 => Ok(Cow::Owned(bytes)),
            _ => Err("a packed variable that is longer than it says".into()),
        }
    }
}
