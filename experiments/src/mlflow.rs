//! Export to the folder layout that MLflow's tracking UI opens (`mlflow ui --backend-store-uri DIR`).
//!
//! One MLflow experiment; one run a task, with parameters, final metrics, the course of training, and the run directory's files as
//! artefacts. Layout: `mlflow.store.tracking.file_store` of MLflow 3.

use std::fs;
use std::path::Path;
use std::time::UNIX_EPOCH;

use sha2::{Digest, Sha256};
use tactnet_pipeline::{Evaluation, RunDir};
use toml::Value;

use crate::tasks::{ExperimentDir, TaskState};
use crate::{ExperimentError, Probe, Task};

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
    if dir.plan.recipe.study.is_some() {
        return Err(ExperimentError::Folder {
            path: dir.path().into(),
            reason: "a study's tasks are no training runs, which is what MLflow shows; its numbers are in summary.json".into(),
        });
    }
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

fn export_task(
    dir: &ExperimentDir,
    task: &Task,
    experiment: &Path,
    id: &str,
) -> Result<(), ExperimentError> {
    let folder = dir.task_dir(task);
    let run = RunDir::open(&folder)?;
    let (Some(result), config) = (run.result()?, run.config()?) else {
        return Ok(());
    };
    let uuid: String = hex(&task.id).chars().take(32).collect();
    let target = experiment.join(&uuid);
    let end = millis(&folder.join("result.json"));
    let start = end.saturating_sub((result.train_seconds * 1e3) as u128);
    write(
        &target.join("meta.yaml"),
        &format!(
            "artifact_uri: {}\nend_time: {end}\nentry_point_name: ''\nexperiment_id: '{id}'\nlifecycle_stage: active\nrun_id: {uuid}\n\
             run_name: {}\nrun_uuid: {uuid}\nsource_name: ''\nsource_type: 4\nsource_version: {}\nstart_time: {start}\nstatus: 3\n\
             tags: []\nuser_id: tactnet\n",
            uri(&target.join("artifacts")),
            yaml(&task.id),
            yaml(&result.git)
        ),
    )?;
    for folder in ["metrics", "params", "tags", "artifacts"] {
        let path = target.join(folder);
        fs::create_dir_all(&path).map_err(|error| ExperimentError::io(&path, "make", error))?;
    }
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
    for (name, value) in &parameters {
        write(&target.join("params").join(name), value)?;
    }
    let metric = |name: &str, value: f64| {
        write(
            &target.join("metrics").join(name),
            &format!("{end} {value} 0\n"),
        )
    };
    for (way, evaluation) in &result.evaluations {
        let Evaluation {
            one_sweep,
            fused,
            negative_log_likelihood,
            expected_calibration_error,
            brier,
            ..
        } = evaluation;
        metric(&format!("{way}.accuracy"), one_sweep.mean)?;
        if let Some(fused) = fused {
            metric(
                &format!("{way}.accuracy_{}_sweeps", fused.sweeps),
                fused.bayes.mean,
            )?;
        }
        metric(
            &format!("{way}.negative_log_likelihood"),
            *negative_log_likelihood,
        )?;
        metric(
            &format!("{way}.expected_calibration_error"),
            *expected_calibration_error,
        )?;
        metric(&format!("{way}.brier"), *brier)?;
    }
    metric("train_seconds", result.train_seconds)?;
    let course = run.metrics_before(usize::MAX)?;
    let line = |value: f64, epoch: usize| format!("{end} {value} {epoch}\n");
    if !course.is_empty() {
        let losses: String = course.iter().map(|e| line(e.train_loss, e.epoch)).collect();
        write(&target.join("metrics/train_loss"), &losses)?;
        let accuracies: String = course
            .iter()
            .map(|e| line(e.train_accuracy, e.epoch))
            .collect();
        write(&target.join("metrics/train_accuracy"), &accuracies)?;
    }
    let probe = match task.probe {
        None => "no",
        Some(Probe::Means) => "taxel means",
        Some(Probe::Permuted) => "permuted labels",
    };
    for (tag, value) in [
        ("mlflow.runName", task.id.as_str()),
        ("mlflow.source.git.commit", &result.git),
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

fn hex(text: &str) -> String {
    Sha256::digest(text)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// A number that stands for a name: MLflow's experiments are numbered.
fn number(name: &str) -> String {
    let digest = Sha256::digest(name);
    let mut bytes = [0; 8];
    bytes.copy_from_slice(&digest[..8]);
    (u64::from_be_bytes(bytes) % 1_000_000_000_000_000_000).to_string()
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
