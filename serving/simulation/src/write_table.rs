//! Channel table as a file, for child processes.

use std::path::{Path, PathBuf};

use tactnet_channel::Table;
use tactnet_data::write_whole;

use crate::SimulationError;

/// Writes the table into `folder` and returns the path of the file.
///
/// # Errors
/// Fails if the file cannot be written.
pub(crate) fn write_table(table: &Table, folder: &Path) -> Result<PathBuf, SimulationError> {
    let path = folder.join("robot.toml");
    write_whole(&path, toml::to_string(table)?.as_bytes())?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_is_not_there_is_a_wrong_call() {
        let error = write_table(&Table::new("t"), Path::new("/no/such/folder")).unwrap_err();
        assert!(error.is_usage(), "{error}");
    }
}
