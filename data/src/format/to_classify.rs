//! Sweeps to classify: their files need not name the materials.
//!
//! | file | sweeps |
//! |---|---|
//! | `.npz` with `X` or `samples` alone | its entries |
//! | a folder of `.csv` or `.npy`, a `.csv` of numbers alone | a file each |
//! | a `.csv` or `.parquet` table | by its column `sweep`; without one, all frames are one sweep's |
//! | any data set with materials | its sweeps |

use std::path::Path;

use super::lengths::OddLength;
use super::named_sweeps::{Labels, NamedSweeps};
use super::read_options::ReadOptions;
use super::{in_file, read_arrays, refuse_non_finite, table_with_gaps};
use crate::{DataError, Dataset};

/// Sweeps to classify.
#[derive(Debug)]
pub struct SweepsToClassify {
    /// The sweeps. If the file names no materials, all have a placeholder as material.
    pub dataset: Dataset,
    /// Names of the files or sweeps, `[sweeps]`; numbers from 0 if there are none.
    pub names: Vec<String>,
    /// True if the file names the materials.
    pub labelled: bool,
    /// True if the taxels of a file without an arrangement were put into the rows and columns of a classifier.
    pub arranged: bool,
    /// Sweeps that were cut because they are longer than most, or omitted because they are shorter, see [`Keep::Most`](super::Keep::Most).
    pub odd_lengths: Vec<OddLength>,
}

impl SweepsToClassify {
    /// Returns the sweeps of a labelled data set.
    pub fn of(dataset: Dataset) -> Self {
        Self {
            names: (0..dataset.len()).map(|index| index.to_string()).collect(),
            labelled: true,
            arranged: false,
            odd_lengths: Vec::new(),
            dataset,
        }
    }

    /// Returns sweeps of a table or folder.
    ///
    /// # Errors
    /// Sweeps that do not form a data set.
    pub(super) fn of_named(path: &Path, sweeps: NamedSweeps) -> Result<Self, DataError> {
        Ok(Self {
            names: sweeps.sweeps.clone(),
            labelled: sweeps.materials.is_some(),
            arranged: false,
            odd_lengths: sweeps.odd_lengths.clone(),
            dataset: sweeps
                .into_dataset()
                .map_err(|error| in_file(path, error))?,
        })
    }

    /// Returns an error if a value is NaN or infinite.
    pub(super) fn refuse_non_finite(self, path: &Path) -> Result<Self, DataError> {
        Ok(Self {
            dataset: refuse_non_finite(path, self.dataset, self.labelled)?,
            ..self
        })
    }

    /// Returns true for sweeps without any change, `[sweeps]`: they contain no touch.
    pub fn still(&self) -> Vec<bool> {
        let taxels = self.dataset.shape().taxels();
        (0..self.dataset.len())
            .map(|index| {
                let sweep = self.dataset.sweep(index);
                // A single frame cannot show a change.
                sweep.len() > taxels
                    && sweep
                        .iter()
                        .zip(&sweep[taxels..])
                        .all(|(before, after)| before == after)
            })
            .collect()
    }
}

/// Reads sweeps whose values are all finite; materials are optional.
///
/// - `steps`: number of frames of every sweep that are kept; `None`: all
///
/// # Errors
/// As [`read`](super::read), but missing materials are accepted.
///
/// ```no_run
/// use tactnet_data::format::read_to_classify;
///
/// let sweeps = read_to_classify("new.npz".as_ref(), Some(1000))?;
/// println!("{} sweeps, labelled: {}", sweeps.dataset.len(), sweeps.labelled);
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn read_to_classify(path: &Path, steps: Option<usize>) -> Result<SweepsToClassify, DataError> {
    read_to_classify_with(path, &ReadOptions::keeping(steps))
}

/// Reads sweeps as [`read_to_classify`], with options.
///
/// # Errors
/// As [`read_to_classify`], and options that the file does not allow.
pub fn read_to_classify_with(
    path: &Path,
    options: &ReadOptions,
) -> Result<SweepsToClassify, DataError> {
    read_to_classify_with_gaps(path, options)?.refuse_non_finite(path)
}

/// Reads sweeps as [`read_to_classify_with`]; values may be NaN or infinite, so that a check can list them.
///
/// # Errors
/// As [`read_to_classify_with`], but values that are not finite are accepted.
pub fn read_to_classify_with_gaps(
    path: &Path,
    options: &ReadOptions,
) -> Result<SweepsToClassify, DataError> {
    Ok(match table_with_gaps(path, options, Labels::Optional) {
        Some(sweeps) => SweepsToClassify::of_named(path, sweeps?)?,
        None => {
            let (dataset, labelled) = read_arrays(path, Labels::Optional, options)?;
            let dataset = options.apply_to(path, dataset)?;
            SweepsToClassify {
                labelled,
                ..SweepsToClassify::of(dataset)
            }
        }
    })
}
