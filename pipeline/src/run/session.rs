//! A training in a run directory, from sweeps to result: split, set aside, fit, calibrate, evaluate, write.
//!
//! It can be stopped after every batch and resumed in another process; the result is then the same to the bit.

use std::path::Path;
use std::time::Instant;

use tactnet_data::{
    DataSource, Dataset, Finding, Fold, TrainSplit, ValidationSplit, refuse_errors,
};

use super::free_folder::free_folder;
use super::training_record::TrainingRecord;
use crate::network::train_network::train_batches;
use crate::{
    BaselineRecipe, BatchReport, Calibration, CalibrationTarget, Classifier, ClassifierConfig,
    ModelConfig, ModelRecipe, NoveltyScore, NoveltyScorer, PipelineError, Provenance, Recipe,
    RunConfig, RunDir, RunResult, TactNetSetup, TrainEmbeddings, TrainJob, TrainSpec, Training,
    TrainingSteps, TrainingSummary, evaluate_run, fit_baseline,
};

/// What a session does, for whoever shows progress.
#[derive(Debug)]
pub enum TrainEvent<'a> {
    /// The run has a result already; nothing is trained.
    AlreadyEnded,
    /// Another build of the program trained before; the result will name both commits.
    OtherBuild,
    /// A network is about to be trained.
    Begun {
        /// Batches trained before an interruption.
        batches_before: usize,
        /// Of the whole training.
        steps: TrainingSteps,
    },
    /// A batch has been trained.
    Batch {
        /// What it did.
        batch: &'a BatchReport,
        /// Epochs of the whole training.
        epochs: usize,
    },
    /// A step of fitting a baseline, for people.
    Fitting {
        /// The step.
        step: &'a str,
        /// Time since the fit began, seconds.
        seconds: f64,
    },
    /// Thresholds have been fitted.
    Calibrated(&'a Calibration),
    /// The test sweeps are about to be predicted.
    Predicting {
        /// How many there are.
        sweeps: usize,
    },
}

/// How a session ended.
#[derive(Debug)]
pub enum TrainOutcome {
    /// The run has a result.
    Finished(Box<RunResult>),
    /// Somebody asked to stop; the run can be resumed.
    Stopped,
}

/// A run directory that this process holds the lock of, and its data set.
#[derive(Debug)]
pub struct Session {
    dataset: Dataset,
    run: RunDir,
    program: Provenance,
}

impl Session {
    /// Reads the data, splits it, and writes everything known before training into a new folder.
    ///
    /// - `folder`: where the run is kept; `None`: `runs/DATA-RECIPE-FOLD-SEED`, numbered on if taken
    /// - `on_finding`: told what is odd about the data without being an error, before the rest can fail; an error of it ends all
    ///
    /// # Errors
    /// Data that cannot be read or has errors; a fold that it does not have; too few sweeps for the calibration; settings that do not
    /// fit the sweeps; a folder that holds anything already.
    pub fn begin(
        job: &TrainJob,
        folder: Option<&Path>,
        program: Provenance,
        on_finding: impl FnMut(&Finding) -> Result<(), PipelineError>,
    ) -> Result<Self, PipelineError> {
        let spec = job.spec();
        let dataset = spec.read_sweeps()?;
        refuse_errors(&dataset, &spec.data)?
            .iter()
            .try_for_each(on_finding)?;
        let number = spec.fold.unwrap_or(0);
        let fold = Fold::new(
            &dataset,
            spec.scheme(&dataset),
            spec.seed,
            spec.repeat,
            number,
        )?;
        let fold = match spec.inner {
            None => fold,
            Some(part) => fold.nested(part)?,
        };
        let (fitted, aside) = set_aside(&fold, spec.calibration)?;
        if let Some((target, aside)) = &aside {
            target.check(aside.len())?;
        }
        let recipe = match job.recipe() {
            ModelRecipe::TactNet2(recipe) => {
                ModelRecipe::TactNet2(recipe.for_sweeps(fitted.train.len()))
            }
            baseline => baseline.clone(),
        };
        let model = match &recipe {
            ModelRecipe::TactNet2(recipe) => {
                ModelConfig::TactNet2(TactNetSetup::fit(recipe, &fitted.train))
            }
            ModelRecipe::Baseline(recipe) => ModelConfig::Baseline(recipe.clone()),
        };
        let classifier = ClassifierConfig::new(model, &fitted.train, spec.seed);
        classifier.validate()?;
        let config = RunConfig {
            schema_version: RunConfig::SCHEMA_VERSION,
            spec: TrainSpec {
                data: DataSource::from_anywhere(&spec.data),
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
        let run = RunDir::create(&folder, &config, &fold.manifest(), &program)?;
        Ok(Self {
            dataset,
            run,
            program,
        })
    }

    /// Opens a run that was interrupted, with its own settings.
    ///
    /// - `data`: where its data set is now, if it was moved
    ///
    /// # Errors
    /// No run in the folder, or one that materials were added to; another data set than before.
    pub fn resume(
        folder: &Path,
        data: Option<&str>,
        program: Provenance,
    ) -> Result<Self, PipelineError> {
        let run = RunDir::open(folder)?.locked()?;
        let refused = |path: &Path, reason: String| PipelineError::Run {
            path: path.into(),
            reason,
        };
        if !run.enrolled()?.is_empty() {
            let reason = "materials were added to this classifier, so it cannot be trained further; train the run it came from, and \
                          enroll again";
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
                "{what}: expected SHA-256 {}, found {}; `--data FILE` names the right one",
                config.data_sha256,
                dataset.sha256()
            );
            return Err(refused(
                Path::new(data.unwrap_or(&config.spec.data)),
                reason,
            ));
        }
        Ok(Self {
            dataset,
            run,
            program,
        })
    }

    /// The run directory.
    pub fn run(&self) -> &RunDir {
        &self.run
    }

    /// Trains from where the run stands to its result.
    ///
    /// - `on_event`: called as work goes on
    /// - `stop`: asked after every batch; true ends the session as soon as the run can be resumed
    ///
    /// # Errors
    /// A loss that is not finite, a solver that fails, a file of the run that is damaged or cannot be written.
    pub fn train(
        &self,
        mut on_event: impl FnMut(TrainEvent<'_>),
        stop: impl Fn() -> bool,
    ) -> Result<TrainOutcome, PipelineError> {
        let run = &self.run;
        if let Some(result) = run.result()? {
            on_event(TrainEvent::AlreadyEnded);
            return Ok(TrainOutcome::Finished(Box::new(result)));
        }
        let config = run.config()?;
        let fold = run.split()?.fold(&self.dataset)?;
        let (fitted, aside) = set_aside(&fold, config.spec.calibration)?;
        let sessions = run.record_session(&self.program)?;
        if sessions
            .iter()
            .any(|session| session.git != self.program.git)
        {
            on_event(TrainEvent::OtherBuild);
        }

        let trained = match (&config.recipe, &config.classifier.model) {
            (ModelRecipe::TactNet2(recipe), ModelConfig::TactNet2(setup)) => {
                self.train_network(&config, recipe, setup, &fitted.train, &mut on_event, &stop)?
            }
            (ModelRecipe::Baseline(recipe), ModelConfig::Baseline(_)) => {
                self.fit_baseline(&config, recipe, &fitted.train, &mut on_event, &stop)?
            }
            _ => {
                return Err(PipelineError::Run {
                    path: run.path().into(),
                    reason: "recipe and model do not belong together".into(),
                });
            }
        };
        let Some(trained) = trained else {
            return Ok(TrainOutcome::Stopped);
        };
        let device = config.spec.device.open()?;
        let classifier = Classifier::new(config.classifier.clone(), &run.weights()?, &device)?;
        if let ModelConfig::TactNet2(_) = config.classifier.model {
            let known = TrainEmbeddings::of(&classifier.embed(&fitted.train)?);
            run.write_train_embeddings(&known)?;
            if let Some((target, aside)) = &aside {
                let novelty = NoveltyScorer::fit(&classifier, &known)?;
                let held_out = classifier.embed(aside)?;
                let score = NoveltyScore::BEST;
                run.write_held_out(&held_out)?;
                let calibration = Calibration::fit(*target, score, &novelty, &held_out)?;
                run.write_calibration(&calibration)?;
                on_event(TrainEvent::Calibrated(&calibration));
            }
        }
        on_event(TrainEvent::Predicting {
            sweeps: fold.test.len(),
        });
        let command = config.named_spec(&fold).without_folders().to_string();
        let result = evaluate_run(run, &config, &classifier, &fold, sessions, trained, command)?;
        if stop() {
            return Ok(TrainOutcome::Stopped);
        }
        run.write_json("result.json", &result)?;
        run.write_manifest()?;
        Ok(TrainOutcome::Finished(Box::new(result)))
    }

    /// `None` when somebody asked to stop; the training then goes on from a checkpoint.
    fn train_network(
        &self,
        config: &RunConfig,
        recipe: &Recipe,
        setup: &TactNetSetup,
        train: &TrainSplit<'_>,
        on_event: &mut impl FnMut(TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Result<Option<TrainingSummary>, PipelineError> {
        let device = config.spec.device.open()?;
        let network = config.classifier.network_config(setup)?;
        let normalizer = &setup.normalizer;
        let training = Training::start(
            recipe,
            train,
            normalizer,
            &network,
            config.spec.seed,
            &device,
        )?;
        let (mut record, mut training) = TrainingRecord::resume(&self.run, training)?;
        let (epochs, batches) = (recipe.training.epochs, training.batches());
        on_event(TrainEvent::Begun {
            batches_before: training.position().epoch * batches + training.position().batch,
            steps: TrainingSteps { epochs, batches },
        });
        let ended = train_batches(&mut training, Some(&mut record), |batch| {
            on_event(TrainEvent::Batch { batch, epochs });
            !stop()
        })?;
        if !ended {
            return Ok(None);
        }
        record.save(&training)?;
        self.run.write_weights(&training.state()?.weights)?;
        Ok(Some(TrainingSummary {
            seconds: record.seconds(),
            sweeps: train.len(),
            epochs: Some(epochs),
            ..TrainingSummary::default()
        }))
    }

    /// `None` when somebody asked to stop; the fit then starts over.
    fn fit_baseline(
        &self,
        config: &RunConfig,
        recipe: &BaselineRecipe,
        train: &TrainSplit<'_>,
        on_event: &mut impl FnMut(TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Result<Option<TrainingSummary>, PipelineError> {
        let begun = Instant::now();
        let fitted = fit_baseline(recipe, train, config.spec.seed, |step| {
            on_event(TrainEvent::Fitting {
                step: &step,
                seconds: begun.elapsed().as_secs_f64(),
            });
        })?;
        if stop() {
            return Ok(None);
        }
        let seconds = begun.elapsed().as_secs_f64();
        self.run.write_baseline(&fitted.weights)?;
        Ok(Some(TrainingSummary {
            seconds,
            sweeps: train.len(),
            epochs: None,
            chosen: fitted.chosen,
        }))
    }
}

/// What is fitted to, and what a calibration has of the training sweeps, if there is one.
type SetAside<'a> = (Fold<'a>, Option<(CalibrationTarget, ValidationSplit<'a>)>);

fn set_aside<'a>(
    fold: &Fold<'a>,
    target: Option<CalibrationTarget>,
) -> Result<SetAside<'a>, PipelineError> {
    match target {
        None => Ok((fold.clone(), None)),
        Some(target) => {
            let (fitted, aside) = fold.set_aside()?;
            Ok((fitted, Some((target, aside))))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use tactnet_data::format::Format;
    use tactnet_data::twin::{self, TwinConfig};
    use tactnet_data::{Samples, Scheme, Seed};

    use super::*;

    const RECIPE: &str = r#"
        name = "small"
        network = { maps = [3, 4], hidden = 8, keep_probability = 0.8 }
        [training]
        epochs = 3
        batch = 8
        learning_rate = 0.005
        method = { kind = "base" }
    "#;

    fn program() -> Provenance {
        Provenance::of_this_process("0", "test")
    }

    fn spec(folder: &Path) -> TrainSpec {
        let [data, recipe] = ["twin.h5", "small.toml"].map(|name| folder.join(name));
        let config = TwinConfig {
            materials: 3,
            sweeps: 10,
            steps: 60,
            ..TwinConfig::default()
        };
        Format::TactMat
            .write(&data, &twin::generate(&config).unwrap())
            .unwrap();
        std::fs::write(&recipe, RECIPE).unwrap();
        TrainSpec {
            data: data.display().to_string(),
            recipe: recipe.display().to_string(),
            ..TrainSpec::default()
        }
    }

    #[test]
    fn a_session_that_is_stopped_after_every_batch_ends_with_the_same_bits() {
        let folder = tempfile::tempdir().unwrap();
        let job = TrainJob::try_from(spec(folder.path())).unwrap();
        let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(name));
        let session = Session::begin(&job, Some(&whole), program(), |_| Ok(())).unwrap();
        let mut batches = 0;
        let count = |event: TrainEvent<'_>| {
            batches += usize::from(matches!(event, TrainEvent::Batch { .. }));
        };
        let outcome = session.train(count, || false).unwrap();
        assert!(matches!(outcome, TrainOutcome::Finished(_)), "{outcome:?}");
        assert_eq!(batches, 9, "three epochs of three batches");
        drop(session);

        drop(Session::begin(&job, Some(&parts), program(), |_| Ok(())).unwrap());
        let mut sessions = 0;
        loop {
            let session = Session::resume(&parts, None, program()).unwrap();
            let trained = Cell::new(false);
            let note = |event: TrainEvent<'_>| {
                trained.set(trained.get() || matches!(event, TrainEvent::Batch { .. }));
            };
            sessions += 1;
            if let TrainOutcome::Finished(_) = session.train(note, || trained.get()).unwrap() {
                break;
            }
        }
        assert_eq!(sessions, 10, "one for every batch, one to end");
        for file in ["weights.safetensors", "predictions_test.csv"] {
            let [whole, parts] = [&whole, &parts].map(|run| std::fs::read(run.join(file)).unwrap());
            assert!(whole == parts, "{file}");
        }
        let again = Session::resume(&whole, None, program()).unwrap();
        let ended = Cell::new(false);
        let note = |event: TrainEvent<'_>| ended.set(matches!(event, TrainEvent::AlreadyEnded));
        again.train(note, || false).unwrap();
        assert!(ended.get());
    }

    #[test]
    fn a_run_names_its_data_from_anywhere_and_says_how_to_name_a_new_place() {
        let folder = tempfile::tempdir().unwrap();
        let asked = spec(folder.path());
        let job = TrainJob::try_from(asked.clone()).unwrap();
        let run = folder.path().join("run");
        let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
        let named = session.run().config().unwrap().spec.data;
        drop(session);
        assert_eq!(named, asked.data, "an absolute path stays as it is");
        let here = std::env::current_dir().unwrap().join("sweeps.h5");
        assert_eq!(
            DataSource::from_anywhere("sweeps.h5"),
            here.display().to_string()
        );
        assert_eq!(DataSource::from_anywhere("twin"), "twin");

        let moved = folder.path().join("moved.h5");
        std::fs::rename(&named, &moved).unwrap();
        let resume = |data: Option<&str>| Session::resume(&run, data, program()).map(drop);
        let lost = resume(None).unwrap_err();
        assert!(
            lost.is_usage() && lost.to_string().contains(&named),
            "{lost}"
        );
        assert!(lost.to_string().contains("`--data FILE`"), "{lost}");
        let other = folder.path().join("other.h5");
        let config = TwinConfig {
            materials: 3,
            sweeps: 10,
            steps: 60,
            seed: 2,
            ..TwinConfig::default()
        };
        let twin = twin::generate(&config).unwrap();
        Format::TactMat.write(&other, &twin).unwrap();
        let refused = resume(other.to_str()).unwrap_err().to_string();
        assert!(
            refused.contains("another data set than the run began with"),
            "{refused}"
        );
        resume(moved.to_str()).unwrap();
    }

    #[test]
    fn runs_of_the_versions_before_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let asked = TrainSpec {
            steps: Some(40),
            inner: Some(1),
            ..spec(folder.path())
        };
        let job = TrainJob::try_from(asked.clone()).unwrap();
        let run = folder.path().join("run");
        let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
        let config = session.run().config().unwrap();
        assert_eq!(config.spec, asked);
        let mut old = serde_json::to_value(&config).unwrap();
        let fields = old.as_object_mut().unwrap();
        fields.remove("spec");
        fields["schema_version"] = 2.into();
        for (field, value) in [
            ("data", asked.data.clone().into()),
            ("recipe_source", asked.recipe.clone().into()),
            ("steps", 40.into()),
            ("inner", 1.into()),
            ("seed", asked.seed.0.into()),
            ("compute", "cpu".into()),
        ] {
            fields.insert(field.into(), value);
        }
        let read = RunConfig::from_json(&old.to_string()).unwrap();
        assert_eq!(read, config);
        old["schema_version"] = 5.into();
        let refused = RunConfig::from_json(&old.to_string()).unwrap_err();
        assert_eq!(refused, "expected schema version 4, 3 or 2, found 5");

        let mut old = serde_json::to_value(&config).unwrap();
        old["schema_version"] = 3.into();
        let read = RunConfig::from_json(&old.to_string()).unwrap();
        assert_eq!(read, config);
        old["spec"]["data"] = "twin".into();
        let read = RunConfig::from_json(&old.to_string()).unwrap();
        assert_eq!(read.spec.data, "twin1", "the only twin that there was");
    }

    #[test]
    fn a_run_names_the_spec_that_leads_to_it_again() {
        let folder = tempfile::tempdir().unwrap();
        let asked = TrainSpec {
            fold: Some(2),
            ..spec(folder.path())
        };
        let job = TrainJob::try_from(asked.clone()).unwrap();
        let run = folder.path().join("run");
        let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
        let config = session.run().config().unwrap();
        let manifest = session.run().split().unwrap();
        let fold = manifest.fold(&session.dataset).unwrap();
        let named = config.named_spec(&fold);
        assert_eq!(named.epochs, Some(3), "what the recipe says is named");
        let again = TrainSpec {
            mean_removal: None,
            split: None,
            epochs: None,
            ..named
        };
        assert_eq!(again, asked);
    }

    /// Of two recordings that differ in their test sweeps alone.
    #[test]
    fn nothing_that_is_fitted_depends_on_the_test_sweeps() {
        let folder = tempfile::tempdir().unwrap();
        let config = TwinConfig {
            materials: 3,
            sweeps: 20,
            steps: 200,
            ..TwinConfig::default()
        };
        let twin = twin::generate(&config).unwrap();
        let tested = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0).unwrap();
        let digits: Vec<f32> = (0..twin.len())
            .flat_map(|index| {
                let other = tested.test.indices().contains(&index);
                let digits = twin.sweep(index).into_iter().enumerate();
                digits.map(move |(i, x)| {
                    if other {
                        ((i + 7 * index) * (i + 1) % 97) as f32
                    } else {
                        x
                    }
                })
            })
            .collect();
        let changed = Dataset::new(
            "changed",
            twin.sample_rate_hz(),
            twin.shape(),
            twin.labels().clone(),
            twin.records().to_vec(),
            Samples::U8(digits.into_iter().map(|x| x as u8).collect()),
        )
        .unwrap();
        let fitted = |name: &str, dataset: &Dataset| {
            let [data, recipe, run] =
                ["h5", "toml", "run"].map(|end| folder.path().join(format!("{name}.{end}")));
            Format::TactMat.write(&data, dataset).unwrap();
            std::fs::write(
                &recipe,
                format!("{RECIPE}\n[input]\nscaling = \"per-taxel\""),
            )
            .unwrap();
            let spec = TrainSpec {
                data: data.display().to_string(),
                recipe: recipe.display().to_string(),
                calibration: Some(CalibrationTarget {
                    false_alarms: 0.2,
                    coverage: 0.8,
                }),
                ..TrainSpec::default()
            };
            let job = TrainJob::try_from(spec).unwrap();
            let session = Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap();
            session.train(|_| {}, || false).unwrap();
            let run = session.run();
            let parts = (
                run.weights().unwrap(),
                run.config().unwrap().classifier,
                run.calibration().unwrap().unwrap(),
                run.train_embeddings().unwrap(),
            );
            let fold = Fold::new(dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
            let baselines = ["lda", "svm-h", "knn-l", "minirocket"].map(|name| {
                let ModelRecipe::Baseline(recipe) = ModelRecipe::load(name).unwrap() else {
                    panic!("{name} is a baseline");
                };
                let fit = fit_baseline(&recipe, &fold.train, Seed(1), |_| {}).unwrap();
                (fit.weights, fit.chosen)
            });
            (parts, baselines)
        };
        assert_ne!(twin.sha256(), changed.sha256());
        let (first, second) = (fitted("twin", &twin), fitted("changed", &changed));
        assert_eq!(first.0.1, second.0.1, "normaliser");
        assert_eq!(first.0.0, second.0.0, "weights");
        assert_eq!(first.0.2, second.0.2, "calibration");
        assert_eq!(first.0.3, second.0.3, "embeddings");
        assert_eq!(first.1, second.1, "baselines");
    }
}
