//! Everything that can be wrong with recorded data.

use std::path::{Path, PathBuf};

use crate::Remedy;

/// An error about a data set; every variant that comes from a file names that file.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// The operating system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file in question.
        path: PathBuf,
        /// What was attempted, as a verb phrase ("read", "rename into place").
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file does not hold what its format promises.
    #[error("{}: {item}: expected {expected}, found {found}", path.display())]
    Format {
        /// The file in question.
        path: PathBuf,
        /// The part of it: "data set `samples`", "attribute `sample_rate_hz`", "file".
        item: String,
        /// What the layout asks for.
        expected: String,
        /// What was there.
        found: String,
        /// Cure, if the caller can apply one.
        remedy: Option<Remedy>,
    },
    /// Parts of a data set in memory contradict each other.
    #[error("{item}: expected {expected}, found {found}")]
    Inconsistent {
        /// Which part.
        item: String,
        /// What the rest of the data set asks for.
        expected: String,
        /// What was there.
        found: String,
        /// Cure, if the caller can apply one.
        remedy: Option<Remedy>,
    },
    /// A data set that [`crate::check()`] finds errors in.
    #[error(
        "{name}: the data set has {errors} error{}, the first: {first}", if *errors == 1 { "" } else { "s" }
    )]
    Unsound {
        /// Its name or file, as it was given.
        name: String,
        /// How many there are.
        errors: usize,
        /// What the first one is.
        first: String,
    },
}

impl DataError {
    /// Returns true if the mistake is in what was handed over, such as a folder for a file; false if the disk fails.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Format { .. } | Self::Inconsistent { .. } | Self::Unsound { .. } => true,
            Self::Io { source, .. } => is_wrong_path(source),
        }
    }

    /// Returns the cure that the caller can apply, if there is one; the message does not contain it.
    pub fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Format { remedy, .. } | Self::Inconsistent { remedy, .. } => remedy.clone(),
            Self::Unsound { name, .. } => Some(Remedy::ListFindings { data: name.clone() }),
            Self::Io { .. } => None,
        }
    }

    /// Returns the error with this cure; errors of the operating system and of [`crate::refuse_errors`] stay as they are.
    #[must_use]
    pub fn with_remedy(mut self, cure: Remedy) -> Self {
        if let Self::Format { remedy, .. } | Self::Inconsistent { remedy, .. } = &mut self {
            *remedy = Some(cure);
        }
        self
    }

    /// An [`DataError::Io`] for `path`.
    pub fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_path_buf(),
            action,
            source,
        }
    }

    /// A [`DataError::Format`] for `path`.
    pub fn format(
        path: &Path,
        item: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Format {
            path: path.to_path_buf(),
            item: item.into(),
            expected: expected.into(),
            found: found.into(),
            remedy: None,
        }
    }

    /// A [`DataError::Inconsistent`].
    pub fn inconsistent(
        item: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Inconsistent {
            item: item.into(),
            expected: expected.into(),
            found: found.into(),
            remedy: None,
        }
    }
}

/// Returns true where a path is wrong (nothing there, not allowed, a folder for a file), which another call mends; false where the disk fails.
pub fn is_wrong_path(error: &std::io::Error) -> bool {
    use std::io::ErrorKind;
    matches!(
        error.kind(),
        ErrorKind::NotFound
            | ErrorKind::PermissionDenied
            | ErrorKind::AlreadyExists
            | ErrorKind::IsADirectory
            | ErrorKind::NotADirectory
            | ErrorKind::InvalidInput
            | ErrorKind::InvalidFilename
            // A file that is no text.
            | ErrorKind::InvalidData
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_path_is_a_mistake_in_the_call_and_a_full_disk_is_none() {
        let path = Path::new("a.h5");
        let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
        assert!(!DataError::io(path, "write", full).is_usage());
        let folder = std::fs::read(std::env::temp_dir()).unwrap_err();
        assert!(DataError::io(path, "read", folder).is_usage());
        assert!(DataError::format(path, "file", "HDF5", "text").is_usage());
        assert!(DataError::inconsistent("steps", "1 to 9", "10").is_usage());
        let unsound = DataError::Unsound {
            name: "a.h5".into(),
            errors: 2,
            first: "sweep 3 has values that are no numbers".into(),
        };
        assert!(unsound.is_usage());
    }
}
