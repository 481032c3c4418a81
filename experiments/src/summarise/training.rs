//! Reads finished trainings for the summary.

use tactnet_data::{Scheme, SplitManifest};
use tactnet_pipeline::{Evaluation, ModelRecipe, PredictionMethod, RunConfig, RunDir, RunResult};

use super::finished::FinishedTask;
use crate::phrases::few_sweeps;
use crate::tasks::ExperimentDir;
use crate::{ExperimentError, Measure, Measurement, Part, Task, TaskRecord};

/// Reads the run directory of a finished training.
///
/// # Errors
/// A damaged run directory, or a result that does not match its predictions.
pub(crate) fn read_training<'a>(
    dir: &'a ExperimentDir,
    task: &'a Task,
) -> Result<FinishedTask<'a>, ExperimentError> {
    let path = dir.task_dir(task);
    let run = RunDir::open(&path)?;
    let result = run
        .verified_result()?
        .ok_or_else(|| ExperimentError::Folder {
            path: path.clone(),
            reason: "expected a result.json, found none".into(),
        })?;
    let (config, split) = (run.config()?, run.split()?);
    let setting = split_name(&split, &config);
    let mut measurements = Vec::new();
    for (method, evaluation) in &result.evaluations {
        measurements.extend(measured(*method, &setting, evaluation, &result));
    }
    let test_share = test_share(&result, &split, &config);
    Ok(FinishedTask {
        task,
        model: shown_model(&task.model, &result.recipe),
        data: result.data,
        label_order: config.spec.label_order,
        recipe_key: recipe_key(&config.recipe),
        origin: result.origin,
        data_sha256: result.data_sha256,
        assumed_rate_hz: config
            .classifier
            .sample_rate_assumed
            .then_some(config.classifier.sample_rate_hz),
        materials: config.classifier.labels.len(),
        levels: config.recipe.levels(),
        steps: (config.classifier.shape.steps, config.spec.steps),
        processors: result
            .provenance
            .iter()
            .map(|session| session.processor.clone())
            .collect(),
        test_share,
        measurements,
        maps: Vec::new(),
        record: TaskRecord {
            id: task.id.clone(),
            part: Part::Fold {
                repeat: result.repeat,
                fold: result.fold,
            },
            command: result.command,
            split: result.split,
            split_sha256: result.split_sha256,
            recipe_sha256: result.recipe_sha256,
            git: result.git,
            seconds: result.train_seconds,
            chosen: result.chosen,
        },
    })
}

/// Returns the ratio of test to training sweeps. Few sweeps that are drawn from the training sweeps of a fold overlap less between folds than
/// these do, so the ratio of the folds is an upper bound for them, while theirs would be far above 1.
fn test_share(result: &RunResult, split: &SplitManifest, config: &RunConfig) -> f64 {
    match (config.spec.shots, split.scheme) {
        (Some(_), Scheme::StratifiedKFold { folds, .. } | Scheme::GroupKFold { folds, .. }) => {
            1.0 / (folds as f64 - 1.0)
        }
        _ => result.test_share(),
    }
}

/// Returns the text of a recipe without its epochs, whose number depends on the size of the fold.
fn recipe_key(recipe: &ModelRecipe) -> String {
    recipe.clone().with_epochs(0).to_toml()
}

/// Returns the measurements of one prediction method.
fn measured(
    method: PredictionMethod,
    setting: &str,
    evaluation: &Evaluation,
    result: &RunResult,
) -> Vec<Measurement> {
    let mut values = vec![(Measure::Accuracy, 1, evaluation.one_sweep.mean)];
    if let Some(balanced) = &evaluation.balanced {
        values.push((Measure::BalancedAccuracy, 1, balanced.mean));
    }
    if let Some(fused) = &evaluation.fused {
        values.push((Measure::Accuracy, fused.sweeps, fused.bayes.mean));
        values.push((Measure::VoteAccuracy, fused.sweeps, fused.majority.mean));
    }
    values.extend([
        (
            Measure::NegativeLogLikelihood,
            1,
            evaluation.negative_log_likelihood,
        ),
        (
            Measure::ExpectedCalibrationError,
            1,
            evaluation.expected_calibration_error,
        ),
        (Measure::Brier, 1, evaluation.brier),
        (Measure::TrainSeconds, 1, result.train_seconds),
    ]);
    values
        .into_iter()
        .map(|(measure, sweeps, value)| {
            Measurement::new(measure, method.name(), value, result.n_test)
                .setting(setting)
                .sweeps(sweeps)
        })
        .collect()
}

/// Returns the name of the model, or its recipe's longer title (for example with drawn settings).
fn shown_model(name: &str, title: &str) -> String {
    if title.starts_with(name) {
        title.into()
    } else {
        name.into()
    }
}

/// Returns the description of a split.
pub(super) fn split_name(split: &SplitManifest, config: &RunConfig) -> String {
    let scheme = match split.scheme {
        Scheme::StratifiedKFold { folds, .. } => format!("{folds} random folds"),
        Scheme::HoldOut { test_percent, .. } => format!("{test_percent} % held out"),
        Scheme::TestFlag => "author's test sweeps".into(),
        Scheme::TrainOnAll => "no test sweeps".into(),
        Scheme::LeaveBlockOut => "block left out".into(),
        Scheme::GroupKFold { folds, .. } => format!("{folds} folds of whole blocks"),
    };
    let few = config.spec.shots.map_or(String::new(), few_sweeps);
    match config.spec.inner {
        None => format!("{scheme}{few}"),
        Some(part) => format!("{scheme}, judged by inner part {part}{few}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folds_of_one_recipe_have_one_key() {
        let of_sweeps = |name: &str, sweeps| match ModelRecipe::load(name).unwrap() {
            ModelRecipe::Network(recipe) => recipe.for_sweeps(sweeps),
            _ => panic!("a network"),
        };
        let (one, other) = (of_sweeps("fast", 72), of_sweeps("fast", 73));
        assert_ne!(
            one.training.epochs, other.training.epochs,
            "folds that straddle a batch"
        );
        let key = |recipe| recipe_key(&ModelRecipe::Network(recipe));
        assert_eq!(key(one.clone()), key(other));
        let mut changed = one.clone();
        changed.training.batch += 1;
        assert_ne!(key(one), key(changed));
    }
}
