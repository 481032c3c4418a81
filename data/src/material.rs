//! Materials and the label set that numbers them.

use std::collections::HashMap;

use crate::{DataError, normal_name};
use serde::{Deserialize, Serialize};

/// Name of a surface ("cork", "linen fabric rough").
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Material(pub String);

/// Materials of a data set in label order: label `k` is the `k`-th material.
///
/// ```
/// use tactnet_data::LabelSet;
///
/// let labels = LabelSet::new(["cork", "denim"])?;
/// assert_eq!((labels.len(), labels.name(1)), (2, "denim"));
/// assert!(LabelSet::new(["cork", "cork"]).is_err());
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct LabelSet(Vec<Material>);

/// Maximum length of a material's name, in bytes of UTF-8.
const MAX_NAME: usize = 256;

impl TryFrom<Vec<String>> for LabelSet {
    type Error = DataError;

    fn try_from(names: Vec<String>) -> Result<Self, DataError> {
        Self::new(names)
    }
}

impl From<LabelSet> for Vec<String> {
    fn from(labels: LabelSet) -> Self {
        labels.0.into_iter().map(|material| material.0).collect()
    }
}

impl LabelSet {
    /// Returns the label set of `names` in this order, in Unicode's composed form, see [`normal_name`].
    ///
    /// # Errors
    /// No names, an empty or duplicate name, a name of more than 256 bytes or with control characters.
    pub fn new<I, S>(names: I) -> Result<Self, DataError>
    where
        I: IntoIterator<Item = S>,
        S: Into<String>,
    {
        let materials: Vec<Material> = names
            .into_iter()
            .map(|name| Material(normal_name(&name.into())))
            .collect();
        if materials.is_empty() {
            return Err(DataError::inconsistent(
                "materials",
                "at least one name",
                "none",
            ));
        }
        let mut labels = HashMap::new();
        for (label, material) in materials.iter().enumerate() {
            if material.0.trim().is_empty() {
                return Err(DataError::inconsistent(
                    "materials",
                    "a name for every label",
                    format!("an empty name at label {label}"),
                ));
            }
            if material.0.len() > MAX_NAME {
                return Err(DataError::inconsistent(
                    "materials",
                    format!("names of at most {MAX_NAME} bytes"),
                    format!("{} bytes at label {label}", material.0.len()),
                ));
            }
            // Control characters could move a terminal's cursor, or reverse the columns of a table.
            if material.0.chars().any(is_control) {
                return Err(DataError::inconsistent(
                    "materials",
                    "names without control characters",
                    format!("{:?} at label {label}", material.0),
                ));
            }
            if let Some(first) = labels.insert(material.0.as_str(), label) {
                return Err(DataError::inconsistent(
                    "materials",
                    "distinct names",
                    format!("`{}` at labels {first} and {label}", material.0),
                ));
            }
        }
        Ok(Self(materials))
    }

    /// Returns the number of materials, at least 1.
    #[allow(clippy::len_without_is_empty)] // never empty, by construction
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns the name of a label.
    ///
    /// # Panics
    /// If `label >= self.len()`.
    pub fn name(&self, label: usize) -> &str {
        &self.0[label].0
    }

    /// Returns the names in label order.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.0.iter().map(|m| m.0.as_str())
    }
}

/// Returns true for invisible characters and those that change the display of others.
///
/// ```
/// assert!(tactnet_data::is_control('\u{1b}'));
/// assert!(!tactnet_data::is_control('ü'));
/// ```
pub fn is_control(character: char) -> bool {
    character.is_control() || matches!(character, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_would_change_what_a_terminal_shows_are_refused_also_from_a_file() {
        for name in ["\u{1b}[2Jcork", "co\nrk", "\u{202e}kroc", "cork\0"] {
            let refused = LabelSet::new([name]).unwrap_err().to_string();
            assert!(refused.contains("without control characters"), "{refused}");
            assert!(!refused.chars().any(is_control), "{refused:?}");
            let text = serde_json::to_string(&[name]).unwrap();
            assert!(serde_json::from_str::<LabelSet>(&text).is_err());
        }
        let long = "x".repeat(10_000);
        let refused = LabelSet::new([long.as_str()]).unwrap_err().to_string();
        assert!(refused.len() < 200, "{refused}");
        LabelSet::new(["Kork, grün", "コルク", &"x".repeat(256)]).unwrap();
    }

    #[test]
    fn names_in_both_forms_of_unicode_are_one_material() {
        let composed = LabelSet::new(["gr\u{fc}n"]).unwrap();
        assert_eq!(LabelSet::new(["gru\u{308}n"]).unwrap(), composed);
        let error = LabelSet::new(["gr\u{fc}n", "gru\u{308}n"]).unwrap_err();
        assert!(error.to_string().contains("at labels 0 and 1"), "{error}");
    }

    #[test]
    fn label_set_refuses_duplicate_and_empty_names() {
        let error = LabelSet::new(["cork", "denim", "cork"])
            .unwrap_err()
            .to_string();
        assert!(error.contains("`cork` at labels 0 and 2"), "{error}");
        assert!(LabelSet::new(["cork", " "]).is_err());
        assert!(LabelSet::new(Vec::<String>::new()).is_err());
    }
}
