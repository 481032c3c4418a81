//! A fitted classifier, in memory and as a folder.

use std::path::Path;

use tactnet_data::{SplitManifest, SweepShape, SweepView, TrainSplit};
use tactnet_models::Weights;
use tactnet_pipeline::{
    Adaptation, BatchReport, Calibration, Enrolled, FittedModel, FormerSweeps, LeftOutMember,
    Likeness, LikenessReport, ModelConfig, ModelRecipe, NewSweeps, OnlineClassifier,
    PredictionMethod, Predictions, Provenance, RiskPolicy, RunConfig, RunDir, Thresholds,
    TrainEmbeddings, TrainJob, TrainSpec, enroll_into_committee, fit_model, novelty_scores,
};

use crate::Error;

/// A fitted classifier: materials, model and weights.
///
/// [`Recipe::fit`](crate::Recipe::fit) creates one.
pub struct Classifier {
    fitted: tactnet_pipeline::Classifier,
    config: RunConfig,
    split: SplitManifest,
    weights: Weights,
    /// Embeddings of the training sweeps, for enrolment; `None` for baselines and committees.
    embeddings: Option<TrainEmbeddings>,
    calibration: Option<Calibration>,
    /// Description of the training sweeps; `None` if they are few.
    likeness: Option<Likeness>,
    /// Adaptations after training, in order.
    adaptations: Vec<Adaptation>,
}

impl Classifier {
    pub(crate) fn fit(
        job: &TrainJob,
        train: &TrainSplit<'_>,
        go_on: impl FnMut(&BatchReport) -> bool,
    ) -> Result<Option<Self>, Error> {
        let (spec, device) = (job.spec(), job.device());
        let Some(fitted) = fit_model(job.recipe(), train, spec.seed, device, go_on)? else {
            return Ok(None);
        };
        let FittedModel {
            classifier: fitted,
            weights,
        } = fitted;
        let embeddings = match job.recipe() {
            ModelRecipe::Network(_) => Some(TrainEmbeddings::of(&fitted.embed(train)?)),
            ModelRecipe::Baseline(_) | ModelRecipe::Committee(_) => None,
        };
        let config = RunConfig {
            schema_version: RunConfig::SCHEMA_VERSION,
            spec: TrainSpec {
                data: train.dataset().name().into(),
                lengths: spec.lengths_in(train.dataset()),
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
            likeness: Likeness::fit(train, spec.seed)?,
            adaptations: Vec::new(),
        }))
    }

    /// Loads a run directory that [`Classifier::save`] or the command line wrote.
    ///
    /// # Errors
    /// Fails if the folder holds no classifier, a damaged one, or an unfinished training.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let folder = tempfile::tempdir().unwrap();
    /// let path = folder.path().join("classifier");
    /// Recipe::named("means")?.fit(&fold.train)?.save(&path)?;
    /// let classifier = tactnet::Classifier::load(&path)?;
    /// assert_eq!(classifier.materials().count(), 3);
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn load(folder: impl AsRef<Path>) -> Result<Self, Error> {
        let run = RunDir::open(folder.as_ref())?;
        let (config, weights) = (run.config()?, run.final_weights()?);
        let device = config.spec.device.open()?;
        let fitted =
            tactnet_pipeline::Classifier::new(config.classifier.clone(), &weights, &device)?;
        let embeddings = match &config.classifier.model {
            ModelConfig::Network(_) => Some(run.train_embeddings()?),
            ModelConfig::Baseline(_) | ModelConfig::Committee(_) => None,
        };
        Ok(Self {
            fitted,
            split: run.split()?,
            weights,
            embeddings,
            calibration: run.calibration()?,
            likeness: run.likeness()?,
            adaptations: run.adaptations()?,
            config,
        })
    }

    /// Saves everything that a prediction needs into a new folder, a run directory of the command line.
    ///
    /// # Errors
    /// Fails if the folder is not empty or a file cannot be written.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let folder = tempfile::tempdir().unwrap();
    /// let classifier = Recipe::named("means")?.fit(&fold.train)?;
    /// classifier.save(folder.path().join("classifier"))?;
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn save(&self, folder: impl AsRef<Path>) -> Result<(), Error> {
        let program = Provenance::of_this_process(env!("CARGO_PKG_VERSION"), env!("TACTNET_GIT"));
        let run = RunDir::create(folder.as_ref(), &self.config, &self.split, &program)?;
        if let Some(calibration) = &self.calibration {
            run.write_calibration(calibration)?;
        }
        if let Some(likeness) = &self.likeness {
            run.write_likeness(likeness)?;
        }
        if !self.adaptations.is_empty() {
            run.write_adaptations(&self.adaptations)?;
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

    /// Returns the names of the materials, by label.
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
    pub fn materials(&self) -> impl Iterator<Item = &str> {
        self.fitted.config().labels.names()
    }

    /// Predicts the material of every sweep of `view` with the recipe's method and compares it with the label. Materials are matched by
    /// name.
    ///
    /// # Errors
    /// Fails for sweeps of another shape or sample rate, or of an unknown material.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("means")?.fit(&fold.train)?;
    /// let accuracy = classifier.predict(&fold.test)?.accuracy();
    /// assert!((0.0..=1.0).contains(&accuracy));
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn predict(&self, view: &SweepView<'_>) -> Result<Predictions, Error> {
        self.fitted.predict(view, self.config.recipe.method())
    }

    /// Returns `[sweeps][materials]`: natural logarithms of the probabilities, by the recipe's method. The labels of the sweeps are
    /// ignored.
    ///
    /// # Errors
    /// Fails for sweeps of another shape or sample rate.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("means")?.fit(&fold.train)?;
    /// let log_p = classifier.log_probabilities(&fold.test)?;
    /// assert_eq!(log_p[0].len(), 3);
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn log_probabilities(&self, view: &SweepView<'_>) -> Result<Vec<Vec<f64>>, Error> {
        let method = self.config.recipe.method();
        self.fitted.log_probabilities(view, method)
    }

    /// Returns the novelty score of each sweep: of a network the mutual information of material and dropout masks in nats (Gal &
    /// Ghahramani, 2016), of a committee the negative logarithm of its largest probability. Larger scores mean less similarity to the
    /// known materials.
    ///
    /// # Errors
    /// Fails for sweeps of another shape or sample rate, and for baselines.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("fast")?.epochs(1).fit(&fold.train)?;
    /// let scores = classifier.unknown_scores(&fold.test)?;
    /// assert_eq!(scores.len(), fold.test.len());
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn unknown_scores(&self, view: &SweepView<'_>) -> Result<Vec<f64>, Error> {
        novelty_scores(&self.fitted, self.embeddings.as_ref(), view)
    }

    /// Compares sweeps with the training sweeps, whatever their labels; `None` if the classifier was trained on fewer than 20 sweeps, or by
    /// an earlier version.
    ///
    /// # Errors
    /// Fails for sweeps of another shape.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 20, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("means")?.fit(&fold.train)?;
    /// let report = classifier.likeness(&fold.test)?.unwrap();
    /// assert_eq!(report.p_of_sweeps.len(), fold.test.len());
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn likeness(&self, view: &SweepView<'_>) -> Result<Option<LikenessReport>, Error> {
        let config = self.fitted.config();
        let dataset = config.with_own_conditions(view.dataset())?;
        let view = &view.of_same_sweeps(&dataset);
        if view.shape() != config.shape {
            return Err(Error::incompatible(
                "sweeps",
                config.shape.to_string(),
                view.shape().to_string(),
            ));
        }
        let likeness = self.likeness.as_ref();
        Ok(likeness.map(|likeness| likeness.assess(view, config.seed)))
    }

    /// Returns a classifier with one more material, from a few sweeps; see [`tactnet_pipeline::enroll`].
    ///
    /// - `sweeps`: sweeps of the new material; their label is ignored
    ///
    /// # Errors
    /// Fails if the name exists, for sweeps of another shape or sample rate, and for baselines and committees, which need
    /// [`enroll_with`](Self::enroll_with) or training.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("fast")?.epochs(1).fit(&fold.train)?;
    /// let extended = classifier.enroll("new felt", &fold.test)?;
    /// assert_eq!(extended.materials().last(), Some("new felt"));
    /// # Ok::<(), tactnet::Error>(())
    /// ```
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
        self.grown(enrolled, sweeps)
    }

    /// Returns a committee with one more material, from a few sweeps. Its networks learn the material on their embeddings, its baselines are
    /// fitted again; members for which the sweeps are too few are left out and returned. Thresholds of a calibration are left out.
    ///
    /// - `train`: training sweeps of the committee
    /// - `sweeps`: sweeps of the new material; their label is ignored
    ///
    /// # Errors
    /// Fails if the name exists, for sweeps of another shape or sample rate, and for models that are not committees.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// # let file = std::env::temp_dir().join(format!("two-{}.toml", std::process::id()));
    /// std::fs::write(&file, "name = 'two'\nmembers = ['lda', 'means']")?;
    /// let committee = Recipe::read(&file)?.fit(&fold.train)?;
    /// # std::fs::remove_file(&file)?;
    /// let (extended, left_out) = committee.enroll_with(&fold.train, "new felt", &fold.test)?;
    /// assert_eq!((extended.materials().last(), left_out.len()), (Some("new felt"), 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn enroll_with(
        &self,
        train: &TrainSplit<'_>,
        material: &str,
        sweeps: &SweepView<'_>,
    ) -> Result<(Self, Vec<LeftOutMember>), Error> {
        let former = FormerSweeps { train, aside: None };
        let enrolled = enroll_into_committee(&self.fitted, &former, sweeps, material)?;
        let left_out = enrolled.left_out.clone();
        Ok((self.grown(enrolled, sweeps)?, left_out))
    }

    /// Returns this classifier with the results of an enrolment.
    fn grown(&self, enrolled: Enrolled, sweeps: &SweepView<'_>) -> Result<Self, Error> {
        let device = self.config.spec.device.open()?;
        let label = enrolled.config.labels.len() - 1;
        let likeness = self.likeness.as_ref();
        Ok(Self {
            likeness: likeness
                .map(|likeness| likeness.extended(sweeps, label))
                .transpose()?,
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
            embeddings: enrolled.known,
            calibration: enrolled.calibration,
            adaptations: self.adaptations.clone(),
        })
    }

    /// Returns a classifier that is adapted to sweeps of another skin, robot or day; see [`tactnet_pipeline::adapt`]. Thresholds of a
    /// calibration are left out.
    ///
    /// # Errors
    /// Fails for sweeps of another shape or sample rate, for risks that are not accepted, and for models that cannot be adapted.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, NewSweeps, Recipe, RiskPolicy, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 20, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("lda")?.fit(&fold.train)?;
    /// let new = NewSweeps { unlabelled: Some(&fold.test), labelled: None };
    /// let adapted = classifier.adapt(new, RiskPolicy::Refuse)?;
    /// assert_eq!(adapted.materials().count(), 3);
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn adapt(&self, new: NewSweeps<'_>, policy: RiskPolicy) -> Result<Self, Error> {
        let adapted = tactnet_pipeline::adapt(&self.fitted, self.likeness.as_ref(), new, policy)?;
        let own = Adaptation::new(&adapted, new, &self.weights, env!("TACTNET_GIT"))?;
        let device = self.config.spec.device.open()?;
        let (config, weights) = (adapted.config, adapted.weights);
        Ok(Self {
            fitted: tactnet_pipeline::Classifier::new(config.clone(), &weights, &device)?,
            config: RunConfig {
                classifier: config,
                ..self.config.clone()
            },
            split: self.split.clone(),
            weights,
            embeddings: self.embeddings.clone(),
            calibration: None,
            likeness: adapted.likeness,
            adaptations: [self.adaptations.clone(), vec![own]].concat(),
        })
    }

    /// Returns the adaptations after training, in order, with their warnings.
    pub fn adaptations(&self) -> &[Adaptation] {
        &self.adaptations
    }

    fn embeddings(&self) -> Result<&TrainEmbeddings, Error> {
        self.embeddings.as_ref().ok_or_else(|| {
            let expected = "a network, which learns a material without its training sweeps";
            let found = "another model; fit it again with all materials";
            Error::incompatible("enrolment", expected, found)
        })
    }

    /// Returns the shape of the training sweeps.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("means")?.fit(&fold.train)?;
    /// assert_eq!(classifier.shape().steps, 120);
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn shape(&self) -> SweepShape {
        self.fitted.config().shape
    }

    /// Returns true if the training sweeps differ in length, so that sweeps of any length can be classified.
    ///
    /// # Example
    /// ```
    /// use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    ///
    /// let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// assert!(!Recipe::named("means")?.fit(&fold.train)?.any_length());
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn any_length(&self) -> bool {
        self.fitted.config().trained_steps.is_some()
    }

    /// Returns the sample rate of the training sweeps in Hz, and true if it is assumed.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("means")?.fit(&fold.train)?;
    /// assert_eq!(classifier.sample_rate_hz(), (750.0, false));
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn sample_rate_hz(&self) -> (f64, bool) {
        let config = self.fitted.config();
        (config.sample_rate_hz, config.sample_rate_assumed)
    }

    /// Returns a classifier that takes one sweep frame by frame, with the recipe's number of Monte Carlo samples.
    ///
    /// # Errors
    /// Fails if the model needs complete sweeps: a baseline, or a network that removes each taxel's mean.
    ///
    /// # Example
    /// ```
    /// # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
    /// # let small = TwinConfig { materials: 3, sweeps: 10, steps: 120, ..TwinConfig::default() };
    /// let dataset = Dataset::twin(&small)?;
    /// let fold = dataset.folds(Seed(1)).first();
    /// let classifier = Recipe::named("fast")?.epochs(1).fit(&fold.train)?;
    /// let mut online = classifier.online()?;
    /// online.begin();
    /// for frame in dataset.sweep(0).chunks(classifier.shape().taxels()) {
    ///     online.push(frame);
    /// }
    /// assert_eq!(online.classify().log_probability.len(), 3);
    /// # Ok::<(), tactnet::Error>(())
    /// ```
    pub fn online(&self) -> Result<OnlineClassifier, Error> {
        let mc_samples = match self.config.recipe.method() {
            PredictionMethod::Plain => 0,
            PredictionMethod::McDropout { mc_samples } => mc_samples,
        };
        let calibration = self.calibration.clone();
        OnlineClassifier::new(&self.fitted, calibration, mc_samples)
    }
}
