//! Layouts of the structs of a description.

use std::collections::BTreeMap;

use toml::{Spanned, Value};

use super::names::{self, Case};
use super::text::{self, FieldText, StructText};
use super::{Contents, DescriptionError, Located, Source};
use crate::description::{Field, FieldType, Layout};

/// Maximum size of a packet, in bytes.
const MOST_BYTES: usize = 1 << 30;
/// Field numbers of Protocol Buffers, without those that its implementation uses.
const MOST_NUMBER: u32 = (1 << 29) - 1;
const RESERVED_NUMBERS: std::ops::RangeInclusive<u32> = 19_000..=19_999;

/// Layouts so far; parts come before the structs that contain them.
pub(super) struct Layouts<'a> {
    contents: &'a Contents,
    done: Vec<Layout>,
    /// Structs whose fields are being resolved, the outermost first.
    open: Vec<&'a str>,
}

impl<'a> Layouts<'a> {
    /// Returns the layouts of all structs.
    pub fn of(contents: &'a Contents) -> Result<Vec<Layout>, DescriptionError> {
        let mut layouts = Layouts {
            contents,
            done: Vec::new(),
            open: Vec::new(),
        };
        for of in &contents.structs {
            layouts.layout(of)?;
        }
        Ok(layouts.done)
    }

    fn layout(&mut self, of: &'a Located<StructText>) -> Result<Layout, DescriptionError> {
        let Located { source, value } = of;
        let name = value.name.get_ref();
        if let Some(known) = self.done.iter().find(|layout| layout.name == name) {
            return Ok(*known);
        }
        let version = match &value.version {
            Some(version) if *version.get_ref() == 0 => {
                return Err(source.error(version.span(), "version: expected 1 or more"));
            }
            version => version.as_ref().map_or(0, |version| *version.get_ref()),
        };
        self.open.push(name);
        let mut fields: Vec<Field> = Vec::new();
        let (mut end, mut align) = (0_usize, 1);
        for field in &value.fields {
            let kind = self.kind(source, field)?;
            align = kind.align().max(align);
            let missing = end.next_multiple_of(kind.align()) - end;
            if missing > 0 {
                let at = format!("`{}` would begin at byte {end}", field.name.get_ref());
                let reason = format!(
                    "{at}, which is no multiple of {}; {}",
                    kind.align(),
                    advice(missing)
                );
                return Err(source.error(field.name.span(), reason));
            }
            fields.push(self.field(source, field, kind, end, &fields)?);
            end += kind.size();
            if end > MOST_BYTES {
                let reason = format!("expected at most {MOST_BYTES} bytes in a struct");
                return Err(source.error(field.name.span(), reason));
            }
        }
        let missing = end.next_multiple_of(align) - end;
        if end == 0 || missing > 0 {
            let reason = match end {
                0 => "expected at least one field".into(),
                _ => format!(
                    "{end} bytes are no multiple of {align}; at the end {}",
                    advice(missing)
                ),
            };
            return Err(source.error(value.name.span(), reason));
        }
        number(source, &value.fields, &mut fields)?;
        let layout = Layout {
            name: name.clone().leak(),
            version,
            docs: text::lines(value.doc.clone()),
            bytes: end,
            fields: fields.leak(),
        };
        self.open.pop();
        self.done.push(layout);
        Ok(layout)
    }

    fn field(
        &self,
        source: &Source,
        field: &FieldText,
        kind: FieldType,
        offset: usize,
        before: &[Field],
    ) -> Result<Field, DescriptionError> {
        names::check(source, &field.name, Case::Snake)?;
        let name = field.name.get_ref();
        if before.iter().any(|other| other.name == name) {
            return Err(source.error(field.name.span(), format!("`{name}` is there twice")));
        }
        if let Some(count) = &field.counted_by {
            let is_array = matches!(kind, FieldType::Array(..));
            let counter = before.iter().find(|other| other.name == count.get_ref());
            if !is_array || counter.is_none_or(|counter| counter.kind != FieldType::U32) {
                let reason = "counted_by: expected an array, and the name of a `u32` before it in the same struct";
                return Err(source.error(count.span(), reason));
            }
        }
        let count = field
            .counted_by
            .as_ref()
            .map(|count| count.get_ref().clone());
        Ok(Field {
            name: name.clone().leak(),
            docs: field.docs(),
            offset,
            kind,
            number: None,
            counted_by: count.map(|count| -> &'static str { count.leak() }),
        })
    }

    /// Returns the type of a field.
    fn kind(&mut self, source: &Source, field: &FieldText) -> Result<FieldType, DescriptionError> {
        let mut kind = self.base(source, field)?;
        for length in field.shape.iter().rev() {
            let length = self.length(source, length)?;
            let bytes = kind.size().checked_mul(length);
            if bytes.is_none_or(|bytes| bytes > MOST_BYTES) {
                let reason = format!("expected at most {MOST_BYTES} bytes in a field");
                return Err(source.error(field.name.span(), reason));
            }
            kind = FieldType::Array(Box::leak(Box::new(kind)), length);
        }
        Ok(kind)
    }

    fn base(&mut self, source: &Source, field: &FieldText) -> Result<FieldType, DescriptionError> {
        let of = &field.r#type;
        let kind = match of.get_ref().as_str() {
            "u8" => FieldType::U8,
            "u16" => FieldType::U16,
            "u32" => FieldType::U32,
            "u64" => FieldType::U64,
            "i8" => FieldType::I8,
            "i16" => FieldType::I16,
            "i32" => FieldType::I32,
            "i64" => FieldType::I64,
            "f32" => FieldType::F32,
            "f64" => FieldType::F64,
            "text" => {
                let Some(bytes) = &field.bytes else {
                    return Err(source.error(of.span(), "text: expected its length as `bytes`"));
                };
                return self.length(source, bytes).map(FieldType::Text);
            }
            other => self.defined(source, of, other)?,
        };
        match &field.bytes {
            None => Ok(kind),
            Some(bytes) => Err(source.error(bytes.span(), "bytes: expected only for a text")),
        }
    }

    /// Returns the type of a struct or an enum.
    fn defined(
        &mut self,
        source: &Source,
        of: &Spanned<String>,
        name: &str,
    ) -> Result<FieldType, DescriptionError> {
        let contents = self.contents;
        if contents.choices.iter().any(|choice| choice.name == name) {
            return Ok(FieldType::U32);
        }
        if self.open.contains(&name) {
            return Err(source.error(of.span(), format!("`{name}` contains itself")));
        }
        let mut structs = contents.structs.iter();
        let Some(part) = structs.find(|of| of.value.name.get_ref() == name) else {
            let reason = format!(
                "unknown type `{}`; expected u8 to u64, i8 to i64, f32, f64, text, a struct or an enum",
                name.escape_debug()
            );
            return Err(source.error(of.span(), reason));
        };
        Ok(FieldType::Packet(Box::leak(Box::new(self.layout(part)?))))
    }

    /// Returns a length, given as a number or the name of a constant.
    fn length(&self, source: &Source, of: &Spanned<Value>) -> Result<usize, DescriptionError> {
        let length = match of.get_ref() {
            Value::Integer(length) => usize::try_from(*length).ok(),
            Value::String(name) => {
                let mut constants = self.contents.constants.iter();
                constants
                    .find(|(known, ..)| known == name)
                    .map(|(.., value)| *value)
            }
            _ => None,
        };
        length
            .filter(|length| (1..=MOST_BYTES).contains(length))
            .ok_or_else(|| {
                let reason = format!(
                    "expected a length of at least 1 or the name of a constant, found {}",
                    of.get_ref()
                );
                source.error(of.span(), reason)
            })
    }
}

/// Names the padding that is missing.
fn advice(missing: usize) -> String {
    format!("insert {{ name = \"reserved\", type = \"u8\", shape = [{missing}] }}")
}

/// Sets the numbers in recordings: the given one or the position from 1.
fn number(
    source: &Source,
    texts: &[FieldText],
    fields: &mut [Field],
) -> Result<(), DescriptionError> {
    let counts: Vec<&str> = fields.iter().filter_map(|field| field.counted_by).collect();
    let mut taken: BTreeMap<u32, &str> = BTreeMap::new();
    for ((position, text), field) in (1..).zip(texts).zip(fields) {
        if field.name.starts_with("reserved") || counts.contains(&field.name) {
            continue;
        }
        let given = text.number.as_ref();
        let number = given.map_or(position, |number| *number.get_ref());
        let span = given.map_or(text.name.span(), Spanned::span);
        if !(1..=MOST_NUMBER).contains(&number) || RESERVED_NUMBERS.contains(&number) {
            return Err(source.error(
                span,
                format!("number {number} is not allowed in Protocol Buffers"),
            ));
        }
        if let Some(other) = taken.insert(number, field.name) {
            return Err(source.error(span, format!("number {number} is taken by `{other}`")));
        }
        field.number = Some(number);
    }
    Ok(())
}
