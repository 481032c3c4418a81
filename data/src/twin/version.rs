//! Versions of the twin.

use serde::{Deserialize, Serialize};

/// Version of the twin; results on one version do not hold for the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub enum TwinVersion {
    /// Steady textures that differ in their power; materials are normal classes. Data set `twin1`.
    One,
    /// Unsteady textures, larger differences at low frequencies, and sweeps that feel like another material.
    #[default]
    Two,
}

impl TwinVersion {
    /// Returns the number of the version, 1 or 2.
    pub fn number(self) -> u8 {
        self.into()
    }

    /// Returns the name of the generated data set: `twin1` or `twin`.
    pub fn name(self) -> &'static str {
        match self {
            Self::One => "twin1",
            Self::Two => "twin",
        }
    }
}

impl TwinVersion {
    /// Returns the version of a file's mark; `None` for 0. The first files have the mark 1.
    pub(crate) fn of_mark(mark: f64) -> Option<Self> {
        match mark {
            0.0 => None,
            2.0 => Some(Self::Two),
            _ => Some(Self::One),
        }
    }
}

impl From<TwinVersion> for u8 {
    fn from(version: TwinVersion) -> Self {
        match version {
            TwinVersion::One => 1,
            TwinVersion::Two => 2,
        }
    }
}

impl TryFrom<u8> for TwinVersion {
    type Error = String;

    fn try_from(number: u8) -> Result<Self, String> {
        match number {
            1 => Ok(Self::One),
            2 => Ok(Self::Two),
            _ => Err(format!("expected a twin of version 1 or 2, found {number}")),
        }
    }
}
