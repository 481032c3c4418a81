//! How a classifier comes about.

use std::path::Path;

use tactnet_data::{Seed, TrainSplit, known_names};
use tactnet_models::Compute;
use tactnet_pipeline::{BatchReport, MeanRemoval, ModelRecipe, TrainJob, TrainSpec};

use crate::{Classifier, Error};

/// Settings of a classifier of any kind, ready to be fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    spec: TrainSpec,
}

impl Recipe {
    /// Returns a recipe that comes with the library: `spectra`, `fast`, `thesis`, `knn-l`, `knn-h`, `svm-l`, `svm-h`, `minirocket`,
    /// `multirocket-hydra`, `lda`, `svm-spectra`, `means`.
    ///
    /// # Errors
    /// Another name.
    pub fn named(name: &str) -> Result<Self, Error> {
        if !ModelRecipe::built_in_names().any(|known| known == name) {
            return Err(Error::UnknownRecipe {
                name: name.into(),
                known: known_names(name, ModelRecipe::built_in_names()),
            });
        }
        Self::of(name)
    }

    /// Reads a recipe from a TOML file.
    ///
    /// # Errors
    /// A file that cannot be read; an unknown field or a setting out of range.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::of(&path.as_ref().to_string_lossy())
    }

    fn of(recipe: &str) -> Result<Self, Error> {
        let spec = TrainSpec {
            recipe: recipe.into(),
            ..TrainSpec::default()
        };
        TrainJob::try_from(spec.clone())?;
        Ok(Self { spec })
    }

    /// Sets the seed of every random choice: initial weights, order, dropout, kernels. At first 1.
    pub fn seed(mut self, seed: Seed) -> Self {
        self.spec.seed = seed;
        self
    }

    /// Sets how often a network sees every training sweep, instead of the recipe's number.
    pub fn epochs(mut self, epochs: usize) -> Self {
        self.spec.epochs = Some(epochs);
        self
    }

    /// Sets whether each taxel's mean over a sweep is removed, instead of what the recipe says.
    pub fn mean_removal(mut self, removal: MeanRemoval) -> Self {
        self.spec.mean_removal = Some(removal);
        self
    }

    /// Sets where networks compute; at first the processor.
    pub fn device(mut self, device: Compute) -> Self {
        self.spec.device = device;
        self
    }

    /// Fits a classifier to training sweeps.
    ///
    /// # Errors
    /// A setting out of range; sweeps that are too short or too few for the model; a loss or a solver that fails.
    pub fn fit(&self, train: &TrainSplit<'_>) -> Result<Classifier, Error> {
        let fitted = self.fit_while(train, |_| true)?;
        Ok(fitted.unwrap_or_else(|| panic!("nobody asked to stop")))
    }

    /// The same, with a look at every batch of a network's training. Returns `None` if `go_on` said no; the work is then lost.
    ///
    /// # Errors
    /// As [`Recipe::fit`].
    pub fn fit_while(
        &self,
        train: &TrainSplit<'_>,
        go_on: impl FnMut(&BatchReport) -> bool,
    ) -> Result<Option<Classifier>, Error> {
        Classifier::fit(&TrainJob::try_from(self.spec.clone())?, train, go_on)
    }
}
