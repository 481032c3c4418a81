//! Description as Rust source.

use std::fmt::Write;

use super::{Choice, Description, FieldType, Layout, prose, wrapped};

const WIDTH: usize = 110;

fn kind(field: &FieldType) -> String {
    match field {
        FieldType::Text(bytes) => format!("Text<{bytes}>"),
        FieldType::Packet(layout) => layout.name.into(),
        FieldType::Array(of, length) => format!("[{}; {length}]", kind(of)),
        number => format!("{number:?}").to_ascii_lowercase(),
    }
}

fn comment(text: &mut String, indent: &str, docs: &[&str]) {
    for line in wrapped(&prose(docs), WIDTH - indent.len()) {
        let _ = writeln!(text, "{indent}/// {line}");
    }
}

fn write_choice(choice: &Choice, text: &mut String) {
    comment(text, "    ", choice.docs);
    let _ = writeln!(text, "    pub enum {} {{", choice.name);
    for (value, docs, number) in choice.values {
        comment(text, "        ", docs);
        let _ = writeln!(text, "        {value} = {number},");
    }
    text.push_str("    }\n");
}

fn write_layout(layout: &Layout, text: &mut String) {
    comment(text, "    ", layout.docs);
    if layout.is_packet() {
        let _ = writeln!(text, "    #[version({})]", layout.version);
    }
    let _ = writeln!(text, "    pub struct {} {{", layout.name);
    for field in layout.fields {
        comment(text, "        ", field.docs);
        if let Some(number) = field.number {
            let count = field.counted_by.map(|count| format!(", {count}"));
            let _ = writeln!(
                text,
                "        #[recorded({number}{})]",
                count.unwrap_or_default()
            );
        }
        let _ = writeln!(text, "        pub {}: {},", field.name, kind(&field.kind));
    }
    text.push_str("    }\n");
}

impl Description {
    /// Returns the packets as a Rust module, for the crates `tactnet-channel` and `bytemuck` (features `derive` and
    /// `min_const_generics`).
    pub fn rust(&self) -> String {
        let packets = self.packets.iter();
        let mut fields = packets.flat_map(|layout| layout.fields);
        let has_text =
            fields.any(|field| matches!(field.kind.base_and_shape().0, FieldType::Text(_)));
        let mut text = format!(
            "//! Packets of {}. Generated from {}; do not edit.\n\nuse tactnet_channel::{{Described, Description{}, {}packets}};\n",
            self.project,
            self.source,
            if has_text { ", Text" } else { "" },
            if self.choices.is_empty() {
                ""
            } else {
                "choices, "
            },
        );
        for (name, docs, value) in self.constants {
            text.push('\n');
            comment(&mut text, "", &[docs]);
            let _ = writeln!(text, "pub const {name}: usize = {value};");
        }
        if !self.choices.is_empty() {
            text.push_str("\nchoices! {\n");
            for choice in self.choices {
                write_choice(choice, &mut text);
            }
            text.push_str("}\n");
        }
        text.push_str("\npackets! {\n");
        for layout in self.packets {
            write_layout(layout, &mut text);
        }
        text.push_str("}\n");
        self.write_description(&mut text);
        text
    }

    fn write_description(&self, text: &mut String) {
        let constants = self.constants.iter();
        let constants = constants.map(|(name, docs, _)| format!("({name:?}, {docs:?}, {name})"));
        let choices = self
            .choices
            .iter()
            .map(|choice| format!("{}::CHOICE", choice.name));
        let packets = self
            .packets
            .iter()
            .map(|layout| format!("{}::LAYOUT", layout.name));
        let list = |items: Vec<String>| items.join(", ");
        let _ = writeln!(
            text,
            "\n/// Description of the packets, from which the definitions for other languages are generated.\n\
             pub const DESCRIPTION: Description = Description {{\n    project: {:?},\n    source: {:?},\n    \
             constants: &[{}],\n    choices: &[{}],\n    packets: &[{}],\n}};",
            self.project,
            self.source,
            list(constants.collect()),
            list(choices.collect()),
            list(packets.collect()),
        );
    }
}
