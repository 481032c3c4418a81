//! Atomic writing of files.

use std::fs;
use std::io::Write;
use std::path::Path;

use crate::DataError;

/// Beginning of the names of files that [`write_whole`] has not finished; a killed process leaves one.
pub const UNFINISHED: &str = ".writing-";

/// Writes a temporary file next to `path`, syncs it and renames it. After a crash or on a full disk the previous file is
/// intact.
///
/// # Errors
/// A file that cannot be written.
///
/// ```
/// let path = std::env::temp_dir().join(format!("tactnet-doc-{}.txt", std::process::id()));
/// tactnet_data::write_whole(&path, b"cork")?;
/// assert_eq!(tactnet_data::read_text(&path).unwrap(), "cork");
/// std::fs::remove_file(&path).unwrap();
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), DataError> {
    let failed = |error: std::io::Error| DataError::io(path, "write", error);
    // The parent of a bare file name is empty.
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or_else(|| Path::new("."));
    if !folder.is_dir() {
        let reason = format!("there is no folder {}", folder.display());
        return Err(failed(std::io::Error::new(
            std::io::ErrorKind::NotFound,
            reason,
        )));
    }
    let mut file = tempfile::Builder::new()
        .prefix(UNFINISHED)
        .tempfile_in(folder)
        .map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    set_ordinary_permissions(file.as_file()).map_err(failed)?;
    file.persist(path).map_err(|error| failed(error.error))?;
    // The sync of the folder makes the rename survive a power failure.
    fs::File::open(folder)
        .and_then(|folder| folder.sync_all())
        .map_err(failed)
}

/// Temporary files are private, but these files are meant for other users.
#[cfg(unix)]
fn set_ordinary_permissions(file: &fs::File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn set_ordinary_permissions(_: &fs::File) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        for text in ["first and longer", "second"] {
            write_whole(&path, text.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        let refused = write_whole(&folder.path().join("no/such/file"), b"").unwrap_err();
        assert!(
            refused.to_string().contains("file: cannot write")
                && refused.to_string().contains("there is no folder"),
            "{refused}"
        );
    }
}
