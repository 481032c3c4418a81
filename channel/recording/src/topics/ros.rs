//! Messages of ROS 2 (CDR) and ROS 1.

use super::ros_definition::{Count, Definitions, Field, Type};
use super::value::Value;

/// Maximum depth of messages within messages.
const DEPTH: usize = 32;
/// Length of the header of a CDR message, in bytes. Alignment counts from its end.
const CDR_HEADER: usize = 4;

/// Encoding of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Common Data Representation, of ROS 2.
    Cdr,
    /// Of ROS 1: little-endian without alignment.
    Ros1,
}

/// Decodes a message.
///
/// # Errors
/// A message that is shorter than its definition says; a type that cannot be read.
pub(super) fn decode(
    definitions: &Definitions,
    encoding: Encoding,
    data: &[u8],
) -> Result<Value, String> {
    let mut reader = match encoding {
        Encoding::Ros1 => Reader::new(data, Layout::ROS1),
        Encoding::Cdr => {
            let (header, body) = data
                .split_at_checked(CDR_HEADER)
                .ok_or("a message without header")?;
            Reader::new(body, Layout::of_cdr([header[0], header[1]])?)
        }
    };
    reader.message(definitions, definitions.root(), 0)
}

/// Order of bytes and alignment.
#[derive(Debug, Clone, Copy)]
struct Layout {
    little_endian: bool,
    /// Largest alignment of numbers, in bytes.
    alignment: usize,
    /// True if an empty message is one byte and texts end with a zero.
    is_ros2: bool,
}

impl Layout {
    const ROS1: Self = Self {
        little_endian: true,
        alignment: 1,
        is_ros2: false,
    };

    /// Returns the layout that the header of a CDR message names.
    fn of_cdr(header: [u8; 2]) -> Result<Self, String> {
        let alignment = match header {
            [0, 0..=1] => 8,
            // XCDR2 aligns to four bytes at most.
            [0, 6..=7] => 4,
            other => return Err(format!("CDR of another kind, {other:02x?}")),
        };
        Ok(Self {
            little_endian: header[1] & 1 == 1,
            alignment,
            is_ros2: true,
        })
    }
}

struct Reader<'a> {
    data: &'a [u8],
    at: usize,
    layout: Layout,
    /// Number of values that may still be read: no message has more than some per byte.
    budget: usize,
}

impl<'a> Reader<'a> {
    fn new(data: &'a [u8], layout: Layout) -> Self {
        Self {
            data,
            at: 0,
            layout,
            budget: 4 * data.len() + 10_000,
        }
    }

    fn message(&mut self, of: &Definitions, name: &str, depth: usize) -> Result<Value, String> {
        if depth > DEPTH {
            return Err(format!("messages within messages, deeper than {DEPTH}"));
        }
        let fields = of.fields(name)?;
        if fields.is_empty() && self.layout.is_ros2 {
            self.bytes(1)?;
        }
        let mut values = Vec::with_capacity(fields.len());
        for field in fields {
            values.push((field.name.clone(), self.field(of, field, depth)?));
        }
        Ok(Value::Fields(values))
    }

    fn field(&mut self, of: &Definitions, field: &Field, depth: usize) -> Result<Value, String> {
        let count = match field.count {
            Count::One => return self.value(of, &field.of, depth),
            Count::Fixed(count) => count,
            Count::Counted => self.unsigned(4)? as usize,
        };
        let mut values = Vec::new();
        for _ in 0..count {
            values.push(self.value(of, &field.of, depth)?);
        }
        Ok(match field.of {
            Type::Signed(_) | Type::Unsigned(_) | Type::Float(_) => Value::of_entries(values),
            _ => Value::List(values),
        })
    }

    fn value(&mut self, of: &Definitions, kind: &Type, depth: usize) -> Result<Value, String> {
        self.budget = self.budget.checked_sub(1).ok_or("more values than bytes")?;
        Ok(match kind {
            Type::Unsigned(bytes) => Value::Number(self.unsigned(*bytes)? as f64),
            Type::Signed(bytes) => {
                let unused = 64 - 8 * *bytes as u32;
                Value::Number(((self.unsigned(*bytes)? << unused) as i64 >> unused) as f64)
            }
            Type::Float(4) => Value::Number(f64::from(f32::from_bits(self.unsigned(4)? as u32))),
            Type::Float(_) => Value::Number(f64::from_bits(self.unsigned(8)?)),
            Type::Text => Value::Text(self.text()?),
            Type::WideText => Value::Text(self.wide_text()?),
            Type::Time(is_unsigned) => {
                let part = match is_unsigned {
                    true => Type::Unsigned(4),
                    false => Type::Signed(4),
                };
                let seconds = self.value(of, &part, depth)?;
                let nanoseconds = self.value(of, &part, depth)?;
                Value::Fields(vec![("sec".into(), seconds), ("nsec".into(), nanoseconds)])
            }
            Type::Message(name) => self.message(of, name, depth + 1)?,
        })
    }

    fn bytes(&mut self, count: usize) -> Result<&'a [u8], String> {
        let end = self
            .at
            .checked_add(count)
            .filter(|end| *end <= self.data.len());
        let end = end.ok_or_else(|| {
            format!(
                "a message of {} bytes, shorter than its definition says",
                self.data.len()
            )
        })?;
        let bytes = &self.data[self.at..end];
        self.at = end;
        Ok(bytes)
    }

    /// Reads a number of up to eight bytes at its alignment.
    fn unsigned(&mut self, bytes: usize) -> Result<u64, String> {
        self.at = self.at.next_multiple_of(bytes.min(self.layout.alignment));
        let bytes = self.bytes(bytes)?;
        let add = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        Ok(match self.layout.little_endian {
            true => bytes.iter().rev().fold(0, add),
            false => bytes.iter().fold(0, add),
        })
    }

    fn text(&mut self) -> Result<String, String> {
        let count = self.unsigned(4)? as usize;
        let bytes = self.bytes(count)?;
        let text = String::from_utf8_lossy(bytes);
        Ok(text.trim_end_matches('\0').to_owned())
    }

    /// Reads a text of two bytes a letter; its length counts letters.
    fn wide_text(&mut self) -> Result<String, String> {
        let count = self.unsigned(4)? as usize;
        let mut units = Vec::new();
        for _ in 0..count {
            units.push(self.unsigned(2)? as u16);
        }
        Ok(String::from_utf16_lossy(&units)
            .trim_end_matches('\0')
            .to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WRENCH: &str = "std_msgs/Header header\nWrench wrench\n===\nMSG: geometry_msgs/Wrench\nVector3 force\nVector3 torque\n\
        ===\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n===\nMSG: std_msgs/Header\n\
        builtin_interfaces/Time stamp\nstring frame_id\n===\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

    /// A stamped wrench with the frame `abc`: after its text of 4 + 4 bytes the floats are aligned to 8 bytes.
    fn wrench(little_endian: bool) -> Vec<u8> {
        let order = |bytes: &[u8]| -> Vec<u8> {
            match little_endian {
                true => bytes.iter().rev().copied().collect(),
                false => bytes.to_vec(),
            }
        };
        let mut data = vec![0, u8::from(little_endian), 0, 0];
        data.extend(order(&(-7_i32).to_be_bytes()));
        data.extend(order(&9_u32.to_be_bytes()));
        data.extend(order(&2_u32.to_be_bytes()));
        data.extend(b"a\0\0\0");
        for number in [1.5_f64, -2.0, 3.0, 4.0, 5.0, 6.25] {
            data.extend(order(&number.to_be_bytes()));
        }
        data
    }

    #[test]
    fn a_stamped_wrench_is_read_in_both_orders_of_bytes_and_cut_ones_are_refused() {
        let definitions = Definitions::parse("geometry_msgs/msg/WrenchStamped", WRENCH).unwrap();
        for little_endian in [true, false] {
            let data = wrench(little_endian);
            let message = decode(&definitions, Encoding::Cdr, &data).unwrap();
            assert_eq!(
                message.numbers("wrench").unwrap(),
                [1.5, -2.0, 3.0, 4.0, 5.0, 6.25]
            );
            assert_eq!(message.numbers("header.stamp").unwrap(), [-7.0, 9.0]);
            assert_eq!(message.label("header.frame_id"), Some("a".into()));
            for end in 0..data.len() {
                assert!(
                    decode(&definitions, Encoding::Cdr, &data[..end]).is_err(),
                    "{end}"
                );
            }
        }
    }

    #[test]
    fn messages_without_end_are_refused() {
        let text = "Loop loop\n===\nMSG: a/Loop\nLoop[2] loop\n";
        let definitions = Definitions::parse("a/Root", text).unwrap();
        assert!(decode(&definitions, Encoding::Ros1, &[0; 64]).is_err());
        let text = "Empty[4000000000] many\n===\nMSG: a/Empty\n";
        let definitions = Definitions::parse("a/Root", text).unwrap();
        assert!(decode(&definitions, Encoding::Ros1, &[0; 64]).is_err());
        let definitions = Definitions::parse("a/Root", "float32[] v").unwrap();
        assert!(decode(&definitions, Encoding::Ros1, &[255, 255, 255, 255, 0]).is_err());
    }

    #[test]
    fn ros_1_has_no_alignment() {
        let definitions =
            Definitions::parse("a/Root", "uint8 a\nint16[] b\ntime t\nstring s").unwrap();
        let data = [
            7, 2, 0, 0, 0, 1, 0, 255, 255, 5, 0, 0, 0, 6, 0, 0, 0, 1, 0, 0, 0, b'x',
        ];
        let message = decode(&definitions, Encoding::Ros1, &data).unwrap();
        assert_eq!(message.numbers("b").unwrap(), [1.0, -1.0]);
        assert_eq!(message.numbers("t").unwrap(), [5.0, 6.0]);
        assert_eq!(message.label("s"), Some("x".into()));
    }
}
