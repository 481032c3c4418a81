//! Folders with one file per sweep.
//!
//! | layout | material of a sweep |
//! |---|---|
//! | `FOLDER/labels.csv` with columns `file`, `material` or `label` (optional `block` or `session`, `test`, `speed`, `force`) | given in the table |
//! | `FOLDER/felt/*.csv`, `FOLDER/cork/*.npy` | the name of its folder |
//! | `FOLDER/train/felt/*.csv`, `FOLDER/test/felt/*.csv`, see `split_folders.rs` | the name of its folder |
//!
//! `sweep_file.rs` describes the files.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::csv::Rows;
use super::dialect::number as real;
use super::file_layout::stretched;
use super::frame_table::{BLOCK, MATERIAL, is_one_of};
use super::name_pattern::{NamePattern, named_files};
use super::named_sweeps::{NamedSweeps, block_numbers, some_names};
use super::read_options::ReadOptions;
use super::recording::{Recording, Recordings};
use super::split_folders::SplitFolders;
use super::sweep_file::{OfConditions, Patch, SweepFile, is_sweep_file};
use crate::{Condition, DataError, Finding};

/// Name of the table of labels in a folder.
const LABELS: &str = "labels.csv";

/// Layout of a folder of labelled sweeps, for messages.
pub(super) const LAYOUT: &str =
    "labels.csv with columns file, material; or a folder of .csv or .npy files per material";

/// Reads a folder of labelled sweeps; values may be NaN or infinite.
///
///
/// # Errors
/// A file that cannot be read; sweeps of different lengths or numbers of taxels.
pub(super) fn read_with_gaps(path: &Path, options: &ReadOptions) -> Result<NamedSweeps, DataError> {
    if path.join(LABELS).is_file() {
        let entries = listed(&path.join(LABELS), options)?;
        let unlisted = unlisted(path, &entries)?;
        let mut sweeps = read_files(path, entries, options)?;
        sweeps.findings.extend(unlisted.map(Finding::not_read));
        return Ok(sweeps);
    }
    options.refuse_blocks(path)?;
    let FilesByFolder { entries, findings } = files_by_folder(path)?;
    let mut sweeps = read_files(path, entries, options)?;
    sweeps.findings.extend(findings);
    Ok(sweeps)
}

/// Reads the files in a folder whose names match a pattern.
///
/// # Errors
/// As [`read_with_gaps`]; no file that matches.
pub(super) fn read_named(
    path: &Path,
    names: &NamePattern,
    options: &ReadOptions,
) -> Result<NamedSweeps, DataError> {
    options.refuse_blocks(path)?;
    let (files, others) = named_files(path, names)?;
    let dropped = &options.layout.drop_materials;
    let files: Vec<_> = files
        .into_iter()
        .filter(|(_, named)| !dropped.contains(&named.material))
        .collect();
    // Blocks of equal name are one block, of all materials. A pattern names the block of every file, or of none.
    let blocks: Vec<String> = files
        .iter()
        .filter_map(|(_, named)| named.block.clone())
        .collect();
    let mut blocks = block_numbers(&blocks).into_iter();
    let entries = files.into_iter().map(|(file, named)| Entry {
        file,
        block: named.block.and_then(|_| blocks.next()),
        material: Some(named.material),
        test: named.test,
        conditions: Vec::new(),
    });
    let mut sweeps = read_files(path, entries.collect(), options)?;
    if others > 0 {
        let message = format!("files that are not named {names}: {others}");
        sweeps.findings.push(Finding::not_read(message));
    }
    Ok(sweeps)
}

/// Reads the file of one sweep.
///
/// # Errors
/// As [`read_with_gaps`].
pub(super) fn read_one(path: &Path, options: &ReadOptions) -> Result<NamedSweeps, DataError> {
    read_files(path, vec![Entry::unlabelled(path.into())], options)
}

/// Reads the sweep files directly in a folder, in the order of their names; `None` if there are none.
///
/// # Errors
/// As [`read_with_gaps`].
pub(super) fn read_flat_folder(
    path: &Path,
    options: &ReadOptions,
) -> Result<Option<NamedSweeps>, DataError> {
    let entries: Vec<Entry> = sweeps_in(path)?.map(Entry::unlabelled).collect();
    if entries.is_empty() {
        return Ok(None);
    }
    options.refuse_blocks(path)?;
    read_files(path, entries, options).map(Some)
}

/// Returns true if a folder looks like a folder of sweeps: it has a table of labels, or folders with sweep files.
///
/// ```
/// use tactnet_data::format::is_folder_of_sweeps;
///
/// assert!(!is_folder_of_sweeps("missing".as_ref()));
/// ```
pub fn is_folder_of_sweeps(path: &Path) -> bool {
    path.join(LABELS).is_file()
        || files_by_folder(path).is_ok_and(|files| !files.entries.is_empty())
}

/// File of a sweep with its metadata.
struct Entry {
    file: PathBuf,
    material: Option<String>,
    block: Option<u32>,
    test: Option<bool>,
    /// Conditions of the table of labels.
    conditions: Vec<(Condition, f32)>,
}

impl Entry {
    fn unlabelled(file: PathBuf) -> Self {
        Self {
            file,
            material: None,
            block: None,
            test: None,
            conditions: Vec::new(),
        }
    }
}

/// Reads the files of sweeps.
///
/// - `path`: folder or file that the user named
fn read_files(
    path: &Path,
    entries: Vec<Entry>,
    options: &ReadOptions,
) -> Result<NamedSweeps, DataError> {
    if entries.is_empty() {
        return Err(DataError::format(path, "folder", LAYOUT, "neither"));
    }
    let read = |of_conditions| {
        let files = entries.par_iter();
        let read = files.map(|entry| SweepFile::read(&entry.file, options, of_conditions));
        all_or_unreadable(path, read.collect())
    };
    let mut sweeps = read(OfConditions::Known)?;
    let conditions = match known_conditions(&entries, &sweeps) {
        Some(conditions) => conditions,
        None => {
            sweeps = read(OfConditions::Taxels)?;
            known_conditions(&entries, &sweeps).unwrap_or_default()
        }
    };
    let patch = common_patch(&entries, &sweeps)?;
    // All files of a set have the same columns.
    let findings = sweeps[0].left_out.clone();
    let clockwork = sweeps[0].clockwork;
    let resolution = sweeps[0].resolution;
    let names = sweep_names(&entries);
    let recording = |((entry, sweep), name): ((Entry, SweepFile), String)| Recording {
        name,
        file: entry.file,
        lines: sweep.lines,
        values: match options.layout.stretch {
            Some(steps) => stretched(&sweep.values, patch.taxels(), steps),
            None => sweep.values,
        },
        // The rate of a stretched sweep is another for every sweep.
        seconds: match options.layout.stretch {
            Some(_) => Vec::new(),
            None => sweep.time,
        },
        material: entry.material,
        labels: sweep.labels,
        block: entry.block,
        test: entry.test,
        conditions: sweep
            .conditions
            .iter()
            .filter_map(|of| of.1)
            .chain(entry.conditions.iter().map(|of| of.1))
            .collect(),
    };
    let parts = entries.into_iter().zip(sweeps).zip(names);
    let recordings = Recordings {
        path,
        patch,
        recordings: parts.map(recording).collect(),
        clockwork,
        resolution,
        conditions,
        findings,
    };
    recordings.into_sweeps(options)
}

/// Returns the conditions in the columns of the files and in the table of labels; `None` if a column changes during a sweep,
/// if the files have different ones, or if the table repeats one.
fn known_conditions(entries: &[Entry], sweeps: &[SweepFile]) -> Option<Vec<Condition>> {
    let of = |(entry, sweep): (&Entry, &SweepFile)| -> Option<Vec<Condition>> {
        let columns = sweep.conditions.iter();
        let columns = columns.map(|(condition, value)| value.map(|_| condition.clone()));
        let listed = entry.conditions.iter().map(|of| Some(of.0.clone()));
        columns.chain(listed).collect()
    };
    let mut all = entries.iter().zip(sweeps).map(of);
    let first = all.next()??;
    let repeats = (1..first.len()).any(|at| {
        let mut before = first[..at].iter();
        before.any(|of| of.quantity == first[at].quantity)
    });
    (!repeats && all.all(|other| other.as_ref() == Some(&first))).then_some(first)
}

/// Returns the content of all files.
///
/// # Errors
/// The first error of another kind, otherwise all places that cannot be read.
fn all_or_unreadable(
    path: &Path,
    read: Vec<Result<SweepFile, DataError>>,
) -> Result<Vec<SweepFile>, DataError> {
    let (mut sweeps, mut unreadable) = (Vec::with_capacity(read.len()), Vec::new());
    for file in read {
        match file {
            Ok(sweep) => sweeps.push(sweep),
            Err(DataError::Unreadable { findings, .. }) => unreadable.extend(findings),
            Err(error) => return Err(error),
        }
    }
    match unreadable.len() {
        0 => Ok(sweeps),
        _ => Err(DataError::Unreadable {
            path: path.into(),
            findings: unreadable,
        }),
    }
}

/// Returns the arrangement of the taxels, which all files must share.
fn common_patch(entries: &[Entry], sweeps: &[SweepFile]) -> Result<Patch, DataError> {
    let patch = sweeps[0].patch;
    match sweeps.iter().position(|sweep| sweep.patch != patch) {
        None => Ok(patch),
        Some(odd) => Err(DataError::format(
            &entries[odd].file,
            "taxels",
            format!("{patch}, as {}", entries[0].file.display()),
            sweeps[odd].patch.to_string(),
        )),
    }
}

/// Returns the files' names, preceded by their folders' names if some would be equal.
fn sweep_names(entries: &[Entry]) -> Vec<String> {
    let names = || entries.iter().map(|entry| super::stem(&entry.file));
    let different: HashSet<String> = names().collect();
    if different.len() == entries.len() {
        return names().collect();
    }
    let with_folders = |levels: usize| -> Vec<String> {
        let named = names().zip(entries).map(|(name, entry)| {
            let folders = entry.file.ancestors().skip(1).take(levels);
            folders.fold(name, |name, folder| format!("{}/{name}", name_of(folder)))
        });
        named.collect()
    };
    let different: HashSet<String> = with_folders(1).into_iter().collect();
    // Both parts of a split may have a file of this name and material.
    with_folders(if different.len() == entries.len() {
        1
    } else {
        2
    })
}

/// Returns the files that a table of labels lists, in its order.
fn listed(table: &Path, options: &ReadOptions) -> Result<Vec<Entry>, DataError> {
    let folder = table.parent().unwrap_or(Path::new("."));
    let mut rows = Rows::open(table)?;
    let mut header = rows.next()?.unwrap_or_default();
    options.rename_blocks(table, &mut header)?;
    let column = |names: &[&str]| header.iter().position(|found| is_one_of(found, names));
    let (Some(file), Some(material)) = (column(&["file"]), column(MATERIAL)) else {
        return Err(DataError::format(
            table,
            "first line",
            "the columns file, material",
            some_names(header.iter().map(String::as_str)),
        ));
    };
    let block = column(&["block"]).or_else(|| column(BLOCK));
    let test = column(&["test"]);
    let condition = |(at, name): (usize, &String)| Some((at, Condition::of_name(name)?));
    let conditions: Vec<(usize, Condition)> =
        header.iter().enumerate().filter_map(condition).collect();
    let (mut entries, mut blocks) = (Vec::new(), Vec::new());
    while let Some(row) = rows.next()? {
        blocks.extend(block.map(|at| row[at].trim().to_string()));
        let number = |at: Option<usize>| match at.map(|at| (at, row[at].trim().parse::<u32>())) {
            None => Ok(None),
            Some((_, Ok(value))) => Ok(Some(value)),
            Some((at, Err(_))) => Err(rows.error("a whole number from 0", at, &row[at])),
        };
        entries.push(Entry {
            file: folder.join(row[file].trim()),
            material: Some(row[material].trim().to_string()),
            block: None,
            test: number(test)?.map(|flag| flag != 0),
            conditions: conditions
                .iter()
                .map(|(at, condition)| match real(&row[*at]) {
                    Some(value) => Ok((condition.clone(), value as f32)),
                    None => Err(rows.error("a number", *at, &row[*at])),
                })
                .collect::<Result<_, _>>()?,
        });
    }
    for (entry, block) in entries.iter_mut().zip(block_numbers(&blocks)) {
        entry.block = Some(block);
    }
    Ok(entries)
}

/// Returns a sentence about files that the table of labels does not list.
fn unlisted(folder: &Path, listed: &[Entry]) -> Result<Option<String>, DataError> {
    let files: Vec<PathBuf> = sweeps_in(folder)?
        .filter(|file| listed.iter().all(|entry| entry.file != *file))
        .collect();
    if files.is_empty() {
        return Ok(None);
    }
    let names: Vec<String> = files.iter().map(|file| super::stem(file)).collect();
    let names = some_names(names.iter().map(String::as_str));
    Ok(Some(format!("files that {LABELS} does not list: {names}")))
}

/// Sweep files of folders.
struct FilesByFolder {
    /// Files, sorted by folder.
    entries: Vec<Entry>,
    /// Notes on the layout and on what is not read.
    findings: Vec<Finding>,
}

/// Returns the sweep files in the folders of `path`.
fn files_by_folder(path: &Path) -> Result<FilesByFolder, DataError> {
    let folders = folders_in(path)?;
    let has_sweeps =
        |folder: &Path| sweeps_in(folder).is_ok_and(|mut files| files.next().is_some());
    let has_materials = |folder: &Path| {
        folders_in(folder).is_ok_and(|materials| materials.iter().any(|of| has_sweeps(of)))
    };
    let Some(split) = SplitFolders::among(&folders, has_sweeps, has_materials) else {
        return files_of_materials(&folders, None);
    };
    let mut all = FilesByFolder {
        entries: Vec::new(),
        findings: vec![split.note()],
    };
    for (folder, part) in split.parts() {
        let test = split.test_flag(*part);
        let of_part = files_of_materials(&folders_in(folder)?, test)?;
        let without_material = sweeps_in(folder)?.map(|file| Entry {
            test,
            ..Entry::unlabelled(file)
        });
        all.entries.extend(of_part.entries);
        all.entries.extend(without_material);
        all.findings.extend(of_part.findings);
    }
    Ok(all)
}

/// Returns the sweep files in the folders of materials.
///
/// - `test`: test flag of all sweeps
fn files_of_materials(folders: &[PathBuf], test: Option<bool>) -> Result<FilesByFolder, DataError> {
    let (mut entries, mut empty, mut deeper) = (Vec::new(), Vec::new(), Vec::new());
    for folder in folders {
        let material = folder.file_name().unwrap_or_default().to_string_lossy();
        let before = entries.len();
        entries.extend(sweeps_in(folder)?.map(|file| Entry {
            material: Some(material.to_string()),
            test,
            ..Entry::unlabelled(file)
        }));
        // Files and folders whose name begins with a dot belong to other programs.
        if entries.len() == before && !material.starts_with('.') {
            empty.push(material.to_string());
        }
        let with_sweeps = folders_in(folder)?
            .into_iter()
            .filter(|below| sweeps_in(below).is_ok_and(|mut files| files.next().is_some()));
        deeper.extend(with_sweeps.map(|below| format!("{material}/{}", name_of(&below))));
    }
    let note = |names: &[String], what: &str| {
        let listed = some_names(names.iter().map(String::as_str));
        (!names.is_empty()).then(|| Finding::not_read(format!("{what}: {listed}")))
    };
    let findings = [
        note(&empty, "folders without a .csv or .npy file"),
        note(
            &deeper,
            "folders in the folders that name the materials, which are not read",
        ),
    ];
    Ok(FilesByFolder {
        entries,
        findings: findings.into_iter().flatten().collect(),
    })
}

/// Returns a description of the first sweep two levels below a folder, for messages.
pub(super) fn nested_sweep(path: &Path) -> Option<String> {
    let folders = folders_in(path).ok()?;
    folders.iter().find_map(|folder| {
        let below = folders_in(folder).ok()?;
        let inner = below.iter().find_map(|below| Some((below, sweeps_in(below).ok()?.next()?)));
        let (below, file) = inner?;
        Some(format!(
            "sweeps two levels below, such as `{}/{}/{}`; the folders directly in this one have to name the materials, or a pattern for the names of the files has to",
            name_of(folder),
            name_of(below),
            name_of(&file)
        ))
    })
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Returns the folders in a folder, sorted by name.
fn folders_in(path: &Path) -> Result<Vec<PathBuf>, DataError> {
    let mut paths = list(path)?;
    paths.retain(|path| path.is_dir());
    Ok(paths)
}

/// Returns true if a folder contains single NumPy arrays.
pub(super) fn holds_arrays(folder: &Path) -> bool {
    let is_array = |path: &PathBuf| path.extension().is_some_and(|e| e == "npy");
    list(folder).is_ok_and(|paths| paths.iter().any(is_array))
}

/// Returns the first file in a folder that is a complete data set.
pub(super) fn data_set_in(folder: &Path) -> Option<PathBuf> {
    complete_files(folder).into_iter().next()
}

/// Returns the data sets directly in a folder, sorted by name; none for a folder that is a data set itself, and for anything but a folder.
///
/// ```
/// use tactnet_data::format::data_sets_in;
///
/// assert!(data_sets_in("missing".as_ref()).is_empty());
/// ```
pub fn data_sets_in(folder: &Path) -> Vec<PathBuf> {
    #[cfg(feature = "parquet")]
    if super::lerobot::is_data_set(folder) {
        return Vec::new();
    }
    match is_folder_of_sweeps(folder) {
        true => Vec::new(),
        false => complete_files(folder),
    }
}

/// Returns the files in a folder that are complete data sets by their extension, sorted by name.
fn complete_files(folder: &Path) -> Vec<PathBuf> {
    let is_whole = |path: &PathBuf| {
        let extension = path.extension().and_then(|extension| extension.to_str());
        extension.is_some_and(|e| ["npz", "h5", "hdf5", "mat", "parquet", "pq"].contains(&e))
    };
    let files = list(folder).unwrap_or_default();
    files.into_iter().filter(is_whole).collect()
}

/// Returns the content of a folder, sorted by name.
fn list(folder: &Path) -> Result<Vec<PathBuf>, DataError> {
    let io = |error| DataError::io(folder, "list", error);
    let entries = std::fs::read_dir(folder).map_err(io)?;
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()
        .map_err(io)?;
    paths.sort();
    Ok(paths)
}

/// Returns the sweep files in a folder.
fn sweeps_in(folder: &Path) -> Result<impl Iterator<Item = PathBuf>, DataError> {
    let is_sweep = |file: &PathBuf| is_sweep_file(file) && !file.ends_with(LABELS);
    Ok(list(folder)?.into_iter().filter(is_sweep))
}
