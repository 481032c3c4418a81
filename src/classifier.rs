//! A fitted classifier, in memory and in a folder.

use std::path::Path;

use tactnet_data::{SplitManifest, SweepShape, SweepView, TrainSplit};
use tactnet_models::Weights;
use tactnet_pipeline::{
    BatchReport, Calibration, ClassifierConfig, ModelConfig, ModelRecipe, NoveltyScore,
    NoveltyScorer, OnlineClassifier, PredictionMethod, Predictions, Provenance, RunConfig, RunDir,
    Thresholds, TrainEmbeddings, TrainJob, TrainSpec, fit_baseline, train_network,
};

use crate::Error;

/// A fitted classifier: materials, model and numbers.
pub struct Classifier {
    fitted: tactnet_pipeline::Classifier,
    config: RunConfig,
    split: SplitManifest,
    weights: Weights,
    /// Of networks: what their output layer saw of the training sweeps, for enrolment.
    embeddings: Option<TrainEmbeddings>,
    calibration: Option<Calibration>,
}

impl Classifier {
    pub(crate) fn fit(
        job: &TrainJob,
        train: &TrainSplit<'_>,
        go_on: impl FnMut(&BatchReport) -> bool,
    ) -> Result<Option<Self>, Error> {
        let (spec, device) = (job.spec(), job.device());
        let (fitted, weights) = match job.recipe() {
            ModelRecipe::Network(recipe) => {
                let Some(fitted) = train_network(recipe, train, spec.seed, device, go_on)? else {
                    return Ok(None);
                };
                let weights = fitted.network()?.weights();
                (fitted, weights)
            }
            ModelRecipe::Baseline(recipe) => {
                let weights = fit_baseline(recipe, train, spec.seed, |_| {})?.weights;
                let model = ModelConfig::Baseline(recipe.clone());
                let config = ClassifierConfig::new(model, train, spec.seed);
                let fitted = tactnet_pipeline::Classifier::new(config, &weights, device)?;
                (fitted, weights)
            }
        };
        let embeddings = match job.recipe() {
            ModelRecipe::Network(_) => Some(TrainEmbeddings::of(&fitted.embed(train)?)),
            ModelRecipe::Baseline(_) => None,
        };
        let config = RunConfig {
            schema_version: RunConfig::SCHEMA_VERSION,
            spec: TrainSpec {
                data: train.dataset().name().into(),
                ..spec.clone()
            },
            data_sha256: train.dataset().sha256().into(),
            recipe: job.recipe().clone(),
            classifier: fitted.config().clone(),
        };
        Ok(Some(Self {
            fitted,
            config,
            split: train.manifest()?,
            weights,
            embeddings,
            calibration: None,
        }))
    }

    /// Opens a folder that [`Classifier::save`], `tactnet train` or `tactnet enroll` made.
    ///
    /// # Errors
    /// No classifier there, or a damaged one; a training that has not come to its end.
    pub fn load(folder: impl AsRef<Path>) -> Result<Self, Error> {
        let run = RunDir::open(folder.as_ref())?;
        let (config, weights) = (run.config()?, run.final_weights()?);
        let device = config.spec.device.open()?;
        let fitted =
            tactnet_pipeline::Classifier::new(config.classifier.clone(), &weights, &device)?;
        let embeddings = match &config.classifier.model {
            ModelConfig::Network(_) => Some(run.train_embeddings()?),
            ModelConfig::Baseline(_) => None,
        };
        Ok(Self {
            fitted,
            split: run.split()?,
            weights,
            embeddings,
            calibration: run.calibration()?,
            config,
        })
    }

    /// Saves everything that a prediction needs into a new folder, which the command line opens too.
    ///
    /// # Errors
    /// A folder that holds anything already; a file that cannot be written.
    pub fn save(&self, folder: impl AsRef<Path>) -> Result<(), Error> {
        let program = Provenance::of_this_process(env!("CARGO_PKG_VERSION"), env!("TACTNET_GIT"));
        let run = RunDir::create(folder.as_ref(), &self.config, &self.split, &program)?;
        if let Some(calibration) = &self.calibration {
            run.write_calibration(calibration)?;
        }
        match &self.embeddings {
            Some(embeddings) => {
                run.write_train_embeddings(embeddings)?;
                run.write_weights(&self.weights)?;
            }
            None => run.write_baseline(&self.weights)?,
        }
        Ok(())
    }

    /// Returns the names of the materials, in the order of their labels.
    pub fn materials(&self) -> impl Iterator<Item = &str> {
        self.fitted.config().labels.names()
    }

    /// Scores every sweep of `view` the recipe's own way. Materials are found by their names, in whatever order.
    ///
    /// # Errors
    /// Sweeps of another shape or rate, or of a material that the classifier does not know.
    pub fn predict(&self, view: &SweepView<'_>) -> Result<Predictions, Error> {
        self.fitted.predict(view, self.config.recipe.method())
    }

    /// Returns `[sweeps][materials]`, the natural log of the probabilities, the recipe's own way; the sweeps may be of any material.
    ///
    /// # Errors
    /// Sweeps of another shape or rate.
    pub fn log_probabilities(&self, view: &SweepView<'_>) -> Result<Vec<Vec<f64>>, Error> {
        let method = self.config.recipe.method();
        self.fitted.log_probabilities(view, method)
    }

    /// Returns a score for each sweep that is larger the less it is like a known material: the mutual information of material and dropout
    /// masks, nats (Gal & Ghahramani, 2016).
    ///
    /// # Errors
    /// Sweeps of another shape or rate; a model that is no network.
    pub fn unknown_scores(&self, view: &SweepView<'_>) -> Result<Vec<f64>, Error> {
        let embedding = self.fitted.embed(view)?;
        let scorer = NoveltyScorer::fit(&self.fitted, self.embeddings()?)?;
        scorer.score(NoveltyScore::BEST, &embedding)
    }

    /// Returns a classifier that knows one material more, from a few sweeps; see [`tactnet_pipeline::enroll`].
    ///
    /// - `sweeps`: of the new material alone, whatever their label in their data set
    ///
    /// # Errors
    /// A name that is known already; sweeps of another shape or rate; a model that is no network.
    pub fn enroll(&self, material: &str, sweeps: &SweepView<'_>) -> Result<Self, Error> {
        let thresholds = self.calibration.clone().map(|calibration| Thresholds {
            calibration,
            held_out: None,
        });
        let enrolled = tactnet_pipeline::enroll(
            &self.fitted,
            self.embeddings()?,
            thresholds.as_ref(),
            sweeps,
            material,
        )?;
        let device = self.config.spec.device.open()?;
        Ok(Self {
            fitted: tactnet_pipeline::Classifier::new(
                enrolled.config.clone(),
                &enrolled.weights,
                &device,
            )?,
            config: RunConfig {
                classifier: enrolled.config,
                ..self.config.clone()
            },
            split: self.split.clone(),
            weights: enrolled.weights,
            embeddings: Some(enrolled.known),
            calibration: enrolled.calibration,
        })
    }

    fn embeddings(&self) -> Result<&TrainEmbeddings, Error> {
        self.fitted.network()?;
        let known = self.embeddings.as_ref();
        Ok(known.unwrap_or_else(|| panic!("a network keeps what it saw")))
    }

    /// Returns the shape of the sweeps that it was fitted to.
    pub fn shape(&self) -> SweepShape {
        self.fitted.config().shape
    }

    /// Returns their frames per second, and whether that is assumed.
    pub fn sample_rate_hz(&self) -> (f64, bool) {
        let config = self.fitted.config();
        (config.sample_rate_hz, config.sample_rate_assumed)
    }

    /// Returns the same classifier for one sweep as it happens, frame by frame, with as many Monte Carlo samples as the recipe asks for.
    ///
    /// # Errors
    /// A model that needs whole sweeps: a baseline, or a network that removes each taxel's mean.
    pub fn online(&self) -> Result<OnlineClassifier, Error> {
        let mc_samples = match self.config.recipe.method() {
            PredictionMethod::Plain => 0,
            PredictionMethod::McDropout { mc_samples } => mc_samples,
        };
        let calibration = self.calibration.clone();
        OnlineClassifier::new(&self.fitted, calibration, mc_samples)
    }
}
