//! `tactnet train`: from sweeps to a trained, judged classifier in a run directory.

mod choices;
mod progress;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::Args;
use tactnet_data::{Dataset, Fold, Scheme, Seed, Severity, TrainSplit, check};
use tactnet_models::Compute;
use tactnet_pipeline::{
    BaselineRecipe, Calibration, CalibrationTarget, Classifier, ClassifierConfig, EpochMetrics,
    LabelOrder, MeanRemoval, ModelConfig, ModelRecipe, NoveltyScore, NoveltyScorer, Provenance,
    Recipe, RunConfig, RunDir, TactNetSetup, TrainEmbeddings, Training, TrainingSummary,
    evaluate_run, fit_baseline,
};

use crate::report::OutputFormat;
use crate::stop::Stop;
use crate::{GIT, failure, report, source};
use choices::{ModelChoice, SplitChoice};
use progress::Progress;

pub use choices::{DeviceChoice, LevelsChoice};

/// Every epoch is saved at its end, and a long one also this often.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet train                                        the twin, two minutes\n  \
    tactnet train --recipe thesis --out runs/thesis      TactNet-II as published\n  \
    tactnet train --model minirocket                     a baseline on the same fold\n  \
    tactnet train --data sweeps.h5 --fold 3 --seed 7     the fourth of five folds\n  \
    tactnet train --calibrate                            can say that it does not know a material\n  \
    tactnet train --resume runs/thesis                   go on after Ctrl-C or a crash\n\n\
    Without --fold the file's own `test_flag` decides what is tested, where it has one; else fold 0 of 5.")]
pub struct TrainArgs {
    /// A data set (.h5, .npz), or `twin` [default: twin]
    #[arg(long, value_name = "FILE|twin")]
    data: Option<String>,
    /// What to train [default: tactnet2]
    #[arg(long, value_enum)]
    model: Option<ModelChoice>,
    /// How to train it: a built-in recipe (fast, thesis) or a TOML file [default: fast, or the model's only one]
    #[arg(long, value_name = "NAME|FILE")]
    recipe: Option<String>,
    /// Whether a taxel's mean over the sweep may be used [default: the recipe's]
    #[arg(long, value_enum)]
    levels: Option<LevelsChoice>,
    /// Only the first N time steps of every sweep
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Deal the labels anew at random first: a sound experiment then scores chance
    #[arg(long)]
    permute_labels: bool,
    /// How to split into training and test sweeps [default: the file's test flag, else k-fold]
    #[arg(long, value_enum)]
    split: Option<SplitChoice>,
    /// Fold to test on, counted from 0 [default: 0]
    #[arg(long, value_name = "K")]
    fold: Option<usize>,
    /// Repeat of the cross-validation, counted from 0; every repeat deals its folds anew
    #[arg(long, alias = "run", value_name = "R", default_value_t = 0)]
    repeat: usize,
    /// Judge by part I of the fold's training sweeps instead of its test sweeps, and train on the other parts: for choosing settings
    #[arg(long, value_name = "I")]
    inner: Option<usize>,
    /// Set a fifth of the training sweeps aside to calibrate: when to say "unknown", and how many materials to name to be sure
    #[arg(long)]
    calibrate: bool,
    /// Share of sweeps of known materials that may be called unknown [default: 0.05]
    #[arg(long, value_name = "SHARE", requires = "calibrate", value_parser = share)]
    false_alarms: Option<f64>,
    /// Share of sweeps whose material is to be in the prediction set [default: 0.9]
    #[arg(long, value_name = "SHARE", requires = "calibrate", value_parser = share)]
    coverage: Option<f64>,
    /// Folder for the run [default: runs/DATA-RECIPE-FOLD-SEED, numbered on if taken]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Decides every random choice: folds, weights, order, dropout
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Train this many epochs instead of the recipe's
    #[arg(long, value_name = "N")]
    epochs: Option<usize>,
    /// Where to compute
    #[arg(long, value_enum, default_value_t)]
    device: DeviceChoice,
    /// Continue an interrupted run with its own settings; --data says where its data set is now, if it was moved
    #[arg(long, value_name = "DIR", conflicts_with_all = ["model", "recipe", "levels", "steps", "permute_labels", "inner", "calibrate", "split", "fold", "repeat", "out", "seed", "epochs", "device"])]
    resume: Option<PathBuf>,
    /// Print result.json instead of a table
    #[arg(long)]
    json: bool,
}

impl TrainArgs {
    /// What `--calibrate` and its settings ask for.
    fn promise(&self) -> Option<CalibrationTarget> {
        let usual = CalibrationTarget::default();
        self.calibrate.then(|| CalibrationTarget {
            false_alarms: self.false_alarms.unwrap_or(usual.false_alarms),
            coverage: self.coverage.unwrap_or(usual.coverage),
        })
    }
}

fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_string())?;
    if value > 0.0 && value < 1.0 {
        Ok(value)
    } else {
        Err("expected a number between 0 and 1".into())
    }
}

/// Runs the command.
pub fn run(arguments: TrainArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen()?;
    let shown = OutputFormat::from_flag(arguments.json);
    let (dataset, run) = match &arguments.resume {
        Some(path) => reopen(path, arguments.data.as_deref())?,
        None => prepare(&arguments)?,
    };
    if let Some(result) = run.result()? {
        eprintln!("{}: this run has ended already", run.path().display());
        return report::print_result(&run, &result, shown);
    }
    let config = run.config()?;
    let fold = run.split()?.fold(&dataset)?;
    let (fitted, aside) = match config.promise {
        None => (fold.clone(), None),
        Some(promise) => {
            let (fitted, aside) = fold.set_aside()?;
            (fitted, Some((promise, aside)))
        }
    };
    let sessions = run.record_session(&this_session())?;
    if sessions.iter().any(|session| session.git != GIT) {
        eprintln!("this run was begun by another build; its result will name both commits");
    }

    let stopped = || {
        let path = run.path().display();
        eprintln!("stopped; continue with `tactnet train --resume {path}`");
        Ok(ExitCode::from(failure::INTERRUPTED))
    };
    let device = config.compute.open()?;
    let trained = match (&config.recipe, &config.classifier.model) {
        (ModelRecipe::TactNet2(recipe), ModelConfig::TactNet2(setup)) => {
            train_epochs(&run, &config, recipe, setup, &fitted.train, &stop)?
        }
        (ModelRecipe::Baseline(recipe), ModelConfig::Baseline(_)) => {
            fit(&run, &config, recipe, &fitted, &stop)?
        }
        _ => bail!(
            "{}: recipe and model do not belong together",
            run.path().display()
        ),
    };
    let Some(trained) = trained else {
        return stopped();
    };
    let weights = run.weights()?;
    let classifier = Classifier::new(config.classifier.clone(), &weights, &device)?;
    if let ModelConfig::TactNet2(_) = config.classifier.model {
        let known = TrainEmbeddings::of(&classifier.embed(&fitted.train)?);
        run.write_train_embeddings(&known)?;
        if let Some((promise, aside)) = &aside {
            let strangeness = NoveltyScorer::fit(&classifier, &known)?;
            let held_out = classifier.embed(aside)?;
            let score = NoveltyScore::BEST;
            let calibration = Calibration::fit(*promise, score, &strangeness, &held_out)?;
            run.write_calibration(&calibration)?;
        }
    }
    eprintln!("predicting {} test sweeps …", fold.test.len());
    let command = command_line(&config, &fold);
    let result = evaluate_run(
        &run,
        &config,
        &classifier,
        &fold,
        sessions,
        trained,
        command,
    )?;
    if stop.asked() {
        return stopped();
    }
    run.write_json("result.json", &result)
        .context("cannot write the result")?;
    report::print_result(&run, &result, shown)
}

fn this_session() -> Provenance {
    Provenance::of_this_process(env!("CARGO_PKG_VERSION"), GIT)
}

/// Loads data and recipe, checks both, and writes everything known before training.
fn prepare(arguments: &TrainArgs) -> anyhow::Result<(Dataset, RunDir)> {
    let (recipe_source, recipe) = chosen_recipe(arguments)?;
    let compute = arguments.device.compute();
    compute.open()?;
    let data = arguments.data.as_deref().unwrap_or(source::TWIN);
    let seed = Seed(arguments.seed);
    let label_order = if arguments.permute_labels {
        LabelOrder::Permuted
    } else {
        LabelOrder::True
    };
    let dataset = source::load_part(data, arguments.steps, label_order, seed)?;
    refuse_errors(&dataset, data)?;
    let scheme = match (arguments.split, arguments.fold) {
        (Some(SplitChoice::KFold), _) | (None, Some(_)) => Scheme::default(),
        (Some(SplitChoice::TestFlag), _) => Scheme::TestFlag,
        (Some(SplitChoice::LeaveBlockOut), _) => Scheme::LeaveBlockOut,
        (None, None) => Scheme::default_for(&dataset),
    };
    let fold = Fold::new(
        &dataset,
        scheme,
        seed,
        arguments.repeat,
        arguments.fold.unwrap_or(0),
    )?;
    let fold = match arguments.inner {
        None => fold,
        Some(part) => fold.nested(part)?,
    };
    let promise = arguments.promise();
    if let (ModelRecipe::Baseline(recipe), Some(_)) = (&recipe, promise) {
        bail!("--calibrate is for networks, `{}` is none", recipe.name);
    }
    let fitted = match promise {
        None => fold.clone(),
        Some(promise) => {
            let (fitted, aside) = fold.set_aside()?;
            promise.check(aside.len())?;
            fitted
        }
    };
    let model = match &recipe {
        ModelRecipe::TactNet2(recipe) => {
            ModelConfig::TactNet2(TactNetSetup::fit(recipe, &fitted.train))
        }
        ModelRecipe::Baseline(recipe) => ModelConfig::Baseline(recipe.clone()),
    };
    let classifier = ClassifierConfig::new(model, &fitted.train, seed);
    match &classifier.model {
        ModelConfig::TactNet2(setup) => drop(classifier.network_config(setup)?),
        ModelConfig::Baseline(recipe) => {
            recipe
                .features
                .check(classifier.shape, classifier.sample_rate_hz)?;
        }
    }
    let config = RunConfig {
        schema_version: RunConfig::SCHEMA_VERSION,
        data: data.into(),
        steps: arguments.steps,
        label_order,
        inner: arguments.inner,
        promise,
        recipe_source,
        data_sha256: dataset.sha256().into(),
        seed,
        compute,
        recipe,
        classifier,
    };
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => free_folder(dataset.name(), &config, &fold),
    };
    let run = RunDir::create(&out, &config, &fold.manifest(), &this_session())?;
    Ok((dataset, run))
}

/// What `--model`, `--recipe`, `--levels` and `--epochs` ask for: where the recipe comes from, and the recipe.
fn chosen_recipe(arguments: &TrainArgs) -> anyhow::Result<(String, ModelRecipe)> {
    let own = arguments.model.map(ModelChoice::recipe);
    let source = arguments.recipe.as_deref().or(own).unwrap_or("fast");
    let mut recipe = ModelRecipe::load(source)?;
    if let Some(model) = arguments.model {
        let fits = match &recipe {
            ModelRecipe::TactNet2(_) => model == ModelChoice::Tactnet2,
            ModelRecipe::Baseline(recipe) => recipe.name == model.recipe(),
        };
        if !fits {
            bail!(
                "recipe `{source}` does not train the model asked for; leave out --model or --recipe"
            );
        }
    }
    if let Some(levels) = arguments.levels {
        recipe = recipe.with_levels(levels.levels());
    }
    if let Some(epochs) = arguments.epochs {
        let ModelRecipe::TactNet2(network) = &mut recipe else {
            bail!("`{source}` is fitted at once: --epochs is for networks");
        };
        network.training.epochs = epochs;
        recipe = Recipe::parse("--epochs", &network.to_toml()).map(ModelRecipe::TactNet2)?;
    }
    Ok((source.into(), recipe))
}

/// `runs/DATA-RECIPE-FOLD-SEED`, or the first `…-2`, `…-3` that is free.
fn free_folder(dataset: &str, config: &RunConfig, fold: &Fold<'_>) -> PathBuf {
    let part = match fold.scheme() {
        Scheme::TestFlag => "test_flag".to_string(),
        Scheme::LeaveBlockOut => format!("block{}", fold.fold()),
        Scheme::StratifiedKFold { .. } if fold.repeat() == 0 => format!("fold{}", fold.fold()),
        Scheme::StratifiedKFold { .. } => format!("run{}_fold{}", fold.repeat(), fold.fold()),
    };
    let levels = match config.recipe.levels() {
        MeanRemoval::None => "",
        MeanRemoval::PerSweep => "-no_levels",
    };
    let name: String = format!(
        "{dataset}-{}{levels}-{part}-{}",
        config.recipe.name(),
        config.seed.0
    )
    .chars()
    .map(|c| {
        if c.is_alphanumeric() || "-_.".contains(c) {
            c
        } else {
            '_'
        }
    })
    .collect();
    let numbered = |number: usize| match number {
        1 => Path::new("runs").join(&name),
        _ => Path::new("runs").join(format!("{name}-{number}")),
    };
    let mut number = 1;
    while numbered(number).exists() {
        number += 1;
    }
    numbered(number)
}

/// Refuses a data set that `tactnet data check` finds errors in.
pub fn refuse_errors(dataset: &Dataset, data: &str) -> anyhow::Result<()> {
    let findings = check(dataset);
    let errors: Vec<_> = findings
        .iter()
        .filter(|finding| finding.severity == Severity::Error)
        .collect();
    if let Some(first) = errors.first() {
        bail!(
            "{data}: the data set has {} errors, the first: {}; `tactnet data check {data}` lists all",
            errors.len(),
            first.message
        );
    }
    Ok(())
}

/// Opens a run to go on with, and its data set, which must be the same as before.
fn reopen(path: &Path, data: Option<&str>) -> anyhow::Result<(Dataset, RunDir)> {
    let run = RunDir::open(path)?.locked()?;
    if !run.enrolled()?.is_empty() {
        bail!(
            "{}: materials were added to this classifier, so it cannot be trained further; train the run it came from, and enroll again",
            path.display()
        );
    }
    let config = run.config()?;
    let data = data.unwrap_or(&config.data);
    let dataset = source::load_part(data, config.steps, config.label_order, config.seed)?;
    if dataset.sha256() != config.data_sha256 {
        bail!(
            "{data}: the data set has changed since the run began: expected SHA-256 {}, found {}; \
             `--data FILE` names the right one",
            config.data_sha256,
            dataset.sha256()
        );
    }
    Ok((dataset, run))
}

/// Fits a baseline. `None` when somebody asked to stop; it then starts over.
fn fit(
    run: &RunDir,
    config: &RunConfig,
    recipe: &BaselineRecipe,
    fold: &Fold<'_>,
    stop: &Stop,
) -> anyhow::Result<Option<TrainingSummary>> {
    let begun = Instant::now();
    let say = |line: String| eprintln!("{:>4.0} s: {line}", begun.elapsed().as_secs_f64());
    let fitted = fit_baseline(recipe, fold, config.seed, say)?;
    if stop.asked() {
        return Ok(None);
    }
    let seconds = begun.elapsed().as_secs_f64();
    let metadata = [("format".to_string(), "tactnet baseline 1".to_string())].into();
    run.write(
        "weights.safetensors",
        &fitted.weights.to_safetensors(metadata)?,
    )?;
    Ok(Some(TrainingSummary {
        seconds,
        sweeps: fold.train.len(),
        epochs: None,
        chosen: fitted.chosen,
    }))
}

/// The training loop. `None` when somebody asked to stop; the run can then be resumed.
fn train_epochs(
    run: &RunDir,
    config: &RunConfig,
    recipe: &Recipe,
    setup: &TactNetSetup,
    train: &TrainSplit<'_>,
    stop: &Stop,
) -> anyhow::Result<Option<TrainingSummary>> {
    let device = config.compute.open()?;
    let network = config.classifier.network_config(setup)?;
    let mut training = Training::start(
        recipe,
        train,
        &setup.normalizer,
        &network,
        config.seed,
        &device,
    )?;
    let mut seconds = 0.0;
    if let Some((state, spent)) = run.checkpoint()? {
        training = training.resume(state)?;
        seconds = spent;
    }
    let mut metrics = run.metrics_before(training.position().epoch + 1)?;
    let mut epoch_seconds = 0.0;
    let mut saved = Instant::now();
    let progress = Progress::new(&training, recipe.training.epochs);

    loop {
        let begun = Instant::now();
        let Some(batch) = training.step()? else { break };
        let spent = begun.elapsed().as_secs_f64();
        seconds += spent;
        epoch_seconds += spent;
        progress.show(&batch, recipe.training.epochs);
        if batch.ends_epoch() {
            metrics.push(EpochMetrics {
                epoch: batch.epoch + 1,
                train_loss: batch.mean_loss,
                train_accuracy: batch.accuracy,
                learning_rate: batch.learning_rate,
                seconds: epoch_seconds,
            });
            run.write_metrics(&metrics)?;
            epoch_seconds = 0.0;
        }
        if batch.ends_epoch() || stop.asked() || saved.elapsed() >= CHECKPOINT_EVERY {
            run.write_checkpoint(&training.state()?, seconds)?;
            tracing::debug!(
                epoch = batch.epoch + 1,
                batch = batch.batch + 1,
                "checkpoint written"
            );
            saved = Instant::now();
        }
        if stop.asked() {
            return Ok(None);
        }
    }
    progress.end();
    let state = training.state()?;
    run.write_checkpoint(&state, seconds)?;
    let metadata = [("format".to_string(), "tactnet weights 1".to_string())].into();
    run.write(
        "weights.safetensors",
        &state.weights.to_safetensors(metadata)?,
    )?;
    Ok(Some(TrainingSummary {
        seconds,
        sweeps: train.len(),
        epochs: Some(recipe.training.epochs),
        ..TrainingSummary::default()
    }))
}

/// The call that leads to the same result, with file names only.
fn command_line(config: &RunConfig, fold: &Fold<'_>) -> String {
    let file_name = |path: &str| {
        Path::new(path).file_name().map_or_else(
            || path.to_string(),
            |name| name.to_string_lossy().into_owned(),
        )
    };
    let split = match fold.scheme() {
        Scheme::TestFlag => "test-flag",
        Scheme::LeaveBlockOut => "leave-block-out",
        Scheme::StratifiedKFold { .. } => "k-fold",
    };
    let device = match config.compute {
        Compute::Cpu => "cpu",
        Compute::Vulkan => "vulkan",
        Compute::Cuda => "cuda",
    };
    let levels = config.recipe.levels().name();
    let epochs = match &config.recipe {
        ModelRecipe::TactNet2(recipe) => format!(" --epochs {}", recipe.training.epochs),
        ModelRecipe::Baseline(_) => String::new(),
    };
    let steps = config
        .steps
        .map_or(String::new(), |steps| format!(" --steps {steps}"));
    let permuted = match config.label_order {
        LabelOrder::True => "",
        LabelOrder::Permuted => " --permute-labels",
    };
    let inner = config
        .inner
        .map_or(String::new(), |part| format!(" --inner {part}"));
    let calibrate = config.promise.map_or(String::new(), |promise| {
        format!(
            " --calibrate --false-alarms {} --coverage {}",
            promise.false_alarms, promise.coverage
        )
    });
    format!(
        "tactnet train --data {}{steps}{permuted} --recipe {}{epochs} --levels {levels} --split {split} --repeat {} --fold {}{inner}{calibrate} --seed {} --device {device}",
        file_name(&config.data),
        file_name(&config.recipe_source),
        fold.repeat(),
        fold.fold(),
        config.seed.0
    )
}
