//! Sweeps as a training asks for them.

use tactnet_data::{DataError, DataSource, Dataset, Seed};

use crate::LabelOrder;

/// Reads a data set or generates the twin, cut to the first `steps` time steps of every sweep, with labels in `order`.
///
/// - `data`: `twin`, or a file
/// - `seed`: names the permutation of labels
///
/// # Errors
/// No such file, one that is damaged; more steps than its sweeps have.
pub fn read_sweeps(
    data: &str,
    steps: Option<usize>,
    order: LabelOrder,
    seed: Seed,
) -> Result<Dataset, DataError> {
    let mut dataset = DataSource::named(data).read()?;
    if let Some(steps) = steps {
        dataset = dataset.first_steps(steps)?;
    }
    match order {
        LabelOrder::True => Ok(dataset),
        LabelOrder::Permuted => dataset.permute_labels(seed),
    }
}
