//! The channel table named on the command line.

use std::path::Path;

use anyhow::bail;
use tactnet_channel::Table;
use tactnet_pipeline::quoted;

/// Reads a channel table.
///
/// # Errors
/// Fails if the file is missing or invalid.
pub fn load(path: &Path) -> anyhow::Result<Table> {
    if !path.exists() {
        bail!(
            "{}: no such table; `tactnet serve --print-table > {}` writes one",
            path.display(),
            quoted(&path.display().to_string())
        );
    }
    Ok(Table::load(path)?)
}
