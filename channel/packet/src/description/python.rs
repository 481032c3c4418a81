//! Description in Python, based on NumPy.

use std::fmt::Write;

use super::{Description, FieldType, Layout, plain, snake, wrapped};

const WIDTH: usize = 110;

/// Returns format and shape for NumPy.
fn format(kind: &FieldType) -> String {
    let number = match kind {
        FieldType::U8 => "u1",
        FieldType::U16 => "<u2",
        FieldType::U32 => "<u4",
        FieldType::U64 => "<u8",
        FieldType::I8 => "i1",
        FieldType::I16 => "<i2",
        FieldType::I32 => "<i4",
        FieldType::I64 => "<i8",
        FieldType::F32 => "<f4",
        FieldType::F64 => "<f8",
        FieldType::Text(bytes) => return format!("\"S{bytes}\""),
        FieldType::Packet(layout) => return format!("{}.DTYPE", layout.name),
        FieldType::Array(..) => {
            let (base, shape) = kind.base_and_shape();
            let lengths: Vec<String> = shape.iter().map(|length| format!("{length},")).collect();
            let lengths = lengths.join(" ");
            // A comma makes a tuple of one length only.
            let lengths = match shape.len() {
                1 => lengths.as_str(),
                _ => lengths.trim_end_matches(','),
            };
            return format!("({}, ({lengths}))", format(base));
        }
    };
    format!("\"{number}\"")
}

/// Returns type and default of a dataclass field.
fn declared(kind: &FieldType) -> (String, String) {
    let (kind, default) = match kind {
        FieldType::F32 | FieldType::F64 => ("float", "0.0"),
        FieldType::Text(_) => ("str", "\"\""),
        FieldType::Packet(layout) => {
            let name = layout.name;
            return (name.into(), format!("field(default_factory={name})"));
        }
        FieldType::Array(..) => {
            let (base, shape) = kind.base_and_shape();
            let base = match base {
                FieldType::Text(_) => "str",
                FieldType::Packet(part) => part.name,
                _ => return ("Any".into(), "()".into()),
            };
            let list = shape
                .iter()
                .fold(base.to_owned(), |of, _| format!("list[{of}]"));
            return (list, "field(default_factory=list)".into());
        }
        _ => ("int", "0"),
    };
    (kind.into(), default.into())
}

fn docstring(text: &mut String, indent: &str, docs: &str) {
    let lines = wrapped(docs, WIDTH - indent.len() - 6);
    if lines.is_empty() {
        return;
    }
    let _ = writeln!(
        text,
        "{indent}\"\"\"{}\"\"\"",
        lines.join(&format!("\n{indent}"))
    );
}

fn class(text: &mut String, layout: &Layout) {
    let _ = write!(text, "\n\n@dataclass\nclass {}(Packet):\n", layout.name);
    docstring(text, "    ", &plain(layout.docs));
    let (mut formats, mut counted, mut parts) = (Vec::new(), Vec::new(), Vec::new());
    text.push('\n');
    for field in layout.fields {
        formats.push(format!(
            "        (\"{}\", {}),\n",
            field.name,
            format(&field.kind)
        ));
        if let Some(count) = field.counted_by {
            counted.push(format!("\"{}\": \"{count}\"", field.name));
        }
        if let (FieldType::Array(..), Some(part)) = (&field.kind, field.kind.part()) {
            parts.push(format!("\"{}\": {}", field.name, part.name));
        }
    }
    let _ = writeln!(text, "    NAME: ClassVar[str] = \"{}\"", layout.name);
    let _ = writeln!(text, "    VERSION: ClassVar[int] = {}", layout.version);
    let _ = writeln!(
        text,
        "    DTYPE: ClassVar[np.dtype] = np.dtype([\n{}    ])",
        formats.concat()
    );
    let _ = writeln!(
        text,
        "    COUNTED_BY: ClassVar[dict[str, str]] = {{{}}}",
        counted.join(", ")
    );
    if !parts.is_empty() {
        let _ = writeln!(
            text,
            "    PARTS: ClassVar[dict[str, type[Packet]]] = {{{}}}",
            parts.join(", ")
        );
    }
    text.push('\n');
    for field in layout.fields {
        let (kind, default) = declared(&field.kind);
        let _ = writeln!(text, "    {}: {kind} = {default}", field.name);
        docstring(text, "    ", &plain(field.docs));
    }
}

impl Description {
    /// Returns the packets as Python dataclasses that inherit `Packet` of the module `base`.
    pub fn python(&self, base: &str) -> String {
        let mut names = vec!["Packet".to_string()];
        names.extend(self.constants.iter().map(|(name, ..)| name.to_string()));
        names.extend(self.choices.iter().map(|choice| choice.name.to_string()));
        names.extend(self.packets.iter().map(|layout| layout.name.to_string()));
        let names: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
        let mut text = format!(
            "\"\"\"Packets of {}. Generated from {}; do not edit.\"\"\"\n\n\
             from __future__ import annotations\n\n\
             from dataclasses import dataclass, field\nfrom enum import IntEnum\nfrom typing import Any, ClassVar\n\n\
             import numpy as np\n\nfrom {base} import Packet\n\n__all__ = [{}]\n",
            self.project,
            self.source,
            names.join(", ")
        );
        for (name, docs, value) in self.constants {
            let _ = write!(text, "\n{name} = {value}\n");
            docstring(&mut text, "", &plain(&[docs]));
        }
        for choice in self.choices {
            let _ = write!(text, "\n\nclass {}(IntEnum):\n", choice.name);
            docstring(&mut text, "    ", &plain(choice.docs));
            text.push('\n');
            for (value, docs, number) in choice.values {
                let _ = writeln!(text, "    {} = {number}", snake(value).to_ascii_uppercase());
                docstring(&mut text, "    ", &plain(docs));
            }
        }
        for layout in self.packets {
            class(&mut text, layout);
        }
        text
    }
}
