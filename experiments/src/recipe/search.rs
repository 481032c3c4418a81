//! Randomly drawn recipes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::Value;

/// A random search over the settings of a recipe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Search {
    /// Built-in name or file of the base recipe.
    #[serde(default)]
    pub base: String,
    /// Number of recipes to draw.
    pub trials: usize,
    /// Range of each setting, by path.
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

/// The range of one setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Range {
    /// Uniform distribution.
    Uniform {
        /// Lower bound.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// Log-uniform distribution.
    Logarithmic {
        /// Lower bound, above 0.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// Uniform choice from a list.
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
