//! Where sweeps come from: the twin, or a file.

use std::path::Path;

use tactnet_data::twin::{self, TwinConfig};
use tactnet_data::{DataError, Dataset, Seed, format};
use tactnet_pipeline::LabelOrder;

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

/// The same, with the first `steps` steps of every sweep, and with labels in `order`.
pub fn load_part(
    data: &str,
    steps: Option<usize>,
    order: LabelOrder,
    seed: Seed,
) -> Result<Dataset, DataError> {
    let mut dataset = load(data)?;
    if let Some(steps) = steps {
        dataset = dataset.first_steps(steps)?;
    }
    match order {
        LabelOrder::True => Ok(dataset),
        LabelOrder::Permuted => dataset.permute_labels(seed),
    }
}
