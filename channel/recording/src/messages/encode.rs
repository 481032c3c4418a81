//! Packets to messages.

use bytemuck::{AnyBitPattern, pod_read_unaligned};
use prost::encoding::{WireType, encode_key, encode_varint};
use tactnet_channel::FieldType;

use super::Recorded;

/// Returns the message of a packet's bytes. Zero numbers and empty texts are omitted, as in proto3.
pub(super) fn encode(recorded: &Recorded, packet: &[u8]) -> Vec<u8> {
    let mut message = Vec::new();
    for field in &recorded.fields {
        let size = field.kind.size();
        let Some(most) = field.most else {
            let value = &packet[field.offset..][..size];
            if let Some(part) = &field.part {
                inner(field.number, &encode(part, value), &mut message);
                continue;
            }
            let is_default = match field.kind {
                FieldType::Text(_) => text(value).is_empty(),
                _ => value.iter().all(|byte| *byte == 0),
            };
            if !is_default {
                one(field.number, &field.kind, value, &mut message);
            }
            continue;
        };
        let count = field.count.map_or(most, |offset| {
            read::<u32>(&packet[offset..]) as usize * field.unit
        });
        let values = &packet[field.offset..][..size * count.min(most)];
        if values.is_empty() {
            continue;
        }
        if let Some(part) = &field.part {
            for value in values.chunks_exact(size) {
                inner(field.number, &encode(part, value), &mut message);
            }
            continue;
        }
        if let FieldType::Text(_) = field.kind {
            for value in values.chunks_exact(size) {
                one(field.number, &field.kind, value, &mut message);
            }
            continue;
        }
        encode_key(field.number, WireType::LengthDelimited, &mut message);
        if matches!(field.kind, FieldType::F32 | FieldType::F64) {
            encode_varint(values.len() as u64, &mut message);
            message.extend_from_slice(values);
            continue;
        }
        let mut packed = Vec::new();
        for value in values.chunks_exact(size) {
            encode_varint(whole(&field.kind, value), &mut packed);
        }
        encode_varint(packed.len() as u64, &mut message);
        message.append(&mut packed);
    }
    message
}

/// Appends a message or a text within another message.
fn inner(number: u32, content: &[u8], message: &mut Vec<u8>) {
    encode_key(number, WireType::LengthDelimited, message);
    encode_varint(content.len() as u64, message);
    message.extend_from_slice(content);
}

fn one(number: u32, kind: &FieldType, value: &[u8], message: &mut Vec<u8>) {
    match kind {
        FieldType::F32 | FieldType::F64 => {
            let wire = match kind {
                FieldType::F32 => WireType::ThirtyTwoBit,
                _ => WireType::SixtyFourBit,
            };
            encode_key(number, wire, message);
            message.extend_from_slice(value);
        }
        FieldType::Text(_) => inner(number, text(value).as_bytes(), message),
        _ => {
            encode_key(number, WireType::Varint, message);
            encode_varint(whole(kind, value), message);
        }
    }
}

/// Returns the text of a fixed-size field; empty if a faulty sender put bytes that are not text.
fn text(value: &[u8]) -> &str {
    let end = value.iter().position(|byte| *byte == 0);
    std::str::from_utf8(&value[..end.unwrap_or(value.len())]).unwrap_or("")
}

fn read<T: AnyBitPattern>(value: &[u8]) -> T {
    pod_read_unaligned(&value[..size_of::<T>()])
}

/// Returns an integer in its wire form; negative ones have 64 bits.
fn whole(kind: &FieldType, value: &[u8]) -> u64 {
    match kind {
        FieldType::U8 => read::<u8>(value).into(),
        FieldType::U16 => read::<u16>(value).into(),
        FieldType::U32 => read::<u32>(value).into(),
        FieldType::U64 => read::<u64>(value),
        FieldType::I8 => i64::from(read::<i8>(value)) as u64,
        FieldType::I16 => i64::from(read::<i16>(value)) as u64,
        FieldType::I32 => i64::from(read::<i32>(value)) as u64,
        FieldType::I64 => read::<i64>(value) as u64,
        other => unreachable!("{other:?} is not an integer"),
    }
}
