//! Files that are written whole or not at all, with the error of this crate.

use std::path::Path;

use crate::PipelineError;

/// As [`tactnet_data::write_whole`].
///
/// # Errors
/// It cannot be written.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), PipelineError> {
    tactnet_data::write_whole(path, bytes).map_err(PipelineError::from)
}
