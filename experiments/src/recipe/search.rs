//! Recipes drawn at random.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::Value;

/// Recipes drawn at random.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Search {
    /// Built-in name or file of the recipe they are made from.
    #[serde(default)]
    pub base: String,
    /// How many.
    pub trials: usize,
    /// Ranges of the settings that are drawn, by path.
    #[serde(default)]
    pub space: BTreeMap<String, Range>,
}

impl Search {
    /// Checks that there is something to draw.
    pub(super) fn validate(&self) -> Result<(), String> {
        if self.base.is_empty() {
            return Err(
                "`search`: this experiment has none; one needs `base`, `trials` and `space`".into(),
            );
        }
        if self.trials == 0 || self.space.is_empty() {
            return Err("`search`: expected at least one trial and one setting to draw".into());
        }
        let unfit = self.space.iter().find(|(_, range)| !range.is_drawable());
        match unfit {
            None => Ok(()),
            Some((path, range)) => Err(format!(
                "`search.space.\"{path}\"`: expected something to draw from, found {range:?}"
            )),
        }
    }
}

/// The range that one setting is drawn from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Range {
    /// Any number between two, each equally likely.
    Uniform {
        /// Smallest.
        low: f64,
        /// Largest.
        high: f64,
    },
    /// Any number between two, each order of magnitude equally likely.
    Logarithmic {
        /// Smallest, above 0.
        low: f64,
        /// Largest.
        high: f64,
    },
    /// One of a list.
    Choice {
        /// The list.
        values: Vec<Value>,
    },
}

impl Range {
    fn is_drawable(&self) -> bool {
        match self {
            Self::Uniform { low, high } => low < high && (high - low).is_finite(),
            Self::Logarithmic { low, high } => *low > 0.0 && low < high && high.is_finite(),
            Self::Choice { values } => !values.is_empty(),
        }
    }
}
