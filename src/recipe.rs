//! Settings of a classifier.

use std::path::Path;

use tactnet_data::{Seed, TrainSplit, known_names};
use tactnet_models::Compute;
use tactnet_pipeline::{BatchReport, MeanRemoval, ModelRecipe, TrainJob, TrainSpec};

use crate::{Classifier, Error};

/// Settings of a classifier, either a network or a baseline.
///
/// # Example
/// ```
/// use tactnet::{MeanRemoval, Recipe, Seed};
///
/// let recipe = Recipe::named("fast")?.seed(Seed(7)).epochs(3).mean_removal(MeanRemoval::PerSweep);
/// assert_ne!(recipe, Recipe::named("fast")?);
/// # Ok::<(), tactnet::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    spec: TrainSpec,
}

impl Recipe {
    /// Returns a built-in recipe: `spectra`, `fast`, `thesis`, `robust`, `knn-l`, `knn-h`, `svm-l`, `svm-h`, `minirocket`,
    /// `multirocket-hydra`, `quant`, `lda`, `svm-spectra`, `means`.
    ///
    /// # Errors
    /// Fails for an unknown name.
    ///
    /// # Example
    /// ```
    /// use tactnet::Recipe;
    ///
    /// assert!(Recipe::named("lda").is_ok());
    /// assert!(Recipe::named("nothing").is_err());
    /// ```
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
    /// Fails if the file cannot be read, a field is unknown, or a setting is out of range.
    ///
    /// # Example
    /// ```no_run
    /// let recipe = tactnet::Recipe::read("my.toml")?;
    /// # Ok::<(), tactnet::Error>(())
    /// ```
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

    /// Sets the seed of every random choice: initial weights, order, dropout, kernels. The default is 1.
    ///
    /// # Example
    /// ```
    /// use tactnet::Recipe;
    ///
    /// let recipe = Recipe::named("fast")?.seed(tactnet::Seed(7));
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn seed(mut self, seed: Seed) -> Self {
        self.spec.seed = seed;
        self
    }

    /// Sets the number of training epochs of a network.
    ///
    /// # Example
    /// ```
    /// use tactnet::Recipe;
    ///
    /// let recipe = Recipe::named("fast")?.epochs(3);
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn epochs(mut self, epochs: usize) -> Self {
        self.spec.epochs = Some(epochs);
        self
    }

    /// Sets the removal of each taxel's mean over a sweep.
    ///
    /// # Example
    /// ```
    /// use tactnet::Recipe;
    ///
    /// let recipe = Recipe::named("fast")?.mean_removal(tactnet::MeanRemoval::PerSweep);
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn mean_removal(mut self, removal: MeanRemoval) -> Self {
        self.spec.mean_removal = Some(removal);
        self
    }

    /// Sets the compute device of networks. The default is the processor.
    ///
    /// # Example
    /// ```
    /// use tactnet::Recipe;
    ///
    /// let recipe = Recipe::named("fast")?.device(tactnet::Compute::Cpu);
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn device(mut self, device: Compute) -> Self {
        self.spec.device = device;
        self
    }

    /// Fits a classifier to training sweeps.
    ///
    /// # Errors
    /// Fails if a setting is out of range, if the sweeps are too short or too few for the model, or if training diverges.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("means")?.fit(&fold.train)?;
    /// assert_eq!(classifier.materials().count(), 3);
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn fit(&self, train: &TrainSplit<'_>) -> Result<Classifier, Error> {
        let fitted = self.fit_while(train, |_| true)?;
        Ok(fitted.unwrap_or_else(|| panic!("training was not stopped")))
    }

    /// Fits a classifier and calls `go_on` after every training batch of a network. If it returns false, training stops without a
    /// classifier and the result is `None`.
    ///
    /// # Errors
    /// Fails as [`Recipe::fit`] does.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let stopped = Recipe::named("fast")?.fit_while(&fold.train, |_| false)?;
    /// assert!(stopped.is_none());
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn fit_while(
        &self,
        train: &TrainSplit<'_>,
        go_on: impl FnMut(&BatchReport) -> bool,
    ) -> Result<Option<Classifier>, Error> {
        Classifier::fit(&TrainJob::try_from(self.spec.clone())?, train, go_on)
    }
}
