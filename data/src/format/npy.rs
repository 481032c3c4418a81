//! Single numpy arrays (`.npy`): a short header in Python's notation, then the values.
//!
//! Format: NEP 1 and the documentation of `numpy.lib.format`, versions 1 to 3. This is no external crate, because those
//! on crates.io bring a Python grammar and multiply the extents of a damaged shape unchecked.

use super::narrow::{Stored, TooWide, append, join, narrow};
use super::resolution::SomeSweeps;
use crate::Samples;
use half::f16;
use hdf5_reader::ByteOrder;
use rayon::prelude::*;
use std::io::{ErrorKind, Read};

/// Array in its stored type.
pub(super) struct Array {
    /// Letter of the type: `u`, `i`, `f`, `b` (bool), `S` (bytes), `U` (text).
    kind: char,
    /// Bytes per value; for `U`, characters per value.
    size: usize,
    order: ByteOrder,
    /// Extents in the order of the indices; empty for a scalar.
    pub(super) shape: Vec<usize>,
    /// Values, last index fastest; empty if they are in `samples`.
    values: Vec<u8>,
    /// Narrowed values of an array that [`Array::read_samples`] read.
    samples: Option<Result<Samples, TooWide>>,
    /// Some of the values in `samples`, before they were narrowed.
    some: Option<SomeSweeps>,
}

/// Number of bytes that are narrowed at once.
const PIECE: usize = 1 << 16;

/// Maximum length of the header, in bytes; numpy writes less than a kibibyte.
const MAX_HEADER: usize = 1 << 16;
/// Maximum number of dimensions; numpy has 64, formerly 32.
const MAX_DIMENSIONS: usize = 64;

/// Header of a `.npy`.
pub(super) struct Header {
    kind: char,
    size: usize,
    order: ByteOrder,
    fortran: bool,
    /// Extents in the order of the indices.
    pub(super) shape: Vec<usize>,
    /// Size of all values, in bytes.
    bytes: usize,
}

impl Header {
    /// Reads the header, and leaves `from` at the first value.
    ///
    /// # Errors
    /// A sentence about an invalid header.
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
            .ok_or_else(|| format!("a structured array, {descr}; take one field: X[\"name\"]"))?;
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
                'O' => "an object array (pickled), as numpy saves a dict, or a list of sweeps of several lengths: sweeps must be one array of numbers, names text (`.astype(str)`)".into(),
                'c' => format!("complex numbers ({}); `np.abs(X)` or `X.real.astype(np.float32)` gives real ones", numpy_name(kind, letters.as_str())),
                'M' | 'm' => format!("{}; `X.astype(np.int64)` gives numbers", numpy_name(kind, letters.as_str())),
                _ => format!("values of type `{descr}`"),
            });
        }
        let size: usize = letters
            .as_str()
            .parse()
            .map_err(|_| format!("values of type `{descr}`"))?;
        if kind == 'f' && size > 8 {
            return Err(format!(
                "longdouble (numpy's float{}); `X.astype(np.float64)` gives numbers that are read",
                8 * size
            ));
        }
        // A size that the file cannot contain would otherwise be accepted, however large.
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

/// Returns numpy's name of a type: `complex128` for `c16`, `datetime64[s]` for `M8[s]`.
fn numpy_name(kind: char, size: &str) -> String {
    let bits = |bytes: usize| 8 * bytes;
    let unit = size.trim_start_matches(|c: char| c.is_ascii_digit());
    let bytes = size[..size.len() - unit.len()].parse().unwrap_or(0);
    match kind {
        'c' => format!("complex{}", bits(bytes)),
        'M' => format!("datetime{}{unit}", bits(bytes)),
        _ => format!("timedelta{}{unit}", bits(bytes)),
    }
}

impl Header {
    fn wrong(&self, found: String) -> String {
        let Self {
            kind, size, shape, ..
        } = self;
        format!("{found} for {shape:?} values of type `{kind}{size}`")
    }

    /// Succeeds if the file can contain as many bytes as the values need.
    fn check_room(&self, room: u64) -> Result<(), String> {
        if self.bytes as u64 > room {
            return Err(self.wrong(format!("at most {room} bytes")));
        }
        Ok(())
    }

    /// Succeeds if no bytes follow the values.
    fn check_end(&self, from: &mut impl Read) -> Result<(), String> {
        match from.read(&mut [0]) {
            Ok(0) => Ok(()),
            Ok(_) => Err(self.wrong(format!("more than {} bytes", self.bytes))),
            Err(error) => Err(error.to_string()),
        }
    }
}

impl Array {
    /// Returns true for an array of numbers or truth values.
    pub(super) fn is_number(&self) -> bool {
        !matches!(self.kind, 'S' | 'U')
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
            samples: None,
            some: None,
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
            'U' | 'S' => "text".into(),
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

/// Returns the text after `'name':` in a header.
fn field<'a>(header: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = header.split_once(&format!("'{name}'"))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
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
