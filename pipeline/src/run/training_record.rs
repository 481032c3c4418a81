//! Training loop that writes metrics and checkpoints into a run directory.

use std::time::{Duration, Instant};

use tactnet_data::SweepView;

use crate::network::training::Watched;
use crate::{BatchReport, EpochMetrics, PipelineError, RunDir, Training, TrainingState};

/// Maximum time between checkpoints.
pub(crate) const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);
/// Minimum time between checkpoints at the ends of epochs, since small networks would otherwise spend most of their time on them.
pub(crate) const EPOCHS_EVERY: Duration = Duration::from_secs(2);

/// Metrics and checkpoints of a network's training.
pub(crate) struct TrainingRecord<'a> {
    run: &'a RunDir,
    metrics: Vec<EpochMetrics>,
    /// Time spent in training steps, in seconds, without interruptions.
    seconds: f64,
    epoch_seconds: f64,
    saved: Instant,
    /// State at the end of the last epoch and training seconds until then, if not saved yet.
    unsaved: Option<(TrainingState, f64)>,
}

impl<'a> TrainingRecord<'a> {
    /// Moves `training` to the last checkpoint of `run`, if there is one.
    ///
    /// # Errors
    /// A damaged file; a checkpoint of another training.
    pub fn resume<'b>(
        run: &'a RunDir,
        mut training: Training<'b>,
    ) -> Result<(Self, Training<'b>), PipelineError> {
        let (record, state) = Self::open(run)?;
        if let Some(state) = state {
            training = training.resume(state)?;
        }
        Ok((record, training))
    }

    /// Opens the record of `run`; also returns the state of its last checkpoint, if there is one.
    ///
    /// # Errors
    /// A damaged file.
    pub fn open(run: &'a RunDir) -> Result<(Self, Option<TrainingState>), PipelineError> {
        let (state, seconds) = match run.checkpoint()? {
            Some((state, seconds)) => (Some(state), seconds),
            None => (None, 0.0),
        };
        let epoch = state.as_ref().map_or(0, |state| state.position.epoch);
        let record = Self {
            run,
            metrics: run.metrics_before(epoch + 1)?,
            seconds,
            epoch_seconds: 0.0,
            saved: Instant::now(),
            unsaved: None,
        };
        Ok((record, state))
    }

    /// Returns the time spent in training steps since the training began, in seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Records a batch that took `spent`.
    pub fn note(&mut self, batch: &BatchReport, spent: Duration) {
        self.seconds += spent.as_secs_f64();
        self.epoch_seconds += spent.as_secs_f64();
        if batch.ends_epoch() {
            self.metrics.push(EpochMetrics {
                epoch: batch.epoch + 1,
                train_loss: batch.mean_loss.unwrap_or(f64::NAN),
                train_accuracy: batch.accuracy.unwrap_or(f64::NAN),
                adversarial_accuracy: batch.adversarial_accuracy,
                test_accuracy: None,
                adversarial_test_accuracy: None,
                learning_rate: batch.learning_rate,
                seconds: self.epoch_seconds,
            });
            self.epoch_seconds = 0.0;
        }
    }

    /// Records the accuracy on the test sweeps after the last recorded epoch.
    pub fn note_watched(&mut self, watched: Watched) {
        if let Some(epoch) = self.metrics.last_mut() {
            epoch.test_accuracy = Some(watched.accuracy);
            epoch.adversarial_test_accuracy = watched.adversarial_accuracy;
        }
    }

    /// Returns true if a checkpoint is due: at the end of an epoch after two seconds, in any case after a minute.
    pub fn is_due(&self, batch: &BatchReport) -> bool {
        let since = self.saved.elapsed();
        (batch.ends_epoch() && since >= EPOCHS_EVERY) || since >= CHECKPOINT_EVERY
    }

    /// Writes the metrics of all epochs so far, and a checkpoint.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn save(&mut self, training: &mut Training<'_>) -> Result<(), PipelineError> {
        self.write(&training.state()?)
    }

    /// Writes the metrics of all epochs so far.
    ///
    /// # Errors
    /// A file that cannot be written.
    #[cfg(any(feature = "vulkan", feature = "cuda"))]
    pub fn write_metrics(&self) -> Result<(), PipelineError> {
        self.run.write_metrics(&self.metrics)
    }

    /// Writes the metrics of all epochs so far, and `state` as a checkpoint.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, state: &TrainingState) -> Result<(), PipelineError> {
        self.run.write_metrics(&self.metrics)?;
        self.run.write_checkpoint(state, self.seconds)?;
        self.saved = Instant::now();
        self.unsaved = None;
        Ok(())
    }

    /// Keeps the state at the end of an epoch in memory until the next save.
    ///
    /// # Errors
    /// Weights that cannot be read; a network's always can.
    pub fn keep(&mut self, training: &mut Training<'_>) -> Result<(), PipelineError> {
        self.unsaved = Some((training.state()?, self.seconds));
        Ok(())
    }

    /// Writes the unsaved state at the end of the last epoch, after a failure of the training.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn save_last_epoch(&mut self) -> Result<(), PipelineError> {
        let Some((state, seconds)) = self.unsaved.take() else {
            return Ok(());
        };
        self.run.write_metrics(&self.metrics)?;
        self.run.write_checkpoint(&state, seconds)
    }
}

/// Trains to the last epoch. Returns false if `go_on` stopped it; the record then has a checkpoint of that moment.
///
/// - `record`: writes metrics and checkpoints
/// - `watched`: sweeps whose accuracy is recorded after every epoch
/// - `go_on`: called after every batch; false stops the training
pub(crate) fn train_batches(
    training: &mut Training<'_>,
    record: &mut TrainingRecord<'_>,
    watched: Option<&SweepView<'_>>,
    mut go_on: impl FnMut(&BatchReport) -> bool,
) -> Result<bool, PipelineError> {
    loop {
        let begun = Instant::now();
        let batch = match training.step() {
            Ok(Some(batch)) => batch,
            Ok(None) => return Ok(true),
            Err(error) => {
                record.save_last_epoch()?;
                return Err(error);
            }
        };
        let spent = begun.elapsed();
        let continues = go_on(&batch);
        record.note(&batch, spent);
        if let (Some(watched), true) = (watched, batch.ends_epoch()) {
            record.note_watched(training.watch(watched)?);
        }
        if record.is_due(&batch) || !continues {
            record.save(training)?;
        } else if batch.ends_epoch() {
            record.keep(training)?;
        }
        if !continues {
            return Ok(false);
        }
    }
}
