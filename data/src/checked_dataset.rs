//! A data set that was checked, and the folds that it falls into.

use std::ops::Deref;
use std::path::Path;

use crate::format::Format;
use crate::twin::{self, TwinConfig};
use crate::{DataError, Dataset, Fold, Scheme, Seed, format, refuse_errors};

/// Sweeps with their materials, checked and ready to be split.
///
/// Dereferences to [`Dataset`], which has names, shape, rate and values.
#[derive(Debug, Clone)]
pub struct CheckedDataset {
    sweeps: Dataset,
    scheme: Scheme,
}

impl CheckedDataset {
    /// Reads a file or folder in any of the formats of [`mod@crate::format`].
    ///
    /// # Errors
    /// No such file, or one that is damaged; values that cannot be trained on; a material with fewer than two sweeps.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, DataError> {
        format::read(path.as_ref())?.try_into()
    }

    /// Generates the synthetic twin of TactMat.
    ///
    /// # Errors
    /// A setting out of range; fewer than two sweeps of a material.
    pub fn twin(config: &TwinConfig) -> Result<Self, DataError> {
        twin::generate(config)?.try_into()
    }

    /// Writes a file, in the format that its extension names: `.h5`, `.npz`, `.ts`.
    ///
    /// # Errors
    /// Another extension; a file that cannot be written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), DataError> {
        let path = path.as_ref();
        Format::from_extension(path)?.write(path, &self.sweeps)
    }

    /// Returns the ways to split the sweeps into training and test sweeps: the author's own split where the file has one, else five
    /// stratified folds, or as many as the material with the fewest sweeps has.
    ///
    /// - `seed`: decides which sweep falls into which fold
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
        refuse_errors(&sweeps, sweeps.name())?;
        let scheme = Scheme::default_for(&sweeps);
        // What can be split once can be split by any seed: the number of sweeps decides.
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

/// The folds of a data set.
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

    /// Returns how many folds there are.
    pub fn count(&self) -> usize {
        match self.dataset.scheme {
            Scheme::StratifiedKFold { folds, .. } => folds,
            Scheme::HoldOut { .. }
            | Scheme::TestFlag
            | Scheme::LeaveBlockOut
            | Scheme::TrainOnAll => 1,
        }
    }

    /// Returns the folds one after the other; every sweep is a test sweep of one of them.
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
