//! Probes: classifiers that measure the information in a data set other than texture.

use serde::{Deserialize, Serialize};

/// A classifier that measures the information in a data set other than texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, PartialOrd, Ord)]
#[serde(rename_all = "kebab-case")]
pub enum Probe {
    /// Nearest neighbour on taxel means.
    Means,
    /// MiniRocket on permuted labels, which must score chance.
    Permuted,
}

impl Probe {
    /// All probes.
    pub const ALL: [Self; 2] = [Self::Means, Self::Permuted];

    /// Returns the name in recipes of experiments.
    pub fn name(self) -> &'static str {
        match self {
            Self::Means => "means",
            Self::Permuted => "permuted",
        }
    }

    /// Returns the recipe of the probe's model.
    pub fn recipe(self) -> &'static str {
        match self {
            Self::Means => "means",
            Self::Permuted => "minirocket",
        }
    }
}
