//! Conversion of tasks to MLflow runs.

use std::path::Path;

use tactnet_pipeline::{EpochMetrics, Evaluation, RunDir};
use toml::Value;

use crate::tasks::ExperimentDir;
use crate::{ExperimentError, Measurement, QuestionTask, Task};

/// Content of one MLflow run.
pub(super) struct Run {
    /// Commits of the program, separated by spaces.
    pub(super) git: String,
    /// Duration of the task, in seconds.
    pub(super) seconds: f64,
    pub(super) parameters: Vec<(String, String)>,
    pub(super) metrics: Vec<(String, f64)>,
    /// Curves by name: epoch and value.
    pub(super) courses: Vec<(&'static str, Vec<(usize, f64)>)>,
}

/// Reads a training from its run directory; `None` if it has no result.
pub(super) fn training(folder: &Path) -> Result<Option<Run>, ExperimentError> {
    let run = RunDir::open(folder)?;
    let (Some(result), config) = (run.result()?, run.config()?) else {
        return Ok(None);
    };
    let mut parameters = vec![
        ("data".to_string(), result.data.clone()),
        ("data_sha256".into(), result.data_sha256.clone()),
        ("model".into(), result.recipe.clone()),
        ("levels".into(), config.recipe.levels().name().into()),
        ("split".into(), result.split.clone()),
        ("split_sha256".into(), result.split_sha256.clone()),
        ("repeat".into(), result.repeat.to_string()),
        ("fold".into(), result.fold.to_string()),
        ("seed".into(), result.seed.0.to_string()),
        ("command".into(), result.command.clone()),
    ];
    if let Ok(table) = config.recipe.to_toml().parse::<toml::Table>() {
        flatten("recipe", &Value::Table(table), &mut parameters);
    }
    let evaluations = result.evaluations.iter();
    let mut metrics: Vec<(String, f64)> = evaluations
        .flat_map(|(method, evaluation)| evaluation_metrics(method.name(), evaluation))
        .collect();
    metrics.push(("train_seconds".into(), result.train_seconds));
    let epochs = run.metrics_before(usize::MAX)?;
    let course = |of: fn(&EpochMetrics) -> f64| -> Vec<(usize, f64)> {
        epochs
            .iter()
            .map(|epoch| (epoch.epoch, of(epoch)))
            .collect()
    };
    Ok(Some(Run {
        seconds: result.train_seconds,
        parameters,
        metrics,
        courses: vec![
            ("train_loss", course(|epoch| epoch.train_loss)),
            ("train_accuracy", course(|epoch| epoch.train_accuracy)),
        ],
        git: result.git.join(" "),
    }))
}

/// Returns the metrics of one prediction method.
fn evaluation_metrics(way: &str, evaluation: &Evaluation) -> Vec<(String, f64)> {
    let mut metrics = vec![(format!("{way}.accuracy"), evaluation.one_sweep.mean)];
    if let Some(fused) = &evaluation.fused {
        let name = format!("{way}.accuracy_{}_sweeps", fused.sweeps);
        metrics.push((name, fused.bayes.mean));
    }
    let scores = [
        (
            "negative_log_likelihood",
            evaluation.negative_log_likelihood,
        ),
        (
            "expected_calibration_error",
            evaluation.expected_calibration_error,
        ),
        ("brier", evaluation.brier),
    ];
    metrics.extend(scores.map(|(name, value)| (format!("{way}.{name}"), value)));
    metrics
}

/// Reads the result of a question's task.
pub(super) fn question(
    dir: &ExperimentDir,
    task: &Task,
    asked: &QuestionTask,
) -> Result<Run, ExperimentError> {
    let result = dir.question_result(task)?;
    let (repeat, fold) = asked.part.repeat_and_fold();
    let mut parameters = vec![
        ("data".to_string(), result.data),
        ("data_sha256".into(), result.data_sha256),
        ("model".into(), result.recipe),
        ("recipe_sha256".into(), result.recipe_sha256),
        ("levels".into(), result.levels.name().into()),
        ("split".into(), result.split),
        ("split_sha256".into(), result.split_sha256),
        ("repeat".into(), repeat.to_string()),
        ("fold".into(), fold.to_string()),
        ("seed".into(), asked.networks.seed.0.to_string()),
    ];
    if let Ok(fields) = Value::try_from(&asked.question) {
        flatten("question", &fields, &mut parameters);
    }
    for (name, value) in &result.chosen {
        parameters.push((allowed(&format!("chosen.{name}")), value.to_string()));
    }
    let mut metrics: Vec<(String, f64)> = result
        .measurements
        .iter()
        .map(|measurement| (metric_name(measurement), measurement.value))
        .collect();
    metrics.push(("train_seconds".into(), result.seconds));
    Ok(Run {
        git: result.provenance.git,
        seconds: result.seconds,
        parameters,
        metrics,
        courses: Vec::new(),
    })
}

/// Returns the name of a metric, such as `ol-mean.accuracy.3_shots`.
fn metric_name(measurement: &Measurement) -> String {
    let mut name = format!("{}.{}", measurement.method, measurement.measure);
    if !measurement.setting.is_empty() {
        name.push('.');
        name.push_str(&measurement.setting);
    }
    for (count, what) in [(measurement.shots, "shots"), (measurement.sweeps, "sweeps")] {
        if let Some(count) = count {
            name.push_str(&format!(".{count}_{what}"));
        }
    }
    allowed(&name)
}

/// Replaces the characters that MLflow forbids in names.
fn allowed(name: &str) -> String {
    let kept = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let replaced = name.replace(", ", "_").replace(' ', "_");
    replaced
        .chars()
        .map(|c| if kept(c) { c } else { '_' })
        .collect()
}

/// Appends all leaves of a TOML value under dotted names such as `recipe.training.epochs`.
fn flatten(path: &str, value: &Value, into: &mut Vec<(String, String)>) {
    match value {
        Value::Table(table) => {
            for (name, value) in table {
                flatten(&format!("{path}.{name}"), value, into);
            }
        }
        Value::String(text) => into.push((path.into(), text.clone())),
        other => into.push((path.into(), other.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Measure;

    #[test]
    fn measurements_are_metrics_with_names_that_mlflow_allows() {
        let lost =
            Measurement::new(Measure::KnownLost, "knowledge prior, a tenth", 0.1, 9).shots(5);
        assert_eq!(
            metric_name(&lost),
            "knowledge_prior_a_tenth.known_lost.5_shots"
        );
        let pairs = Measurement::new(Measure::Accuracy, "siamese", 0.1, 9)
            .setting("all pairs")
            .sweeps(3);
        assert_eq!(metric_name(&pairs), "siamese.accuracy.all_pairs.3_sweeps");
        let target =
            Measurement::new(Measure::Coverage, "conformal set", 0.9, 9).setting("target 90 %");
        assert_eq!(metric_name(&target), "conformal_set.coverage.target_90__");
    }
}
