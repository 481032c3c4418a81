//! Where the sweeps of a data set come from.

use serde::{Deserialize, Serialize};

use crate::{LabelSet, SweepShape, twin};

/// Where sweeps come from. Decided once, when a data set is read or made, and carried into every result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DataOrigin {
    /// Somebody's recordings.
    #[default]
    Recorded,
    /// The recordings that the thesis reports on: its 36 materials, a 4x4 skin.
    Tactmat,
    /// The synthetic stand-in for TactMat; the file or the generator says so.
    Twin,
}

impl DataOrigin {
    /// The origin of recorded sweeps: TactMat has its 36 materials, in any order, and a 4x4 skin.
    pub(crate) fn of_recording(shape: SweepShape, labels: &LabelSet) -> Self {
        let skin = (shape.rows, shape.cols) == (4, 4);
        let same = labels.len() == twin::NAMES.len()
            && twin::NAMES
                .iter()
                .all(|name| labels.names().any(|found| found == *name));
        if skin && same {
            Self::Tactmat
        } else {
            Self::Recorded
        }
    }

    /// True for TactMat and its twin, whose results may be set beside those published for TactMat.
    pub fn is_comparable_to_published(self) -> bool {
        self != Self::Recorded
    }

    /// True if a generator made the sweeps.
    pub fn is_synthetic(self) -> bool {
        self == Self::Twin
    }
}
