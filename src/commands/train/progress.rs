//! Progress of a training.

use std::io::IsTerminal;
use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tactnet_pipeline::{BatchReport, TrainEvent, quoted};

use crate::commands::progress_line::{about, in_five_columns};

/// Number of epochs at the beginning that are all printed.
const FIRST_EPOCHS: usize = 5;
/// Time without output after which a later epoch is printed.
const SILENCE: Duration = Duration::from_secs(2);

/// Progress display: a bar on a terminal, one line per epoch elsewhere.
pub struct Progress {
    network: Option<NetworkProgress>,
    resumed: bool,
}

struct NetworkProgress {
    bar: Option<ProgressBar>,
    begun: Instant,
    /// Time of the last line.
    last_line: Instant,
    batches_before: usize,
}

impl Progress {
    /// - `resumed`: true if another process began the run
    pub fn new(resumed: bool) -> Self {
        Self {
            network: None,
            resumed,
        }
    }

    /// Shows a step of the session in the run directory `run`.
    pub fn show(&mut self, event: &TrainEvent<'_>, run: &Path) {
        match *event {
            TrainEvent::AlreadyEnded => say!("{}: this run has already ended", run.display()),
            TrainEvent::OtherBuild => {
                say!("another build began this run; its result will name both commits");
            }
            TrainEvent::LeftOut(member) => {
                say!("note: without `{}`: {}", member.name, member.reason);
            }
            TrainEvent::Member {
                name,
                number,
                members,
            } => say!("{name}, {number} of {members}:"),
            TrainEvent::Teacher {
                name,
                number,
                parts,
            } => say!("{name}, without part {number} of {parts}:"),
            TrainEvent::Begun {
                batches_before,
                steps,
                ref why_more_epochs,
            } => {
                match (self.resumed, batches_before) {
                    (false, _) => {}
                    (true, 0) => {
                        say!("the interrupted training saved no checkpoint: starting over")
                    }
                    (true, before) => say!(
                        "continuing after step {before} of {}, epoch {}",
                        steps.count(),
                        before / steps.batches + 1
                    ),
                }
                if let Some(why) = why_more_epochs {
                    say!("note: {why}; `--epochs N` sets another number");
                }
                // The epochs of a resumed run cannot be changed.
                if let Some(hint) = steps.hint("--epochs ").filter(|_| batches_before == 0) {
                    say!("hint: {hint}");
                }
                self.network = Some(NetworkProgress::new(batches_before, steps.count()));
            }
            TrainEvent::Batch { batch, epochs } => {
                if let Some(network) = &mut self.network {
                    network.show(batch, epochs);
                }
            }
            TrainEvent::Fitting { step, seconds } => say!("{seconds:>4.0} s: {step}"),
            TrainEvent::Calibrated(calibration) => {
                if let Some(caution) = calibration.caution() {
                    say!("hint: {caution}");
                }
                say!(
                    "calibrated: `tactnet eval {}` measures how often known materials are called unknown, `tactnet experiment run unknown --set data=FILE` how often unknown materials are detected",
                    quoted(&run.display().to_string())
                );
            }
            TrainEvent::Predicting { sweeps } => {
                if let Some(bar) = self.network.as_ref().and_then(|it| it.bar.as_ref()) {
                    bar.finish();
                }
                say!("predicting {sweeps} test sweeps …");
            }
            TrainEvent::RandomFold => {
                say!("training once more, with sweeps of the same recordings, for comparison …");
            }
        }
    }
}

impl NetworkProgress {
    fn new(batches_before: usize, batches: usize) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = batch_bar(batches, ProgressDrawTarget::stderr());
            bar.set_position(batches_before as u64);
            bar.reset_eta();
            bar
        });
        Self {
            bar,
            begun: Instant::now(),
            last_line: Instant::now(),
            batches_before,
        }
    }

    fn show(&mut self, batch: &BatchReport, epochs: usize) {
        let text = epoch_text(batch, epochs);
        match &self.bar {
            Some(bar) => {
                bar.set_message(text);
                bar.inc(1);
            }
            None if batch.ends_epoch() && self.is_due(batch.epoch + 1, epochs) => {
                let done = (batch.epoch + 1) * batch.batches - self.batches_before;
                let left = (epochs - batch.epoch - 1) * batch.batches;
                let eta = self.begun.elapsed().mul_f64(left as f64 / done as f64);
                say!("{text}, {} to go", about(eta));
                self.last_line = Instant::now();
            }
            None => {}
        }
    }

    /// Returns true if an epoch is printed: the first ones, the last one, and others after some time without output.
    fn is_due(&self, epoch: usize, epochs: usize) -> bool {
        epoch <= FIRST_EPOCHS || epoch == epochs || self.last_line.elapsed() >= SILENCE
    }
}

fn batch_bar(batches: usize, target: ProgressDrawTarget) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(batches as u64), target);
    if let Ok(style) = ProgressStyle::with_template("{msg}, {eta} to go {wide_bar}") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// Returns a summary of at most 46 columns, which leaves room for the remaining time.
fn epoch_text(batch: &BatchReport, epochs: usize) -> String {
    let epoch = batch.epoch + 1;
    match (batch.mean_loss, batch.accuracy) {
        (Some(loss), Some(accuracy)) => format!(
            "epoch {epoch}/{epochs}: loss {}, training {:.1} %",
            in_five_columns(loss),
            100.0 * accuracy
        ),
        _ => format!("epoch {epoch}/{epochs}"),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::commands::progress_line::{COLUMNS, Screen};

    #[test]
    fn the_longest_line_of_a_training_fits_terminals_of_every_width() {
        let batch = BatchReport {
            epoch: 999,
            batch: 0,
            batches: 1,
            epochs: 1000,
            mean_loss: Some(99_999.0),
            accuracy: Some(1.0),
            adversarial_accuracy: None,
            learning_rate: 1e-4,
        };
        let text = epoch_text(&batch, 1000);
        let left = about(Duration::from_secs(99 * 86_400));
        let line = format!("{text}, {left} to go");
        assert!(line.len() <= COLUMNS, "{} columns: {line}", line.len());
        let shown = Screen::shows(
            |target| batch_bar(1000, target),
            |bar| {
                bar.set_message(text.clone());
                bar.set_position(500);
            },
        );
        for line in &shown {
            assert!(line.starts_with(&text) && line.contains("to go"), "{line}");
        }
        assert!(
            shown[3].contains("==>"),
            "a wide terminal has a bar: {shown:?}"
        );
    }
}
