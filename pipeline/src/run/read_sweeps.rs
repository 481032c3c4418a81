//! Reading of sweeps with the settings of a training.

use std::path::Path;

use tactnet_data::format::{self, ReadOptions, SweepsToClassify};
use tactnet_data::{DataError, DataSource, Dataset, SweepShape};

use crate::{ClassifierConfig, LabelOrder, PipelineError, PipelineRemedy, TrainSpec};

impl TrainSpec {
    /// Reads the sweeps for training and test.
    ///
    /// # Errors
    /// A missing or damaged file; more steps than the sweeps have.
    pub fn read_sweeps(&self) -> Result<Dataset, DataError> {
        let options = self.options_for(&self.data);
        let dataset = DataSource::named(&self.data).read_with(&options)?;
        self.with_rate_and_labels(dataset, self.label_order)
    }

    /// Reads other sweeps with the same settings, with labels in `order`. Other data that names its sample rate keeps it, even if it does not
    /// match the classifier; see [`TrainSpec::name_rate_of`].
    ///
    /// - `data`: path of the data set, or `twin`
    ///
    /// # Errors
    /// As [`TrainSpec::read_sweeps`].
    pub fn read_sweeps_of(&self, data: &str, order: LabelOrder) -> Result<Dataset, DataError> {
        let read = |options: &ReadOptions| DataSource::named(data).read_with(options);
        let dataset = with_or_without_blocks(self.options_for(data), read)?;
        self.with_rate_and_labels(dataset, order)
    }

    fn options_for(&self, data: &str) -> ReadOptions {
        ReadOptions {
            keep: self.keep(),
            rate_hz: self.rate_hz.filter(|_| data == self.data),
            ..self.names_in(data)
        }
    }

    fn with_rate_and_labels(
        &self,
        mut dataset: Dataset,
        order: LabelOrder,
    ) -> Result<Dataset, DataError> {
        if dataset.is_rate_assumed() {
            dataset = dataset.with_named_rate(self.rate_hz)?;
        }
        match order {
            LabelOrder::True => Ok(dataset),
            LabelOrder::Permuted => dataset.permute_labels(self.seed),
        }
    }

    /// Returns options with the names of samples and labels, for the training data and other files of its kind.
    fn names_in(&self, data: &str) -> ReadOptions {
        let kind = |data: &str| Path::new(data).extension().map(ToOwned::to_owned);
        let names = |name: &Option<String>| {
            let is_alike = data == self.data || kind(data) == kind(&self.data);
            name.clone().filter(|_| is_alike)
        };
        ReadOptions {
            samples: names(&self.samples),
            labels: names(&self.labels),
            blocks: names(&self.blocks),
            ..ReadOptions::default()
        }
    }

    /// Names the sample rate of other data, in Hz; it takes precedence over that of the data. With `None` the settings do not change.
    pub fn name_rate_of(&mut self, data: &str, rate_hz: Option<f64>) {
        if rate_hz.is_some() {
            self.rate_hz = rate_hz;
            self.data = data.into();
        }
    }

    /// Reads sweeps of any material for a classifier trained with these settings.
    ///
    /// Taxels of a file without rows and columns (tables, two-dimensional arrays) are arranged as those of the classifier. An array with exactly
    /// its frames, rows and columns counts as one sweep. A file without a rate gets the classifier's, unless these settings name a rate. A file
    /// that names either keeps it, even if it does not match the classifier. The sweeps have the classifier's conditions, see
    /// [`ClassifierConfig::with_own_conditions`], with a finding on those that differ.
    ///
    /// - `data`: path of the data set, or `twin`
    ///
    /// # Errors
    /// As [`TrainSpec::read_sweeps`], except that materials need not be named; a condition in another unit.
    pub fn read_to_classify(
        &self,
        data: &str,
        classifier: &ClassifierConfig,
    ) -> Result<SweepsToClassify, PipelineError> {
        let (shape, sample_rate_hz) = (classifier.taxel_shape(), classifier.sample_rate_hz);
        let mut sweeps = match DataSource::named(data) {
            DataSource::File(path) if path.exists() => {
                let options = ReadOptions {
                    rate_hz: self.rate_hz,
                    keep: self.keep(),
                    ..self.names_in(data)
                };
                let read = |options: &ReadOptions| format::read_to_classify_with(&path, options);
                with_or_without_blocks(options, read)?
            }
            // The twin, or a missing file.
            other => {
                let mut dataset = other.read()?;
                if let Some(steps) = self.steps {
                    dataset = dataset.first_steps(steps)?;
                }
                SweepsToClassify::of(dataset)
            }
        };
        let own = sweeps.dataset.taxel_shape();
        let one = (shape.steps, shape.rows, shape.cols);
        if !sweeps.labelled
            && sweeps.dataset.is_patch_assumed()
            && (sweeps.dataset.len(), own.steps, own.taxels()) == one
        {
            // The array holds the frames of a single sweep, not that many sweeps.
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
        sweeps.dataset = classifier.conformed(sweeps.dataset.with_named_rate(rate_hz)?)?;
        Ok(sweeps)
    }

    /// Reads the training data of a run with these settings, from its original path or from `moved_to`.
    ///
    /// # Errors
    /// As [`TrainSpec::read_sweeps`] and [`TrainSpec::place_of_data`].
    pub fn read_sweeps_of_run(&self, moved_to: Option<&str>) -> Result<Dataset, PipelineError> {
        let place = self.place_of_data(moved_to)?;
        Ok(self.read_sweeps_of(place, self.label_order)?)
    }

    /// Reads the sweeps on which a classifier with these settings is evaluated: those of `other`, or its training data. Also returns true if the
    /// taxels of a file without rows and columns were arranged as those of the classifier. The sweeps have its conditions, see
    /// [`ClassifierConfig::with_own_conditions`], with a finding on those that differ.
    ///
    /// # Errors
    /// As [`TrainSpec::read_sweeps_of_run`]; a condition in another unit.
    pub fn read_sweeps_to_judge(
        &self,
        other: Option<&str>,
        classifier: &ClassifierConfig,
    ) -> Result<(Dataset, bool), PipelineError> {
        let dataset = self.read_sweeps_of_run(other)?;
        let (dataset, is_changed) = arranged(dataset, classifier.taxel_shape())?;
        Ok((classifier.conformed(dataset)?, is_changed))
    }

    /// Returns `moved_to`, or the original path of a run's training data, or `twin`.
    ///
    /// # Errors
    /// No file at the original path; the remedy is to name the new one.
    pub fn place_of_data<'a>(
        &'a self,
        moved_to: Option<&'a str>,
    ) -> Result<&'a str, PipelineError> {
        let place = moved_to.unwrap_or(&self.data);
        if moved_to.is_none() && !DataSource::is_twin(place) && !Path::new(place).exists() {
            return Err(PipelineError::run(
                place,
                "expected the data set of the run, found no file",
            )
            .with_remedy(PipelineRemedy::NameData));
        }
        Ok(place)
    }
}

/// Reads data for a trained classifier: with the blocks that the training named, or without them where the data lack them.
fn with_or_without_blocks<T>(
    options: ReadOptions,
    read: impl Fn(&ReadOptions) -> Result<T, DataError>,
) -> Result<T, DataError> {
    match read(&options) {
        Err(_) if options.blocks.is_some() => read(&ReadOptions {
            blocks: None,
            ..options
        }),
        result => result,
    }
}

/// Arranges the taxels of a file without rows and columns as in `shape`; returns true if that changed the rows.
fn arranged(dataset: Dataset, shape: SweepShape) -> Result<(Dataset, bool), DataError> {
    let own = dataset.taxel_shape();
    if !dataset.is_patch_assumed() || own.taxels() != shape.taxels() {
        return Ok((dataset, false));
    }
    Ok((
        dataset.with_patch(shape.rows, shape.cols)?,
        shape.rows != own.rows,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A robot's new sweeps have no sessions; the training data must have those that the user named.
    #[test]
    fn only_the_training_data_need_the_named_blocks() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, room: bool| {
            let mut text = format!("sweep,material{},a,b\n", if room { ",room" } else { "" });
            for sweep in 0..8 {
                for step in 0..60 {
                    let material = ["cork", "felt"][sweep % 2];
                    let of = if room {
                        format!(",{}", sweep / 4)
                    } else {
                        String::new()
                    };
                    text += &format!("{sweep},{material}{of},{},{}\n", step * sweep, step + sweep);
                }
            }
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            path.to_str().unwrap().to_string()
        };
        let (with, without) = (write("with.csv", true), write("without.csv", false));
        let spec = |data: &str| TrainSpec {
            data: data.into(),
            rate_hz: Some(100.0),
            blocks: Some("room".into()),
            ..TrainSpec::default()
        };
        let trained = spec(&with);
        assert!(trained.read_sweeps().unwrap().has_blocks());
        let other = |data: &str| trained.read_sweeps_of(data, LabelOrder::True).unwrap();
        assert!(other(&with).has_blocks());
        assert!(!other(&without).has_blocks());
        assert_eq!(other(&without).taxel_shape().taxels(), 2);
        let error = spec(&without).read_sweeps().unwrap_err().to_string();
        assert!(error.contains("a column `room` for the blocks"), "{error}");
        // A rate that is named for new data makes them the data of the settings.
        let mut named = spec(&with);
        named.name_rate_of(&without, Some(50.0));
        assert!(
            !named
                .read_sweeps_of(&without, LabelOrder::True)
                .unwrap()
                .has_blocks()
        );
    }
}
