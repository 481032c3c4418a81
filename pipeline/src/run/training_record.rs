//! What a training notes in its run directory while it goes on.

use std::time::{Duration, Instant};

use crate::network::training::Watched;
use crate::{BatchReport, EpochMetrics, PipelineError, RunDir, Training, TrainingState};

/// A long epoch is saved this often.
pub(crate) const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);
/// Epochs are saved at their ends, but not more often than this: small networks would spend most of their time on it.
pub(crate) const EPOCHS_EVERY: Duration = Duration::from_secs(2);

/// Metrics and checkpoints of a network's training.
pub(crate) struct TrainingRecord<'a> {
    run: &'a RunDir,
    metrics: Vec<EpochMetrics>,
    /// Time spent in training steps, interruptions left out.
    seconds: f64,
    epoch_seconds: f64,
    saved: Instant,
    /// The end of the last epoch, if that was not saved, with the seconds until then.
    unsaved: Option<(TrainingState, f64)>,
}

impl<'a> TrainingRecord<'a> {
    /// Puts `training` where the last checkpoint of `run` stands, if there is one.
    ///
    /// # Errors
    /// A damaged file, a checkpoint of another training.
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

    /// Returns the record of `run`, and the state of its last checkpoint, if there is one.
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

    /// Time spent in training steps since the training began, seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Notes a batch that took `spent`.
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

    /// Notes how the test sweeps do after the epoch that was noted last.
    pub fn note_watched(&mut self, watched: Watched) {
        if let Some(epoch) = self.metrics.last_mut() {
            epoch.test_accuracy = Some(watched.accuracy);
            epoch.adversarial_test_accuracy = watched.adversarial_accuracy;
        }
    }

    /// Returns true at the end of an epoch, two seconds after the last checkpoint at the earliest, and a minute after it in any case.
    pub fn is_due(&self, batch: &BatchReport) -> bool {
        let since = self.saved.elapsed();
        (batch.ends_epoch() && since >= EPOCHS_EVERY) || since >= CHECKPOINT_EVERY
    }

    /// Writes the metrics of the epochs so far, and a checkpoint.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn save(&mut self, training: &mut Training<'_>) -> Result<(), PipelineError> {
        self.write(&training.state()?)
    }

    /// Writes the metrics of the epochs so far.
    ///
    /// # Errors
    /// They cannot be written.
    #[cfg(any(feature = "vulkan", feature = "cuda"))]
    pub fn write_metrics(&self) -> Result<(), PipelineError> {
        self.run.write_metrics(&self.metrics)
    }

    /// Writes the metrics of the epochs so far, and `state` as a checkpoint.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&mut self, state: &TrainingState) -> Result<(), PipelineError> {
        self.run.write_metrics(&self.metrics)?;
        self.run.write_checkpoint(state, self.seconds)?;
        self.saved = Instant::now();
        self.unsaved = None;
        Ok(())
    }

    /// Keeps the end of an epoch in memory until something is saved.
    ///
    /// # Errors
    /// None with weights of a network.
    pub fn keep(&mut self, training: &mut Training<'_>) -> Result<(), PipelineError> {
        self.unsaved = Some((training.state()?, self.seconds));
        Ok(())
    }

    /// Writes the end of the last epoch, after which the training failed, if that was not saved.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn save_last_epoch(&mut self) -> Result<(), PipelineError> {
        let Some((state, seconds)) = self.unsaved.take() else {
            return Ok(());
        };
        self.run.write_metrics(&self.metrics)?;
        self.run.write_checkpoint(&state, seconds)
    }
}
