//! Data sets without errors, and their folds.

use std::ops::Deref;
use std::path::Path;

use crate::format::Format;
use crate::twin::{self, TwinConfig};
use crate::{DataError, Dataset, Fold, Scheme, Seed, format, refuse_errors, refuse_leaks};

/// Data set without errors that can be split into folds.
///
/// Dereferences to [`Dataset`], which has names, shape, rate and values.
///
/// ```
/// use tactnet_data::twin::TwinConfig;
/// use tactnet_data::{CheckedDataset, Seed};
///
/// let config = TwinConfig { materials: 2, sweeps: 5, steps: 100, ..TwinConfig::default() };
/// let dataset = CheckedDataset::twin(&config)?;
/// assert_eq!(dataset.len(), 10);
/// for fold in dataset.folds(Seed(1)).iter() {
///     assert_eq!((fold.train.len(), fold.test.len()), (8, 2));
/// }
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone)]
pub struct CheckedDataset {
    sweeps: Dataset,
    scheme: Scheme,
}

impl CheckedDataset {
    /// Reads a file or folder in any of the formats of [`mod@crate::format`].
    ///
    /// # Errors
    /// A missing or damaged file; findings of [`Severity::Error`](crate::Severity::Error), such as a material with fewer
    /// than two sweeps.
    ///
    /// ```
    /// use tactnet_data::CheckedDataset;
    ///
    /// let error = CheckedDataset::read("missing.npz").unwrap_err();
    /// assert!(error.to_string().contains("missing.npz"));
    /// ```
    pub fn read(path: impl AsRef<Path>) -> Result<Self, DataError> {
        format::read(path.as_ref())?.try_into()
    }

    /// Generates the synthetic twin of TactMat.
    ///
    /// # Errors
    /// A setting out of range, or fewer than two sweeps of a material.
    pub fn twin(config: &TwinConfig) -> Result<Self, DataError> {
        twin::generate(config)?.try_into()
    }

    /// Writes a file in the format that its extension names: `.h5`, `.npz` or `.ts`.
    ///
    /// # Errors
    /// Another extension, or a file that cannot be written.
    ///
    /// ```no_run
    /// use tactnet_data::CheckedDataset;
    ///
    /// CheckedDataset::read("sweeps.npz")?.write("sweeps.h5")?;
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), DataError> {
        let path = path.as_ref();
        Format::from_extension(path)?.write(path, &self.sweeps)
    }

    /// Returns the folds: the author's split if the file has one, otherwise five stratified folds, or as many as the
    /// material with the fewest sweeps has.
    ///
    /// - `seed`: decides the fold of each sweep
    pub fn folds(&self, seed: Seed) -> Folds<'_> {
        Folds {
            dataset: self,
            seed,
        }
    }
}

impl TryFrom<Dataset> for CheckedDataset {
    type Error = DataError;

    fn try_from(sweeps: Dataset) -> Result<Self, DataError> {
        let findings = refuse_errors(&sweeps, sweeps.name())?;
        let scheme = Scheme::default_for(&sweeps);
        refuse_leaks(&sweeps, &findings, scheme, sweeps.name())?;
        // The number of sweeps decides whether a data set can be split, so any seed shows it.
        Fold::new(&sweeps, scheme, Seed(0), 0, 0)?;
        Ok(Self { sweeps, scheme })
    }
}

impl Deref for CheckedDataset {
    type Target = Dataset;

    fn deref(&self) -> &Dataset {
        &self.sweeps
    }
}

/// Folds of a data set.
#[derive(Debug, Clone, Copy)]
pub struct Folds<'a> {
    dataset: &'a CheckedDataset,
    seed: Seed,
}

impl<'a> Folds<'a> {
    /// Returns the first fold.
    pub fn first(&self) -> Fold<'a> {
        self.fold(0)
    }

    /// Returns the number of folds.
    pub fn count(&self) -> usize {
        match self.dataset.scheme {
            Scheme::StratifiedKFold { folds, .. } | Scheme::GroupKFold { folds, .. } => folds,
            Scheme::HoldOut { .. }
            | Scheme::TestFlag
            | Scheme::LeaveBlockOut
            | Scheme::TrainOnAll => 1,
        }
    }

    /// Returns all folds in order; with stratified folds every sweep is a test sweep of exactly one of them.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Fold<'a>> + use<'a> {
        let folds = *self;
        (0..self.count()).map(move |number| folds.fold(number))
    }

    fn fold(&self, number: usize) -> Fold<'a> {
        let CheckedDataset { sweeps, scheme } = self.dataset;
        Fold::new(sweeps, *scheme, self.seed, 0, number)
            .unwrap_or_else(|error| panic!("a data set that was split once can be split: {error}"))
    }
}
