//! Single numpy arrays (`.npy`): a short header in Python's notation, then the values.
//!
//! Format: NEP 1 and the documentation of `numpy.lib.format`, versions 1 to 3. An external crate is not used, because those
//! on crates.io bring a Python grammar and multiply the extents of a damaged shape unchecked.

mod header;

use super::narrow::{Stored, TooWide, append, join, narrow};
use super::resolution::SomeSweeps;
use crate::Samples;
use half::f16;
use hdf5_reader::ByteOrder;
use rayon::prelude::*;
use std::io::Read;

pub(super) use header::Header;

/// Array in its stored type.
pub(super) struct Array {
    /// Letter of the type: `u`, `i`, `f`, `b` (bool), `S` (bytes), `U` (text), `T` (text in `words`).
    kind: char,
    /// Bytes per value; for `U`, characters per value.
    size: usize,
    order: ByteOrder,
    /// Extents in the order of the indices; empty for a scalar.
    pub(super) shape: Vec<usize>,
    /// Values, last index fastest; empty if they are in `samples`.
    values: Vec<u8>,
    /// Texts of another container than numpy's; otherwise empty.
    words: Vec<String>,
    /// Narrowed values of an array that [`Array::read_samples`] read.
    samples: Option<Result<Samples, TooWide>>,
    /// Some of the values in `samples`, before they were narrowed.
    some: Option<SomeSweeps>,
}

/// Number of bytes that are narrowed at once.
const PIECE: usize = 1 << 16;

impl Array {
    /// Returns true for an array of numbers or truth values.
    pub(super) fn is_number(&self) -> bool {
        !matches!(self.kind, 'S' | 'U' | 'T')
    }

    /// Reads a whole `.npy` that contains exactly the values of its header.
    ///
    /// - `room`: maximum number of bytes of the values
    ///
    /// # Errors
    /// A sentence about an invalid file.
    pub(super) fn read(mut from: impl Read, room: u64) -> Result<Self, String> {
        let header = Header::read(&mut from)?;
        header.check_room(room)?;
        Self::whole(header, from)
    }

    /// Reads a whole `.npy` of numbers as [`Samples`]. They are narrowed while they are read, so memory holds only one
    /// copy.
    pub(super) fn read_samples(mut from: impl Read, room: u64) -> Result<Self, String> {
        let header = Header::read(&mut from)?;
        header.check_room(room)?;
        let mut array = Self::empty(&header);
        // Single bytes need no narrowing, and changing the index order needs all values.
        let is_plain = (array.kind, array.size) == ('u', 1);
        if header.fortran || is_plain || array.narrowed(Vec::new()).is_none() {
            return Self::whole(header, from);
        }
        let mut samples = Ok(Samples::U8(Vec::new()));
        let mut left = header.bytes;
        let mut some = array
            .wide(Vec::new())
            .map(|_| SomeSweeps::of_array(&array.shape));
        while left > 0 {
            let mut piece = vec![0; left.min(array.size * PIECE)];
            from.read_exact(&mut piece)
                .map_err(|_| header.wrong(format!("less than {} bytes", header.bytes)))?;
            left -= piece.len();
            if let Some(some) = &mut some {
                some.push_if_kept(piece.len() / array.size, || {
                    array.wide(piece.clone()).unwrap_or_default()
                });
            }
            samples = match (samples, array.narrowed(piece)) {
                (Ok(all), Some(Ok(piece))) => Ok(append(all, piece)),
                (Ok(_), Some(Err(too_wide))) => Err(too_wide),
                (Ok(_), None) => return Err(header.wrong("no numbers".into())),
                (too_wide, _) => too_wide,
            };
        }
        header.check_end(&mut from)?;
        array.samples = Some(samples);
        array.some = some;
        Ok(array)
    }

    fn whole(header: Header, mut from: impl Read) -> Result<Self, String> {
        let mut values = Vec::with_capacity(header.bytes);
        let read = from
            .by_ref()
            .take(header.bytes as u64)
            .read_to_end(&mut values);
        read.map_err(|error| error.to_string())?;
        if values.len() < header.bytes {
            return Err(header.wrong(format!("{} bytes", values.len())));
        }
        header.check_end(&mut from)?;
        let mut array = Self::empty(&header);
        array.values = if header.fortran {
            let bytes = if header.kind == 'U' {
                4 * header.size
            } else {
                header.size
            };
            last_index_fastest(&values, &header.shape, bytes)
        } else {
            values
        };
        Ok(array)
    }

    fn empty(header: &Header) -> Self {
        Self {
            kind: header.kind,
            size: header.size,
            order: header.order,
            shape: header.shape.clone(),
            values: Vec::new(),
            words: Vec::new(),
            samples: None,
            some: None,
        }
    }

    /// Returns an array of numbers.
    ///
    /// - `kind`: `u`, `i` or `f`
    /// - `size`: bytes per value
    /// - `shape`: extents in the order of the indices; empty for a scalar
    /// - `values`: as many values, last index fastest
    pub(super) fn of_bytes(
        kind: char,
        size: usize,
        order: ByteOrder,
        shape: Vec<usize>,
        values: Vec<u8>,
    ) -> Self {
        Self {
            kind,
            size,
            order,
            shape,
            values,
            words: Vec::new(),
            samples: None,
            some: None,
        }
    }

    /// Returns an array of texts.
    pub(super) fn of_texts(shape: Vec<usize>, words: Vec<String>) -> Self {
        let empty = Self::of_bytes('T', 1, ByteOrder::LittleEndian, shape, Vec::new());
        Self { words, ..empty }
    }

    /// Returns the numbers of an array whose values are stored with the first index fastest.
    pub(super) fn with_columns_first(mut self) -> Self {
        self.values = last_index_fastest(&self.values, &self.shape, self.size);
        self
    }

    /// Returns a row or column as an array of one dimension; other shapes do not change.
    pub(super) fn into_list(mut self) -> Self {
        if let [1, length] | [length, 1] = self.shape[..] {
            self.shape = vec![length];
        }
        self
    }

    /// Returns a single whole number as text.
    pub(super) fn single_text(&self) -> Option<String> {
        match self.whole_numbers()?.as_slice() {
            [number] => Some(number.to_string()),
            _ => None,
        }
    }

    /// Returns the numbers of `bytes` as `f64`, if 32-bit floats may lose their resolution; `None` for other types.
    fn wide(&self, bytes: Vec<u8>) -> Option<Vec<f64>> {
        fn floats<T: Stored>(bytes: Vec<u8>, order: ByteOrder) -> Vec<f64> {
            T::decode(bytes, order).into_iter().map(T::to_f64).collect()
        }
        let order = self.order;
        Some(match (self.kind, self.size) {
            ('f', 8) => floats::<f64>(bytes, order),
            ('i', 4) => floats::<i32>(bytes, order),
            ('u', 4) => floats::<u32>(bytes, order),
            ('i', 8) => floats::<i64>(bytes, order),
            ('u', 8) => floats::<u64>(bytes, order),
            _ => return None,
        })
    }

    /// Returns the numbers as `f64`, if 32-bit floats may lose their resolution; `None` for other types.
    pub(super) fn wide_values(&self) -> Option<Vec<f64>> {
        self.wide(self.values.clone())
    }

    /// Removes and returns some of the sweeps, if 32-bit floats may lose their resolution; `None` for other types.
    pub(super) fn some_sweeps(&mut self) -> Option<SomeSweeps> {
        if self.samples.is_some() {
            return self.some.take();
        }
        self.wide(Vec::new())?;
        let mut some = SomeSweeps::of_array(&self.shape);
        for piece in self.values.chunks(self.size * PIECE) {
            some.push_if_kept(piece.len() / self.size, || {
                self.wide(piece.to_vec()).unwrap_or_default()
            });
        }
        Some(some)
    }

    /// Returns the type as numpy writes it, without the byte order; for text only the kind.
    pub(super) fn type_name(&self) -> String {
        match self.kind {
            'U' | 'S' | 'T' => "text".into(),
            kind => format!("{kind}{}", self.size),
        }
    }

    /// Returns the numbers as [`Array::numbers`], without a second copy.
    pub(super) fn into_numbers(self) -> Option<Result<Samples, TooWide>> {
        match (self.kind, self.size) {
            _ if self.samples.is_some() => self.samples,
            ('u' | 'b', 1) => Some(Ok(Samples::U8(self.values))),
            _ => self.numbers(),
        }
    }

    /// Returns the numbers in their smallest element type; `None` for other values.
    pub(super) fn numbers(&self) -> Option<Result<Samples, TooWide>> {
        // The values are narrowed in pieces, so the wide values are never copied as a whole.
        self.narrowed(Vec::new())?.ok()?;
        let pieces: Result<Vec<Samples>, TooWide> = self
            .values
            .par_chunks(self.size * PIECE)
            .filter_map(|piece| self.narrowed(piece.to_vec()))
            .collect();
        Some(pieces.map(join))
    }

    /// Returns the numbers of `bytes` in their smallest element type; `None` for other values.
    fn narrowed(&self, bytes: Vec<u8>) -> Option<Result<Samples, TooWide>> {
        let order = self.order;
        Some(match (self.kind, self.size) {
            ('u' | 'b', 1) => Ok(Samples::U8(bytes)),
            ('u', 2) => narrow(&u16::decode(bytes, order)),
            ('u', 4) => narrow(&u32::decode(bytes, order)),
            ('u', 8) => narrow(&u64::decode(bytes, order)),
            ('i', 1) => narrow(&i8::decode(bytes, order)),
            ('i', 2) => narrow(&i16::decode(bytes, order)),
            ('i', 4) => narrow(&i32::decode(bytes, order)),
            ('i', 8) => narrow(&i64::decode(bytes, order)),
            ('f', 2) => {
                let halves = u16::decode(bytes, order).into_iter();
                let widened = halves.map(|bits| f16::from_bits(bits).to_f32());
                narrow(&widened.collect::<Vec<f32>>())
            }
            ('f', 4) => narrow(&f32::decode(bytes, order)),
            ('f', 8) => narrow(&f64::decode(bytes, order)),
            _ => return None,
        })
    }

    /// Returns whole numbers, also those that are stored as floats; `None` for other values.
    pub(super) fn whole_numbers(&self) -> Option<Vec<i64>> {
        let whole = |value: f64| (value.fract() == 0.0).then_some(value as i64);
        self.floats()?.into_iter().map(whole).collect()
    }

    /// Returns numbers as `f64`; `None` for other values and numbers too large for an `f32`.
    pub(super) fn floats(&self) -> Option<Vec<f64>> {
        self.values_f64()?.ok()
    }

    /// Returns numbers as `f64`; `None` for other values.
    ///
    /// # Errors
    /// An integer that an `f32` does not represent.
    pub(super) fn values_f64(&self) -> Option<Result<Vec<f64>, TooWide>> {
        if (self.kind, self.size) == ('f', 8) {
            return Some(Ok(f64::decode(self.values.clone(), self.order)));
        }
        Some(self.numbers()?.map(|samples| {
            let mut values = vec![0.0; samples.len()];
            samples.copy_to(0, &mut values);
            values.into_iter().map(f64::from).collect()
        }))
    }

    /// Returns whole numbers from 0; `None` for other values.
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

    /// Returns texts; `None` for other values.
    pub(super) fn texts(&self) -> Option<Vec<String>> {
        let width = match self.kind {
            'T' => return Some(self.words.clone()),
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

/// Converts from first-index-fastest ("Fortran") order.
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

/// Returns a whole `.npy` of `shape`, little-endian, last index fastest.
///
/// - `descr`: numpy's name of the type, such as `|u1` or `<f4`
pub(super) fn encode(descr: &str, shape: &[usize], values: &[u8]) -> Vec<u8> {
    let extents: Vec<String> = shape.iter().map(|extent| format!("{extent},")).collect();
    let mut header = format!(
        "{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}), }}",
        extents.join(" ")
    );
    // The values begin at a multiple of 64 bytes, after a line feed.
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
