//! Where the sweeps of a data set come from.

use serde::{Deserialize, Serialize};

use crate::twin::TwinVersion;
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
    /// Version 1 of the synthetic stand-in for TactMat; the file or the generator says so.
    #[serde(rename = "twin")]
    Twin1,
    /// Version 2.
    #[serde(rename = "twin-2")]
    Twin2,
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

    /// Returns the twin's version if a generator made the sweeps.
    pub fn twin_version(self) -> Option<TwinVersion> {
        match self {
            Self::Twin1 => Some(TwinVersion::One),
            Self::Twin2 => Some(TwinVersion::Two),
            Self::Recorded | Self::Tactmat => None,
        }
    }

    /// True if a generator made the sweeps.
    pub fn is_synthetic(self) -> bool {
        self.twin_version().is_some()
    }
}

impl From<TwinVersion> for DataOrigin {
    fn from(version: TwinVersion) -> Self {
        match version {
            TwinVersion::One => Self::Twin1,
            TwinVersion::Two => Self::Twin2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin(names: &[&str], rows: usize, cols: usize) -> DataOrigin {
        let shape = SweepShape {
            steps: 10,
            rows,
            cols,
        };
        let labels = LabelSet::new(names.iter().copied()).unwrap();
        DataOrigin::of_recording(shape, &labels)
    }

    #[test]
    fn tactmat_is_known_by_its_materials_and_its_skin() {
        let mut names = twin::NAMES.to_vec();
        assert_eq!(origin(&names, 4, 4), DataOrigin::Tactmat);
        names.reverse();
        assert_eq!(origin(&names, 4, 4), DataOrigin::Tactmat);
        assert_eq!(origin(&names, 8, 8), DataOrigin::Recorded);
        assert_eq!(origin(&names[1..], 4, 4), DataOrigin::Recorded);
        names[0] = "felt";
        assert_eq!(origin(&names, 4, 4), DataOrigin::Recorded);
        names.push(twin::NAMES[35]);
        assert_eq!(origin(&names, 4, 4), DataOrigin::Recorded);
    }
}
