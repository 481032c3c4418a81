//! Errors of data sets.

use std::path::{Path, PathBuf};

use crate::{Finding, FindingKind, Place, Remedy, Severity};

/// Error of a data set; every variant that concerns a file names it.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// Error of the operating system.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Attempted action, as a verb phrase ("read", "rename into place").
        action: &'static str,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The content of a file does not match its format.
    #[error("{}: {item}: expected {expected}, found {found}", path.display())]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Part of the file: "data set `samples`", "attribute `sample_rate_hz`", "file".
        item: String,
        /// Content that the format requires.
        expected: String,
        /// Content of the file.
        found: String,
        /// Cure, if the caller can apply one.
        remedy: Option<Remedy>,
    },
    /// Parts of a file that cannot be read, each with its place.
    #[error("{}: {}", path.display(), first_of(findings))]
    Unreadable {
        /// Path of the file or folder.
        path: PathBuf,
        /// At least one finding.
        findings: Vec<Finding>,
    },
    /// Parts of a data set in memory contradict each other.
    #[error("{item}: expected {expected}, found {found}")]
    Inconsistent {
        /// The contradicting part.
        item: String,
        /// Value that the other parts require.
        expected: String,
        /// Value of this part.
        found: String,
        /// Cure, if the caller can apply one.
        remedy: Option<Remedy>,
    },
    /// A data set with findings of severity error, see [`crate::check()`].
    #[error(
        "{name}: the data set has {errors} error{}, the first: {first}", if *errors == 1 { "" } else { "s" }
    )]
    Unsound {
        /// Name or file of the data set, as the caller gave it.
        name: String,
        /// Number of errors.
        errors: usize,
        /// Message of the first error.
        first: String,
    },
    /// A split would put sweeps that share frames on both sides, see [`crate::refuse_leaks`].
    #[error(
        "{name}: the split could train on frames that it tests on, since {sweeps} sweep{} with an earlier one, the first: {first}", if *sweeps == 1 { " shares frames" } else { "s share frames" }
    )]
    Leak {
        /// Name or file of the data set, as the caller gave it.
        name: String,
        /// Number of sweeps that share frames with an earlier one.
        sweeps: usize,
        /// Message of the first finding.
        first: String,
    },
}

impl DataError {
    /// Returns true if the caller can fix the error, for example a folder in place of a file; false if the disk fails.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Format { .. }
            | Self::Unreadable { .. }
            | Self::Inconsistent { .. }
            | Self::Unsound { .. }
            | Self::Leak { .. } => true,
            Self::Io { source, .. } => is_wrong_path(source),
        }
    }

    /// Returns the cure that the caller can apply, if there is one; the message does not contain it.
    pub fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Format { remedy, .. } | Self::Inconsistent { remedy, .. } => remedy.clone(),
            Self::Unsound { name, .. } => Some(Remedy::ListFindings { data: name.clone() }),
            Self::Leak { .. } => Some(Remedy::LeaveBlocksOut),
            Self::Unreadable { findings, .. } => findings.iter().find_map(|of| of.remedy.clone()),
            Self::Io { .. } => None,
        }
    }

    /// Returns the error as findings of a check.
    pub fn findings(&self) -> Vec<Finding> {
        let file = match self {
            Self::Unreadable { findings, .. } => return findings.clone(),
            Self::Format { path, .. } | Self::Io { path, .. } => Some(path.clone()),
            Self::Inconsistent { .. } | Self::Unsound { .. } | Self::Leak { .. } => None,
        };
        vec![
            Finding {
                remedy: self.remedy(),
                ..Finding::new(Severity::Error, FindingKind::Unreadable, self.to_string())
            }
            .at(Place {
                file,
                ..Place::default()
            }),
        ]
    }

    /// Returns the error with this cure. Errors of the operating system and of [`crate::refuse_errors`] do not change.
    #[must_use]
    pub fn with_remedy(mut self, cure: Remedy) -> Self {
        if let Self::Format { remedy, .. } | Self::Inconsistent { remedy, .. } = &mut self {
            *remedy = Some(cure);
        }
        self
    }

    /// Returns a [`DataError::Io`].
    pub fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_path_buf(),
            action,
            source,
        }
    }

    /// Returns a [`DataError::Format`].
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

    /// Returns a [`DataError::Inconsistent`].
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

/// Returns the first message and the number of further ones.
fn first_of(findings: &[Finding]) -> String {
    let first = findings.first().map_or("", |finding| &finding.message);
    match findings.len() {
        0 | 1 => first.into(),
        all => format!("{first} (and {} more)", all - 1),
    }
}

/// Returns true if the path is wrong (missing, not permitted, a folder in place of a file), so the caller can fix it;
/// false if the disk fails.
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
            // A text file with bytes that are not UTF-8.
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
