//! Numbers of any type, narrowed to the smallest of `u8`, `u16` and `f32` that keeps their values.

use crate::Samples;
use hdf5_reader::dataset::SliceInfo;
use hdf5_reader::{ByteOrder, Dataset};

impl Samples {
    /// Returns the values in the smallest type that keeps them.
    pub(crate) fn narrowed(self) -> Self {
        match &self {
            // 32-bit floats are never too wide.
            Self::F32(values) => narrow(values).unwrap_or(self),
            Self::U8(_) | Self::U16(_) => self,
        }
    }
}

/// Smallest element type that keeps some values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Width {
    /// Whole numbers from 0 to 255.
    U8,
    /// Whole numbers from 0 to 65535.
    U16,
    /// Numbers that an `f32` represents exactly, `f64` rounded to the nearest `f32`, NaN and infinity.
    F32,
    /// An integer that `f32` does not represent, or an `f64` beyond the range of `f32`.
    TooWide,
}

/// Number type in files.
pub(super) trait Stored: Copy + Send + Sync + std::fmt::Display + 'static {
    /// Returns the smallest type that keeps this number.
    fn width(self) -> Width;
    /// Converts to `u8`, if [`Stored::width`] allows it.
    fn to_u8(self) -> u8;
    /// Converts to `u16`, if [`Stored::width`] allows it.
    fn to_u16(self) -> u16;
    /// Converts to the nearest `f32`.
    fn to_f32(self) -> f32;
    /// Converts to the nearest `f64`.
    fn to_f64(self) -> f64;
    /// Decodes all numbers of `bytes`; a shorter remainder is ignored.
    fn decode(bytes: Vec<u8>, order: ByteOrder) -> Vec<Self>;
    /// Reads the numbers of a box of an HDF5 data set, row-major.
    fn read_box(dataset: &Dataset, selection: &SliceInfo) -> hdf5_reader::error::Result<Vec<Self>>;
}

macro_rules! stored {
    ($type:ty, $width:expr, $decode:expr) => {
        impl Stored for $type {
            fn width(self) -> Width {
                $width(self)
            }
            fn to_u8(self) -> u8 {
                self as u8
            }
            fn to_u16(self) -> u16 {
                self as u16
            }
            fn to_f32(self) -> f32 {
                self as f32
            }
            fn to_f64(self) -> f64 {
                self as f64
            }
            fn decode(bytes: Vec<u8>, order: ByteOrder) -> Vec<Self> {
                $decode(bytes, order)
            }
            fn read_box(
                dataset: &Dataset,
                selection: &SliceInfo,
            ) -> hdf5_reader::error::Result<Vec<Self>> {
                Ok(dataset
                    .read_slice::<Self>(selection)?
                    .into_raw_vec_and_offset()
                    .0)
            }
        }
    };
}

macro_rules! decode {
    ($type:ty) => {
        |bytes: Vec<u8>, order| {
            let (numbers, _) = bytes.as_chunks();
            match order {
                ByteOrder::LittleEndian => {
                    numbers.iter().map(|&b| <$type>::from_le_bytes(b)).collect()
                }
                ByteOrder::BigEndian => {
                    numbers.iter().map(|&b| <$type>::from_be_bytes(b)).collect()
                }
            }
        }
    };
}

fn integer_width(value: i128) -> Width {
    match value {
        0..=0xff => Width::U8,
        0x100..=0xffff => Width::U16,
        _ if (value as f32) as i128 == value => Width::F32,
        _ => Width::TooWide,
    }
}

fn float_width(value: f64) -> Width {
    if f64::from(value as u8) == value {
        Width::U8
    } else if f64::from(value as u16) == value {
        Width::U16
    } else if value.is_finite() && !(value as f32).is_finite() {
        Width::TooWide
    } else {
        Width::F32
    }
}

stored!(u8, |_| Width::U8, |bytes, _| bytes);
stored!(i8, |value: i8| integer_width(value.into()), decode!(i8));
stored!(
    u16,
    |value: u16| if value < 0x100 { Width::U8 } else { Width::U16 },
    decode!(u16)
);
stored!(i16, |value: i16| integer_width(value.into()), decode!(i16));
stored!(u32, |value: u32| integer_width(value.into()), decode!(u32));
stored!(i32, |value: i32| integer_width(value.into()), decode!(i32));
stored!(u64, |value: u64| integer_width(value.into()), decode!(u64));
stored!(i64, |value: i64| integer_width(value.into()), decode!(i64));
stored!(f32, |value: f32| float_width(value.into()), decode!(f32));
stored!(f64, float_width, decode!(f64));

/// Expected values, for messages about [`TooWide`].
pub(super) const HELD: &str = "values that a 32-bit float holds";

/// Value that no element type represents, as text.
#[derive(Debug)]
pub(super) struct TooWide(pub String);

/// Returns the smallest type that keeps all of `values`.
///
/// # Errors
/// The first value that is [`Width::TooWide`].
pub(super) fn width_of<T: Stored>(values: &[T]) -> Result<Width, TooWide> {
    let width = values
        .iter()
        .fold(Width::U8, |width, value| width.max(value.width()));
    if width < Width::TooWide {
        return Ok(width);
    }
    let value = values.iter().find(|value| value.width() == Width::TooWide);
    Err(TooWide(value.map_or_else(String::new, ToString::to_string)))
}

/// Converts `values` to their smallest element type.
///
/// # Errors
/// A value that is [`Width::TooWide`].
pub(super) fn narrow<T: Stored>(values: &[T]) -> Result<Samples, TooWide> {
    Ok(match width_of(values)? {
        Width::U8 => Samples::U8(values.iter().map(|v| v.to_u8()).collect()),
        Width::U16 => Samples::U16(values.iter().map(|v| v.to_u16()).collect()),
        Width::F32 | Width::TooWide => Samples::F32(values.iter().map(|v| v.to_f32()).collect()),
    })
}

/// Converts `samples` to an element type of at least `width`.
pub(super) fn widen(samples: Samples, width: Width) -> Samples {
    match (samples, width) {
        (Samples::U8(values), Width::U16) => {
            Samples::U16(values.into_iter().map(u16::from).collect())
        }
        (Samples::U8(values), Width::F32) => {
            Samples::F32(values.into_iter().map(f32::from).collect())
        }
        (Samples::U16(values), Width::F32) => {
            Samples::F32(values.into_iter().map(f32::from).collect())
        }
        (samples, _) => samples,
    }
}

/// Concatenates the pieces in the widest of their element types.
pub(super) fn join(mut pieces: Vec<Samples>) -> Samples {
    if pieces.len() == 1
        && let Some(only) = pieces.pop()
    {
        return only;
    }
    let length = pieces.iter().map(Samples::len).sum();
    let width = pieces.iter().map(samples_width).max().unwrap_or(Width::U8);
    let mut joined = match width {
        Width::U8 => Samples::U8(Vec::with_capacity(length)),
        Width::U16 => Samples::U16(Vec::with_capacity(length)),
        Width::F32 | Width::TooWide => Samples::F32(Vec::with_capacity(length)),
    };
    for piece in pieces {
        match (&mut joined, widen(piece, width)) {
            (Samples::U8(all), Samples::U8(piece)) => all.extend_from_slice(&piece),
            (Samples::U16(all), Samples::U16(piece)) => all.extend_from_slice(&piece),
            (Samples::F32(all), Samples::F32(piece)) => all.extend_from_slice(&piece),
            _ => unreachable!("every piece was widened to the widest"),
        }
    }
    joined
}

/// Appends `piece` to `all`, which is widened if necessary. Memory grows with the data that was read, not with the size
/// that a file claims.
pub(super) fn append(all: Samples, piece: Samples) -> Samples {
    let width = samples_width(&all).max(samples_width(&piece));
    let mut all = widen(all, width);
    match (&mut all, widen(piece, width)) {
        (Samples::U8(all), Samples::U8(piece)) => all.extend_from_slice(&piece),
        (Samples::U16(all), Samples::U16(piece)) => all.extend_from_slice(&piece),
        (Samples::F32(all), Samples::F32(piece)) => all.extend_from_slice(&piece),
        _ => unreachable!("both were widened to the wider"),
    }
    all
}

fn samples_width(samples: &Samples) -> Width {
    match samples {
        Samples::U8(_) => Width::U8,
        Samples::U16(_) => Width::U16,
        Samples::F32(_) => Width::F32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn values_narrow_to_the_smallest_type_that_keeps_them() {
        assert_eq!(narrow(&[0.0f64, 255.0]).unwrap(), Samples::U8(vec![0, 255]));
        assert_eq!(narrow(&[0i64, 256]).unwrap(), Samples::U16(vec![0, 256]));
        assert_eq!(narrow(&[-1i8, 1]).unwrap(), Samples::F32(vec![-1.0, 1.0]));
        assert_eq!(narrow(&[0.1f64]).unwrap(), Samples::F32(vec![0.1]));
        assert_eq!(
            narrow(&[1u64 << 40]).unwrap(),
            Samples::F32(vec![1.099_511_6e12])
        );
        assert_eq!(
            narrow(&[f64::INFINITY]).unwrap(),
            Samples::F32(vec![f32::INFINITY])
        );
        assert!(matches!(narrow(&[f64::NAN]).unwrap(), Samples::F32(v) if v[0].is_nan()));
    }

    #[test]
    fn values_that_no_f32_holds_are_named() {
        assert_eq!(narrow(&[0, (1 << 24) + 1]).unwrap_err().0, "16777217");
        assert_eq!(narrow(&[u64::MAX]).unwrap_err().0, u64::MAX.to_string());
        assert_eq!(narrow(&[i64::MAX]).unwrap_err().0, i64::MAX.to_string());
        assert!(narrow(&[1e300f64]).is_err());
    }

    proptest! {
        #[test]
        fn integers_narrow_without_loss(values in prop::collection::vec(any::<i32>(), 1..20)) {
            match narrow(&values) {
                Ok(samples) => {
                    let mut back = vec![0.0; values.len()];
                    samples.copy_to(0, &mut back);
                    let back: Vec<i64> = back.iter().map(|&x| x as i64).collect();
                    let values: Vec<i64> = values.iter().map(|&x| i64::from(x)).collect();
                    prop_assert_eq!(back, values);
                }
                Err(_) => prop_assert!(values.iter().any(|v| v.unsigned_abs() > 1 << 24)),
            }
        }

        #[test]
        fn joined_pieces_are_the_whole(values in prop::collection::vec(any::<u16>(), 2..40), cut in 1usize..39) {
            let cut = cut.min(values.len() - 1);
            let pieces = [&values[..cut], &values[cut..]].map(|p| narrow(p).unwrap());
            let appended = pieces.iter().cloned().fold(Samples::U8(Vec::new()), append);
            prop_assert_eq!(appended, narrow(&values).unwrap());
            prop_assert_eq!(join(pieces.into()), narrow(&values).unwrap());
        }
    }
}
