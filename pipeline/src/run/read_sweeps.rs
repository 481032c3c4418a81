//! Sweeps as a training asks for them.

use std::path::Path;

use tactnet_data::format::{self, SweepsToClassify};
use tactnet_data::{DataError, DataSource, Dataset, SweepShape};

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

    /// Reads sweeps of whatever material for a classifier of this, arranged and timed as it was taught: the taxels of a file that does not
    /// say how they are arranged (tables, arrays without rows and columns) are put into its rows and columns, an array of just its frames, rows and
    /// columns is one sweep, and the rate of a file that
    /// does not say is its own, unless this names another. A file that says either keeps it, and may not fit.
    ///
    /// - `data`: `twin`, or a file
    /// - `shape`, `sample_rate_hz`: of the training sweeps
    ///
    /// # Errors
    /// As [`TrainSpec::read_sweeps`], except for materials that are not named.
    pub fn read_to_classify(
        &self,
        data: &str,
        shape: SweepShape,
        sample_rate_hz: f64,
    ) -> Result<SweepsToClassify, DataError> {
        let mut sweeps = match DataSource::named(data) {
            DataSource::File(path) if path.exists() => format::read_to_classify(&path, self.steps)?,
            // The twin, or a file that is not there.
            other => {
                let mut dataset = other.read()?;
                if let Some(steps) = self.steps {
                    dataset = dataset.first_steps(steps)?;
                }
                SweepsToClassify::of(dataset)
            }
        };
        let own = sweeps.dataset.shape();
        let one = (shape.steps, shape.rows, shape.cols);
        if !sweeps.labelled
            && sweeps.dataset.is_patch_assumed()
            && (sweeps.dataset.len(), own.steps, own.taxels()) == one
        {
            // Not so many sweeps, but the frames of a single one with its rows and columns.
            sweeps.dataset = sweeps.dataset.as_one_sweep(shape)?;
            sweeps.names.truncate(1);
        } else {
            (sweeps.dataset, sweeps.arranged) = arranged(sweeps.dataset, shape)?;
        }
        let is_named = self.rate_hz.is_some() || !sweeps.dataset.is_rate_assumed();
        let rate_hz = if is_named {
            self.rate_hz
        } else {
            Some(sample_rate_hz)
        };
        sweeps.dataset = sweeps.dataset.with_named_rate(rate_hz)?;
        Ok(sweeps)
    }

    /// Reads the sweeps that a run of this was trained on, from where they were then or from `moved_to`.
    ///
    /// # Errors
    /// As [`TrainSpec::read_sweeps`] and [`TrainSpec::place_of_data`].
    pub fn read_sweeps_of_run(&self, moved_to: Option<&str>) -> Result<Dataset, PipelineError> {
        let place = self.place_of_data(moved_to)?;
        Ok(self.read_sweeps_of(place, self.label_order)?)
    }

    /// Reads the sweeps that a classifier of this is judged by: of `other`, or else those that it was trained on. Returns also whether their taxels
    /// were put into the rows and columns of `shape`, the classifier's, since the data does not say how they are arranged.
    ///
    /// # Errors
    /// As [`TrainSpec::read_sweeps_of_run`].
    pub fn read_sweeps_to_judge(
        &self,
        other: Option<&str>,
        shape: SweepShape,
    ) -> Result<(Dataset, bool), PipelineError> {
        Ok(arranged(self.read_sweeps_of_run(other)?, shape)?)
    }

    /// Returns `moved_to`, or where the data were that a run of this was trained on: `twin`, or a file.
    ///
    /// # Errors
    /// Nothing is at the old place; the message says that `--data` names the new one.
    pub fn place_of_data<'a>(
        &'a self,
        moved_to: Option<&'a str>,
    ) -> Result<&'a str, PipelineError> {
        let place = moved_to.unwrap_or(&self.data);
        if moved_to.is_none() && !DataSource::is_twin(place) && !Path::new(place).exists() {
            return Err(PipelineError::Run {
                path: place.into(),
                reason: "expected the data set of the run, found nothing; `--data FILE` names where it is now".into(),
            });
        }
        Ok(place)
    }
}

/// Puts the taxels of a file that does not say how they are arranged into the rows and columns of `shape`; returns whether that changed anything.
fn arranged(dataset: Dataset, shape: SweepShape) -> Result<(Dataset, bool), DataError> {
    let own = dataset.shape();
    if !dataset.is_patch_assumed() || own.taxels() != shape.taxels() {
        return Ok((dataset, false));
    }
    Ok((
        dataset.with_patch(shape.rows, shape.cols)?,
        shape.rows != own.rows,
    ))
}
