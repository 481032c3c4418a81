//! Causes of failures in shared memory. Iceoryx2 reports them as an internal error without a cause.

use std::cell::RefCell;
use std::fmt::Debug;
use std::fs::File;
use std::io;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};

use crate::ChannelError;
use crate::memory_folder::free_memory;

/// Free memory below which every failure of iceoryx2 counts as a lack of memory, in bytes. Its small files need less.
const LITTLE: u64 = 128 << 10;

thread_local! {
    static LAST: RefCell<Option<MemoryFailure>> = const { RefCell::new(None) };
}

/// Failed operation on a file in shared memory.
#[derive(Debug)]
pub(crate) struct MemoryFailure {
    path: PathBuf,
    action: &'static str,
    /// Memory that the file needs, in bytes; 0 if it exists already.
    needed: u64,
    source: io::Error,
}

impl MemoryFailure {
    /// Records a failure of this thread for [`transport_error`].
    pub(crate) fn note(path: &Path, action: &'static str, needed: u64, source: io::Error) {
        let failure = Self {
            path: path.into(),
            action,
            needed,
            source,
        };
        LAST.with(|last| last.replace(Some(failure)));
    }

    /// Forgets an earlier failure of this thread, before an operation that may fail.
    pub(crate) fn forget() {
        LAST.with(RefCell::take);
    }
}

/// Allocates the pages of a shared-memory file now, so that a lack of memory is an error here and not a signal later.
pub(crate) fn reserve(file: &File, bytes: u64) -> io::Result<()> {
    // SAFETY: a plain call with a valid descriptor.
    match unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, bytes as i64) } {
        0 => Ok(()),
        libc::EINTR => reserve(file, bytes),
        error => Err(io::Error::from_raw_os_error(error)),
    }
}

/// Returns the error for a failed operation on a file of the bus.
///
/// - `needed`: memory that the file needs, in bytes
pub(crate) fn file_error(
    path: &Path,
    action: &'static str,
    needed: u64,
    source: io::Error,
) -> ChannelError {
    let folder = path.parent().unwrap_or(path);
    if source.raw_os_error() == Some(libc::ENOSPC) {
        return ChannelError::Memory {
            what: path.display().to_string(),
            folder: folder.into(),
            needed,
            free: free_memory(folder),
        };
    }
    ChannelError::Io {
        path: path.into(),
        action,
        source,
    }
}

/// Returns the error for an operation of iceoryx2 that failed, with its cause where this thread knows one.
///
/// - `what`: channel or bus
/// - `folder`: folder of the bus's files; empty in the process domain
pub(crate) fn transport_error(
    what: impl ToString,
    folder: &Path,
    error: impl Debug,
) -> ChannelError {
    let what = what.to_string();
    let memory = |needed| {
        let free = free_memory(folder);
        ChannelError::Memory {
            what: what.clone(),
            folder: folder.into(),
            needed,
            free,
        }
    };
    match LAST.with(RefCell::take) {
        Some(failure) if failure.source.raw_os_error() == Some(libc::ENOSPC) => {
            memory(failure.needed.max(4096))
        }
        Some(failure) => ChannelError::Io {
            path: failure.path,
            action: failure.action,
            source: failure.source,
        },
        None if !folder.as_os_str().is_empty() && free_memory(folder) < LITTLE => memory(LITTLE),
        None => match File::open("/dev/null") {
            // No file descriptor is left.
            Err(source) => ChannelError::Io {
                path: folder.into(),
                action: "open another file in",
                source,
            },
            Ok(_) => ChannelError::transport(what, words(&format!("{error:?}"))),
        },
    }
}

/// Returns the name of an error variant as words, like `version mismatch` for `VersionMismatch`.
fn words(variant: &str) -> String {
    if variant.contains("Internal") || variant.contains("CouldNotBeCreated") {
        return "the operating system refused a file of the bus".into();
    }
    let mut words = String::new();
    for letter in variant.chars() {
        if letter.is_ascii_uppercase() && !words.is_empty() && !words.ends_with([' ', '(']) {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lack_of_memory_names_folder_need_and_remedy() {
        let folder = Path::new("/dev/shm");
        let full = || io::Error::from_raw_os_error(libc::ENOSPC);
        MemoryFailure::note(&folder.join("a.data"), "reserve memory for", 70_000, full());
        let error = transport_error("channel `a`", folder, "InternalError").to_string();
        for part in ["channel `a`", "70000 bytes", "/dev/shm", "--shm-size"] {
            assert!(error.contains(part), "{error}");
        }
        // A cause is reported once.
        let next = transport_error("channel `a`", folder, "InternalError").to_string();
        assert!(!next.contains("70000"), "{next}");
    }

    #[test]
    fn names_of_iceoryx_errors_become_words() {
        let error = |name: &str| transport_error("a", Path::new(""), format_args!("{name}"));
        assert_eq!(error("VersionMismatch").to_string(), "a: version mismatch");
        for name in ["InternalError", "ServiceConfigCouldNotBeCreated"] {
            assert!(!error(name).to_string().contains(name));
        }
    }
}
