//! Description in C11 and C++17.

use std::fmt::Write;

use super::{Choice, Description, Field, FieldType, Layout, plain, snake, wrapped};

/// Line width of the header, in characters.
const WIDTH: usize = 110;

/// Returns the type and the suffix after the name.
fn declared(project: &str, kind: &FieldType) -> (String, String) {
    let number = match kind {
        FieldType::U8 => "uint8_t",
        FieldType::U16 => "uint16_t",
        FieldType::U32 => "uint32_t",
        FieldType::U64 => "uint64_t",
        FieldType::I8 => "int8_t",
        FieldType::I16 => "int16_t",
        FieldType::I32 => "int32_t",
        FieldType::I64 => "int64_t",
        FieldType::F32 => "float",
        FieldType::F64 => "double",
        FieldType::Text(bytes) => return ("char".into(), format!("[{bytes}]")),
        FieldType::Packet(layout) => return (named(project, layout), String::new()),
        FieldType::Array(of, length) => {
            let (number, suffix) = declared(project, of);
            return (number, format!("[{length}]{suffix}"));
        }
    };
    (number.into(), String::new())
}

fn named(project: &str, layout: &Layout) -> String {
    format!("{project}_{}", snake(layout.name))
}

fn comment(text: &mut String, indent: &str, docs: &str) {
    for line in wrapped(docs, WIDTH - indent.len()) {
        let _ = writeln!(text, "{indent}/// {line}");
    }
}

fn field_docs(field: &Field) -> String {
    let docs = plain(field.docs);
    match field.counted_by {
        Some(count) => format!("{docs} `{count}` says how many are valid.").replace('`', ""),
        None => docs,
    }
}

impl Description {
    /// Returns the packets as a header for C11 and C++, with assertions of size and offsets.
    pub fn c_header(&self) -> String {
        let Self { project, .. } = self;
        let upper = project.to_ascii_uppercase();
        let mut text = format!(
            "/* Packets of {project}: plain data, little endian, without padding. Generated from {}; do not edit. */\n\
             #ifndef {upper}_PACKETS_H\n#define {upper}_PACKETS_H\n\n\
             #include <stddef.h>\n#include <stdint.h>\n\n\
             #ifdef __cplusplus\n#define {upper}_STATIC_ASSERT static_assert\n#else\n\
             #define {upper}_STATIC_ASSERT _Static_assert\n#endif\n",
            self.source
        );
        for (name, docs, value) in self.constants {
            text.push('\n');
            comment(&mut text, "", &plain(&[docs]));
            let _ = writeln!(text, "#define {upper}_{name} {value}");
        }
        for choice in self.choices {
            self.write_choice(choice, &mut text);
        }
        for layout in self.packets {
            self.write_layout(layout, &mut text);
        }
        let _ = writeln!(text, "\n#endif");
        text
    }

    fn write_choice(&self, choice: &Choice, text: &mut String) {
        let project = self.project;
        let upper = project.to_ascii_uppercase();
        text.push('\n');
        comment(text, "", &plain(choice.docs));
        let name = snake(choice.name);
        let _ = writeln!(text, "enum {project}_{name} {{");
        for (value, docs, number) in choice.values {
            comment(text, "  ", &plain(docs));
            let value = format!("{upper}_{}_{}", name, snake(value)).to_ascii_uppercase();
            let _ = writeln!(text, "  {value} = {number},");
        }
        text.push_str("};\n");
    }

    fn write_layout(&self, layout: &Layout, text: &mut String) {
        let project = self.project;
        let upper = project.to_ascii_uppercase();
        text.push('\n');
        comment(
            text,
            "",
            &format!("{} {} bytes.", plain(layout.docs), layout.bytes),
        );
        let name = named(project, layout);
        let _ = writeln!(text, "typedef struct {name} {{");
        for field in layout.fields {
            comment(text, "  ", &field_docs(field));
            let (kind, suffix) = declared(project, &field.kind);
            let _ = writeln!(text, "  {kind} {}{suffix};", field.name);
        }
        let _ = writeln!(text, "}} {name};");
        if layout.is_packet() {
            let of = name.to_ascii_uppercase();
            let _ = writeln!(text, "#define {of}_NAME \"{}\"", layout.name);
            let _ = writeln!(text, "#define {of}_VERSION {}", layout.version);
        }
        let assert = format!("{upper}_STATIC_ASSERT");
        let _ = writeln!(
            text,
            "{assert}(sizeof({name}) == {}, \"size of {name}\");",
            layout.bytes
        );
        for field in layout.fields {
            let at = format!("{name}.{}", field.name);
            let _ = writeln!(
                text,
                "{assert}(offsetof({name}, {}) == {}, \"offset of {at}\");",
                field.name, field.offset
            );
        }
    }

    /// Returns the traits that C++ templates need for the packets of [`Description::c_header`].
    pub fn cpp_traits(&self) -> String {
        let Self { project, .. } = self;
        let upper = project.to_ascii_uppercase();
        let mut text = format!(
            "// Names and versions of packets for templates. Generated from {}; do not edit.\n\
             #ifndef {upper}_PACKETS_HPP\n#define {upper}_PACKETS_HPP\n\n\
             #include <cstdint>\n\n#include \"{}\"\n\n\
             namespace tactnet {{\n\n\
             /// Name and version of a packet; to be specialised for packets of one's own.\n\
             template <class T>\nstruct packet_traits;\n",
            self.source,
            self.c_file()
        );
        for layout in self.packets.iter().filter(|layout| layout.is_packet()) {
            let name = named(project, layout);
            let of = name.to_ascii_uppercase();
            let _ = write!(
                text,
                "\ntemplate <>\nstruct packet_traits<{name}> {{\n  \
                 static constexpr const char *name = {of}_NAME;\n  \
                 static constexpr std::uint32_t version = {of}_VERSION;\n}};\n"
            );
        }
        let _ = writeln!(text, "\n}} // namespace tactnet\n\n#endif");
        text
    }
}
