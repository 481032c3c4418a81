//! Training with progress and Ctrl-C on the calling thread.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, channel, sync_channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;
use tactnet::Recipe;
use tactnet_data::TrainSplit;
use tactnet_pipeline::BatchReport;

use crate::error::{TactnetError, raised};
use crate::threads::Operation;

/// Interval between two checks for Ctrl-C while no batch ends.
const PATIENCE: Duration = Duration::from_millis(100);
/// Time after which a thread that waits for the answer to a report helps other operations, which that answer may depend on.
const ANSWER: Duration = Duration::from_millis(20);

/// Fits a classifier in the thread pool. After every batch of a network, `progress` is called on this thread, the only one that Python's signal
/// handlers run on.
///
/// # Errors
/// Errors of the training; an exception of `progress` or of a signal handler, which stops the training at the next batch.
pub(crate) fn fit_watched(
    py: Python<'_>,
    recipe: &Recipe,
    train: &TrainSplit<'_>,
    progress: Option<&Py<PyAny>>,
) -> PyResult<tactnet::Classifier> {
    let operation = Operation::begin()?;
    let (reports, incoming) = sync_channel(0);
    let (answers, answered) = channel();
    let (stopped, joined) = py.detach(move || {
        let operation = &operation;
        thread::scope(|scope| {
            let worker = scope.spawn(move || {
                operation.install(move || {
                    let ask = Ask { reports, answered };
                    recipe.fit_while(train, |report| ask.may_go_on(report))
                })
            });
            let mut stopped = None;
            loop {
                match incoming.recv_timeout(PATIENCE) {
                    Ok(report) => {
                        if stopped.is_none() {
                            stopped = look(Some(&report), progress).err();
                        }
                        // The training waits for it.
                        let _ = answers.send(stopped.is_none());
                    }
                    Err(RecvTimeoutError::Timeout) => {
                        if stopped.is_none() {
                            stopped = look(None, progress).err();
                        }
                    }
                    Err(RecvTimeoutError::Disconnected) => break,
                }
            }
            (stopped, worker.join())
        })
    });
    let fitted = joined.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    if let Some(error) = stopped {
        return Err(error);
    }
    fitted
        .map_err(raised)?
        .ok_or_else(|| TactnetError::new_err("the training was stopped"))
}

/// The training's side of the reports and their answers.
struct Ask {
    reports: SyncSender<BatchReport>,
    answered: Receiver<bool>,
}

impl Ask {
    /// Reports a batch, and returns true if the training is to go on.
    fn may_go_on(&self, report: &BatchReport) -> bool {
        if self.reports.send(report.clone()).is_err() {
            return false;
        }
        loop {
            match self.answered.recv_timeout(ANSWER) {
                Ok(answer) => return answer,
                Err(RecvTimeoutError::Timeout) => drop(rayon::yield_now()),
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
    }
}

/// Checks for Ctrl-C, and calls `progress` with the report of a batch.
fn look(report: Option<&BatchReport>, progress: Option<&Py<PyAny>>) -> PyResult<()> {
    Python::attach(|py| {
        py.check_signals()?;
        if let (Some(report), Some(progress)) = (report, progress) {
            let BatchReport {
                epoch,
                batch,
                batches,
                epochs,
                mean_loss,
                accuracy,
                ..
            } = *report;
            progress.call1(py, (epoch, batch, batches, epochs, mean_loss, accuracy))?;
        }
        Ok(())
    })
}
