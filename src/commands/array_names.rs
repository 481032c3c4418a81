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
    /// Column, array or HDF5 path with the block of each sweep: recording, session, day or subject, as numbers or names
    /// [default: columns such as `block` and `session`, the array `blocks`]
    #[arg(long, value_name = "NAME")]
    pub blocks: Option<String>,
}

impl ArrayNames {
    /// Returns the first option that is set, for data that allows none.
    pub fn first(&self) -> Option<&'static str> {
        let options = [
            (&self.samples, "--samples"),
            (&self.labels, "--labels"),
            (&self.blocks, "--blocks"),
        ];
        let mut set = options.into_iter().filter(|(name, _)| name.is_some());
        set.next().map(|(_, option)| option)
    }
}
