//! Sources of data sets: a file, or the generator of the twin.

use std::path::{Path, PathBuf};

use crate::format::{Keep, ReadOptions};
use crate::twin::{self, TwinConfig, TwinVersion};
use crate::{DataError, Dataset, format, near_name};

/// Source of a data set, as a command or a recipe names it.
///
/// ```
/// use tactnet_data::DataSource;
///
/// assert!(matches!(DataSource::named("twin"), DataSource::Twin(_)));
/// assert!(matches!(DataSource::named("sweeps.h5"), DataSource::File(_)));
/// assert!(DataSource::named("missing.h5").read().is_err());
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DataSource {
    /// The synthetic stand-in for TactMat with its default settings.
    Twin(TwinVersion),
    /// File or folder in any of the formats of [`mod@crate::format`].
    File(PathBuf),
}

impl DataSource {
    /// Returns the source with this name: `twin`, `twin1`, or a path.
    pub fn named(name: &str) -> Self {
        let twin = [TwinVersion::One, TwinVersion::Two]
            .into_iter()
            .find(|version| version.name() == name);
        match twin {
            Some(version) => Self::Twin(version),
            None => Self::File(name.into()),
        }
    }

    /// Returns true if `name` is a twin's.
    pub fn is_twin(name: &str) -> bool {
        matches!(Self::named(name), Self::Twin(_))
    }

    /// Returns a name that is valid in every working folder: the twin's name, or the file's absolute path.
    pub fn from_anywhere(name: &str) -> String {
        match Self::named(name) {
            Self::Twin(_) => name.into(),
            // Without a working folder the path stays relative.
            Self::File(path) => std::path::absolute(&path)
                .map_or_else(|_| name.into(), |path| path.display().to_string()),
        }
    }

    /// Reads the file or generates the twin.
    ///
    /// # Errors
    /// A file that is missing, damaged or cannot be read.
    pub fn read(&self) -> Result<Dataset, DataError> {
        self.read_at(None)
    }

    /// Reads the file or generates the twin at a sample rate in Hz, which takes precedence over that of the file.
    ///
    /// # Errors
    /// As [`DataSource::read`].
    pub fn read_at(&self, rate_hz: Option<f64>) -> Result<Dataset, DataError> {
        self.read_with(&ReadOptions {
            rate_hz,
            ..ReadOptions::default()
        })
    }

    /// Reads the file or generates the twin with options. Of the twin, only sample rate and number of frames can be chosen.
    ///
    /// # Errors
    /// As [`DataSource::read`], and options that the data does not allow.
    pub fn read_with(&self, options: &ReadOptions) -> Result<Dataset, DataError> {
        match self {
            Self::Twin(version) => {
                let twin = twin::generate(&TwinConfig {
                    version: *version,
                    ..TwinConfig::default()
                })?;
                let twin = twin.with_named_rate(options.rate_hz)?;
                match options.keep {
                    Keep::First(steps) => twin.first_steps(steps),
                    Keep::Equal | Keep::All | Keep::Shortest | Keep::Most => Ok(twin),
                }
            }
            Self::File(path) if path.exists() => format::read_with(path, options),
            Self::File(path) => Err(DataError::format(
                path,
                "file",
                "a data set (.h5, .npz, .mat, .csv, .parquet, a folder of .csv or .npy) or the word `twin`",
                missing(path),
            )),
        }
    }
}

/// Returns the error of a missing file, with the most similar name in the same folder.
fn missing(path: &Path) -> String {
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    names.sort();
    let typed = path.file_name().unwrap_or_default().to_string_lossy();
    match near_name(&typed, names.iter().map(String::as_str)) {
        Some(meant) => format!(
            "no such file; did you mean `{}`?",
            path.with_file_name(meant).display()
        ),
        None => "no such file".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_was_nearly_named_is_proposed() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("own.npz"), b"").unwrap();
        let refused = |name: &str| {
            let path = folder.path().join(name);
            let source = DataSource::named(&path.to_string_lossy());
            source.read().unwrap_err().to_string()
        };
        assert!(
            refused("own.np").contains("own.npz`?"),
            "{}",
            refused("own.np")
        );
        assert!(!refused("felt.h5").contains("did you mean"));
    }

    #[test]
    fn a_missing_file_is_named() {
        for version in [TwinVersion::One, TwinVersion::Two] {
            let named = DataSource::named(version.name());
            assert_eq!(named, DataSource::Twin(version));
        }
        let refused = DataSource::named("no/such.h5").read().unwrap_err();
        assert!(refused.to_string().contains("no/such.h5"), "{refused}");
        assert!(refused.is_usage());
    }
}
