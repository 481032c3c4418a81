//! Evaluation of a trained classifier into its run directory.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use tactnet_data::{Fold, sha256_hex};

use crate::{
    Classifier, ConfoundedAccuracy, Evaluation, ModelRecipe, PipelineError, PredictionSource,
    Predictions, Provenance, RunConfig, RunDir, RunResult, describe_split, evaluate_all_ways,
    peak_rss_mib,
};

/// Number of sweeps that are fused into one decision in a result.
pub(crate) const FUSED: usize = 3;
/// Number of Monte Carlo passes if the recipe names none.
pub(super) const MC_SAMPLES: usize = 100;

/// Result of a training besides its weights.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct TrainingSummary {
    /// Time spent in training steps or in fitting, seconds.
    pub seconds: f64,
    /// Number of training sweeps.
    pub sweeps: usize,
    /// Number of epochs trained; `None` for a baseline or committee.
    pub epochs: Option<usize>,
    /// Settings selected on training sweeps, by name.
    pub chosen: BTreeMap<String, f64>,
}

/// Predicts the test sweeps by every method, writes predictions and confusion matrix into `run`, and returns the result without writing it.
///
/// - `sessions`: program and machine of every session that trained
/// - `command`: command line that reproduces the result
///
/// # Errors
/// Sweeps that do not match the classifier; a file that cannot be written.
pub fn evaluate_run(
    run: &RunDir,
    config: &RunConfig,
    classifier: &Classifier,
    fold: &Fold<'_>,
    sessions: Vec<Provenance>,
    trained: TrainingSummary,
    command: String,
) -> Result<RunResult, PipelineError> {
    let mc_samples = config.recipe.method().mc_samples_or(MC_SAMPLES);
    let ways = evaluate_all_ways(classifier, &fold.test, mc_samples, FUSED, config.spec.seed)?;
    write_evaluation(run, config, ways, fold, sessions, trained, command)
}

/// Writes predictions and confusion matrix into `run`, and returns the result without writing it.
///
/// - `ways`: predictions and evaluation of every method
///
/// # Errors
/// A file that cannot be written.
pub(super) fn write_evaluation(
    run: &RunDir,
    config: &RunConfig,
    ways: Vec<(Predictions, Evaluation)>,
    fold: &Fold<'_>,
    sessions: Vec<Provenance>,
    trained: TrainingSummary,
    command: String,
) -> Result<RunResult, PipelineError> {
    let (recipe, own) = (&config.recipe, config.recipe.method());
    let dataset = fold.test.dataset();
    let mut predictions = ways.iter().map(|(predictions, _)| predictions);
    let of_recipe = predictions.find(|predictions| predictions.method == own);
    let confounded = of_recipe.and_then(|own| ConfoundedAccuracy::of(dataset, own));
    let evaluations = ways.into_iter().map(|(predictions, evaluation)| {
        write_predictions(run, recipe, fold, &predictions, &command)?;
        Ok((predictions.method, evaluation))
    });
    let evaluations = evaluations.collect::<Result<BTreeMap<_, _>, PipelineError>>()?;
    let chosen = &evaluations[&own];
    let manifest = fold.manifest();
    let commits: BTreeSet<String> = sessions.iter().map(|session| session.git.clone()).collect();
    Ok(RunResult {
        schema_version: RunResult::SCHEMA_VERSION,
        data: dataset.name().into(),
        origin: dataset.origin(),
        data_sha256: dataset.sha256().into(),
        git: commits.into_iter().collect(),
        command,
        seed: config.spec.seed,
        recipe: recipe.name().into(),
        recipe_sha256: sha256_hex(recipe.to_toml()),
        split_sha256: manifest.sha256.clone(),
        split: describe_split(&manifest, &config.spec),
        repeat: fold.repeat(),
        fold: fold.fold(),
        n_train: trained.sweeps,
        n_test: fold.test.len(),
        epochs: trained.epochs,
        chosen: trained.chosen,
        accuracy_one_sweep: chosen.one_sweep,
        accuracy_three_sweeps: chosen.fused.map(|fused| fused.bayes),
        random_fold: None,
        confounded,
        evaluations,
        train_seconds: trained.seconds,
        seconds_per_epoch: trained.epochs.map(|epochs| trained.seconds / epochs as f64),
        peak_rss_mib: peak_rss_mib(),
        provenance: sessions,
    })
}

/// Writes predictions into `run`, and the confusion matrix of the recipe's own method.
fn write_predictions(
    run: &RunDir,
    recipe: &ModelRecipe,
    fold: &Fold<'_>,
    predictions: &Predictions,
    command: &str,
) -> Result<(), PipelineError> {
    let dataset = fold.test.dataset();
    let (method, own) = (predictions.method, recipe.method());
    let name = method.name();
    let tsml = predictions.to_tsml(&PredictionSource {
        dataset: dataset.name(),
        classifier: &format!("{} ({name})", recipe.name()),
        resample: fold.repeat() * 1000 + fold.fold(),
        parameters: command,
    });
    run.write(&RunDir::predictions_file(method, own), tsml.as_bytes())?;
    if method == own {
        let title = format!(
            "{}: {:.1} % of {} test sweeps right (recipe {}, {name})",
            dataset.name(),
            100.0 * predictions.accuracy(),
            fold.test.len(),
            recipe.name()
        );
        let picture = predictions.confusion_svg(&title);
        run.write("confusion.svg", picture.as_bytes())?;
    }
    Ok(())
}
