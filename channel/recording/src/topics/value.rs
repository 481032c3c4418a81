//! Decoded messages: their numbers and texts by path.

/// Part of a decoded message.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    /// A number; true and false are 1 and 0.
    Number(f64),
    /// Array of numbers.
    Numbers(Vec<f64>),
    Text(String),
    List(Vec<Value>),
    /// Fields in the order of their definition.
    Fields(Vec<(String, Value)>),
}

/// Maximum number of different lists of a path that are shown, such as `layers[3]`.
const SHOWN_ENTRIES: usize = 4;

impl Value {
    /// Returns the numbers of all parts of this path, in order.
    ///
    /// - `path`: names of fields separated by points; `[2]` selects an entry of a list, otherwise all are taken. The empty
    ///   path is the whole message.
    ///
    /// Returns `None` if there is no such field.
    pub(super) fn numbers(&self, path: &str) -> Option<Vec<f64>> {
        let mut numbers = Vec::new();
        let found = self.at(path, &mut |part| part.append_numbers(&mut numbers));
        found.then_some(numbers)
    }

    /// Returns the text or number at this path, as a label.
    pub(super) fn label(&self, path: &str) -> Option<String> {
        let mut label = None;
        self.at(path, &mut |part| {
            label = match part {
                Self::Text(text) => Some(text.clone()),
                Self::Number(number) => Some(number.to_string()),
                _ => None,
            }
        });
        label
    }

    /// Calls `take` with all parts at this path. Returns false if there is none.
    fn at(&self, path: &str, take: &mut impl FnMut(&Self)) -> bool {
        let path = path.trim_start_matches('.');
        if path.is_empty() {
            take(self);
            return true;
        }
        match self {
            Self::Fields(fields) => {
                let end = path.find(['.', '[']).unwrap_or(path.len());
                let field = fields.iter().find(|(name, _)| *name == path[..end]);
                field.is_some_and(|(_, value)| value.at(&path[end..], take))
            }
            Self::List(entries) => match entry(path) {
                Some((number, rest)) => entries
                    .get(number)
                    .is_some_and(|entry| entry.at(rest, take)),
                None => {
                    let mut found = false;
                    for entry in entries {
                        found |= entry.at(path, take);
                    }
                    found
                }
            },
            Self::Numbers(numbers) => entry(path).is_some_and(|(number, rest)| {
                numbers
                    .get(number)
                    .is_some_and(|number| Self::Number(*number).at(rest, take))
            }),
            Self::Number(_) | Self::Text(_) => false,
        }
    }

    fn append_numbers(&self, numbers: &mut Vec<f64>) {
        match self {
            Self::Number(number) => numbers.push(*number),
            Self::Numbers(more) => numbers.extend(more),
            Self::Text(_) => {}
            Self::List(entries) => entries.iter().for_each(|of| of.append_numbers(numbers)),
            Self::Fields(fields) => fields.iter().for_each(|(_, of)| of.append_numbers(numbers)),
        }
    }

    /// Returns the paths of all numbers and arrays of numbers with their lengths; 1 for a single number. Times and the
    /// layout of arrays are left out.
    pub(super) fn numeric_paths(&self) -> Vec<(String, usize)> {
        let mut paths = Vec::new();
        self.add_numeric_paths("", &mut paths);
        let is_data = |path: &str| {
            let top = path.split(['.', '[']).next().unwrap_or_default();
            !["header", "stamp", "timestamp", "layout"].contains(&top)
        };
        paths.retain(|(path, _)| is_data(path));
        paths
    }

    fn add_numeric_paths(&self, path: &str, paths: &mut Vec<(String, usize)>) {
        match self {
            Self::Number(_) => paths.push((path.into(), 1)),
            Self::Numbers(numbers) => paths.push((path.into(), numbers.len())),
            Self::Text(_) => {}
            Self::List(entries) => {
                for (number, entry) in entries.iter().take(SHOWN_ENTRIES).enumerate() {
                    entry.add_numeric_paths(&format!("{path}[{number}]"), paths);
                }
            }
            Self::Fields(fields) => {
                for (name, value) in fields {
                    let separator = if path.is_empty() { "" } else { "." };
                    value.add_numeric_paths(&format!("{path}{separator}{name}"), paths);
                }
            }
        }
    }

    fn field(&self, names: &[&str]) -> Option<&Self> {
        let Self::Fields(fields) = self else {
            return None;
        };
        let found = fields.iter().find(|(name, _)| names.contains(&&**name));
        found.map(|(_, value)| value)
    }

    /// Returns the time that the message states, in nanoseconds since 1970: `header.stamp`, `stamp` or `timestamp`, with
    /// seconds and nanoseconds.
    pub(super) fn stamp_ns(&self) -> Option<i64> {
        let outer = self.field(&["header"]).unwrap_or(self);
        let stamp = outer.field(&["stamp", "timestamp"])?;
        let number = |names: &[&str]| match stamp.field(names) {
            Some(Self::Number(number)) => Some(*number),
            _ => None,
        };
        let seconds = number(&["sec", "secs", "seconds"])?;
        let nanoseconds = number(&["nanosec", "nsec", "nsecs", "nanos", "nanoseconds"])?;
        Some(
            (seconds as i64)
                .saturating_mul(1_000_000_000)
                .saturating_add(nanoseconds as i64),
        )
    }
}

/// Splits `[2].x` into 2 and `.x`.
fn entry(path: &str) -> Option<(usize, &str)> {
    let (number, rest) = path.strip_prefix('[')?.split_once(']')?;
    Some((number.trim().parse().ok()?, rest))
}

impl From<serde_json::Value> for Value {
    fn from(json: serde_json::Value) -> Self {
        use serde_json::Value as Json;
        match json {
            Json::Null => Self::Number(f64::NAN),
            Json::Bool(bool) => Self::Number(f64::from(u8::from(bool))),
            Json::Number(number) => Self::Number(number.as_f64().unwrap_or(f64::NAN)),
            Json::String(text) => Self::Text(text),
            Json::Array(entries) => Self::of_entries(entries.into_iter().map(Self::from).collect()),
            Json::Object(fields) => Self::Fields(
                fields
                    .into_iter()
                    .map(|(name, of)| (name, of.into()))
                    .collect(),
            ),
        }
    }
}

impl Value {
    /// Returns an array of numbers if all entries are numbers, otherwise a list.
    pub(super) fn of_entries(entries: Vec<Self>) -> Self {
        let number = |entry: &Self| match entry {
            Self::Number(number) => Some(*number),
            _ => None,
        };
        match entries.iter().map(number).collect() {
            Some(numbers) => Self::Numbers(numbers),
            None => Self::List(entries),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message() -> Value {
        let text = r#"{"header": {"stamp": {"sec": 3, "nanosec": 500}, "frame_id": "tip"},
            "layers": [{"name": "a", "v": [1, 2]}, {"name": "b", "v": [3, null]}], "grid": [[5, 6], [7, 8]], "ok": true}"#;
        serde_json::from_str::<serde_json::Value>(text)
            .unwrap()
            .into()
    }

    #[test]
    fn a_path_selects_fields_entries_and_all_entries() {
        let message = message();
        let bits = |path| {
            message
                .numbers(path)
                .map(|n| n.iter().map(|n| n.to_bits()).collect())
        };
        let expected =
            |numbers: &[f64]| Some(numbers.iter().map(|n| n.to_bits()).collect::<Vec<_>>());
        assert_eq!(bits("layers[1].v[0]"), expected(&[3.0]));
        assert_eq!(bits("layers.v"), expected(&[1.0, 2.0, 3.0, f64::NAN]));
        assert_eq!(bits("grid"), expected(&[5.0, 6.0, 7.0, 8.0]));
        assert_eq!(bits("grid[1]"), expected(&[7.0, 8.0]));
        assert_eq!(bits("ok"), expected(&[1.0]));
        assert_eq!(bits("layers[0].name"), expected(&[]));
        assert_eq!(bits("layers[2].v"), None);
        assert_eq!(bits("layer"), None);
        assert_eq!(message.label("layers[1].name"), Some("b".into()));
        assert_eq!(message.label("ok"), Some("1".into()));
        assert_eq!(message.label("grid"), None);
        assert_eq!(message.stamp_ns(), Some(3_000_000_500));
    }

    #[test]
    fn the_paths_of_all_numbers_are_listed() {
        let paths = message().numeric_paths();
        let shown: Vec<String> = paths
            .iter()
            .map(|(path, n)| format!("{path} {n}"))
            .collect();
        assert!(shown.contains(&"layers[1].v 2".into()), "{shown:?}");
        assert!(shown.contains(&"grid[0] 2".into()), "{shown:?}");
        assert!(shown.contains(&"ok 1".into()), "{shown:?}");
    }
}
