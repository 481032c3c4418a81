//! Descriptions of packets for other languages.
//!
//! [`packets!`](crate::packets) keeps names, types, offsets and documentation of a packet's fields, and a description
//! file has them, too. A [`Description`] writes them as Rust, C, C++, Python, Protocol Buffers and Markdown.

mod c;
mod markdown;
mod proto;
mod python;
mod rust;
mod rust_source;

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
    /// UTF-8 text of this many bytes, padded with zeros.
    Text(usize),
    /// Array of a type and its length.
    Array(&'static FieldType, usize),
    /// Fields within a field.
    Packet(&'static Layout),
}

impl FieldType {
    /// Returns the size of one value, in bytes.
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

    /// Returns the alignment, in bytes.
    pub fn align(&self) -> usize {
        match self {
            Self::Text(_) => 1,
            Self::Array(of, _) => of.align(),
            Self::Packet(layout) => {
                let fields = layout.fields.iter();
                fields.map(|field| field.kind.align()).max().unwrap_or(1)
            }
            number => number.size(),
        }
    }

    /// Returns the type of one value, and the lengths of an array, the outermost first.
    fn base_and_shape(&self) -> (&Self, Vec<usize>) {
        let (mut base, mut shape) = (self, Vec::new());
        while let Self::Array(of, length) = base {
            shape.push(*length);
            base = of;
        }
        (base, shape)
    }
}

/// A type that fields can have.
pub trait IsField {
    /// Its description.
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
    /// Name of the field.
    pub name: &'static str,
    /// Documentation, by line.
    pub docs: &'static [&'static str],
    /// Offset in the packet, in bytes.
    pub offset: usize,
    /// Type of the field.
    pub kind: FieldType,
    /// Number in recordings, which never changes. `None` if the field is not recorded or its parts have numbers.
    pub number: Option<u32>,
    /// Name of the field with the number of valid values; only these are recorded.
    pub counted_by: Option<&'static str>,
}

/// Memory layout of a packet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Name of the packet.
    pub name: &'static str,
    /// Increased whenever layout or meaning changes; 0 for a part of other packets.
    pub version: u32,
    /// Documentation, by line.
    pub docs: &'static [&'static str],
    /// Size, in bytes.
    pub bytes: usize,
    /// Fields, ordered by offset.
    pub fields: &'static [Field],
}

/// A set of named numbers for a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Name of the set.
    pub name: &'static str,
    /// Documentation, by line.
    pub docs: &'static [&'static str],
    /// Name, documentation and number of each value.
    pub values: &'static [(&'static str, &'static [&'static str], u32)],
}

/// Packets of a project.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// Prefix of names in C and Protocol Buffers.
    pub project: &'static str,
    /// Source file of the descriptions, named in generated files.
    pub source: &'static str,
    /// Name, documentation and value of each constant.
    pub constants: &'static [(&'static str, &'static str, usize)],
    /// Sets of named numbers.
    pub choices: &'static [Choice],
    /// Packets and their parts; parts come before the packets that contain them.
    pub packets: &'static [Layout],
}

/// Converts `SkinFrame` to `skin_frame`.
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

/// Joins documentation into one text; ``[`Command`]`` becomes `` `Command` ``.
fn prose(docs: &[&str]) -> String {
    let text = docs
        .iter()
        .map(|line| line.trim())
        .collect::<Vec<_>>()
        .join(" ");
    text.replace("[`", "`").replace("`]", "`")
}

/// Like [`prose`], for a comment in C or a string in Python.
fn plain(docs: &[&str]) -> String {
    prose(docs).replace("::", " ").replace(['`', '\\', '"'], "")
}

/// Breaks text into lines of at most `width` characters; none for an empty text.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.len() + 1 + word.len() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.into()),
        }
    }
    lines
}

impl Description {
    /// Returns the file name of the C header, which the C++ header includes.
    fn c_file(&self) -> String {
        match self.project {
            "tactnet" => "packets.h".into(),
            project => format!("{project}_packets.h"),
        }
    }
}

impl Layout {
    /// Returns true if it can be sent by itself, false for a part of other packets.
    pub fn is_packet(&self) -> bool {
        self.version > 0
    }
}
