//! Everything that can be wrong with recorded data.

use std::path::{Path, PathBuf};

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
    },
}

impl DataError {
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
        }
    }
}
