//! One numpy array (`.npy`): a short header in Python's notation, then the values.
//!
//! Format: NEP 1 and the documentation of `numpy.lib.format`, versions 1 to 3. Read here and not by a crate, because the
//! readers on crates.io bring a Python grammar and multiply a damaged shape without a check.

use super::narrow::{Stored, TooWide, join, narrow};
use crate::Samples;
use half::f16;
use hdf5_reader::ByteOrder;
use rayon::prelude::*;
use std::io::{ErrorKind, Read};

/// An array as it stands in the file.
pub(super) struct Array {
    /// Letter of the type: `u`, `i`, `f`, `b` (bool), `S` (bytes), `U` (text).
    kind: char,
    /// Bytes per value, or characters per `U` value.
    size: usize,
    order: ByteOrder,
    /// Extents in the order of the indices; empty for a single value.
    pub(super) shape: Vec<usize>,
    /// The values, last index fastest.
    values: Vec<u8>,
}

/// Longest header that is read: numpy writes less than a kibibyte.
const MAX_HEADER: usize = 1 << 16;
/// Most dimensions: numpy has 32, formerly, and 64.
const MAX_DIMENSIONS: usize = 64;

/// What a `.npy` says of its values.
pub(super) struct Header {
    kind: char,
    size: usize,
    order: ByteOrder,
    fortran: bool,
    /// Extents in the order of the indices.
    pub(super) shape: Vec<usize>,
    /// Bytes of all values.
    bytes: usize,
}

impl Header {
    /// Reads the head of a `.npy`, and leaves `from` at its first value.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub(super) fn read(from: &mut impl Read) -> Result<Self, String> {
        let mut exactly = |bytes: usize| {
            let mut read = vec![0; bytes];
            from.read_exact(&mut read)
                .map(|()| read)
                .map_err(|error| match error.kind() {
                    ErrorKind::UnexpectedEof => "not a numpy array, or one cut short".to_owned(),
                    _ => error.to_string(),
                })
        };
        let magic = exactly(8)?;
        let length = match (magic.strip_prefix(b"\x93NUMPY"), magic[6]) {
            (None, _) => return Err("not a numpy array".into()),
            (_, 1) => usize::from(u16::from_le_bytes([exactly(1)?[0], exactly(1)?[0]])),
            (_, 2 | 3) => {
                let length: [u8; 4] = exactly(4)?.try_into().unwrap_or_default();
                u32::from_le_bytes(length) as usize
            }
            _ => return Err("a numpy array of an unknown version".into()),
        };
        if length > MAX_HEADER {
            return Err(format!("a numpy header of {length} bytes"));
        }
        let header = exactly(length)?;
        let header = str::from_utf8(&header).map_err(|_| "a numpy header that is not text")?;
        Self::of(header)
    }

    fn of(header: &str) -> Result<Self, String> {
        let damaged = || format!("the numpy header `{}`", header.trim());
        let descr = field(header, "descr").ok_or_else(damaged)?;
        let descr = descr
            .strip_prefix(['\'', '"'])
            .and_then(|d| d.split(['\'', '"']).next())
            .ok_or_else(|| format!("records ({descr})"))?;
        let fortran = field(header, "fortran_order")
            .ok_or_else(damaged)?
            .starts_with("True");
        let shape = field(header, "shape").and_then(|s| s.strip_prefix('(')?.split(')').next());
        let shape: Vec<usize> = shape
            .ok_or_else(damaged)?
            .split(',')
            .map(str::trim)
            .filter(|extent| !extent.is_empty())
            .map(|extent| extent.parse().map_err(|_| damaged()))
            .collect::<Result<_, _>>()?;
        let mut letters = descr.chars();
        let order = match letters.next() {
            Some('<' | '|' | '=') => ByteOrder::LittleEndian,
            Some('>') => ByteOrder::BigEndian,
            _ => return Err(format!("values of type `{descr}`")),
        };
        let kind = letters.next().unwrap_or(' ');
        if !"uifbSU".contains(kind) {
            return Err(match kind {
                'O' => "Python objects (pickled): sweeps must be equally long, and names text (`.astype(str)`)".into(),
                _ => format!("values of type `{descr}`"),
            });
        }
        let size: usize = letters
            .as_str()
            .parse()
            .map_err(|_| format!("values of type `{descr}`"))?;
        // Counts that no byte stands behind would be believed, however large.
        if size == 0 || shape.contains(&0) || shape.len() > MAX_DIMENSIONS {
            return Err(format!("no values: {shape:?} of type `{descr}`"));
        }
        let bytes = if kind == 'U' { 4 } else { 1 };
        let bytes = shape
            .iter()
            .chain([&size])
            .try_fold(bytes, |n: usize, &extent| n.checked_mul(extent))
            .ok_or_else(|| format!("{shape:?} values of type `{descr}`"))?;
        Ok(Self {
            kind,
            size,
            order,
            fortran,
            shape,
            bytes,
        })
    }
}

impl Array {
    /// Reads a whole `.npy`, which holds what its header says and no more.
    ///
    /// - `room`: bytes that there can be
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub(super) fn read(mut from: impl Read, room: u64) -> Result<Self, String> {
        let Header {
            kind,
            size,
            order,
            fortran,
            shape,
            bytes,
        } = Header::read(&mut from)?;
        let wrong = |found: String| format!("{found} for {shape:?} values of type `{kind}{size}`");
        if bytes as u64 > room {
            return Err(wrong(format!("at most {room} bytes")));
        }
        let mut values = Vec::with_capacity(bytes);
        let read = from.by_ref().take(bytes as u64).read_to_end(&mut values);
        read.map_err(|error| error.to_string())?;
        if values.len() < bytes {
            return Err(wrong(format!("{} bytes", values.len())));
        }
        match from.read(&mut [0]) {
            Ok(0) => {}
            Ok(_) => return Err(wrong(format!("more than {bytes} bytes"))),
            Err(error) => return Err(error.to_string()),
        }
        if fortran {
            let bytes = if kind == 'U' { 4 * size } else { size };
            values = last_index_fastest(&values, &shape, bytes);
        }
        Ok(Self {
            kind,
            size,
            order,
            shape,
            values,
        })
    }

    /// The type as numpy writes it, without the byte order.
    pub(super) fn type_name(&self) -> String {
        format!("{}{}", self.kind, self.size)
    }

    /// The same as [`Array::numbers`], without a second copy of bytes.
    pub(super) fn into_numbers(self) -> Option<Result<Samples, TooWide>> {
        match (self.kind, self.size) {
            ('u' | 'b', 1) => Some(Ok(Samples::U8(self.values))),
            _ => self.numbers(),
        }
    }

    /// Numbers in their smallest element type; none if the values are not numbers.
    pub(super) fn numbers(&self) -> Option<Result<Samples, TooWide>> {
        // A piece at a time, so that wide values never stand in memory twice.
        fn all<T: Stored>(array: &Array) -> Option<Result<Samples, TooWide>> {
            let pieces: Result<Vec<Samples>, TooWide> = array
                .values
                .par_chunks(array.size << 16)
                .map(|piece| narrow(&T::decode(piece.to_vec(), array.order)))
                .collect();
            Some(pieces.map(join))
        }
        match (self.kind, self.size) {
            ('u' | 'b', 1) => all::<u8>(self),
            ('u', 2) => all::<u16>(self),
            ('u', 4) => all::<u32>(self),
            ('u', 8) => all::<u64>(self),
            ('i', 1) => all::<i8>(self),
            ('i', 2) => all::<i16>(self),
            ('i', 4) => all::<i32>(self),
            ('i', 8) => all::<i64>(self),
            ('f', 2) => Some(narrow(&self.halves())),
            ('f', 4) => all::<f32>(self),
            ('f', 8) => all::<f64>(self),
            _ => None,
        }
    }

    /// The values of a `float16` array.
    fn halves(&self) -> Vec<f32> {
        let halves = u16::decode(self.values.clone(), self.order);
        let widened = halves.into_iter().map(|bits| f16::from_bits(bits).to_f32());
        widened.collect()
    }

    /// Whole numbers, also those that are stored as floats; none if the values are anything else.
    pub(super) fn whole_numbers(&self) -> Option<Vec<i64>> {
        let whole = |value: f64| (value.fract() == 0.0).then_some(value as i64);
        self.floats()?.into_iter().map(whole).collect()
    }

    /// Numbers as `f64`; none if the values are not numbers or too large for an `f32`.
    pub(super) fn floats(&self) -> Option<Vec<f64>> {
        if (self.kind, self.size) == ('f', 8) {
            return Some(f64::decode(self.values.clone(), self.order));
        }
        let samples = self.numbers()?.ok()?;
        let mut values = vec![0.0; samples.len()];
        samples.copy_to(0, &mut values);
        Some(values.into_iter().map(f64::from).collect())
    }

    /// Whole numbers from 0; none if the values are anything else.
    pub(super) fn indices(&self) -> Option<Vec<u32>> {
        if self.kind == 'f' {
            return None;
        }
        match self.numbers()?.ok()? {
            Samples::U8(values) => Some(values.into_iter().map(u32::from).collect()),
            Samples::U16(values) => Some(values.into_iter().map(u32::from).collect()),
            Samples::F32(values) => values
                .into_iter()
                .map(|x| (0.0..4_294_967_296.0).contains(&x).then_some(x as u32))
                .collect(),
        }
    }

    /// Texts; none if the values are not text.
    pub(super) fn texts(&self) -> Option<Vec<String>> {
        let width = match self.kind {
            'S' => self.size,
            'U' => self.size * 4,
            _ => return None,
        };
        let count = self.shape.iter().product();
        let text = |bytes: &[u8]| match self.kind {
            'S' => String::from_utf8(bytes.to_vec()).ok(),
            _ => u32::decode(bytes.to_vec(), self.order)
                .into_iter()
                .map(char::from_u32)
                .collect(),
        };
        (0..count)
            .map(|i| {
                let text = text(&self.values[i * width..(i + 1) * width])?;
                Some(text.trim_end_matches('\0').to_owned())
            })
            .collect()
    }
}

/// Returns what follows `'name':` in a header.
fn field<'a>(header: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = header.split_once(&format!("'{name}'"))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

/// Turns first-index-fastest ("Fortran") order round.
fn last_index_fastest(values: &[u8], shape: &[usize], size: usize) -> Vec<u8> {
    let mut turned = Vec::with_capacity(values.len());
    let count: usize = shape.iter().product();
    for index in 0..count {
        let (mut rest, mut stride, mut source) = (index, count, 0);
        for &extent in shape.iter().rev() {
            stride /= extent;
            source += rest % extent * stride;
            rest /= extent;
        }
        turned.extend_from_slice(&values[source * size..(source + 1) * size]);
    }
    turned
}

/// A whole `.npy` of `shape`, little-endian, last index fastest.
///
/// - `descr`: numpy's name of the type, such as `|u1` or `<f4`
pub(super) fn encode(descr: &str, shape: &[usize], values: &[u8]) -> Vec<u8> {
    let extents: Vec<String> = shape.iter().map(|extent| format!("{extent},")).collect();
    let mut header = format!(
        "{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}), }}",
        extents.join(" ")
    );
    // The values begin at a multiple of 64 bytes, behind a line end.
    let unpadded = 10 + header.len() + 1;
    header.extend(std::iter::repeat_n(
        ' ',
        unpadded.next_multiple_of(64) - unpadded,
    ));
    header.push('\n');
    let mut file = Vec::with_capacity(10 + header.len() + values.len());
    file.extend_from_slice(b"\x93NUMPY\x01\x00");
    file.extend_from_slice(&(header.len() as u16).to_le_bytes());
    file.extend_from_slice(header.as_bytes());
    file.extend_from_slice(values);
    file
}
