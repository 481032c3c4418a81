//! Options that name the arrays of a file, for all commands that read data of other programs.

use clap::Args;

/// Names of the arrays in a file that has several.
#[derive(Args, Clone, Default)]
pub struct ArrayNames {
    /// Array, feature or HDF5 path (data/*/tactile: one sweep each) that holds the samples, in a file that has several
    #[arg(long, value_name = "NAME")]
    pub samples: Option<String>,
    /// Array or HDF5 path with the material of each sweep, as names or numbers, in a file that has several
    #[arg(long, value_name = "NAME")]
    pub labels: Option<String>,
}

impl ArrayNames {
    /// Returns the first option that is set, for data that allows none.
    pub fn first(&self) -> Option<&'static str> {
        match (&self.samples, &self.labels) {
            (Some(_), _) => Some("--samples"),
            (None, Some(_)) => Some("--labels"),
            (None, None) => None,
        }
    }
}
