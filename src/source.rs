//! Where sweeps come from: the twin, or a file.

use std::path::Path;

use tactnet_data::twin::{self, TwinConfig};
use tactnet_data::{DataError, Dataset, format};

/// The name that stands for the built-in synthetic data set.
pub const TWIN: &str = "twin";

/// Generates the twin, or reads a file.
pub fn load(data: &str) -> Result<Dataset, DataError> {
    if data == TWIN {
        eprintln!("generating the twin (synthetic sweeps, not TactMat) …");
        return twin::generate(&TwinConfig::default());
    }
    let path = Path::new(data);
    if !path.exists() {
        return Err(DataError::format(
            path,
            "file",
            "a data set (.h5, .npz) or the word `twin`",
            "no such file",
        ));
    }
    format::read(path)
}
