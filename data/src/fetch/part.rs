//! Incomplete downloads.

use crate::{DataError, write_whole};
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// `<out>.part`, which holds the first bytes of the file, and `<out>.part.etag`, which holds the ETag of their version.
pub(super) struct Part {
    path: PathBuf,
    etag_path: PathBuf,
}

impl Part {
    /// Returns the part that becomes `out`.
    pub(super) fn of(out: &Path) -> Self {
        let beside = |ending: &str| {
            let mut name = OsString::from(out);
            name.push(ending);
            PathBuf::from(name)
        };
        Self {
            path: beside(".part"),
            etag_path: beside(".part.etag"),
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the number of bytes on disk.
    pub(super) fn len(&self) -> Result<u64, DataError> {
        match fs::metadata(&self.path) {
            Ok(metadata) => Ok(metadata.len()),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(0),
            Err(error) => Err(DataError::io(&self.path, "read", error)),
        }
    }

    /// Returns the ETag of the bytes, if the server sent one.
    pub(super) fn etag(&self) -> Result<Option<String>, DataError> {
        match fs::read_to_string(&self.etag_path) {
            Ok(etag) => Ok(Some(etag)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(DataError::io(&self.etag_path, "read", error)),
        }
    }

    /// Discards the bytes and starts anew with content of this ETag.
    pub(super) fn start(&self, etag: Option<&str>) -> Result<File, DataError> {
        remove_file(&self.etag_path)?;
        let file = self.open(OpenOptions::new().write(true).create(true).truncate(true))?;
        if let Some(etag) = etag {
            write_whole(&self.etag_path, etag.as_bytes())?;
        }
        Ok(file)
    }

    /// Opens the part to append bytes.
    pub(super) fn append(&self) -> Result<File, DataError> {
        self.open(OpenOptions::new().append(true))
    }

    fn open(&self, options: &OpenOptions) -> Result<File, DataError> {
        options
            .open(&self.path)
            .map_err(|error| DataError::io(&self.path, "write", error))
    }

    /// Discards the bytes.
    pub(super) fn remove(&self) -> Result<(), DataError> {
        remove_file(&self.path)?;
        remove_file(&self.etag_path)
    }

    /// Renames the part to `out`.
    pub(super) fn rename_to(&self, out: &Path) -> Result<(), DataError> {
        fs::rename(&self.path, out)
            .map_err(|error| DataError::io(&self.path, "rename into place", error))?;
        remove_file(&self.etag_path)
    }
}

fn remove_file(path: &Path) -> Result<(), DataError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(DataError::io(path, "remove", error))
        }
        _ => Ok(()),
    }
}
