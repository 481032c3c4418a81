//! Calibration files.

use std::fs;
use std::path::{Path, PathBuf};

use tactnet_catching::calibrate::KeptCalibration;

/// A calibration file cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {source}")]
pub struct CalibrationFileError {
    /// Path of the file.
    path: PathBuf,
    /// Error of the operating system.
    source: std::io::Error,
}

/// Replaces a calibration file atomically.
///
/// # Errors
/// A file that cannot be written.
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
