//! Reading data sets, with a word on the twin.

use tactnet_data::{DataError, DataSource, Dataset, Seed};
use tactnet_pipeline::{LabelOrder, read_sweeps};

/// The name that stands for the built-in synthetic data set.
pub const TWIN: &str = DataSource::TWIN;

/// Says so where the twin is about to be generated, which takes a moment and is no recording.
pub fn announce(data: &str) {
    if data == TWIN {
        eprintln!("generating the twin (synthetic sweeps, not TactMat) …");
    }
}

/// Generates the twin, or reads a file.
pub fn load(data: &str) -> Result<Dataset, DataError> {
    announce(data);
    DataSource::named(data).read()
}

/// The same, with the first `steps` steps of every sweep, and with labels in `order`.
pub fn load_part(
    data: &str,
    steps: Option<usize>,
    order: LabelOrder,
    seed: Seed,
) -> Result<Dataset, DataError> {
    announce(data);
    read_sweeps(data, steps, order, seed)
}
