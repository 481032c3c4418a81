//! Offline classifier: a model with its label set.

use std::collections::BTreeSet;

use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use tactnet_data::{
    Dataset, LabelSet, Remedy, Seed, SweepShape, SweepView, TrainSplit, ValueRange, is_same_name,
};
use tactnet_models::{Architecture, InputShape, Network, NetworkConfig, Weights};

use crate::baseline::fitted::Baseline;
use crate::committee::fitted::Committee;
use crate::network::network_scorer::NetworkScorer;
use crate::{
    BaselineRecipe, DeadTaxels, Embedding, MemberConfig, NetworkRecipe, Normalizer, PipelineError,
    PipelineRemedy, Prediction, PredictionMethod, Predictions, SweepScore,
};

/// Configuration of a classifier: with the fitted weights, it rebuilds the classifier.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassifierConfig {
    /// Model that scores sweeps.
    pub model: ModelConfig,
    /// Materials in label order.
    pub labels: LabelSet,
    /// Shape of every sweep.
    pub shape: SweepShape,
    /// Sample rate of the training sweeps in Hz.
    pub sample_rate_hz: f64,
    /// True if the data does not name its rate, so that the default rate is assumed.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sample_rate_assumed: bool,
    /// Range of the values of the training sweeps; absent in runs of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<ValueRange>,
    /// Seed of the Monte Carlo masks.
    pub seed: Seed,
}

/// Model that scores sweeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ModelConfig {
    /// A network: TactNet-II or the spectral network.
    #[serde(rename = "tactnet2")]
    Network(NetworkSetup),
    /// Features and a classical classifier.
    #[serde(rename = "baseline")]
    Baseline(BaselineRecipe),
    /// Several models whose probabilities are averaged.
    #[serde(rename = "committee")]
    Committee(Vec<MemberConfig>),
}

/// Settings of a network and its fitted normaliser.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkSetup {
    /// Layers of the network.
    pub network: Architecture,
    /// Default prediction method.
    pub prediction: Prediction,
    /// Normaliser, fitted to the training sweeps.
    pub normalizer: Normalizer,
}

impl NetworkSetup {
    /// Returns the settings of `recipe`, with a normaliser fitted to the training sweeps.
    pub fn fit(recipe: &NetworkRecipe, train: &TrainSplit<'_>) -> Self {
        Self {
            network: recipe.network.clone(),
            prediction: recipe.prediction.clone(),
            normalizer: Normalizer::fit(recipe.input.scaling, recipe.input.levels, train),
        }
    }
}

impl ClassifierConfig {
    /// Returns the configuration for the sweep shape and materials of `train`'s data set.
    pub fn new(model: ModelConfig, train: &TrainSplit<'_>, seed: Seed) -> Self {
        let dataset = train.dataset();
        Self {
            model,
            labels: dataset.labels().clone(),
            shape: dataset.shape(),
            sample_rate_hz: dataset.sample_rate_hz(),
            sample_rate_assumed: dataset.is_rate_assumed(),
            values: ValueRange::of(train),
            seed,
        }
    }

    /// Succeeds if the model's settings match the sweeps and materials.
    ///
    /// # Errors
    /// A setting of the network that is out of range; sweeps too short for the features of a baseline.
    pub(crate) fn validate(&self) -> Result<(), PipelineError> {
        match &self.model {
            ModelConfig::Network(setup) => self.network_config(setup).map(drop),
            ModelConfig::Baseline(recipe) => recipe.features.check(self.shape, self.sample_rate_hz),
            ModelConfig::Committee(members) => members.iter().try_for_each(|member| {
                let model = member.model.clone();
                Self {
                    model,
                    ..self.clone()
                }
                .validate()
            }),
        }
    }

    /// Returns the validated configuration of a network for these sweeps and materials.
    ///
    /// # Errors
    /// A setting that is out of range.
    pub fn network_config(&self, setup: &NetworkSetup) -> Result<NetworkConfig, PipelineError> {
        let input = InputShape {
            steps: self.shape.steps,
            taxels: self.shape.taxels(),
        };
        Ok(NetworkConfig::new(
            setup.network.clone(),
            input,
            self.labels.len(),
        )?)
    }
}

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

    /// Predicts every sweep of `view`. Materials are matched by name, so their order is irrelevant and the classifier may know more.
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

    /// Returns the natural logarithms of the probabilities, `[sweeps][materials]`. The classifier need not know the sweeps' materials.
    ///
    /// # Errors
    /// Sweeps of another shape or rate; Monte Carlo dropout of a model without dropout.
    pub fn log_probabilities(
        &self,
        view: &SweepView<'_>,
        method: PredictionMethod,
    ) -> Result<Vec<Vec<f64>>, PipelineError> {
        self.check_shape(view)?;
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

    /// Returns the layer outputs of a network for every sweep of `view`. The classifier need not know the sweeps' materials.
    ///
    /// # Errors
    /// Sweeps of another shape or rate; a model that is not a network.
    pub fn embed(&self, view: &SweepView<'_>) -> Result<Embedding, PipelineError> {
        self.check_shape(view)?;
        Ok(self.scorer()?.embed(view))
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

    /// Returns the baseline; `None` for a network.
    pub(crate) fn baseline(&self) -> Option<&Baseline> {
        match &self.model {
            Model::Network(_) => None,
            Model::Baseline(baseline) => Some(baseline),
        }
    }

    /// Returns the compute device.
    pub(crate) fn device(&self) -> Device {
        match &self.model {
            Model::Network(network) => network.device().clone(),
            Model::Baseline(_) => Device::default(),
        }
    }

    /// Returns the name of a baseline's recipe, or "network".
    pub(crate) fn model_name(&self) -> String {
        match &self.config.model {
            ModelConfig::Network(_) => "network".into(),
            ModelConfig::Baseline(recipe) => recipe.name.clone(),
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
        self.check_shape(view)?;
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

    pub(crate) fn check_shape(&self, view: &SweepView<'_>) -> Result<(), PipelineError> {
        let (own, shape) = (view.shape(), self.config.shape);
        if own == shape {
            return self.check_rate(view.dataset());
        }
        let error = |cause: &str| {
            PipelineError::incompatible("sweeps", shape.to_string(), format!("{own}{cause}"))
        };
        Err(
            if own.steps == shape.steps && (own.rows, own.cols) == (shape.cols, shape.rows) {
                error("; rows and columns are probably exchanged: swap these two axes in the file")
            } else if own.steps == shape.taxels() && own.taxels() >= shape.steps {
                error(
                    "; steps and taxels are probably exchanged: a sweep has a row per frame and a column per taxel",
                )
            } else if own.taxels() == shape.taxels() && own.steps > shape.steps {
                error("").with_remedy(PipelineRemedy::Data(Remedy::KeepSteps {
                    steps: shape.steps,
                }))
            } else if (view.dataset().len(), own.steps, own.taxels())
                == (shape.steps, shape.rows, shape.cols)
            {
                error("; if the array `X` is a single sweep, save `X[None]`")
            } else if (shape.steps, shape.taxels()) == (own.steps, own.taxels()) {
                error("").with_remedy(PipelineRemedy::Data(Remedy::NameShape {
                    rows: shape.rows,
                    cols: shape.cols,
                }))
            } else {
                error("")
            },
        )
    }

    fn check_rate(&self, dataset: &Dataset) -> Result<(), PipelineError> {
        let (own, known) = (dataset.sample_rate_hz(), self.config.sample_rate_hz);
        if (own - known).abs() <= 1e-6 * known {
            return Ok(());
        }
        let hz = |rate: f64, assumed: bool| {
            let assumed = if assumed { ", which is assumed" } else { "" };
            format!("{rate} Hz{assumed}")
        };
        let expected = hz(known, self.config.sample_rate_assumed);
        let mut found = hz(own, dataset.is_rate_assumed());
        if dataset.is_rate_assumed() {
            found.push_str(" since the data does not name its rate");
        }
        let error = PipelineError::incompatible("sample rate", expected, found);
        Err(if dataset.is_rate_assumed() {
            error.with_remedy(PipelineRemedy::Data(Remedy::NameRate))
        } else if self.config.sample_rate_assumed {
            error.with_remedy(PipelineRemedy::TrainWithRate)
        } else {
            error
        })
    }
}
