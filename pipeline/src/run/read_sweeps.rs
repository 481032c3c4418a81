//! Sweeps as a training asks for them.

use std::path::Path;

use tactnet_data::{DataError, DataSource, Dataset};

use crate::{LabelOrder, PipelineError, TrainSpec};

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

    /// Reads the sweeps that a run of this was trained on, from where they were then or from `moved_to`.
    ///
    /// # Errors
    /// As [`TrainSpec::read_sweeps`]; where nothing is at the old place, the message says that `--data` names the new one.
    pub fn read_sweeps_of_run(&self, moved_to: Option<&str>) -> Result<Dataset, PipelineError> {
        let place = moved_to.unwrap_or(&self.data);
        if moved_to.is_none() && !DataSource::is_twin(place) && !Path::new(place).exists() {
            return Err(PipelineError::Run {
                path: place.into(),
                reason: "expected the data set of the run, found nothing; `--data FILE` names where it is now".into(),
            });
        }
        Ok(self.read_sweeps_of(place, self.label_order)?)
    }
}

/// Returns the name of a data set as it is read from any working folder: `twin`, or the file's absolute path.
pub(super) fn from_anywhere(data: &str) -> String {
    match DataSource::named(data) {
        DataSource::Twin(_) => data.into(),
        // Without a working folder there is nothing better than the path as it was given.
        DataSource::File(path) => std::path::absolute(&path)
            .map_or_else(|_| data.into(), |path| path.display().to_string()),
    }
}
