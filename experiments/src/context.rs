//! Inputs of a question's task: data, recipe, device, seeds, and networks that survive an interruption.

use std::time::Instant;

use burn::tensor::Device;
use rand::Rng;
use tactnet_data::{Dataset, Seed, SweepView, TrainSplit};
use tactnet_pipeline::{
    BatchReport, Classifier, ClassifierConfig, Embedding, ModelConfig, ModelRecipe, NetworkRecipe,
    NetworkSetup, PipelineError, fit_model, train_network, train_siamese,
};

use crate::networks::FinishedNetworks;
use crate::{ExperimentError, Part};

/// Progress callback: receives the current step and each training batch, and returns false to stop.
pub(crate) type OnProgress<'a> = dyn Fn(&str, Option<&BatchReport>) -> bool + 'a;

/// Data, recipe, device and seeds of one task.
pub(crate) struct StudyContext<'a> {
    pub(crate) dataset: &'a Dataset,
    /// Name of the data in the recipe: `twin`, or a file.
    pub(crate) data: &'a str,
    pub(crate) model: &'a ModelRecipe,
    pub(crate) device: &'a Device,
    pub(crate) seed: Seed,
    pub(crate) part: Part,
    pub(crate) networks: &'a FinishedNetworks,
    pub(crate) on_progress: &'a OnProgress<'a>,
}

/// Reason why a task ended without an answer.
pub(crate) enum Cancelled {
    /// The progress callback asked to stop.
    Stopped,
    /// The task failed.
    Failed(ExperimentError),
}

impl<E: Into<PipelineError>> From<E> for Cancelled {
    fn from(error: E) -> Self {
        Self::Failed(ExperimentError::Pipeline(error.into()))
    }
}

impl<'a> StudyContext<'a> {
    /// Returns the recipe of the networks.
    ///
    /// # Panics
    /// If the model is not a network, which only questions with [`Ask::takes_baselines`](crate::questions::Ask) get.
    pub(crate) fn recipe(&self) -> &'a NetworkRecipe {
        match self.model {
            ModelRecipe::Network(recipe) => recipe,
            other => panic!("a network, not {}", other.name()),
        }
    }

    /// Reports the next step.
    ///
    /// # Errors
    /// [`Cancelled::Stopped`] if the progress callback asks to stop.
    pub(crate) fn say(&self, what: &str) -> Result<(), Cancelled> {
        if (self.on_progress)(what, None) {
            Ok(())
        } else {
            Err(Cancelled::Stopped)
        }
    }

    /// Returns a separate seed for each pair of name and number.
    pub(crate) fn seed_for(&self, name: &str, number: usize) -> Seed {
        Seed(self.seed.rng((name, number)).next_u64())
    }

    /// Fits the task's model to `train`. A network is loaded if an interrupted session of the task has already trained it.
    pub(crate) fn fitted(
        &self,
        what: &str,
        train: &TrainSplit<'_>,
        seed: Seed,
    ) -> Result<Classifier, Cancelled> {
        if let ModelRecipe::Network(_) = self.model {
            return self.trained(what, train, seed);
        }
        self.say(what)?;
        let go_on = |_: &_| (self.on_progress)(what, None);
        let fitted = fit_model(self.model, train, seed, self.device, go_on)?;
        fitted.map(|of| of.classifier).ok_or(Cancelled::Stopped)
    }

    /// Trains a network on `train`, or loads it if an interrupted session of the task has already trained it.
    pub(crate) fn trained(
        &self,
        what: &str,
        train: &TrainSplit<'_>,
        seed: Seed,
    ) -> Result<Classifier, Cancelled> {
        Ok(self.trained_in(what, train, seed)?.0)
    }

    /// Like [`Self::trained`], and also returns the training time in seconds; `None` if the network was loaded.
    pub(crate) fn trained_in(
        &self,
        what: &str,
        train: &TrainSplit<'_>,
        seed: Seed,
    ) -> Result<(Classifier, Option<f64>), Cancelled> {
        self.finished_or(what, train, seed, |on_progress| {
            train_network(self.recipe(), train, seed, self.device, on_progress)
        })
    }

    /// Like [`Self::trained`], but trains a Siamese network on pairs.
    pub(crate) fn trained_on_pairs(
        &self,
        what: &str,
        train: &TrainSplit<'_>,
        seed: Seed,
    ) -> Result<Classifier, Cancelled> {
        let (classifier, _) = self.finished_or(what, train, seed, |on_progress| {
            train_siamese(self.recipe(), train, seed, self.device, on_progress)
        })?;
        Ok(classifier)
    }

    fn finished_or(
        &self,
        what: &str,
        train: &TrainSplit<'_>,
        seed: Seed,
        fit: impl FnOnce(&dyn Fn(&BatchReport) -> bool) -> Result<Option<Classifier>, PipelineError>,
    ) -> Result<(Classifier, Option<f64>), Cancelled> {
        self.say(what)?;
        let network = self.networks.next(&format!(
            "{what}, seed {}, data {}, sweeps {:?}\n{}",
            seed.0,
            self.dataset.sha256(),
            train.indices(),
            self.recipe().to_toml()
        ));
        if let Some(weights) = network.read().map_err(Cancelled::Failed)? {
            let setup = NetworkSetup::fit(self.recipe(), train);
            let config = ClassifierConfig::new(ModelConfig::Network(setup), train, seed);
            return Ok((Classifier::new(config, &weights, self.device)?, None));
        }
        let on_progress = |batch: &BatchReport| (self.on_progress)(what, Some(batch));
        let begun = Instant::now();
        let classifier = fit(&on_progress)?.ok_or(Cancelled::Stopped)?;
        let seconds = begun.elapsed().as_secs_f64();
        network.write(&classifier).map_err(Cancelled::Failed)?;
        Ok((classifier, Some(seconds)))
    }
}

/// Returns the network's embedding of every sweep of `view`.
pub(crate) fn embedded(
    classifier: &Classifier,
    view: &SweepView<'_>,
) -> Result<Embedding, Cancelled> {
    Ok(classifier.embed(view)?)
}
