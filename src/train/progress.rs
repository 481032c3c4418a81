//! How far a training is.

use std::io::IsTerminal;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tactnet_pipeline::{BatchReport, Training};

/// A bar on a terminal, a line per epoch elsewhere.
pub struct Progress {
    bar: Option<ProgressBar>,
    begun: Instant,
    batches_before: usize,
}

impl Progress {
    pub fn new(training: &Training<'_>, epochs: usize) -> Self {
        let batches = training.batches();
        let batches_before = training.position().epoch * batches + training.position().batch;
        let bar = std::io::stderr().is_terminal().then(|| {
            let total = (epochs * batches) as u64;
            let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template(
                "{msg} [{bar:30}] {percent:>3} %, {elapsed} gone, {eta} to go",
            ) {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_position(batches_before as u64);
            bar.reset_eta();
            bar
        });
        Self {
            bar,
            begun: Instant::now(),
            batches_before,
        }
    }

    pub fn show(&self, batch: &BatchReport, epochs: usize) {
        let text = format!(
            "epoch {}/{epochs}: loss {:.3}, accuracy {:.1} %",
            batch.epoch + 1,
            batch.mean_loss,
            100.0 * batch.accuracy
        );
        match &self.bar {
            Some(bar) => {
                bar.set_message(text);
                bar.inc(1);
            }
            None if batch.ends_epoch() => {
                let done = (batch.epoch + 1) * batch.batches - self.batches_before;
                let left = (epochs - batch.epoch - 1) * batch.batches;
                let eta = self.begun.elapsed().mul_f64(left as f64 / done as f64);
                eprintln!("{text}, {} to go", indicatif::HumanDuration(eta));
            }
            None => {}
        }
    }

    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish();
        }
    }
}
