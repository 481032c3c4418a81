//! Calibrations as files.

use std::fs;
use std::path::{Path, PathBuf};

use tactnet_catching::calibrate::KeptCalibration;

/// A file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}")]
pub struct CalibrationFileError {
    /// The file.
    path: PathBuf,
    /// What the system says.
    source: std::io::Error,
}

/// Puts a calibration in the place of the last good one: whole, or not at all.
///
/// # Errors
/// Where the system says no.
pub fn keep_calibration(
    path: &Path,
    calibration: &KeptCalibration,
) -> Result<(), CalibrationFileError> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    let beside = PathBuf::from(beside);
    fs::write(&beside, calibration.to_toml()).map_err(|source| io(&beside, source))?;
    fs::rename(&beside, path).map_err(|source| io(path, source))
}

fn io(path: &Path, source: std::io::Error) -> CalibrationFileError {
    CalibrationFileError {
        path: path.into(),
        source,
    }
}
