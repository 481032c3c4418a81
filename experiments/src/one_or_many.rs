//! Fields of a recipe that hold one value or a list.

use std::path::Path;

use serde::{Deserialize, Deserializer};
use toml::Value;

/// Reads a list, or a single value that stands for a list of one; a text with commas that is no file stands for as many texts.
pub(crate) fn one_or_many<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    let value = Value::deserialize(deserializer)?;
    let values = match value {
        Value::Array(values) => values,
        Value::String(text) if text.contains(',') && !Path::new(&text).exists() => text
            .split(',')
            .map(|part| Value::String(part.trim().into()))
            .collect(),
        single => vec![single],
    };
    values
        .into_iter()
        .map(|value| value.try_into().map_err(serde::de::Error::custom))
        .collect()
}
