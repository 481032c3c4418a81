//! Messages to packets.

use prost::encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field};
use tactnet_channel::FieldType;

use super::{Recorded, RecordedField};

/// Reads a message into the bytes of a zeroed packet. Returns `None` for bytes that are not a message or exceed the
/// packet.
pub(super) fn decode(recorded: &Recorded, mut message: &[u8], packet: &mut [u8]) -> Option<()> {
    let mut found = vec![0; recorded.fields.len()];
    while !message.is_empty() {
        let (number, wire) = decode_key(&mut message).ok()?;
        let at = recorded
            .fields
            .binary_search_by_key(&number, |field| field.number);
        let Ok(at) = at else {
            skip_field(wire, number, &mut message, DecodeContext::default()).ok()?;
            continue;
        };
        let field = &recorded.fields[at];
        let mut into = Values {
            field,
            packet,
            found: &mut found[at],
        };
        let is_text = matches!(field.kind, FieldType::Text(_));
        if wire == WireType::LengthDelimited {
            let length = usize::try_from(decode_varint(&mut message).ok()?).ok()?;
            let content = message.split_at_checked(length)?;
            message = content.1;
            if let Some(part) = &field.part {
                let value = into.next(1)?;
                value.fill(0);
                decode(part, content.0, value)?;
            } else if is_text {
                into.text(content.0)?;
            } else {
                into.packed(content.0)?;
            }
        } else {
            into.number(wire, &mut message)?;
        }
    }
    for (offset, at) in &recorded.counts {
        let count = (found[*at] / recorded.fields[*at].unit) as u32;
        packet[*offset..][..4].copy_from_slice(&count.to_le_bytes());
    }
    Some(())
}

/// Bytes of a field's values, in order.
struct Values<'a> {
    field: &'a RecordedField,
    packet: &'a mut [u8],
    found: &'a mut usize,
}

impl Values<'_> {
    /// Returns the bytes of the next `values` values. For a field that is not an array, the last value counts.
    fn next(&mut self, values: usize) -> Option<&mut [u8]> {
        let size = self.field.kind.size();
        let at = match self.field.most {
            None => 0,
            Some(most) => {
                let at = *self.found;
                *self.found = at.checked_add(values).filter(|end| *end <= most)?;
                at
            }
        };
        Some(&mut self.packet[self.field.offset + size * at..][..size * values])
    }

    fn text(&mut self, text: &[u8]) -> Option<()> {
        std::str::from_utf8(text).ok()?;
        let into = self.next(1)?;
        into.fill(0);
        into.get_mut(..text.len())?.copy_from_slice(text);
        Some(())
    }

    fn packed(&mut self, mut values: &[u8]) -> Option<()> {
        self.field.most?;
        let (wire, size) = match self.field.kind {
            FieldType::F32 => (WireType::ThirtyTwoBit, 4),
            FieldType::F64 => (WireType::SixtyFourBit, 8),
            _ => (WireType::Varint, 1),
        };
        if wire != WireType::Varint {
            let whole = values.len().is_multiple_of(size);
            let into = whole.then(|| self.next(values.len() / size))??;
            into.copy_from_slice(values);
            return Some(());
        }
        while !values.is_empty() {
            self.number(wire, &mut values)?;
        }
        Some(())
    }

    fn number(&mut self, wire: WireType, message: &mut &[u8]) -> Option<()> {
        let kind = self.field.kind;
        match (wire, kind) {
            (WireType::ThirtyTwoBit, FieldType::F32) | (WireType::SixtyFourBit, FieldType::F64) => {
                let (value, rest) = message.split_at_checked(kind.size())?;
                *message = rest;
                self.next(1)?.copy_from_slice(value);
            }
            (
                WireType::Varint,
                FieldType::F32 | FieldType::F64 | FieldType::Text(_) | FieldType::Packet(_),
            ) => return None,
            (WireType::Varint, _) => {
                let value = decode_varint(message).ok()?;
                let signed = value as i64;
                let fits = match kind {
                    FieldType::U8 => u8::try_from(value).is_ok(),
                    FieldType::U16 => u16::try_from(value).is_ok(),
                    FieldType::I8 => i8::try_from(signed).is_ok(),
                    FieldType::I16 => i16::try_from(signed).is_ok(),
                    // Larger numbers are truncated, as Protocol Buffers require.
                    _ => true,
                };
                let into = fits.then(|| self.next(1))??;
                let bytes = into.len();
                into.copy_from_slice(&value.to_le_bytes()[..bytes]);
            }
            _ => return None,
        }
        Some(())
    }
}
