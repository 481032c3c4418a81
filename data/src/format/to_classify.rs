//! Sweeps that are to be classified: files need not say of what materials they are.
//!
//! | file | sweeps |
//! |---|---|
//! | `.npz` with `X` or `samples` alone | its entries |
//! | a folder of `.csv` or `.npy`, a `.csv` of numbers alone | a file each |
//! | a `.csv` or `.parquet` table | by its column `sweep`; without one, all frames are one sweep's |
//! | any data set with materials | its sweeps |

use std::path::Path;

use super::lengths::{Keep, OddLength};
use super::named_sweeps::Labels;
use super::{in_file, read_arrays, refuse_non_finite, table_with_gaps};
use crate::{DataError, Dataset};

/// Sweeps to be classified.
#[derive(Debug)]
pub struct SweepsToClassify {
    /// The sweeps. Where the file names no materials, all are of one that stands for none.
    pub dataset: Dataset,
    /// `[sweeps]`: names of files or of sweeps in a table; numbers from 0 where there are none.
    pub names: Vec<String>,
    /// True if the file says of what material each is.
    pub labelled: bool,
    /// True if the taxels of a file that does not say how they are arranged were put into the rows and columns of a classifier.
    pub arranged: bool,
    /// Sweeps that are longer than most, and were cut, or shorter, and were left out: of [`Keep::Most`].
    pub odd_lengths: Vec<OddLength>,
}

impl SweepsToClassify {
    /// Returns the sweeps of a data set that names its materials.
    pub fn of(dataset: Dataset) -> Self {
        Self {
            names: (0..dataset.len()).map(|index| index.to_string()).collect(),
            labelled: true,
            arranged: false,
            odd_lengths: Vec::new(),
            dataset,
        }
    }

    /// Returns `[sweeps]`: true for a sweep in which no taxel ever changes, which no touch leaves behind.
    pub fn still(&self) -> Vec<bool> {
        let taxels = self.dataset.shape().taxels();
        (0..self.dataset.len())
            .map(|index| {
                let sweep = self.dataset.sweep(index);
                // One frame says nothing about change.
                sweep.len() > taxels
                    && sweep
                        .iter()
                        .zip(&sweep[taxels..])
                        .all(|(before, after)| before == after)
            })
            .collect()
    }
}

/// Reads sweeps whose materials nobody needs to know, and whose values are all finite.
///
/// - `steps`: frames of every sweep that are kept, from its beginning; `None`: all
///
/// # Errors
/// As [`read`](super::read), except for materials that are not named.
pub fn read_to_classify(path: &Path, steps: Option<usize>) -> Result<SweepsToClassify, DataError> {
    let sweeps = read_to_classify_with_gaps(path, steps.into())?;
    Ok(SweepsToClassify {
        dataset: refuse_non_finite(path, sweeps.dataset, sweeps.labelled)?,
        ..sweeps
    })
}

/// As [`read_to_classify`], but values may be NaN or infinite, and sweeps of different lengths, for a check that lists them all.
///
/// - `keep`: frames of every sweep that are read
///
/// # Errors
/// As [`read_to_classify`], except for values that are not finite.
pub fn read_to_classify_with_gaps(path: &Path, keep: Keep) -> Result<SweepsToClassify, DataError> {
    Ok(match table_with_gaps(path, keep, Labels::Optional) {
        Some(sweeps) => {
            let sweeps = sweeps?;
            SweepsToClassify {
                names: sweeps.sweeps.clone(),
                labelled: sweeps.materials.is_some(),
                arranged: false,
                odd_lengths: sweeps.odd_lengths.clone(),
                dataset: sweeps
                    .into_dataset()
                    .map_err(|error| in_file(path, error))?,
            }
        }
        None => {
            let (mut dataset, labelled) = read_arrays(path, Labels::Optional)?;
            if let Keep::First(steps) = keep {
                dataset = dataset
                    .first_steps(steps)
                    .map_err(|error| in_file(path, error))?;
            }
            SweepsToClassify {
                labelled,
                ..SweepsToClassify::of(dataset)
            }
        }
    })
}
