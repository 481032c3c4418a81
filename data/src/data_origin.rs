//! Origins of sweeps.

use serde::{Deserialize, Serialize};

use crate::twin::TwinVersion;
use crate::{LabelSet, SweepShape, twin};

/// Origin of the sweeps of a data set. It is set when the data set is read or generated, and stored with every result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DataOrigin {
    /// Recordings other than TactMat.
    #[default]
    Recorded,
    /// The TactMat recordings of the thesis: 36 materials, a 4x4 skin.
    Tactmat,
    /// Version 1 of the synthetic stand-in for TactMat, marked in the file or by the generator.
    #[serde(rename = "twin")]
    Twin1,
    /// Version 2 of the synthetic stand-in for TactMat.
    #[serde(rename = "twin-2")]
    Twin2,
}

impl DataOrigin {
    /// Returns the origin of recorded sweeps: TactMat has its 36 materials, in any order, and a 4x4 skin.
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

    /// Returns true for TactMat and its twins, whose results can be compared with those published for TactMat.
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

    /// Returns true if a generator made the sweeps.
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
