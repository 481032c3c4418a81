//! Where a data set is read from: a file, or the generator of the twin.

use std::path::PathBuf;

use crate::twin::{self, TwinConfig};
use crate::{DataError, Dataset, format};

/// What a command line or a recipe names as data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DataSource {
    /// The synthetic stand-in for TactMat with its default settings; nothing is read.
    Twin,
    /// A file in any of the formats of [`mod@crate::format`].
    File(PathBuf),
}

impl DataSource {
    /// The name that stands for the twin.
    pub const TWIN: &str = "twin";

    /// The source called `name`: `twin`, or else a path.
    pub fn named(name: &str) -> Self {
        if name == Self::TWIN {
            Self::Twin
        } else {
            Self::File(name.into())
        }
    }

    /// Reads the file or generates the twin.
    ///
    /// # Errors
    /// No such file; one that cannot be read or is damaged.
    pub fn read(&self) -> Result<Dataset, DataError> {
        self.read_at(None)
    }

    /// The same, recorded at `rate_hz` frames per second if the file does not say.
    ///
    /// # Errors
    /// As [`DataSource::read`]; a file that says another rate.
    pub fn read_at(&self, rate_hz: Option<f64>) -> Result<Dataset, DataError> {
        let dataset = self.read_whole()?;
        let Some(rate_hz) = rate_hz else {
            return Ok(dataset);
        };
        if dataset.is_rate_assumed() {
            return dataset.with_sample_rate(rate_hz);
        }
        let own = dataset.sample_rate_hz();
        if (own - rate_hz).abs() > 1e-6 * own {
            return Err(DataError::inconsistent(
                "sample rate",
                format!("{own} Hz, as data set `{}` says", dataset.name()),
                format!("{rate_hz} Hz"),
            ));
        }
        Ok(dataset)
    }

    fn read_whole(&self) -> Result<Dataset, DataError> {
        match self {
            Self::Twin => twin::generate(&TwinConfig::default()),
            Self::File(path) if path.exists() => format::read(path),
            Self::File(path) => Err(DataError::format(
                path,
                "file",
                "a data set (.h5, .npz, .csv, a folder of .csv) or the word `twin`",
                "no such file",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_file_is_named() {
        assert_eq!(DataSource::named("twin"), DataSource::Twin);
        let refused = DataSource::named("no/such.h5").read().unwrap_err();
        assert!(refused.to_string().contains("no/such.h5"), "{refused}");
        assert!(refused.is_usage());
    }
}
