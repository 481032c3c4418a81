//! Probes: classifiers that measure the information in a data set other than texture.

use serde::{Deserialize, Serialize};

/// A classifier that measures the information in a data set other than texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, PartialOrd, Ord)]
#[serde(rename_all = "kebab-case")]
pub enum Probe {
    /// Nearest neighbour on taxel means.
    Means,
    /// Nearest neighbour on the first frame.
    FirstFrame,
    /// Nearest neighbour on the last frame.
    LastFrame,
    /// MiniRocket on permuted labels, which must score chance.
    Permuted,
}

impl Probe {
    /// All probes.
    pub const ALL: [Self; 4] = [
        Self::Means,
        Self::FirstFrame,
        Self::LastFrame,
        Self::Permuted,
    ];

    /// Returns the name in recipes of experiments.
    pub fn name(self) -> &'static str {
        match self {
            Self::Means => "means",
            Self::FirstFrame => "first-frame",
            Self::LastFrame => "last-frame",
            Self::Permuted => "permuted",
        }
    }

    /// Returns the recipe of the probe's model.
    pub fn recipe(self) -> &'static str {
        match self {
            Self::Means => "means",
            Self::FirstFrame => "first-frame",
            Self::LastFrame => "last-frame",
            Self::Permuted => "minirocket",
        }
    }
}
