//! Folder of a bus's files: in memory, and closed to other users.

use std::ffi::CString;
use std::fs::{self, DirBuilder, Permissions};
use std::io;
use std::mem::MaybeUninit;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use crate::{ChannelError, Table};

/// Environment variable that overrides the folder.
pub const MEMORY_FOLDER_VARIABLE: &str = "TACTNET_RUNTIME_DIR";
/// Folder that systemd creates for hub and classifier.
const OF_SERVICES: &str = "/run/tactnet";

/// Returns the folder of this user's buses, and creates it if it is missing. The first of these:
///
/// 1. `$TACTNET_RUNTIME_DIR`
/// 2. `/run/tactnet`, if it belongs to this user, as under systemd
/// 3. `$XDG_RUNTIME_DIR/tactnet`, if that is in memory
/// 4. `/dev/shm/tactnet-UID`
///
/// Processes can communicate only if they use the same folder.
///
/// # Errors
/// The path is a link, belongs to another user, or is not a folder.
pub fn memory_folder() -> Result<PathBuf, ChannelError> {
    let user = user();
    let folder = match std::env::var_os(MEMORY_FOLDER_VARIABLE) {
        Some(named) if !named.is_empty() => PathBuf::from(named),
        _ if belongs_to(Path::new(OF_SERVICES), user) => OF_SERVICES.into(),
        _ => std::env::var_os("XDG_RUNTIME_DIR")
            .map(PathBuf::from)
            .filter(|folder| belongs_to(folder, user) && is_in_memory(folder))
            .map_or_else(
                || PathBuf::from(format!("/dev/shm/tactnet-{user}")),
                |folder| folder.join("tactnet"),
            ),
    };
    own_folder(&folder)?;
    Ok(folder)
}

/// Returns the folder of one bus on this host. It need not exist.
pub(crate) fn bus_folder(table: &Table) -> Result<PathBuf, ChannelError> {
    Ok(memory_folder()?.join(table.local_name()))
}

/// Removes the files of a bus that will not be used again: wake events, locks and remains of killed clients.
///
/// Processes that still use it keep their memory, but can no longer connect to others.
///
/// # Errors
/// A file cannot be removed.
pub fn remove_bus(table: &Table) -> Result<(), ChannelError> {
    remove(&bus_folder(table)?)
}

/// Removes buses that are named after `purpose` and the id of a process that has ended.
///
/// # Errors
/// A folder cannot be read or removed.
pub fn remove_abandoned_buses(purpose: &str) -> Result<(), ChannelError> {
    let folder = memory_folder()?;
    let failed = |source| ChannelError::Io {
        path: folder.clone(),
        action: "clear up",
        source,
    };
    for entry in fs::read_dir(&folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let process = name.strip_prefix(purpose).map(|rest| {
            let digits = rest.find(|c: char| !c.is_ascii_digit());
            &rest[..digits.unwrap_or(rest.len())]
        });
        let process = process.and_then(|digits| digits.parse::<u32>().ok());
        if process.is_some_and(|process| !Path::new(&format!("/proc/{process}")).exists()) {
            remove(&entry.path())?;
        }
    }
    Ok(())
}

fn remove(folder: &Path) -> Result<(), ChannelError> {
    match fs::remove_dir_all(folder) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => Err(ChannelError::Io {
            path: folder.into(),
            action: "clear up",
            source,
        }),
        _ => Ok(()),
    }
}

/// Creates a folder that only this user can enter, or closes an existing folder of this user to others.
pub(crate) fn own_folder(folder: &Path) -> Result<(), ChannelError> {
    made_or_own(folder, user()).map_err(|source| ChannelError::Io {
        path: folder.into(),
        action: "use",
        source,
    })
}

fn made_or_own(folder: &Path, user: u32) -> io::Result<()> {
    match DirBuilder::new().mode(0o700).create(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    let found = fs::symlink_metadata(folder)?;
    let refuse = |reason: String| {
        Err(io::Error::other(format!(
            "{reason}; name another folder in {MEMORY_FOLDER_VARIABLE}"
        )))
    };
    if !found.is_dir() {
        return refuse("it is a link or a file".into());
    }
    if found.uid() != user {
        return refuse(format!("it belongs to user {}, not to {user}", found.uid()));
    }
    if found.mode() & 0o077 != 0 {
        fs::set_permissions(folder, Permissions::from_mode(0o700))?;
    }
    Ok(())
}

/// Returns the free memory at `folder`, in bytes; 0 if the folder does not exist.
pub fn free_memory(folder: &Path) -> u64 {
    let Ok(path) = CString::new(folder.as_os_str().as_bytes()) else {
        return 0;
    };
    let mut space = MaybeUninit::<libc::statvfs>::zeroed();
    // SAFETY: a valid path and buffer; the buffer stays zero if the call fails.
    let space = unsafe {
        libc::statvfs(path.as_ptr(), space.as_mut_ptr());
        space.assume_init()
    };
    space.f_bavail * space.f_frsize
}

fn user() -> u32 {
    // SAFETY: a system call without arguments that always succeeds.
    unsafe { libc::geteuid() }
}

fn belongs_to(folder: &Path, user: u32) -> bool {
    fs::symlink_metadata(folder).is_ok_and(|found| found.is_dir() && found.uid() == user)
}

/// Returns true if files in `folder` are pages of memory that are never written to a disk.
fn is_in_memory(folder: &Path) -> bool {
    let Ok(path) = CString::new(folder.as_os_str().as_bytes()) else {
        return false;
    };
    let mut found = MaybeUninit::<libc::statfs>::zeroed();
    // SAFETY: a valid path and buffer; the buffer stays zero if the call fails.
    let found = unsafe {
        libc::statfs(path.as_ptr(), found.as_mut_ptr());
        found.assume_init()
    };
    found.f_type == libc::TMPFS_MAGIC
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{chown, symlink};

    use super::*;

    #[test]
    fn a_folder_of_ones_own_is_made_or_closed_and_nothing_else_is_taken() {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        let mode = |name: &str| fs::metadata(path(name)).unwrap().mode() & 0o777;
        made_or_own(&path("new"), user()).unwrap();
        assert_eq!(mode("new"), 0o700);
        fs::set_permissions(path("new"), Permissions::from_mode(0o755)).unwrap();
        made_or_own(&path("new"), user()).unwrap();
        assert_eq!(mode("new"), 0o700);

        symlink(path("new"), path("link")).unwrap();
        fs::write(path("file"), "").unwrap();
        for name in ["link", "file"] {
            let refused = made_or_own(&path(name), user()).unwrap_err().to_string();
            assert!(refused.contains("a link or a file"), "{refused}");
        }
        // Only root can give a folder away.
        if chown(path("new"), Some(65534), None).is_ok() {
            let refused = made_or_own(&path("new"), user()).unwrap_err().to_string();
            assert!(refused.contains("belongs to user 65534"), "{refused}");
        }
    }

    #[test]
    fn buses_of_ended_processes_are_removed_and_no_others() {
        let mut ended = std::process::Command::new("true").spawn().unwrap();
        let dead = ended.id();
        ended.wait().unwrap();
        let folder = memory_folder().unwrap();
        let (own, purpose) = (std::process::id(), format!("test{}-", std::process::id()));
        let names = [
            (format!("{purpose}{dead}"), true),
            (format!("{purpose}{dead}-other-host"), true),
            (format!("{purpose}{own}"), false),
            (format!("{purpose}x"), false),
            (format!("other{purpose}{dead}"), false),
        ];
        for (name, _) in &names {
            fs::create_dir(folder.join(name)).unwrap();
            fs::write(folder.join(name).join("hub"), "").unwrap();
        }
        remove_abandoned_buses(&purpose).unwrap();
        for (name, abandoned) in &names {
            assert_eq!(!folder.join(name).exists(), *abandoned, "{name}");
            remove(&folder.join(name)).unwrap();
        }
    }

    #[test]
    fn memory_is_told_from_a_disk() {
        assert!(is_in_memory(Path::new("/dev/shm")));
        assert!(!is_in_memory(Path::new("/proc")));
        assert!(free_memory(Path::new("/dev/shm")) > 0);
    }
}
