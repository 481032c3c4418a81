//! Description as a page of tables.

use std::fmt::Write;

use super::{Description, FieldType, prose};

fn kind(field: &FieldType) -> String {
    let (base, shape) = field.base_and_shape();
    let mut text = match base {
        FieldType::Text(bytes) => format!("text[{bytes}]"),
        FieldType::Packet(layout) => layout.name.into(),
        number => format!("{number:?}").to_ascii_lowercase(),
    };
    for length in shape {
        let _ = write!(text, "[{length}]");
    }
    text
}

impl Description {
    /// Returns the packets as Markdown tables.
    pub fn markdown(&self) -> String {
        let mut text = format!(
            "# Packets\n\nGenerated from `{}`. Plain data, little endian, without padding; text is UTF-8, filled up with zeros. `no.` is a \
             field's number in the Protocol Buffers of recordings.\n",
            self.source
        );
        for (name, docs, value) in self.constants {
            let _ = write!(text, "\n`{name}` = {value}: {}\n", prose(&[docs]));
        }
        for layout in self.packets {
            let version = match layout.version {
                0 => "part of others".into(),
                version => format!("version {version}"),
            };
            let _ = write!(
                text,
                "\n## {}\n\n{} {} bytes, {version}.\n\n| offset | field | type | no. | |\n|---:|---|---|---:|---|\n",
                layout.name,
                prose(layout.docs),
                layout.bytes
            );
            for field in layout.fields {
                let number = field.number.map(|n| n.to_string()).unwrap_or_default();
                let mut docs = prose(field.docs);
                if let Some(count) = field.counted_by {
                    let _ = write!(docs, " `{count}` of them are valid.");
                }
                let _ = writeln!(
                    text,
                    "| {} | `{}` | {} | {number} | {docs} |",
                    field.offset,
                    field.name,
                    kind(&field.kind)
                );
            }
        }
        for choice in self.choices {
            let _ = write!(
                text,
                "\n## {}\n\n{}\n\n| number | name | |\n|---:|---|---|\n",
                choice.name,
                prose(choice.docs)
            );
            for (value, docs, number) in choice.values {
                let _ = writeln!(text, "| {number} | `{value}` | {} |", prose(docs));
            }
        }
        text
    }
}
