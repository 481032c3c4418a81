//! Where a data set is read from: a file, or the generator of the twin.

use std::path::PathBuf;

use crate::twin::{self, TwinConfig};
use crate::{DataError, Dataset, format};

/// What a command line or a recipe names as data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DataSource {
    /// The synthetic stand-in for TactMat with its default settings; nothing is read.
    Twin,
    /// A file in any of the formats of [`format`].
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
        match self {
            Self::Twin => twin::generate(&TwinConfig::default()),
            Self::File(path) if path.exists() => format::read(path),
            Self::File(path) => Err(DataError::format(
                path,
                "file",
                "a data set (.h5, .npz) or the word `twin`",
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
