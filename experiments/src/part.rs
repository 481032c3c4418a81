//! The part of a data set that one task works on.

use serde::{Deserialize, Serialize};

/// The part of a data set that one task works on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// A draw of new materials, counted from 0.
    Draw(usize),
    /// A fold of the sweeps.
    Fold {
        /// Repeat of the cross-validation, counted from 0.
        repeat: usize,
        /// Fold of the repeat, counted from 0.
        fold: usize,
    },
}

impl Part {
    /// Returns the number that selects the part's random streams.
    pub(crate) fn stream(self) -> usize {
        match self {
            Self::Draw(draw) => draw,
            Self::Fold { repeat, fold } => 5 * repeat + fold,
        }
    }

    /// Returns the last part of a task's name.
    pub(crate) fn id(self) -> String {
        match self {
            Self::Draw(draw) => format!("{draw:03}"),
            Self::Fold { repeat, fold } => format!("run{repeat}-fold{fold}"),
        }
    }

    /// Returns repeat and fold; a draw counts as fold of repeat 0.
    pub(crate) fn repeat_and_fold(self) -> (usize, usize) {
        match self {
            Self::Draw(draw) => (0, draw),
            Self::Fold { repeat, fold } => (repeat, fold),
        }
    }
}
