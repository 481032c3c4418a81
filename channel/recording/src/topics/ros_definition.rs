//! Definitions of ROS messages, as recordings contain them: the text of the `.msg` file, then those of the messages that it
//! uses, each after a line of `=` and one with `MSG: package/Name`.

use std::collections::HashMap;

/// Definitions of a message and of those that it uses.
#[derive(Debug)]
pub(super) struct Definitions {
    /// Fields of the messages by name, without `msg/`.
    messages: HashMap<String, Vec<Field>>,
    /// Name of the message of the topic.
    root: String,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) of: Type,
    pub(super) count: Count,
}

/// Number of values of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Count {
    One,
    /// Array of a fixed length.
    Fixed(usize),
    /// Array that begins with its length.
    Counted,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Type {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
    Text,
    WideText,
    /// Seconds and nanoseconds of ROS 1; true for unsigned ones.
    Time(bool),
    /// Name of another message.
    Message(String),
}

impl Definitions {
    /// Reads the definitions of the message `name`.
    ///
    /// # Errors
    /// A line that cannot be read as a field.
    pub(super) fn parse(name: &str, text: &str) -> Result<Self, String> {
        let root = short(name);
        let mut messages = HashMap::new();
        let (mut current, mut fields) = (root.clone(), Vec::new());
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if line.is_empty() || is_separator(line) {
                continue;
            }
            if let Some(next) = line.strip_prefix("MSG:") {
                messages.insert(current, fields);
                (current, fields) = (short(next.trim()), Vec::new());
            } else if let Some(field) = field(line, &current)? {
                fields.push(field);
            }
        }
        messages.insert(current, fields);
        Ok(Self { messages, root })
    }

    pub(super) fn root(&self) -> &str {
        &self.root
    }

    /// Returns the fields of a message.
    ///
    /// # Errors
    /// A message that is not defined.
    pub(super) fn fields(&self, name: &str) -> Result<&[Field], String> {
        let found = self.messages.get(name).map(Vec::as_slice);
        found.ok_or_else(|| format!("the definition of {name} is missing"))
    }
}

/// Returns the name without its part `msg`: ROS 2 writes `std_msgs/msg/Header`, definitions `std_msgs/Header`.
fn short(name: &str) -> String {
    name.replace("/msg/", "/")
}

fn is_separator(line: &str) -> bool {
    line.len() >= 3 && line.bytes().all(|byte| byte == b'=')
}

/// Returns the field of a line; `None` for a constant.
fn field(line: &str, message: &str) -> Result<Option<Field>, String> {
    let refused = || format!("`{line}` in the definition of {message} is no field");
    let (of, rest) = line.split_once(char::is_whitespace).ok_or_else(refused)?;
    let rest = rest.trim_start();
    let end = rest
        .find(|letter: char| letter.is_whitespace() || letter == '=')
        .unwrap_or(rest.len());
    if rest[end..].trim_start().starts_with('=') {
        return Ok(None);
    }
    // Maximum lengths of texts and arrays do not change the encoding: `string<=10`, `float32[<=4]`.
    let (of, count) = match of.split_once('[') {
        None => (of, Count::One),
        Some((of, length)) => {
            let length = length.strip_suffix(']').ok_or_else(refused)?;
            let count = match length.parse() {
                Ok(length) => Count::Fixed(length),
                Err(_) if length.is_empty() || length.starts_with("<=") => Count::Counted,
                Err(_) => return Err(refused()),
            };
            (of, count)
        }
    };
    let of = of.split("<=").next().unwrap_or_default();
    Ok(Some(Field {
        name: rest[..end].into(),
        of: kind(of, message),
        count,
    }))
}

fn kind(of: &str, message: &str) -> Type {
    match of {
        "bool" | "byte" | "char" | "uint8" => Type::Unsigned(1),
        "int8" => Type::Signed(1),
        "int16" => Type::Signed(2),
        "uint16" => Type::Unsigned(2),
        "int32" => Type::Signed(4),
        "uint32" => Type::Unsigned(4),
        "int64" => Type::Signed(8),
        "uint64" => Type::Unsigned(8),
        "float32" => Type::Float(4),
        "float64" => Type::Float(8),
        "string" => Type::Text,
        "wstring" => Type::WideText,
        "time" => Type::Time(true),
        "duration" => Type::Time(false),
        "Header" => Type::Message("std_msgs/Header".into()),
        other if other.contains('/') => Type::Message(short(other)),
        // A message of the same package.
        other => {
            let package = message.split('/').next().unwrap_or_default();
            Type::Message(format!("{package}/{other}"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_constants_bounds_and_used_messages_are_told_apart() {
        let text = "# comment\nHeader header\nint8 LEFT=1\nstring NAME = \"a=b\"\nfloat32[16] taxels  # of the tip\n\
            float64[<=3] some\nstring<=8 name \"x\"\nPart[] parts\nother_msgs/Thing thing\nbool on true\n\
            ================\nMSG: skin_msgs/Part\nuint16[] v\n";
        let found = Definitions::parse("skin_msgs/msg/Tip", text).unwrap();
        let fields = found.fields(found.root()).unwrap();
        let of = |name: &str| fields.iter().find(|field| field.name == name).unwrap();
        assert_eq!(fields.len(), 7);
        assert_eq!(of("header").of, Type::Message("std_msgs/Header".into()));
        assert_eq!(
            (&of("taxels").of, of("taxels").count),
            (&Type::Float(4), Count::Fixed(16))
        );
        assert_eq!(of("some").count, Count::Counted);
        assert_eq!(
            (&of("name").of, of("name").count),
            (&Type::Text, Count::One)
        );
        assert_eq!(of("parts").of, Type::Message("skin_msgs/Part".into()));
        assert_eq!(of("thing").of, Type::Message("other_msgs/Thing".into()));
        assert_eq!(
            found.fields("skin_msgs/Part").unwrap()[0].of,
            Type::Unsigned(2)
        );
        assert!(found.fields("other_msgs/Thing").is_err());
        assert!(Definitions::parse("a/B", "float32").is_err());
    }
}
