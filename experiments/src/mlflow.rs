//! Export to the folder layout that MLflow's tracking UI opens (`mlflow ui --backend-store-uri DIR`).
//!
//! The experiment becomes one MLflow experiment, and each task one run. A training exports parameters, final metrics,
//! training curves, and the files of its run directory as artefacts. A question exports its fields as parameters and
//! its measurements as metrics.
//!
//! Layout: `mlflow.store.tracking.file_store` of MLflow 3.

mod run;

use std::fs;
use std::path::Path;
use std::time::UNIX_EPOCH;

use tactnet_data::sha256_hex;
use tactnet_pipeline::write_whole;

use crate::tasks::{ExperimentDir, TaskState};
use crate::{ExperimentError, Job, Probe, Task};
use run::{Run, question, training};

/// Files of a run directory that are exported as artefacts.
const ARTEFACTS: [&str; 5] = [
    "result.json",
    "config.json",
    "split.json",
    "predictions_test.csv",
    "confusion.svg",
];

/// Exports all finished tasks and returns their number.
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
    // MLflow requires its default experiment.
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
    write_run(&target, &run, end)?;
    let probe = match task.probe {
        None => "no",
        Some(Probe::Means) => "taxel means",
        Some(Probe::FirstFrame) => "first frame",
        Some(Probe::LastFrame) => "last frame",
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
            let bytes =
                fs::read(&from).map_err(|error| ExperimentError::io(&from, "read", error))?;
            write_whole(&to, &bytes)?;
        }
    }
    Ok(())
}

/// Creates the folders of a run and writes its parameters and metrics.
///
/// - `end`: time of the end, in milliseconds since 1970
fn write_run(target: &Path, run: &Run, end: u128) -> Result<(), ExperimentError> {
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
    Ok(())
}

/// Writes a file and creates its folder.
fn write(path: &Path, text: &str) -> Result<(), ExperimentError> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|error| ExperimentError::io(path, "write", error))?;
    }
    write_whole(path, text.as_bytes()).map_err(ExperimentError::from)
}

/// Returns the modification time of a file in milliseconds since 1970; 0 if it is unknown.
fn millis(path: &Path) -> u128 {
    let written = fs::metadata(path).and_then(|meta| meta.modified()).ok();
    written
        .and_then(|time| time.duration_since(UNIX_EPOCH).ok())
        .map_or(0, |time| time.as_millis())
}

/// Returns a numeric identifier for MLflow: the hash of the name, at most 18 digits.
fn number(name: &str) -> String {
    // Sixteen hexadecimal digits are 64 bits.
    let hash = u64::from_str_radix(&sha256_hex(name)[..16], 16)
        .unwrap_or_else(|error| panic!("a hash is hexadecimal: {error}"));
    (hash % 1_000_000_000_000_000_000).to_string()
}

/// Returns a YAML string in single quotes.
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
