//! Complete sweeps on their way to the model worker.

use super::Service;
use crate::model_worker::Job;
use crate::recent_sweeps::{CompleteSweep, SweepId};

impl Service {
    /// Copies the complete sweep of a finger into a free buffer, or counts it if the worker has none left.
    pub(super) fn keep_sweep(&mut self, number: usize) {
        let finger = &self.fingers[number];
        let steps = finger.classifier.config().longest_trained();
        let Some(sweep) = finger.segmenter.window().first(steps) else {
            return;
        };
        let Some(mut digits) = self.worker.free_buffer() else {
            return self.metrics.count_uncompared();
        };
        digits.copy_from_slice(sweep);
        self.complete.push_back(CompleteSweep {
            id: SweepId {
                finger: number as u32,
                sweep: finger.sweep,
                motion: finger.motion,
            },
            object: finger.object,
            digits,
        });
    }

    /// Hands the kept sweeps to the worker. Returns false if its queue is full.
    pub(super) fn hand_over_sweeps(&mut self) -> bool {
        while let Some(sweep) = self.complete.pop_front() {
            if let Err(Job::Sweep(sweep)) = self.worker.ask(Job::Sweep(sweep)) {
                self.complete.push_front(sweep);
                return false;
            }
        }
        true
    }
}
