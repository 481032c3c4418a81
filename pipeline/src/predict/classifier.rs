//! Offline classifier: a model with its label set.

use std::collections::BTreeSet;

use burn::tensor::Device;
use tactnet_data::{SweepView, is_same_name};
use tactnet_models::{Network, Weights, log_mean_exp_into};

use crate::baseline::fitted::Baseline;
use crate::committee::fitted::Committee;
use crate::network::network_scorer::NetworkScorer;
use crate::predict::long_sweeps::parts;
use crate::{
    ClassifierConfig, DeadTaxels, Embedding, ModelConfig, PipelineError, PipelineRemedy,
    PredictionMethod, Predictions, SweepScore,
};

/// Trained classifier.
pub struct Classifier {
    config: ClassifierConfig,
    model: Model,
}

enum Model {
    Network(Box<NetworkScorer>),
    Baseline(Box<Baseline>),
    Committee(Committee),
}

impl Classifier {
    /// Builds a classifier from configuration and weights; networks compute on `device`.
    ///
    /// # Errors
    /// Weights of another model.
    pub fn new(
        config: ClassifierConfig,
        weights: &Weights,
        device: &Device,
    ) -> Result<Self, PipelineError> {
        let model = match &config.model {
            ModelConfig::Network(setup) => {
                let network = config.network_config(setup)?;
                if !setup.normalizer.is_of(config.shape.taxels()) {
                    return Err(PipelineError::incompatible(
                        "scaling",
                        format!("numbers for {} taxels", config.shape.taxels()),
                        "another number of them",
                    ));
                }
                weights.check_finite()?;
                let scorer = NetworkScorer::new(setup, network, weights, device, config.seed)?;
                Model::Network(Box::new(scorer))
            }
            ModelConfig::Baseline(recipe) => {
                Model::Baseline(Box::new(Baseline::from_weights(recipe, &config, weights)?))
            }
            ModelConfig::Committee(members) => {
                Model::Committee(Committee::new(&config, members, weights, device)?)
            }
        };
        Ok(Self { config, model })
    }

    /// Masks dead taxels in all further predictions, in place of those masked before: networks see them as dropped taxels in training, zero
    /// after scaling; for baselines they read their training median.
    ///
    /// # Errors
    /// A taxel that does not exist; no taxel that remains; a baseline of an earlier version.
    pub fn mask(&mut self, dead: &[usize]) -> Result<(), PipelineError> {
        let taxels = self.config.shape.taxels();
        let dead: BTreeSet<usize> = dead.iter().copied().collect();
        let refused = |expected: String, found: String| {
            Err(PipelineError::Spec {
                setting: "dead",
                expected,
                found,
            })
        };
        if let Some(taxel) = dead.last().filter(|taxel| **taxel >= taxels) {
            let expected = format!("numbers from 0 to {}", taxels - 1);
            return refused(expected, taxel.to_string());
        }
        if dead.len() == taxels {
            return refused("a taxel that is not dead".into(), format!("all {taxels}"));
        }
        let dead: Vec<usize> = dead.into_iter().collect();
        match &mut self.model {
            Model::Network(network) => network.mask(&dead),
            Model::Baseline(baseline) => baseline.mask(&dead)?,
            Model::Committee(committee) => committee.mask(&dead)?,
        }
        Ok(())
    }

    /// Returns the masked taxels with their readings; of a committee, those of its first member.
    pub fn dead(&self) -> &DeadTaxels {
        match &self.model {
            Model::Network(network) => network.dead(),
            Model::Baseline(baseline) => &baseline.dead,
            Model::Committee(committee) => committee.members()[0].dead(),
        }
    }

    /// Returns the configuration that the classifier was built from.
    pub fn config(&self) -> &ClassifierConfig {
        &self.config
    }

    /// Returns true if the model has dropout and so supports [`PredictionMethod::McDropout`].
    pub fn has_dropout(&self) -> bool {
        match &self.model {
            Model::Network(_) => true,
            Model::Baseline(_) => false,
            Model::Committee(committee) => committee.members().iter().any(Self::has_dropout),
        }
    }

    /// Predicts every sweep of `view`; conditions that the data lacks are unknown, see [`ClassifierConfig::with_own_conditions`]. Materials are matched by name, so their order is irrelevant and the classifier may know more.
    ///
    /// The `mc_samples` Monte Carlo masks are drawn once from the classifier's seed. Mask `m` is the same draw of the weights for every sweep,
    /// so a sweep's score does not depend on its neighbours.
    ///
    /// # Errors
    /// Sweeps of another shape or rate; a material that the classifier does not know; Monte Carlo dropout of a model without dropout.
    pub fn predict(
        &self,
        view: &SweepView<'_>,
        method: PredictionMethod,
    ) -> Result<Predictions, PipelineError> {
        let dataset = self.config.with_own_conditions(view.dataset())?;
        let view = &view.of_same_sweeps(&dataset);
        let own_labels = self.own_labels(view)?;
        let sweeps = self
            .log_probabilities(view, method)?
            .into_iter()
            .enumerate()
            .map(|(position, log_probability)| SweepScore {
                index: view.indices()[position],
                label: own_labels[position],
                log_probability,
            })
            .collect();
        Ok(Predictions {
            labels: self.config.labels.clone(),
            method,
            sweeps,
        })
    }

    /// Returns the natural logarithms of the probabilities, `[sweeps][materials]`. The classifier need not know the sweeps' materials. The
    /// probabilities of a sweep that is longer than all training sweeps are the means over windows of their length, which overlap by half.
    ///
    /// # Errors
    /// Sweeps of another shape or rate; Monte Carlo dropout of a model without dropout.
    pub fn log_probabilities(
        &self,
        view: &SweepView<'_>,
        method: PredictionMethod,
    ) -> Result<Vec<Vec<f64>>, PipelineError> {
        let dataset = self.config.with_own_conditions(view.dataset())?;
        let view = &view.of_same_sweeps(&dataset);
        self.config.check_view(view)?;
        let longest = self.config.longest_trained();
        if view.lengths().all(|steps| steps <= longest) {
            return self.scores(view, method);
        }
        let mut windows = vec![Vec::new(); view.len()];
        for part in parts(view, longest) {
            for (position, row) in part.positions.iter().zip(self.scores(&part.view, method)?) {
                windows[*position].extend(row);
            }
        }
        let mean_row = |windows: &Vec<f64>| {
            let mut mean = vec![0.0; self.config.labels.len()];
            match windows.len() == mean.len() {
                true => mean.copy_from_slice(windows),
                false => log_mean_exp_into(windows, &mut mean),
            }
            mean
        };
        Ok(windows.iter().map(mean_row).collect())
    }

    /// Returns log-probabilities of sweeps that are not longer than the training sweeps.
    fn scores(
        &self,
        view: &SweepView<'_>,
        method: PredictionMethod,
    ) -> Result<Vec<Vec<f64>>, PipelineError> {
        if method != PredictionMethod::Plain && !self.has_dropout() {
            return Err(PipelineError::incompatible(
                "prediction",
                "plain prediction, since the model has no dropout",
                "a request for Monte Carlo dropout",
            ));
        }
        match &self.model {
            Model::Network(network) => {
                network.check_masks(method.mc_samples_or(0))?;
                Ok(network.log_probabilities(view, method))
            }
            Model::Baseline(baseline) => Ok(baseline.log_probabilities(view)),
            Model::Committee(committee) => committee.log_probabilities(view, method),
        }
    }

    /// Returns the layer outputs of a network for every sweep of `view`, averaged over windows as [`Classifier::log_probabilities`]. The
    /// classifier need not know the sweeps' materials.
    ///
    /// # Errors
    /// Sweeps of another shape or rate; a model that is not a network.
    pub fn embed(&self, view: &SweepView<'_>) -> Result<Embedding, PipelineError> {
        let dataset = self.config.with_own_conditions(view.dataset())?;
        let view = &view.of_same_sweeps(&dataset);
        self.config.check_view(view)?;
        let (scorer, longest) = (self.scorer()?, self.config.longest_trained());
        if view.lengths().all(|steps| steps <= longest) {
            return Ok(scorer.embed(view));
        }
        let parts = parts(view, longest);
        let embedded = parts
            .iter()
            .map(|part| (part.positions.as_slice(), scorer.embed(&part.view)));
        Ok(Embedding::mean_of(
            view.labels().collect(),
            embedded.collect(),
        ))
    }

    /// Returns the disagreement of `mc_samples` dropout masks about every sweep: mutual information of label and weights, in nats.
    ///
    /// # Errors
    /// A model that is not a network.
    pub fn mutual_information(
        &self,
        embedding: &Embedding,
        mc_samples: usize,
    ) -> Result<Vec<f64>, PipelineError> {
        let scorer = self.scorer()?;
        scorer.check_masks(mc_samples)?;
        Ok(scorer.mutual_information(&embedding.convolution, mc_samples))
    }

    /// Returns the number of multiply-adds of one prediction without dropout; `None` if it overflows, and for baselines and committees.
    ///
    /// # Errors
    /// A setting of the network that is out of range.
    pub fn multiply_adds(&self) -> Result<Option<u64>, PipelineError> {
        match &self.config.model {
            ModelConfig::Network(setup) => Ok(self.config.network_config(setup)?.multiply_adds()),
            ModelConfig::Baseline(_) | ModelConfig::Committee(_) => Ok(None),
        }
    }

    /// Returns the trained network.
    ///
    /// # Errors
    /// A model that is not a network.
    pub fn network(&self) -> Result<&Network, PipelineError> {
        Ok(self.scorer()?.net())
    }

    /// Returns the weights from which [`Classifier::new`] restores it.
    pub fn weights(&self) -> Weights {
        match &self.model {
            Model::Network(network) => network.net().weights(),
            Model::Baseline(baseline) => baseline.to_weights(),
            Model::Committee(committee) => committee.weights(),
        }
    }

    /// Returns the dropout masks of a Monte Carlo prediction for other runtimes, `[mc_samples][features]`.
    ///
    /// # Errors
    /// A model that is not a network.
    pub fn masks(&self, mc_samples: usize) -> Result<Vec<f32>, PipelineError> {
        let scorer = self.scorer()?;
        scorer.check_masks(mc_samples)?;
        Ok(scorer.mask_values(mc_samples))
    }

    pub(crate) fn scorer(&self) -> Result<&NetworkScorer, PipelineError> {
        match &self.model {
            Model::Network(network) => Ok(network),
            Model::Baseline(_) | Model::Committee(_) => Err(PipelineError::incompatible(
                "embedding",
                "none, since the model is not a network",
                "sweeps to embed",
            )),
        }
    }

    /// Returns the baseline; `None` for other models.
    pub(crate) fn baseline(&self) -> Option<&Baseline> {
        match &self.model {
            Model::Network(_) | Model::Committee(_) => None,
            Model::Baseline(baseline) => Some(baseline),
        }
    }

    /// Returns the committee; `None` for other models.
    pub(crate) fn committee(&self) -> Option<&Committee> {
        match &self.model {
            Model::Network(_) | Model::Baseline(_) => None,
            Model::Committee(committee) => Some(committee),
        }
    }

    /// Returns the compute device.
    pub(crate) fn device(&self) -> Device {
        match &self.model {
            Model::Network(network) => network.device().clone(),
            Model::Baseline(_) => Device::default(),
            Model::Committee(committee) => committee.members()[0].device(),
        }
    }

    /// Returns the name of a baseline's recipe, "network" or "committee".
    pub(crate) fn model_name(&self) -> String {
        match &self.config.model {
            ModelConfig::Network(_) => "network".into(),
            ModelConfig::Baseline(recipe) => recipe.name.clone(),
            ModelConfig::Committee(_) => "committee".into(),
        }
    }

    /// Splits the sweeps into those of known and those of unknown materials.
    pub fn by_known_material<'a>(&self, view: &SweepView<'a>) -> (SweepView<'a>, SweepView<'a>) {
        let dataset = view.dataset();
        let known: Vec<&str> = self.config.labels.names().collect();
        let is_known =
            |index: &usize| known.contains(&dataset.labels().name(dataset.records()[*index].label));
        let (inside, outside) = view.indices().iter().copied().partition(is_known);
        (
            SweepView::new(dataset, inside),
            SweepView::new(dataset, outside),
        )
    }

    /// Returns the classifier's own label of the material of every sweep.
    pub(crate) fn own_labels(&self, view: &SweepView<'_>) -> Result<Vec<usize>, PipelineError> {
        self.config.check_view(view)?;
        let own: Vec<&str> = self.config.labels.names().collect();
        let labels = view.dataset().labels();
        let found: Vec<Option<usize>> = labels
            .names()
            .map(|name| own.iter().position(|known| *known == name))
            .collect();
        (0..view.len())
            .map(|position| found[view.label(position)].ok_or_else(|| self.unknown_materials(view)))
            .collect()
    }

    /// Returns the error that names the unknown materials of `view`.
    fn unknown_materials(&self, view: &SweepView<'_>) -> PipelineError {
        let (_, unknown) = self.by_known_material(view);
        let labels = view.dataset().labels();
        let met: BTreeSet<usize> = (0..unknown.len()).map(|at| unknown.label(at)).collect();
        let some = |names: Vec<&str>, shown: usize, quote: &str| {
            let mut text: Vec<String> = names
                .iter()
                .take(shown)
                .map(|name| format!("{quote}{name}{quote}"))
                .collect();
            if names.len() > shown {
                text.push("…".into());
            }
            text.join(", ")
        };
        let meant = met.iter().find_map(|&label| {
            let name = labels.name(label);
            let known = self
                .config
                .labels
                .names()
                .find(|known| is_same_name(known, name))?;
            Some(format!(
                "; is `{name}` the `{known}` that it knows? Spell them alike"
            ))
        });
        let error = PipelineError::incompatible(
            "materials",
            format!(
                "some of {}",
                some(self.config.labels.names().collect(), 4, "")
            ),
            format!(
                "materials named {}, which it does not know{}",
                some(
                    met.iter().map(|&label| labels.name(label)).collect(),
                    3,
                    "`"
                ),
                meant.unwrap_or_default()
            ),
        );
        // Only networks can be extended by enrolment.
        error.with_remedy(match self.has_dropout() {
            true => PipelineRemedy::EnrollOrCalibrate,
            false => PipelineRemedy::Calibrate,
        })
    }
}
