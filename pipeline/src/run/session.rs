//! A training in a run directory, from sweeps to result: split, train, calibrate, evaluate, write.
//!
//! A session can stop after any batch and be resumed in another process; the result is the same to the bit.

use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use tactnet_data::{
    DataSource, Dataset, Finding, Fold, Seed, TrainSplit, refuse_errors, refuse_leaks,
};

use super::committee_session::setups;
use super::free_folder::free_folder;
use super::random_fold::RandomFold;
use super::set_aside::{Aside, set_aside, write_known};
use super::training_record::{TrainingRecord, train_batches};
use crate::{
    BaselineRecipe, BatchReport, Calibration, Classifier, ClassifierConfig, Device, LeftOutMember,
    Likeness, ModelConfig, ModelRecipe, NetworkRecipe, NetworkSetup, PipelineError, PipelineRemedy,
    Provenance, RunConfig, RunDir, RunResult, SplitKind, TrainJob, TrainSpec, Training,
    TrainingSettings, TrainingSteps, TrainingSummary, evaluate_run, fit_baseline,
};

/// Progress of a session.
#[derive(Debug)]
pub enum TrainEvent<'a> {
    /// The run already has a result; nothing is trained.
    AlreadyEnded,
    /// Another build of the program trained before; the result will name both commits.
    OtherBuild,
    /// The training of a member of a committee begins.
    Member {
        /// Name of its recipe.
        name: &'a str,
        /// Number of the member, from 1.
        number: usize,
        /// Number of members.
        members: usize,
    },
    /// A committee has no such member, since the sweeps do not allow it.
    LeftOut(&'a LeftOutMember),
    /// The training of a network's teacher without one part of the training sweeps begins.
    Teacher {
        /// Name of its recipe.
        name: &'a str,
        /// Number of the part, from 1.
        number: usize,
        /// Number of parts.
        parts: usize,
    },
    /// The training of a network begins or continues.
    Begun {
        /// Number of batches trained before an interruption.
        batches_before: usize,
        /// Steps of the whole training.
        steps: TrainingSteps,
        /// Reason why it takes more epochs than its recipe names; `None` if it does not, or for a resumed run.
        why_more_epochs: Option<String>,
    },
    /// A batch has been trained.
    Batch {
        /// Statistics of the batch.
        batch: &'a BatchReport,
        /// Number of epochs of the whole training.
        epochs: usize,
    },
    /// A step of fitting a baseline begins.
    Fitting {
        /// Description of the step.
        step: &'a str,
        /// Time since the fit began, in seconds.
        seconds: f64,
    },
    /// The thresholds have been fitted.
    Calibrated(&'a Calibration),
    /// The prediction of the test sweeps begins.
    Predicting {
        /// Number of test sweeps.
        sweeps: usize,
    },
    /// The same training on a random fold begins, see [`Session::with_random_fold`].
    RandomFold,
}

/// End of a session.
#[derive(Debug)]
pub enum TrainOutcome {
    /// The run has a result.
    Finished(Box<RunResult>),
    /// The session was stopped; the run can be resumed.
    Stopped,
}

/// Program that runs a session.
#[derive(Debug, Clone)]
pub struct Program {
    /// Version and commit of the program, and the machine.
    pub provenance: Provenance,
    /// Returns the command that reproduces a training, which goes into its result.
    pub command: fn(&TrainSpec) -> String,
}

/// Run directory that this process has locked, with its data set.
#[derive(Debug)]
pub struct Session {
    dataset: Dataset,
    run: RunDir,
    pub(super) program: Program,
    /// Device of the session, once open.
    device: OnceLock<Device>,
    /// Settings of the recipe before they were adapted to the number of sweeps; `None` for a resumed run.
    asked: Option<TrainingSettings>,
    /// Members of a committee that the sweeps do not allow; empty for a resumed run.
    left_out: Vec<LeftOutMember>,
    /// Time below which a training is repeated on a random fold; `None`: never.
    random_fold_below: Option<Duration>,
}

/// Checks the number of training sweeps.
///
/// # Errors
/// A material with fewer training sweeps than `recipe` needs.
fn refuse_starved(recipe: &ModelRecipe, train: &TrainSplit<'_>) -> Result<(), PipelineError> {
    let counts = train.sweeps_per_label();
    let Some((label, needed)) = recipe.starved(&counts) else {
        return Ok(());
    };
    Err(PipelineError::TooFewSweeps {
        material: train.dataset().labels().name(label).into(),
        model: recipe.name().into(),
        needed,
        found: counts[label],
        models: ModelRecipe::not_starved(["fast", "knn-h"], &counts),
    })
}

/// Returns the classifier's configuration, with everything that is fitted to the training sweeps before training.
///
/// # Errors
/// Settings that do not match the sweeps.
fn fit_inputs(
    recipe: &ModelRecipe,
    train: &TrainSplit<'_>,
    seed: Seed,
) -> Result<ClassifierConfig, PipelineError> {
    let classifier = ClassifierConfig::new(setup_of(recipe, train), train, seed);
    classifier.validate()?;
    Ok(classifier)
}

/// Returns the model with its normaliser, fitted to the training sweeps.
fn setup_of(recipe: &ModelRecipe, train: &TrainSplit<'_>) -> ModelConfig {
    match recipe {
        ModelRecipe::Network(recipe) => ModelConfig::Network(NetworkSetup::fit(recipe, train)),
        ModelRecipe::Baseline(recipe) => ModelConfig::Baseline(recipe.clone()),
        ModelRecipe::Committee(recipe) => {
            ModelConfig::Committee(setups(recipe, |member| setup_of(member, train)))
        }
    }
}

impl Session {
    /// Reads and splits the data, and writes everything that is known before training into a new folder.
    ///
    /// - `folder`: run directory; `None`: `runs/DATA-RECIPE-FOLD-SEED`, with a number appended if it exists
    /// - `on_finding`: called with suspicious properties of the data before later steps can fail; its error aborts the session
    ///
    /// # Errors
    /// Data that cannot be read or has errors; a random split of sweeps that share frames; a fold that does not exist; too few sweeps for the recipe or the calibration; settings that do not
    /// match the sweeps; a folder that is not empty.
    pub fn begin(
        job: &TrainJob,
        folder: Option<&Path>,
        program: Program,
        on_finding: impl FnMut(&Finding) -> Result<(), PipelineError>,
    ) -> Result<Self, PipelineError> {
        let spec = job.spec();
        let dataset = spec.read_sweeps()?;
        let findings = refuse_errors(&dataset, &spec.data)?;
        findings.iter().try_for_each(on_finding)?;
        refuse_leaks(&dataset, &findings, spec.scheme(&dataset), &spec.data)?;
        let fold = spec.fold_of(&dataset)?;
        job.recipe().check_materials(dataset.labels())?;
        job.recipe().check_data(&dataset)?;
        let (fitted, aside) = set_aside(&fold, spec.calibration)?;
        if let Some((target, aside)) = &aside {
            target.check(aside.len())?;
        }
        refuse_starved(job.recipe(), &fitted.train)?;
        let (recipe, left_out) = job.recipe().for_sweeps(&fitted.train)?;
        let classifier = fit_inputs(&recipe, &fitted.train, spec.seed)?;
        let config = RunConfig {
            schema_version: RunConfig::SCHEMA_VERSION,
            spec: TrainSpec {
                data: DataSource::from_anywhere(&spec.data),
                lengths: spec.lengths_in(&dataset),
                ..spec.clone()
            },
            data_sha256: dataset.sha256().into(),
            recipe,
            classifier,
        };
        let folder = match folder {
            Some(folder) => folder.to_path_buf(),
            None => free_folder(dataset.name(), &config, &fold),
        };
        let run = RunDir::create(&folder, &config, &fold.manifest(), &program.provenance)?;
        let asked = match job.recipe() {
            ModelRecipe::Network(recipe) => Some(recipe.training.clone()),
            ModelRecipe::Baseline(_) | ModelRecipe::Committee(_) => None,
        };
        Ok(Self {
            dataset,
            run,
            program,
            device: OnceLock::from(job.device().clone()),
            asked,
            left_out,
            random_fold_below: None,
        })
    }

    /// Opens an interrupted run with its own settings.
    ///
    /// - `data`: current path of its data set, if that was moved
    ///
    /// # Errors
    /// No run in the folder; a run with enrolled materials; another data set than before.
    pub fn resume(
        folder: &Path,
        data: Option<&str>,
        program: Program,
    ) -> Result<Self, PipelineError> {
        let run = RunDir::open(folder)?.locked()?;
        let refused = |path: &Path, reason: String| PipelineError::run(path, reason);
        if !run.enrolled()?.is_empty() {
            let reason = "a classifier with enrolled materials cannot be trained further; train the run that it was made from, then \
                          enroll again";
            return Err(refused(folder, reason.into()));
        }
        if !run.adaptations()?.is_empty() {
            let reason = "an adapted classifier cannot be trained further; train the run that it was made from, then adapt again";
            return Err(refused(folder, reason.into()));
        }
        let config = run.config()?;
        let dataset = config.spec.read_sweeps_of_run(data)?;
        if dataset.sha256() != config.data_sha256 {
            let what = match data {
                None => "the data set has changed since the run began",
                Some(_) => "another data set than the run began with",
            };
            let reason = format!(
                "{what}: expected SHA-256 {}, found {}",
                config.data_sha256,
                dataset.sha256()
            );
            let path = Path::new(data.unwrap_or(&config.spec.data));
            return Err(refused(path, reason).with_remedy(PipelineRemedy::NameData));
        }
        Ok(Self {
            dataset,
            run,
            program,
            device: OnceLock::new(),
            asked: None,
            left_out: Vec::new(),
            random_fold_below: None,
        })
    }

    /// Adds the accuracy on a random fold to the result, if the run holds out whole blocks and its training takes less time than `limit`.
    ///
    /// The difference shows how much recognising the recordings would contribute. The training is repeated without being written.
    pub fn with_random_fold(mut self, limit: Duration) -> Self {
        self.random_fold_below = Some(limit);
        self
    }

    /// Returns the data set of training and test sweeps.
    pub fn dataset(&self) -> &Dataset {
        &self.dataset
    }

    /// Returns the device, which is opened at most once.
    pub(super) fn device(&self, config: &RunConfig) -> Result<&Device, PipelineError> {
        if let Some(device) = self.device.get() {
            return Ok(device);
        }
        let device = config.spec.device.open()?;
        Ok(self.device.get_or_init(|| device))
    }

    /// Returns the run directory.
    pub fn run(&self) -> &RunDir {
        &self.run
    }

    /// Trains from the current state of the run to its result.
    ///
    /// - `on_event`: called at each step
    /// - `stop`: called after every batch; true ends the session once the run can be resumed
    ///
    /// # Errors
    /// A loss that is not finite; a solver that fails; a file of the run that is damaged or cannot be written.
    pub fn train(
        &self,
        mut on_event: impl FnMut(TrainEvent<'_>),
        stop: impl Fn() -> bool,
    ) -> Result<TrainOutcome, PipelineError> {
        let begun = match self.open(&mut on_event)? {
            Opened::Ended(result) => return Ok(TrainOutcome::Finished(result)),
            Opened::Begun(begun) => begun,
        };
        let config = &begun.config;
        for member in &self.left_out {
            on_event(TrainEvent::LeftOut(member));
        }
        let trained = match (&config.recipe, &config.classifier.model) {
            (ModelRecipe::Committee(recipe), ModelConfig::Committee(members)) => {
                self.train_committee(&begun, recipe, members, &mut on_event, &stop)?
            }
            model => self.train_model(&self.run, &begun, model, &mut on_event, &stop)?,
        };
        match trained {
            Some(trained) => self.finish(*begun, trained, &mut on_event, &stop),
            None => Ok(TrainOutcome::Stopped),
        }
    }

    /// Records the session in the run directory and restores the split.
    pub(super) fn open(
        &self,
        on_event: &mut impl FnMut(TrainEvent<'_>),
    ) -> Result<Opened<'_>, PipelineError> {
        let run = &self.run;
        if let Some(result) = run.result()? {
            on_event(TrainEvent::AlreadyEnded);
            return Ok(Opened::Ended(Box::new(result)));
        }
        let config = run.config()?;
        let fold = run.split()?.fold(&self.dataset)?;
        let (fitted, aside) = set_aside(&fold, config.spec.calibration)?;
        let sessions = run.record_session(&self.program.provenance)?;
        if sessions
            .iter()
            .any(|session| session.git != self.program.provenance.git)
        {
            on_event(TrainEvent::OtherBuild);
        }
        Ok(Opened::Begun(Box::new(Begun {
            config,
            fold,
            fitted,
            aside,
            sessions,
        })))
    }

    /// Calibrates and evaluates the trained classifier, whose weights are in the run directory, and writes the result.
    pub(super) fn finish(
        &self,
        begun: Begun<'_>,
        trained: TrainingSummary,
        on_event: &mut impl FnMut(TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Result<TrainOutcome, PipelineError> {
        let (run, config) = (&self.run, &begun.config);
        let mut result = self.evaluated(run, config, &begun, trained, on_event)?;
        let below = self.random_fold_below.unwrap_or_default().as_secs_f64();
        let holds_out_blocks = SplitKind::of(begun.fold.scheme()).holds_out_blocks();
        if holds_out_blocks && config.spec.inner.is_none() && result.train_seconds < below {
            on_event(TrainEvent::RandomFold);
            let device = self.device(config)?;
            result.random_fold = RandomFold::measure(config, &self.dataset, device, stop);
        }
        if stop() {
            return Ok(TrainOutcome::Stopped);
        }
        run.write_json("result.json", &result)?;
        run.write_manifest()?;
        Ok(TrainOutcome::Finished(Box::new(result)))
    }

    /// Calibrates and evaluates the trained classifier whose weights are in `run`, and writes what is known of its training sweeps.
    pub(super) fn evaluated(
        &self,
        run: &RunDir,
        config: &RunConfig,
        begun: &Begun<'_>,
        trained: TrainingSummary,
        on_event: &mut impl FnMut(TrainEvent<'_>),
    ) -> Result<RunResult, PipelineError> {
        let (fold, train) = (&begun.fold, &begun.fitted.train);
        let classifier = Classifier::new(
            config.classifier.clone(),
            &run.weights()?,
            self.device(config)?,
        )?;
        if let Some(likeness) = Likeness::fit(train, config.spec.seed)? {
            run.write_likeness(&likeness)?;
        }
        let aside = begun.aside.as_ref();
        let aside = aside.map(|(target, aside)| (*target, &**aside));
        let calibration = write_known(run, &classifier, train, aside)?;
        if let Some(calibration) = &calibration {
            on_event(TrainEvent::Calibrated(calibration));
        }
        on_event(TrainEvent::Predicting {
            sweeps: fold.test.len(),
        });
        let command = (self.program.command)(&config.named_spec(fold).without_folders());
        let sessions = begun.sessions.clone();
        evaluate_run(run, config, &classifier, fold, sessions, trained, command)
    }

    /// Trains a network or baseline and writes weights, metrics and checkpoints into `run`; returns `None` if stopped.
    pub(super) fn train_model(
        &self,
        run: &RunDir,
        begun: &Begun<'_>,
        model: (&ModelRecipe, &ModelConfig),
        on_event: &mut impl FnMut(TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Trained {
        match model {
            (ModelRecipe::Network(recipe), ModelConfig::Network(setup)) => {
                self.train_network(run, begun, recipe, setup, on_event, stop)
            }
            (ModelRecipe::Baseline(recipe), ModelConfig::Baseline(_)) => {
                self.fit_baseline(run, begun, recipe, on_event, stop)
            }
            _ => Err(PipelineError::run(
                self.run.path(),
                "recipe and model do not belong together",
            )),
        }
    }

    /// Trains a network; returns `None` if stopped, and a later session then continues from a checkpoint.
    fn train_network(
        &self,
        run: &RunDir,
        begun: &Begun<'_>,
        recipe: &NetworkRecipe,
        setup: &NetworkSetup,
        on_event: &mut impl FnMut(TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Trained {
        let (config, train) = (&begun.config, &begun.fitted.train);
        let watched = config.spec.watch_test.then_some(&*begun.fold.test);
        let device = self.device(config)?;
        let network = config.classifier.network_config(setup)?;
        let normalizer = &setup.normalizer;
        let taught = match &recipe.training.teacher {
            None => None,
            Some(teacher) => {
                let teacher = teacher.recipe();
                match self.soft_targets(run, teacher, begun, on_event, stop)? {
                    None => return Ok(None),
                    taught => taught,
                }
            }
        };
        let training = Training::start(
            recipe,
            train,
            normalizer,
            &network,
            config.spec.seed,
            device,
        )?;
        let (training, teacher_seconds) = match taught {
            None => (training, 0.0),
            Some((targets, seconds)) => (training.towards(targets), seconds),
        };
        let (mut record, mut training) = TrainingRecord::resume(run, training)?;
        let (epochs, batches) = (recipe.training.epochs, training.batches());
        let steps = TrainingSteps { epochs, batches };
        let position = training.position();
        self.tell_begin(position.epoch * batches + position.batch, steps, on_event);
        let ended = train_batches(&mut training, &mut record, watched, |batch| {
            on_event(TrainEvent::Batch { batch, epochs });
            !stop()
        })?;
        if !ended {
            return Ok(None);
        }
        record.save(&mut training)?;
        run.write_weights(&training.state()?.weights)?;
        Ok(Some(TrainingSummary {
            seconds: teacher_seconds + record.seconds(),
            sweeps: train.len(),
            epochs: Some(epochs),
            ..TrainingSummary::default()
        }))
    }

    /// Reports that the training of a network begins.
    pub(super) fn tell_begin(
        &self,
        batches_before: usize,
        steps: TrainingSteps,
        on_event: &mut impl FnMut(TrainEvent<'_>),
    ) {
        let asked = self.asked.as_ref();
        on_event(TrainEvent::Begun {
            batches_before,
            steps,
            why_more_epochs: asked.and_then(|asked| steps.why_more_epochs(asked)),
        });
    }

    /// Fits a baseline; returns `None` if stopped, and a later session then starts over.
    fn fit_baseline(
        &self,
        run: &RunDir,
        begun: &Begun<'_>,
        recipe: &BaselineRecipe,
        on_event: &mut impl FnMut(TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Trained {
        let (start, train) = (Instant::now(), &begun.fitted.train);
        let fitted = fit_baseline(recipe, train, begun.config.spec.seed, |step| {
            on_event(TrainEvent::Fitting {
                step: &step,
                seconds: start.elapsed().as_secs_f64(),
            });
        })?;
        if stop() {
            return Ok(None);
        }
        let seconds = start.elapsed().as_secs_f64();
        run.write_baseline(&fitted.weights)?;
        Ok(Some(TrainingSummary {
            seconds,
            sweeps: train.len(),
            epochs: None,
            chosen: fitted.chosen,
        }))
    }
}

/// Summary of a training; `None` if it was stopped.
pub(super) type Trained = Result<Option<TrainingSummary>, PipelineError>;

/// State of a run when a session opens it.
pub(super) enum Opened<'a> {
    /// The run has a result.
    Ended(Box<RunResult>),
    /// The run is not finished.
    Begun(Box<Begun<'a>>),
}

/// Unfinished run that a session continues.
pub(super) struct Begun<'a> {
    pub(super) config: RunConfig,
    pub(super) fold: Fold<'a>,
    /// Fold without the sweeps that are set aside; models are fitted to its training sweeps.
    pub(super) fitted: Fold<'a>,
    aside: Option<Aside<'a>>,
    /// All sessions of the run so far, including this one.
    pub(super) sessions: Vec<Provenance>,
}

#[cfg(test)]
mod tests;
