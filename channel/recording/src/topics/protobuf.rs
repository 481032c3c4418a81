//! Messages of Protocol Buffers, by the descriptors that the recording contains.

use prost_reflect::{
    DescriptorPool, DynamicMessage, FieldDescriptor, Kind, MessageDescriptor, ReflectMessage,
};

use super::value::Value;

/// Returns the descriptor of a message type.
///
/// # Errors
/// Descriptors that cannot be read, or lack the type.
pub(super) fn descriptor(name: &str, file_set: &[u8]) -> Result<MessageDescriptor, String> {
    // The crate panics on some damaged descriptions.
    let pool = tactnet_data::format::caught(|| DescriptorPool::decode(file_set));
    let pool = pool.ok_or_else(|| format!("the description of {name} is damaged"))?;
    let pool = pool.map_err(|error| error.to_string())?;
    let found = pool.get_message_by_name(name);
    found.ok_or_else(|| format!("the description of {name} is missing"))
}

/// Decodes a message. Fields that are not transmitted have their default, except optional ones and alternatives.
///
/// # Errors
/// Bytes of another type; far more fields than bytes.
pub(super) fn decode(descriptor: &MessageDescriptor, data: &[u8]) -> Result<Value, String> {
    let message = DynamicMessage::decode(descriptor.clone(), data);
    let message = message.map_err(|error| error.to_string())?;
    let mut converter = Converter {
        budget: 4 * data.len() + 10_000,
    };
    converter.fields(&message)
}

/// Conversion of a message to values.
struct Converter {
    /// Number of fields that may still be converted: messages that contain their own type would never end.
    budget: usize,
}

impl Converter {
    fn fields(&mut self, message: &DynamicMessage) -> Result<Value, String> {
        let mut values = Vec::new();
        for field in message.descriptor().fields() {
            self.budget = self
                .budget
                .checked_sub(1)
                .ok_or("far more fields than bytes")?;
            let is_missing = !message.has_field(&field);
            if is_missing && field.supports_presence() && !is_plain_message(&field, message) {
                continue;
            }
            let value = self.value(&message.get_field(&field))?;
            values.extend(value.map(|value| (field.name().to_owned(), value)));
        }
        Ok(Value::Fields(values))
    }

    /// Returns the value of a field; `None` for maps.
    fn value(&mut self, of: &prost_reflect::Value) -> Result<Option<Value>, String> {
        use prost_reflect::Value as Proto;
        Ok(Some(match of {
            Proto::Bool(bool) => Value::Number(f64::from(u8::from(*bool))),
            Proto::I32(number) | Proto::EnumNumber(number) => Value::Number(f64::from(*number)),
            Proto::I64(number) => Value::Number(*number as f64),
            Proto::U32(number) => Value::Number(f64::from(*number)),
            Proto::U64(number) => Value::Number(*number as f64),
            Proto::F32(number) => Value::Number(f64::from(*number)),
            Proto::F64(number) => Value::Number(*number),
            Proto::String(text) => Value::Text(text.clone()),
            Proto::Bytes(bytes) => Value::Numbers(bytes.iter().copied().map(f64::from).collect()),
            Proto::Message(message) => self.fields(message)?,
            Proto::List(entries) => {
                let mut values = Vec::with_capacity(entries.len());
                for entry in entries {
                    values.extend(self.value(entry)?);
                }
                Value::of_entries(values)
            }
            Proto::Map(_) => return Ok(None),
        }))
    }
}

/// Returns true for a message field outside any `oneof` whose type differs from that of the containing message.
fn is_plain_message(field: &FieldDescriptor, of: &DynamicMessage) -> bool {
    match field.kind() {
        Kind::Message(kind) => field.containing_oneof().is_none() && kind != of.descriptor(),
        _ => false,
    }
}
