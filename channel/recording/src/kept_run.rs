//! Run directory of the serving classifier, kept in a recording.

use std::path::{Path, PathBuf};

use tactnet_data::write_whole;

use crate::{Recording, RecordingError};

/// Files that a classifier needs to serve.
const FILES: [&str; 7] = [
    "calibration.json",
    "config.json",
    "split.json",
    "result.json",
    "enrolled.json",
    WEIGHTS,
    "known.safetensors",
];
/// Required file: without weights nothing can serve.
const WEIGHTS: &str = "weights.safetensors";
/// Folder of these files in a recording.
const FOLDER: &str = "run/";

/// Reads the files of a run directory. Returns their names in a recording and their contents.
///
/// # Errors
/// A file cannot be read; the folder has no weights of a trained network.
pub fn files_of_run(run: &Path) -> Result<Vec<(String, Vec<u8>)>, RecordingError> {
    let mut files = Vec::new();
    for name in FILES {
        let path = run.join(name);
        if path.exists() {
            let bytes = std::fs::read(&path).map_err(|source| RecordingError::Io {
                path: path.clone(),
                source,
            })?;
            files.push((format!("{FOLDER}{name}"), bytes));
        }
    }
    let has_weights = |(name, _): &(String, _)| name.ends_with(WEIGHTS);
    if !files.iter().any(has_weights) {
        return Err(RecordingError::NotARun { path: run.into() });
    }
    Ok(files)
}

/// Writes the run directory of a recording into `folder`, and returns its path.
///
/// Returns `None` if the recording keeps no run or has lost a part of it.
///
/// # Errors
/// The folder cannot be written.
pub fn unpack_run(recording: &Recording, folder: &Path) -> Result<Option<PathBuf>, RecordingError> {
    let run = folder.join("run");
    std::fs::create_dir(&run).map_err(|source| RecordingError::Io {
        path: run.clone(),
        source,
    })?;
    let mut whole = false;
    for (name, bytes) in &recording.files {
        // Skips names that contain a path: the recorder does not write them.
        if let Some(name) = name.strip_prefix(FOLDER)
            && Path::new(name).components().count() == 1
            && Path::new(name).file_name().is_some()
        {
            write_whole(&run.join(name), bytes)?;
            whole |= name == WEIGHTS;
        }
    }
    Ok(whole.then_some(run))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_whose_weights_were_cut_off_is_none() {
        let mut recording = Recording {
            entries: Vec::new(),
            table: tactnet_skin::ServeConfig::default().table("robot"),
            channel_clock_zero_ns: None,
            material: None,
            files: [("run/config.json".to_owned(), b"{}".to_vec())].into(),
            cut: None,
            foreign: 0,
        };
        let unpacked = |recording: &Recording| {
            let folder = tempfile::tempdir().unwrap();
            unpack_run(recording, folder.path()).unwrap().is_some()
        };
        assert!(!unpacked(&recording));
        let weights = ("run/weights.safetensors".to_owned(), Vec::new());
        recording.files.extend([weights]);
        assert!(unpacked(&recording));
    }
}
