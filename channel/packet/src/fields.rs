//! Access to a packet's fields by name, for types that are known only at run time.

use std::fmt;

use bytemuck::{AnyBitPattern, pod_read_unaligned};
use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

use crate::{Field, FieldType, Layout};

/// Maximum number of array values that are printed.
const PRINTED: usize = 8;

/// Fields of a packet. `Serialize` writes an object and `Display` one line; both omit invalid array values.
///
/// ```
/// tactnet_packet::packets! {
///     /// State of a joint.
///     #[version(1)]
///     pub struct Joint {
///         /// rad
///         pub position: f64,
///         /// Nm
///         pub torque: f64,
///     }
/// }
/// use tactnet_packet::{Described, Fields};
/// let joint = Joint { position: 0.5, torque: -2.0 };
/// let fields = Fields::of(&Joint::LAYOUT, bytemuck::bytes_of(&joint)).unwrap();
/// assert_eq!(fields.to_string(), "Joint position 0.5, torque -2");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fields<'a> {
    layout: &'static Layout,
    bytes: &'a [u8],
}

impl<'a> Fields<'a> {
    /// Returns the fields of the first item in `bytes`; `None` if the bytes are too few.
    pub fn of(layout: &'static Layout, bytes: &'a [u8]) -> Option<Self> {
        let bytes = bytes.get(..layout.bytes)?;
        Some(Self { layout, bytes })
    }

    /// Returns the number of valid values of an array; `None` if all are valid.
    fn count(&self, field: &Field) -> Option<usize> {
        let name = field.counted_by?;
        let counter = self.layout.fields.iter().find(|field| field.name == name)?;
        let at = &self.bytes[counter.offset..];
        match counter.kind {
            FieldType::U32 => usize::try_from(read::<u32>(at)).ok(),
            FieldType::U64 => usize::try_from(read::<u64>(at)).ok(),
            _ => None,
        }
    }

    fn value(&self, field: &Field) -> Value<'a> {
        Value {
            kind: field.kind,
            bytes: &self.bytes[field.offset..],
            most: self.count(field).unwrap_or(usize::MAX),
        }
    }
}

/// Value of a field.
struct Value<'a> {
    kind: FieldType,
    /// Bytes from the value's first byte on.
    bytes: &'a [u8],
    /// Number of valid values of an array.
    most: usize,
}

impl<'a> Value<'a> {
    /// Returns the values of an array; `None` for other types.
    fn values(&self) -> Option<impl Iterator<Item = Self> + use<'a>> {
        let FieldType::Array(of, length) = self.kind else {
            return None;
        };
        let (size, bytes) = (of.size(), self.bytes);
        Some((0..length.min(self.most)).map(move |at| Self {
            kind: *of,
            bytes: &bytes[at * size..],
            most: usize::MAX,
        }))
    }

    fn text(&self, bytes: usize) -> &'a str {
        let text = &self.bytes[..bytes];
        let end = text.iter().position(|byte| *byte == 0).unwrap_or(bytes);
        std::str::from_utf8(&text[..end]).unwrap_or("")
    }
}

fn read<T: AnyBitPattern>(bytes: &[u8]) -> T {
    pod_read_unaligned(&bytes[..size_of::<T>()])
}

impl Serialize for Fields<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.layout.fields.len()))?;
        for field in self.layout.fields {
            map.serialize_entry(field.name, &self.value(field))?;
        }
        map.end()
    }
}

impl Serialize for Value<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let at = self.bytes;
        match self.kind {
            FieldType::U8 => serializer.serialize_u8(at[0]),
            FieldType::U16 => serializer.serialize_u16(read(at)),
            FieldType::U32 => serializer.serialize_u32(read(at)),
            FieldType::U64 => serializer.serialize_u64(read(at)),
            FieldType::I8 => serializer.serialize_i8(read(at)),
            FieldType::I16 => serializer.serialize_i16(read(at)),
            FieldType::I32 => serializer.serialize_i32(read(at)),
            FieldType::I64 => serializer.serialize_i64(read(at)),
            FieldType::F32 => serializer.serialize_f32(read(at)),
            FieldType::F64 => serializer.serialize_f64(read(at)),
            FieldType::Text(bytes) => serializer.serialize_str(self.text(bytes)),
            FieldType::Packet(layout) => Fields { layout, bytes: at }.serialize(serializer),
            FieldType::Array(..) => {
                let mut list = serializer.serialize_seq(None)?;
                for value in self.values().into_iter().flatten() {
                    list.serialize_element(&value)?;
                }
                list.end()
            }
        }
    }
}

impl fmt::Display for Fields<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.layout.name)?;
        for (at, field) in self.layout.fields.iter().enumerate() {
            let comma = if at == 0 { "" } else { "," };
            write!(f, "{comma} {} {}", field.name, self.value(field))?;
        }
        Ok(())
    }
}

impl fmt::Display for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = self.bytes;
        match self.kind {
            FieldType::U8 => write!(f, "{}", at[0]),
            FieldType::U16 => write!(f, "{}", read::<u16>(at)),
            FieldType::U32 => write!(f, "{}", read::<u32>(at)),
            FieldType::U64 => write!(f, "{}", read::<u64>(at)),
            FieldType::I8 => write!(f, "{}", read::<i8>(at)),
            FieldType::I16 => write!(f, "{}", read::<i16>(at)),
            FieldType::I32 => write!(f, "{}", read::<i32>(at)),
            FieldType::I64 => write!(f, "{}", read::<i64>(at)),
            FieldType::F32 => write!(f, "{}", rounded(read::<f32>(at).into())),
            FieldType::F64 => write!(f, "{}", rounded(read(at))),
            FieldType::Text(bytes) => write!(f, "\"{}\"", self.text(bytes)),
            FieldType::Packet(layout) => {
                f.write_str("(")?;
                for (number, field) in layout.fields.iter().enumerate() {
                    let comma = if number == 0 { "" } else { ", " };
                    let value = Fields { layout, bytes: at }.value(field);
                    write!(f, "{comma}{} {value}", field.name)?;
                }
                f.write_str(")")
            }
            FieldType::Array(..) => {
                let mut values = self.values().into_iter().flatten();
                f.write_str("[")?;
                for (number, value) in values.by_ref().take(PRINTED).enumerate() {
                    let space = if number == 0 { "" } else { " " };
                    write!(f, "{space}{value}")?;
                }
                match values.count() {
                    0 => f.write_str("]"),
                    more => write!(f, " … {more} more]"),
                }
            }
        }
    }
}

/// Rounds to four decimals for printing; smaller values stay as they are.
fn rounded(value: f64) -> f64 {
    let rounded = (value * 1e4).round() / 1e4;
    if rounded == 0.0 && value != 0.0 {
        return value;
    }
    rounded
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Described, Text};

    crate::packets! {
        /// Part of the packet below.
        pub struct Circle {
            /// Position, px.
            pub at: [f32; 2],
        }

        /// A packet with every type of field.
        #[version(1)]
        pub struct Seen {
            /// Number of valid circles.
            pub count: u64,
            /// Circles.
            #[recorded(1, count)]
            pub circles: [Circle; 3],
            /// Reason.
            pub reason: Text<8>,
            /// Row-major.
            pub covariance: [[f64; 2]; 2],
            /// Negative.
            pub level: i32,
            /// Zero.
            pub reserved: u32,
        }
    }

    fn seen() -> Seen {
        Seen {
            count: 1,
            circles: [Circle { at: [0.5, 2.0] }; 3],
            reason: Text::new("far"),
            covariance: [[1.0, f64::NAN], [1e-9, 4.0]],
            level: -3,
            reserved: 0,
        }
    }

    #[test]
    fn fields_are_read_by_the_description_alone() {
        let seen = seen();
        let fields = Fields::of(&Seen::LAYOUT, bytemuck::bytes_of(&seen)).unwrap();
        assert_eq!(
            serde_json::to_string(&fields).unwrap(),
            r#"{"count":1,"circles":[{"at":[0.5,2.0]}],"reason":"far","covariance":[[1.0,null],[1e-9,4.0]],"level":-3,"reserved":0}"#
        );
        assert_eq!(
            fields.to_string(),
            "Seen count 1, circles [(at [0.5 2])], reason \"far\", covariance [[1 NaN] [0.000000001 4]], level -3, reserved 0"
        );
    }

    #[test]
    fn a_count_that_lies_and_a_packet_that_is_cut_do_no_harm() {
        let lying = Seen {
            count: u64::MAX,
            ..seen()
        };
        let bytes = bytemuck::bytes_of(&lying);
        let fields = Fields::of(&Seen::LAYOUT, bytes).unwrap();
        let read: serde_json::Value = serde_json::to_value(fields).unwrap();
        assert_eq!(read["circles"].as_array().unwrap().len(), 3);
        assert_eq!(Fields::of(&Seen::LAYOUT, &bytes[1..]), None);
    }
}
