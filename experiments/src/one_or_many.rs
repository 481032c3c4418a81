//! Recipe fields that accept a single value or a list.

use std::path::Path;

use serde::{Deserialize, Deserializer};
use toml::Value;

/// Reads a list, or a single value as a list of one. Text with commas that is not an existing file is split at the
/// commas.
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
