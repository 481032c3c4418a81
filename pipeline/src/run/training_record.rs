//! What a training notes in its run directory while it goes on.

use std::time::{Duration, Instant};

use crate::{BatchReport, EpochMetrics, PipelineError, RunDir, Training};

/// Every epoch is saved at its end, and a long one also this often.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(60);

/// Metrics and checkpoints of a network's training.
pub(crate) struct TrainingRecord<'a> {
    run: &'a RunDir,
    metrics: Vec<EpochMetrics>,
    /// Time spent in training steps, interruptions left out.
    seconds: f64,
    epoch_seconds: f64,
    saved: Instant,
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
        let mut seconds = 0.0;
        if let Some((state, spent)) = run.checkpoint()? {
            training = training.resume(state)?;
            seconds = spent;
        }
        let record = Self {
            run,
            metrics: run.metrics_before(training.position().epoch + 1)?,
            seconds,
            epoch_seconds: 0.0,
            saved: Instant::now(),
        };
        Ok((record, training))
    }

    /// Time spent in training steps since the training began, seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Notes a batch that took `spent`; writes the metrics at the end of an epoch.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn note(&mut self, batch: &BatchReport, spent: Duration) -> Result<(), PipelineError> {
        self.seconds += spent.as_secs_f64();
        self.epoch_seconds += spent.as_secs_f64();
        if batch.ends_epoch() {
            self.metrics.push(EpochMetrics {
                epoch: batch.epoch + 1,
                train_loss: batch.mean_loss,
                train_accuracy: batch.accuracy,
                adversarial_accuracy: batch.adversarial_accuracy,
                learning_rate: batch.learning_rate,
                seconds: self.epoch_seconds,
            });
            self.run.write_metrics(&self.metrics)?;
            self.epoch_seconds = 0.0;
        }
        Ok(())
    }

    /// Returns true at the end of an epoch, and a minute after the last checkpoint.
    pub fn is_due(&self, batch: &BatchReport) -> bool {
        batch.ends_epoch() || self.saved.elapsed() >= CHECKPOINT_EVERY
    }

    /// Writes a checkpoint.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn save(&mut self, training: &Training<'_>) -> Result<(), PipelineError> {
        self.run
            .write_checkpoint(&training.state()?, self.seconds)?;
        self.saved = Instant::now();
        Ok(())
    }
}
