//! Atomic writes with this crate's error.

use std::path::Path;

use crate::PipelineError;

/// Writes a file atomically, as [`tactnet_data::write_whole`] does.
///
/// # Errors
/// A file that cannot be written.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), PipelineError> {
    tactnet_data::write_whole(path, bytes).map_err(PipelineError::from)
}
