//! Options of reading.

use super::lengths::Keep;
use crate::{DataError, Dataset};

/// Options of reading a data set.
///
/// ```
/// use tactnet_data::format::{Keep, ReadOptions};
///
/// // The first 100 frames of every sweep.
/// let options = ReadOptions { keep: Keep::First(100), ..ReadOptions::default() };
/// assert_eq!(options, ReadOptions::keeping(Some(100)));
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// Frames of each sweep that are read.
    pub keep: Keep,
}

impl ReadOptions {
    /// Returns options that keep the first `steps` frames of every sweep; `None`: all.
    pub fn keeping(steps: Option<usize>) -> Self {
        Self {
            keep: steps.into(),
            ..Self::default()
        }
    }

    /// Returns a data set that was read whole with these options applied.
    ///
    /// # Errors
    /// Options that the data set does not allow.
    pub(super) fn apply_to(&self, dataset: Dataset) -> Result<Dataset, DataError> {
        match self.keep {
            Keep::First(steps) => dataset.first_steps(steps),
            Keep::Equal | Keep::Most => Ok(dataset),
        }
    }
}
