//! The table of channels that a command line names.

use std::path::Path;

use anyhow::bail;
use tactnet_channel::Table;
use tactnet_pipeline::quoted;

/// Reads a table of channels.
///
/// # Errors
/// No such file, with the command that writes one; what is wrong with it.
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
