//! Packets described once, in Rust, for every language that reads them: [`packets!`](crate::packets) keeps names, types, offsets and
//! documentation of a packet's fields, and a [`Description`] writes them as C, C++, Python, Protocol Buffers and Markdown.

mod c;
mod markdown;
mod proto;
mod python;
mod rust;

pub use rust::Described;

/// Type of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub enum FieldType {
    U8,
    U16,
    U32,
    U64,
    I8,
    I16,
    I32,
    I64,
    F32,
    F64,
    /// UTF-8 in so many bytes, filled up with zeros.
    Text(usize),
    /// So many values.
    Array(&'static FieldType, usize),
    /// Fields within a field.
    Packet(&'static Layout),
}

impl FieldType {
    /// Bytes of one value.
    pub const fn size(&self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
            Self::Text(bytes) => *bytes,
            Self::Array(of, length) => of.size() * *length,
            Self::Packet(layout) => layout.bytes,
        }
    }
}

/// A type that fields can have.
pub trait IsField {
    /// Which one.
    const TYPE: FieldType;
}

macro_rules! fields {
    ($($number:ident $kind:ident)*) => { $(
        impl IsField for $number {
            const TYPE: FieldType = FieldType::$kind;
        }
    )* };
}
fields!(u8 U8 u16 U16 u32 U32 u64 U64 i8 I8 i16 I16 i32 I32 i64 I64 f32 F32 f64 F64);

impl<T: IsField, const N: usize> IsField for [T; N] {
    const TYPE: FieldType = FieldType::Array(&T::TYPE, N);
}

/// A field of a packet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Its documentation, in lines.
    pub docs: &'static [&'static str],
    /// Where it begins, bytes.
    pub offset: usize,
    /// Its type.
    pub kind: FieldType,
    /// Its number in recordings, which never changes; `None` where it is not recorded, or its own fields are.
    pub number: Option<u32>,
    /// The field that says how many values of this one are valid; recordings hold those alone.
    pub counted_by: Option<&'static str>,
}

/// How a packet lies in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Its name.
    pub name: &'static str,
    /// Raised whenever layout or meaning changes; 0 for a part of other packets.
    pub version: u32,
    /// Its documentation, in lines.
    pub docs: &'static [&'static str],
    /// Its size.
    pub bytes: usize,
    /// Its fields by offset.
    pub fields: &'static [Field],
}

/// Numbers with names, of which a field holds one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Its name.
    pub name: &'static str,
    /// Its documentation, in lines.
    pub docs: &'static [&'static str],
    /// Name, documentation, number.
    pub values: &'static [(&'static str, &'static [&'static str], u32)],
}

/// The packets of a project.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// What names in C and Protocol Buffers begin with.
    pub project: &'static str,
    /// Where packets are described, for those who read what is generated.
    pub source: &'static str,
    /// Name, documentation, value.
    pub constants: &'static [(&'static str, &'static str, usize)],
    /// Numbers with names.
    pub choices: &'static [Choice],
    /// Packets and their parts; parts come before what they are parts of.
    pub packets: &'static [Layout],
}

/// `SkinFrame` as `skin_frame`.
fn snake(name: &str) -> String {
    let mut snake = String::new();
    for (at, letter) in name.char_indices() {
        if letter.is_ascii_uppercase() && at > 0 {
            snake.push('_');
        }
        snake.push(letter.to_ascii_lowercase());
    }
    snake
}

/// Documentation as one text: `see [`Command`]` as ``see `Command` ``.
fn prose(docs: &[&str]) -> String {
    let text = docs
        .iter()
        .map(|line| line.trim())
        .collect::<Vec<_>>()
        .join(" ");
    text.replace("[`", "`").replace("`]", "`")
}

/// As [`prose`], for a comment of C or a string of Python.
fn plain(docs: &[&str]) -> String {
    prose(docs).replace("::", " ").replace(['`', '\\', '"'], "")
}

/// Text in lines of at most `width` characters.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("never empty");
        if !line.is_empty() && line.len() + 1 + word.len() > width {
            lines.push(word.into());
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}

impl Layout {
    /// Whether it travels on channels by itself.
    pub fn is_packet(&self) -> bool {
        self.version > 0
    }
}
