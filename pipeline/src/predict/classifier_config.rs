//! Configuration of a classifier, and the sweeps that it can predict.

use serde::{Deserialize, Serialize};
use tactnet_data::{
    Dataset, LabelSet, Remedy, Seed, SweepShape, SweepView, TrainSplit, ValueRange,
};
use tactnet_models::{Architecture, InputShape, NetworkConfig, Trunk, default_window};

use crate::{
    BaselineRecipe, MemberConfig, NetworkRecipe, Normalizer, PipelineError, PipelineRemedy,
    Prediction, TrainedConditions,
};

/// Configuration of a classifier: with the fitted weights, it rebuilds the classifier.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassifierConfig {
    /// Model that scores sweeps.
    pub model: ModelConfig,
    /// Materials in label order.
    pub labels: LabelSet,
    /// Shape of every sweep of the data set including conditions, or of the longest if their lengths differ.
    pub shape: SweepShape,
    /// Lengths of the training sweeps; absent if all sweeps of the data set have one length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trained_steps: Option<StepRange>,
    /// Sample rate of the training sweeps in Hz.
    pub sample_rate_hz: f64,
    /// True if the data does not name its rate, so that the default rate is assumed.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sample_rate_assumed: bool,
    /// Range of the values of the training sweeps; absent in runs of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<ValueRange>,
    /// Conditions of the training sweeps, which are the last columns of every sweep.
    #[serde(default, skip_serializing_if = "TrainedConditions::is_empty")]
    pub conditions: TrainedConditions,
    /// Seed of the Monte Carlo masks.
    pub seed: Seed,
}

/// Lengths of some sweeps, in steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepRange {
    /// Length of the shortest sweep.
    pub shortest: usize,
    /// Length of the longest sweep.
    pub longest: usize,
}

impl StepRange {
    /// Returns the lengths of the training sweeps; `None` if all sweeps of the data set have one length.
    fn of_unequal(train: &TrainSplit<'_>) -> Option<Self> {
        train.dataset().lengths()?;
        Some(Self {
            shortest: train.lengths().min()?,
            longest: train.longest(),
        })
    }
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
    /// Returns the settings of `recipe`, with a normaliser fitted to the training sweeps. If sweeps differ in length, the windows of spectra are
    /// those of the shortest training sweep, unless the recipe names them.
    pub fn fit(recipe: &NetworkRecipe, train: &TrainSplit<'_>) -> Self {
        let mut network = recipe.network.clone();
        let trained = StepRange::of_unequal(train);
        if let (Some(trained), Trunk::Spectra(spectra)) = (trained, &mut network.trunk) {
            spectra
                .window
                .get_or_insert(default_window(trained.shortest));
        }
        Self {
            network,
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
            trained_steps: StepRange::of_unequal(train),
            sample_rate_hz: dataset.sample_rate_hz(),
            sample_rate_assumed: dataset.is_rate_assumed(),
            values: ValueRange::of(train),
            conditions: TrainedConditions::of(train),
            seed,
        }
    }

    /// Succeeds if the model's settings match the sweeps and materials.
    ///
    /// # Errors
    /// A setting of the network that is out of range; sweeps too short for the features of a baseline.
    pub(crate) fn validate(&self) -> Result<(), PipelineError> {
        let trained = self.trained_steps.map(|trained| trained.shortest);
        self.check_length(trained.unwrap_or(self.shape.steps))
    }

    /// Returns the number of steps of the longest training sweep.
    pub fn longest_trained(&self) -> usize {
        let trained = self.trained_steps.map(|trained| trained.longest);
        trained.unwrap_or(self.shape.steps)
    }

    /// Succeeds if the model can classify sweeps of `steps` steps.
    ///
    /// # Errors
    /// Sweeps that are too short for the model; a setting of the network that is out of range.
    pub(crate) fn check_length(&self, steps: usize) -> Result<(), PipelineError> {
        let shape = SweepShape {
            steps,
            ..self.shape
        };
        let least = match &self.model {
            ModelConfig::Network(setup) => self.network_config(setup)?.least_steps(),
            ModelConfig::Baseline(recipe) => {
                return recipe.features.check(shape, self.sample_rate_hz);
            }
            ModelConfig::Committee(members) => {
                return members.iter().try_for_each(|member| {
                    let model = member.model.clone();
                    let own = Self {
                        model,
                        ..self.clone()
                    };
                    own.check_length(steps)
                });
            }
        };
        if steps >= least {
            return Ok(());
        }
        let expected = format!("at least {least} steps, a window of the network");
        let found = format!("{steps} steps");
        Err(PipelineError::incompatible("sweeps", expected, found))
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

impl ClassifierConfig {
    /// Succeeds if the classifier can predict the sweeps of a view.
    ///
    /// # Errors
    /// Sweeps of another shape or rate, or too short for the model.
    pub(crate) fn check_view(&self, view: &SweepView<'_>) -> Result<(), PipelineError> {
        let (own, shape) = (view.shape(), self.shape);
        let unequal = self.trained_steps.is_some() || view.dataset().lengths().is_some();
        if own == shape && !unequal {
            return self.check_rate(view.dataset());
        }
        if unequal && (own.rows, own.cols) == (shape.rows, shape.cols) {
            return self.check_lengths(view);
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

    /// Succeeds if sweeps of unequal length can be classified: any length after training on unequal lengths, otherwise those of the training
    /// sweeps and longer.
    fn check_lengths(&self, view: &SweepView<'_>) -> Result<(), PipelineError> {
        self.check_rate(view.dataset())?;
        let lengths = view.lengths().enumerate();
        let Some((position, shortest)) = lengths.min_by_key(|(_, steps)| *steps) else {
            return Ok(());
        };
        let trained = self.shape.steps;
        if self.trained_steps.is_none() && shortest < trained {
            let expected = format!("at least {trained} steps, as all training sweeps");
            let sweep = view.dataset().describe(view.indices()[position]);
            let found = format!("{shortest} steps of {sweep}");
            return Err(PipelineError::incompatible("sweeps", expected, found));
        }
        self.check_length(shortest)
    }

    fn check_rate(&self, dataset: &Dataset) -> Result<(), PipelineError> {
        let (own, known) = (dataset.sample_rate_hz(), self.sample_rate_hz);
        if (own - known).abs() <= 1e-6 * known {
            return Ok(());
        }
        let hz = |rate: f64, assumed: bool| {
            let assumed = if assumed { ", which is assumed" } else { "" };
            format!("{rate} Hz{assumed}")
        };
        let expected = hz(known, self.sample_rate_assumed);
        let mut found = hz(own, dataset.is_rate_assumed());
        if dataset.is_rate_assumed() {
            found.push_str(" since the data does not name its rate");
        }
        let error = PipelineError::incompatible("sample rate", expected, found);
        Err(if dataset.is_rate_assumed() {
            error.with_remedy(PipelineRemedy::Data(Remedy::NameRate))
        } else if self.sample_rate_assumed {
            error.with_remedy(PipelineRemedy::TrainWithRate)
        } else {
            error
        })
    }
}
