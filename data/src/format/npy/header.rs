//! Header of a `.npy`, in Python's notation.

use hdf5_reader::ByteOrder;
use std::io::{ErrorKind, Read};

/// Maximum length of the header, in bytes; numpy writes less than a kibibyte.
const MAX_HEADER: usize = 1 << 16;
/// Maximum number of dimensions; numpy has 64, formerly 32.
const MAX_DIMENSIONS: usize = 64;

/// Header of a `.npy`.
pub(in crate::format) struct Header {
    pub(super) kind: char,
    pub(super) size: usize,
    pub(super) order: ByteOrder,
    pub(super) fortran: bool,
    /// Extents in the order of the indices.
    pub(in crate::format) shape: Vec<usize>,
    /// Size of all values, in bytes.
    pub(super) bytes: usize,
}

impl Header {
    /// Reads the header, and leaves `from` at the first value.
    ///
    /// # Errors
    /// A sentence about an invalid header.
    pub(in crate::format) fn read(from: &mut impl Read) -> Result<Self, String> {
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
            return Err(unread_kind(descr, kind, letters.as_str()));
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

/// Returns a description of a type that is not read, and a cure if there is one.
fn unread_kind(descr: &str, kind: char, size: &str) -> String {
    match kind {
        'O' => "an object array (pickled), as numpy saves a dict, or a list of sweeps of several lengths: sweeps must be one array of numbers, names text (`.astype(str)`)".into(),
        'c' => format!("complex numbers ({}); `np.abs(X)` or `X.real.astype(np.float32)` gives real ones", numpy_name(kind, size)),
        'M' | 'm' => format!("{}; `X.astype(np.int64)` gives numbers", numpy_name(kind, size)),
        _ => format!("values of type `{descr}`"),
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
    pub(super) fn wrong(&self, found: String) -> String {
        let Self {
            kind, size, shape, ..
        } = self;
        format!("{found} for {shape:?} values of type `{kind}{size}`")
    }

    /// Succeeds if the file can contain as many bytes as the values need.
    pub(super) fn check_room(&self, room: u64) -> Result<(), String> {
        if self.bytes as u64 > room {
            return Err(self.wrong(format!("at most {room} bytes")));
        }
        Ok(())
    }

    /// Succeeds if no bytes follow the values.
    pub(super) fn check_end(&self, from: &mut impl Read) -> Result<(), String> {
        match from.read(&mut [0]) {
            Ok(0) => Ok(()),
            Ok(_) => Err(self.wrong(format!("more than {} bytes", self.bytes))),
            Err(error) => Err(error.to_string()),
        }
    }
}

/// Returns the text after `'name':` in a header.
fn field<'a>(header: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = header.split_once(&format!("'{name}'"))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}
