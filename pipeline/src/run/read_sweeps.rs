//! Sweeps as a training asks for them.

use tactnet_data::{DataError, DataSource, Dataset};

use crate::{LabelOrder, TrainSpec};

impl TrainSpec {
    /// Reads the sweeps that are trained on and tested.
    ///
    /// # Errors
    /// No such file, one that is damaged; a rate that contradicts the file's; more steps than its sweeps have.
    pub fn read_sweeps(&self) -> Result<Dataset, DataError> {
        self.read_sweeps_of(&self.data, self.label_order)
    }

    /// Reads other sweeps in the same way, with labels in `order`.
    ///
    /// - `data`: `twin`, or a file
    ///
    /// # Errors
    /// As [`TrainSpec::read_sweeps`].
    pub fn read_sweeps_of(&self, data: &str, order: LabelOrder) -> Result<Dataset, DataError> {
        let mut dataset = DataSource::named(data).read_at(self.rate_hz)?;
        if let Some(steps) = self.steps {
            dataset = dataset.first_steps(steps)?;
        }
        match order {
            LabelOrder::True => Ok(dataset),
            LabelOrder::Permuted => dataset.permute_labels(self.seed),
        }
    }
}
