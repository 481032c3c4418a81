//! Materials and the ordered label set that numbers them.

use crate::DataError;
use serde::{Deserialize, Serialize};

/// A surface that was swept, by its name ("cork", "linen fabric rough").
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Material(pub String);

/// The materials of a data set in label order: label `k` is the `k`-th material.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct LabelSet(Vec<Material>);

impl LabelSet {
    /// Numbers `names` in the given order.
    ///
    /// # Errors
    /// No name at all, an empty name, or the same name twice.
    pub fn new<I, S>(names: I) -> Result<Self, DataError>
    where
        I: IntoIterator<Item = S>,
        S: Into<String>,
    {
        let materials: Vec<Material> = names.into_iter().map(|n| Material(n.into())).collect();
        if materials.is_empty() {
            return Err(DataError::inconsistent(
                "materials",
                "at least one name",
                "none",
            ));
        }
        for (label, material) in materials.iter().enumerate() {
            if material.0.trim().is_empty() {
                return Err(DataError::inconsistent(
                    "materials",
                    "a name for every label",
                    format!("an empty name at label {label}"),
                ));
            }
            if let Some(first) = materials[..label].iter().position(|m| m == material) {
                return Err(DataError::inconsistent(
                    "materials",
                    "distinct names",
                    format!("`{}` at labels {first} and {label}", material.0),
                ));
            }
        }
        Ok(Self(materials))
    }

    /// Number of materials.
    #[allow(clippy::len_without_is_empty)] // never empty, by construction
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The name behind a label.
    ///
    /// # Panics
    /// If `label >= self.len()`.
    pub fn name(&self, label: usize) -> &str {
        &self.0[label].0
    }

    /// The names in label order.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.0.iter().map(|m| m.0.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
