//! Description as Protocol Buffers.

use std::fmt::Write;

use super::{Description, Field, FieldType, Layout, plain, wrapped};

const WIDTH: usize = 110;

/// Returns the type in a message.
fn declared(kind: &FieldType) -> String {
    match kind {
        FieldType::U8 | FieldType::U16 | FieldType::U32 => "uint32".into(),
        FieldType::I8 | FieldType::I16 | FieldType::I32 => "int32".into(),
        FieldType::U64 => "uint64".into(),
        FieldType::I64 => "int64".into(),
        FieldType::F32 => "float".into(),
        FieldType::F64 => "double".into(),
        FieldType::Text(_) => "string".into(),
        FieldType::Packet(layout) => layout.name.into(),
        FieldType::Array(of, _) => {
            let of = declared(of);
            format!("repeated {}", of.trim_start_matches("repeated "))
        }
    }
}

impl Layout {
    /// Returns the recorded fields, including those of parts, as number, offset in this packet, and field; ordered by
    /// number.
    pub fn recorded(&self) -> Vec<(u32, usize, Field)> {
        let mut recorded = Vec::new();
        for field in self.fields {
            match (field.number, field.kind) {
                (Some(number), _) => recorded.push((number, field.offset, *field)),
                (None, FieldType::Packet(part)) => recorded.extend(
                    part.recorded()
                        .into_iter()
                        .map(|(number, offset, inner)| (number, field.offset + offset, inner)),
                ),
                (None, _) => {}
            }
        }
        recorded.sort_by_key(|(number, ..)| *number);
        recorded
    }
}

impl FieldType {
    /// Returns the part that a field holds once or as an array; `None` for numbers and texts.
    pub fn part(&self) -> Option<&'static Layout> {
        match self {
            Self::Packet(layout) => Some(layout),
            Self::Array(of, _) => of.part(),
            _ => None,
        }
    }
}

impl Description {
    /// Returns the layouts that have a separate message: packets, and parts that are numbered fields of others.
    pub fn messages(&self) -> impl Iterator<Item = &'static Layout> + use<> {
        let packets = self.packets;
        let fields = || packets.iter().flat_map(|layout| layout.fields);
        let is_field = move |part: &Layout| {
            fields()
                .filter(|field| field.number.is_some())
                .any(|field| field.kind.part().is_some_and(|of| of.name == part.name))
        };
        packets
            .iter()
            .filter(move |layout| layout.is_packet() || is_field(layout))
    }

    /// Returns the messages of recordings, one per packet.
    pub fn proto(&self) -> String {
        let mut text = format!(
            "// Messages of recordings, one per packet. Generated from {}; do not edit.\nsyntax = \"proto3\";\n\npackage {};\n",
            self.source, self.project
        );
        for layout in self.messages() {
            text.push('\n');
            let comment = |text: &mut String, indent: &str, docs: &[&str]| {
                for line in wrapped(&plain(docs), WIDTH - indent.len()) {
                    let _ = writeln!(text, "{indent}// {line}");
                }
            };
            comment(&mut text, "", layout.docs);
            let _ = writeln!(text, "message {} {{", layout.name);
            for (number, _, field) in layout.recorded() {
                comment(&mut text, "  ", field.docs);
                let kind = declared(&field.kind);
                let _ = writeln!(text, "  {kind} {} = {number};", field.name);
            }
            text.push_str("}\n");
        }
        text
    }
}
