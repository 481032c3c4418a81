//! Export to the folder layout that MLflow's tracking UI opens (`mlflow ui --backend-store-uri DIR`).
//!
//! One MLflow experiment; one run a task. A training has parameters, final metrics, the course of training, and the run directory's
//! files as artefacts; a question has its fields as parameters and its measurements as metrics. Layout: `mlflow.store.tracking.file_store` of MLflow 3.

use std::fs;
use std::path::Path;
use std::time::UNIX_EPOCH;

use tactnet_data::sha256_hex;
use tactnet_pipeline::{EpochMetrics, Evaluation, RunDir};
use toml::Value;

use crate::tasks::{ExperimentDir, TaskState};
use crate::{ExperimentError, Job, Measurement, Probe, QuestionTask, Task};

/// Files that become artefacts.
const ARTEFACTS: [&str; 5] = [
    "result.json",
    "config.json",
    "split.json",
    "predictions_test.csv",
    "confusion.svg",
];

/// Writes every task that has ended; gives their number.
///
/// # Errors
/// A folder that is not empty or cannot be written; a damaged run directory.
pub fn export_mlflow(dir: &ExperimentDir, out: &Path) -> Result<usize, ExperimentError> {
    let failed = |error| ExperimentError::io(out, "make the folder", error);
    if out.exists() && fs::read_dir(out).map_err(failed)?.next().is_some() {
        return Err(ExperimentError::Folder {
            path: out.into(),
            reason: "an export needs an empty or new folder".into(),
        });
    }
    fs::create_dir_all(out).map_err(failed)?;
    let out = out.canonicalize().map_err(failed)?;
    let recipe = &dir.plan.recipe;
    let id = number(&recipe.name);
    let experiment = out.join(&id);
    let made = millis(&dir.path().join("experiment.json"));
    write(
        &experiment.join("meta.yaml"),
        &format!(
            "artifact_location: {}\ncreation_time: {made}\nexperiment_id: '{id}'\nlast_update_time: {made}\nlifecycle_stage: active\nname: {}\n",
            uri(&experiment),
            yaml(&recipe.name)
        ),
    )?;
    write(
        &experiment.join("tags/mlflow.note.content"),
        &recipe.expects,
    )?;
    // MLflow expects its default experiment to be there.
    let default = out.join("0");
    if id != "0" {
        write(
            &default.join("meta.yaml"),
            &format!(
                "artifact_location: {}\ncreation_time: {made}\nexperiment_id: '0'\nlast_update_time: {made}\nlifecycle_stage: active\nname: Default\n",
                uri(&default)
            ),
        )?;
    }
    let mut count = 0;
    for task in &dir.plan.tasks {
        if dir.state(task) == TaskState::Done {
            export_task(dir, task, &experiment, &id)?;
            count += 1;
        }
    }
    Ok(count)
}

/// One run in MLflow's words: names and values.
struct Run {
    /// Commit of the program.
    git: String,
    /// Time of the task, seconds.
    seconds: f64,
    parameters: Vec<(String, String)>,
    metrics: Vec<(String, f64)>,
    /// Value of every epoch, by name.
    courses: Vec<(&'static str, Vec<(usize, f64)>)>,
}

fn export_task(
    dir: &ExperimentDir,
    task: &Task,
    experiment: &Path,
    id: &str,
) -> Result<(), ExperimentError> {
    let folder = dir.task_dir(task);
    let run = match &task.job {
        Job::Train(_) => match training(&folder)? {
            Some(run) => run,
            None => return Ok(()),
        },
        Job::Question(asked) => question(dir, task, asked)?,
    };
    let uuid: String = sha256_hex(&task.id).chars().take(32).collect();
    let target = experiment.join(&uuid);
    let end = millis(&folder.join("result.json"));
    let start = end.saturating_sub((run.seconds * 1e3) as u128);
    write(
        &target.join("meta.yaml"),
        &format!(
            "artifact_uri: {}\nend_time: {end}\nentry_point_name: ''\nexperiment_id: '{id}'\nlifecycle_stage: active\nrun_id: {uuid}\n\
             run_name: {}\nrun_uuid: {uuid}\nsource_name: ''\nsource_type: 4\nsource_version: {}\nstart_time: {start}\nstatus: 3\n\
             tags: []\nuser_id: tactnet\n",
            uri(&target.join("artifacts")),
            yaml(&task.id),
            yaml(&run.git)
        ),
    )?;
    for folder in ["metrics", "params", "tags", "artifacts"] {
        let path = target.join(folder);
        fs::create_dir_all(&path).map_err(|error| ExperimentError::io(&path, "make", error))?;
    }
    for (name, value) in &run.parameters {
        write(&target.join("params").join(name), value)?;
    }
    for (name, value) in &run.metrics {
        let path = target.join("metrics").join(name);
        write(&path, &format!("{end} {value} 0\n"))?;
    }
    for (name, course) in run.courses.iter().filter(|(_, course)| !course.is_empty()) {
        let lines: String = course
            .iter()
            .map(|(epoch, value)| format!("{end} {value} {epoch}\n"))
            .collect();
        write(&target.join("metrics").join(name), &lines)?;
    }
    let probe = match task.probe {
        None => "no",
        Some(Probe::Means) => "taxel means",
        Some(Probe::Permuted) => "permuted labels",
    };
    for (tag, value) in [
        ("mlflow.runName", task.id.as_str()),
        ("mlflow.source.git.commit", &run.git),
        ("probe", probe),
    ] {
        write(&target.join("tags").join(tag), value)?;
    }
    for file in ARTEFACTS {
        let (from, to) = (folder.join(file), target.join("artifacts").join(file));
        if from.exists() {
            fs::copy(&from, &to).map_err(|error| ExperimentError::io(&to, "write", error))?;
        }
    }
    Ok(())
}

/// A training, from its run directory; `None` where it has no result.
fn training(folder: &Path) -> Result<Option<Run>, ExperimentError> {
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
    let mut metrics = Vec::new();
    for (way, evaluation) in &result.evaluations {
        let Evaluation {
            one_sweep,
            fused,
            negative_log_likelihood,
            expected_calibration_error,
            brier,
            ..
        } = evaluation;
        metrics.push((format!("{way}.accuracy"), one_sweep.mean));
        if let Some(fused) = fused {
            let name = format!("{way}.accuracy_{}_sweeps", fused.sweeps);
            metrics.push((name, fused.bayes.mean));
        }
        metrics.extend([
            (
                format!("{way}.negative_log_likelihood"),
                *negative_log_likelihood,
            ),
            (
                format!("{way}.expected_calibration_error"),
                *expected_calibration_error,
            ),
            (format!("{way}.brier"), *brier),
        ]);
    }
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
        git: result.git,
    }))
}

/// The task of a question, from its result.
fn question(
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

/// `ol-mean.accuracy.3_shots` and its like.
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

/// A name with nothing that MLflow forbids in one.
fn allowed(name: &str) -> String {
    let kept = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let replaced = name.replace(", ", "_").replace(' ', "_");
    replaced
        .chars()
        .map(|c| if kept(c) { c } else { '_' })
        .collect()
}

/// `recipe.training.epochs` and its like.
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

fn write(path: &Path, text: &str) -> Result<(), ExperimentError> {
    let failed = |error| ExperimentError::io(path, "write", error);
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(failed)?;
    }
    fs::write(path, text).map_err(failed)
}

/// When a file was written, milliseconds since 1970.
fn millis(path: &Path) -> u128 {
    let written = fs::metadata(path).and_then(|meta| meta.modified()).ok();
    written
        .and_then(|time| time.duration_since(UNIX_EPOCH).ok())
        .map_or(0, |time| time.as_millis())
}

/// Returns the number that stands for a name, as MLflow's experiments are numbered: its hash, at most 18 digits.
fn number(name: &str) -> String {
    // Sixteen hexadecimal digits are 64 bits.
    let hash = u64::from_str_radix(&sha256_hex(name)[..16], 16)
        .unwrap_or_else(|error| panic!("a hash is hexadecimal: {error}"));
    (hash % 1_000_000_000_000_000_000).to_string()
}

/// A YAML string in single quotes.
fn yaml(text: &str) -> String {
    format!("'{}'", text.replace('\'', "''"))
}

fn uri(path: &Path) -> String {
    let text = path.display().to_string();
    let kept = |c: char| c.is_ascii_alphanumeric() || "/-_.~".contains(c);
    let encoded: String = text
        .chars()
        .map(|c| {
            if kept(c) {
                c.to_string()
            } else {
                c.to_string()
                    .bytes()
                    .map(|byte| format!("%{byte:02X}"))
                    .collect()
            }
        })
        .collect();
    yaml(&format!("file://{encoded}"))
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
