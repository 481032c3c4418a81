//! Folders of LeRobot, versions 2 and 3: episodes as sweeps, tasks as materials. Needs the feature `parquet`.
//!
//! | part | holds |
//! |---|---|
//! | `meta/info.json` | frames per second (`fps`) and the features |
//! | `meta/tasks.jsonl` (version 2), `meta/tasks.parquet` (3) | the name of each task |
//! | `data/**/*.parquet` | frames with `episode_index`, `task_index`, `timestamp` and a column of lists per feature |

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::frame_table::{Column, FrameTable};
use super::named_sweeps::{Labels, NamedSweeps, some_names};
use super::parquet;
use super::read_options::ReadOptions;
use crate::{DataError, Finding};

/// Columns of LeRobot that are no feature.
const BOOKKEEPING: [&str; 5] = [
    "episode_index",
    "frame_index",
    "index",
    "task_index",
    "timestamp",
];
/// Words in the names of tactile features.
const TACTILE: [&str; 6] = ["tactile", "touch", "taxel", "skin", "pressure", "force"];

/// Returns true if a folder is a data set of LeRobot.
pub(super) fn is_data_set(path: &Path) -> bool {
    path.join("meta/info.json").is_file() && path.join("data").is_dir()
}

/// Content of `meta/info.json` that matters here.
#[derive(serde::Deserialize)]
struct Info {
    fps: Option<f64>,
}

/// Reads the tactile feature of all episodes; values may be NaN or infinite.
///
/// # Errors
/// Files that cannot be read or differ in their columns; several features none or several of which are tactile by name.
pub(super) fn read_with_gaps(path: &Path, options: &ReadOptions) -> Result<NamedSweeps, DataError> {
    let info = path.join("meta/info.json");
    let found: Info = serde_json::from_str(
        &crate::read_text(&info).map_err(|error| DataError::io(&info, "read", error))?,
    )
    .map_err(|error| {
        DataError::format(
            &info,
            "file",
            "the description of a LeRobot data set",
            error.to_string(),
        )
    })?;
    let mut files = Vec::new();
    parquet_files(&path.join("data"), &mut files)?;
    let mut whole: Option<FrameTable<'_>> = None;
    for file in &files {
        let part = parquet::table(file)?;
        match &mut whole {
            None => whole = Some(FrameTable { path, ..part }),
            Some(whole) => append(whole, part, file)?,
        }
    }
    let Some(mut table) = whole else {
        return Err(DataError::format(
            path,
            "folder `data`",
            "Parquet files",
            "none",
        ));
    };
    let left_out = keep_feature(&mut table, options.samples.as_deref())?;
    name_tasks(&mut table, &tasks(path)?)?;
    let mut recordings = table.into_recordings(Labels::Optional, options)?;
    recordings.findings.extend(left_out);
    let sweeps = recordings.into_sweeps(options)?;
    Ok(NamedSweeps {
        rate_hz: sweeps.rate_hz.or(found.fps),
        ..sweeps
    })
}

/// Appends the Parquet files in a folder and its folders, sorted by name.
fn parquet_files(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), DataError> {
    let failed = |error| DataError::io(folder, "list", error);
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .map_err(failed)?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()
        .map_err(failed)?;
    entries.sort();
    for entry in entries {
        if entry.is_dir() {
            parquet_files(&entry, files)?;
        } else if entry
            .extension()
            .is_some_and(|extension| extension == "parquet")
        {
            files.push(entry);
        }
    }
    Ok(())
}

/// Appends the frames of another file.
fn append(whole: &mut FrameTable<'_>, part: FrameTable<'_>, file: &Path) -> Result<(), DataError> {
    let mut columns: BTreeMap<String, Column> = part.columns.into_iter().collect();
    for (name, column) in &mut whole.columns {
        match (column, columns.remove(name)) {
            (Column::Numbers(all), Some(Column::Numbers(more))) => all.extend(more),
            (Column::Words(all), Some(Column::Words(more))) => all.extend(more),
            (_, found) => {
                let expected = format!("column `{name}` of the same type as in the other files");
                let found = found.map_or("none", |_| "another type");
                return Err(DataError::format(file, "columns", expected, found));
            }
        }
    }
    Ok(())
}

/// Removes all features but the tactile one, or the one with this name.
///
/// # Errors
/// No such feature, or several.
fn keep_feature(
    table: &mut FrameTable<'_>,
    wanted: Option<&str>,
) -> Result<Option<Finding>, DataError> {
    let feature = |name: &str| name.split('[').next().unwrap_or(name).to_owned();
    let mut features: Vec<String> = Vec::new();
    for (name, column) in &table.columns {
        let name = feature(name);
        let is_number = matches!(column, Column::Numbers(_));
        if is_number && !BOOKKEEPING.contains(&name.as_str()) && !features.contains(&name) {
            features.push(name);
        }
    }
    let tactile = |name: &&String| {
        TACTILE
            .iter()
            .any(|word| name.to_lowercase().contains(word))
    };
    let named = |name: &&String| Some(name.as_str()) == wanted;
    let candidates: Vec<String> = match (wanted, features.as_slice()) {
        (Some(_), _) => features.iter().filter(named).cloned().collect(),
        (None, [only]) => vec![only.clone()],
        (None, _) => features.iter().filter(tactile).cloned().collect(),
    };
    let [kept] = candidates.as_slice() else {
        let names = some_names(features.iter().map(String::as_str));
        let error = DataError::format(
            table.path,
            "features",
            "the name of the one that holds the taxels",
            names,
        );
        return Err(error.with_remedy(crate::Remedy::NameSamples));
    };
    let is_kept = |name: &str| BOOKKEEPING.contains(&name) || feature(name) == *kept;
    table.columns.retain(|(name, _)| is_kept(name));
    let others = features
        .iter()
        .filter(|name| *name != kept)
        .map(String::as_str);
    let others: Vec<&str> = others.collect();
    Ok((!others.is_empty()).then(|| {
        let names = some_names(others);
        Finding::not_read(format!(
            "features that are ignored: {names}; the taxels are `{kept}`"
        ))
    }))
}

/// Returns the names of the tasks by their number; empty if the folder names none.
fn tasks(path: &Path) -> Result<BTreeMap<i64, String>, DataError> {
    #[derive(serde::Deserialize)]
    struct Task {
        task_index: i64,
        task: String,
    }
    let lines = path.join("meta/tasks.jsonl");
    if lines.is_file() {
        let text =
            crate::read_text(&lines).map_err(|error| DataError::io(&lines, "read", error))?;
        let read = |(number, line): (usize, &str)| {
            let task: Task = serde_json::from_str(line).map_err(|error| {
                DataError::format(
                    &lines,
                    format!("line {}", number + 1),
                    "a task with its number",
                    error.to_string(),
                )
            })?;
            Ok((task.task_index, task.task))
        };
        let lines = text
            .lines()
            .enumerate()
            .filter(|(_, line)| !line.trim().is_empty());
        return lines.map(read).collect();
    }
    let file = path.join("meta/tasks.parquet");
    if !file.is_file() {
        return Ok(BTreeMap::new());
    }
    let table = parquet::table(&file)?;
    let number = table
        .columns
        .iter()
        .find_map(|(name, column)| match column {
            Column::Numbers(numbers) if name == "task_index" => Some(numbers),
            _ => None,
        });
    // pandas writes the names as a column or as its index.
    let names = table.columns.iter().find_map(|(_, column)| match column {
        Column::Words(words) => Some(words),
        Column::Numbers(_) => None,
    });
    match (number, names) {
        (Some(numbers), Some(names)) => {
            let numbers = numbers.iter().map(|number| *number as i64);
            Ok(numbers.zip(names.iter().cloned()).collect())
        }
        _ => Err(DataError::format(
            &file,
            "columns",
            "`task_index` and the names of the tasks",
            "others",
        )),
    }
}

/// Replaces the column of task numbers by their names.
fn name_tasks(table: &mut FrameTable<'_>, tasks: &BTreeMap<i64, String>) -> Result<(), DataError> {
    for (name, column) in &mut table.columns {
        let Column::Numbers(numbers) = column else {
            continue;
        };
        if name != "task_index" {
            continue;
        }
        let mut names = Vec::with_capacity(numbers.len());
        for number in numbers.iter() {
            match tasks.get(&(*number as i64)) {
                Some(task) => names.push(task.clone()),
                None if tasks.is_empty() => names.push(number.to_string()),
                None => {
                    let found = format!("{number}");
                    return Err(DataError::format(
                        table.path,
                        "column `task_index`",
                        "a task that `meta` names",
                        found,
                    ));
                }
            }
        }
        *column = Column::Words(names);
        *name = "task".into();
    }
    Ok(())
}
