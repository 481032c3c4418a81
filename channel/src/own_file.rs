//! Safe opening of files in shared memory, where other users may have created files of the same name.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

/// Opens a file for reading and writing, or creates it with mode 0600. Never truncates a file or follows a link.
///
/// # Errors
/// The path is a link, is not a regular file, or belongs to another user.
pub(crate) fn own_file(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .custom_flags(libc::O_NOFOLLOW)
        .open(path)
        .map_err(|error| match error.raw_os_error() {
            Some(libc::ELOOP) => io::Error::other("it is a link; remove it"),
            _ => error,
        })?;
    let found = file.metadata()?;
    // SAFETY: a system call without arguments that always succeeds.
    let user = unsafe { libc::geteuid() };
    if !found.is_file() {
        return Err(io::Error::other("it is not a regular file; remove it"));
    }
    if found.uid() != user {
        return Err(io::Error::other(format!(
            "it belongs to user {}, not to {user}; ask them to remove it, or name another `bus` in the table",
            found.uid()
        )));
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, chown, symlink};

    use super::*;

    #[test]
    fn links_and_other_users_files_are_refused_and_nothing_is_emptied() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("victim"), "precious").unwrap();
        symlink(path("victim"), path("link")).unwrap();
        let refused = own_file(&path("link")).unwrap_err().to_string();
        assert!(refused.contains("is a link"), "{refused}");
        own_file(&path("victim")).unwrap();
        assert_eq!(std::fs::read(path("victim")).unwrap(), b"precious");
        own_file(&path("new")).unwrap();
        let mode = std::fs::metadata(path("new")).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        // Only root can give a file away.
        if chown(path("victim"), Some(65534), None).is_ok() {
            let refused = own_file(&path("victim")).unwrap_err().to_string();
            assert!(refused.contains("belongs to user 65534"), "{refused}");
        }
    }
}
