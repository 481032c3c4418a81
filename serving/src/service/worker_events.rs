//! Events of the model worker: new models, enrolled materials, adaptations, masks, comparisons with the training data, failures.

use tactnet_pipeline::OnlineClassifier;
use tactnet_skin::MAX_FINGERS;
use tactnet_skin::packets::Event;

use super::Service;
use crate::ServeError;
use crate::model_worker::{Job, WorkerEvent};
use crate::recent_sweeps::SweepId;
use crate::skin_limits::limits;

/// Fused beliefs that are discarded although the materials stay the same.
#[derive(Clone, Copy, PartialEq)]
enum Discarded {
    OtherMaterials,
    Finger(usize),
    All,
}

impl Discarded {
    fn holds(self, finger: usize) -> bool {
        self == Self::All || self == Self::Finger(finger)
    }
}

impl Service {
    /// Applies the worker's next event; a new model waits until no finger is in a sweep.
    pub(super) fn apply_worker_event(&mut self) -> Result<(), ServeError> {
        // The worker's queue may be full.
        if let Some(classifiers) = self.retired.take()
            && let Err(Job::Retire(classifiers)) = self.worker.ask(Job::Retire(classifiers))
        {
            self.retired = Some(classifiers);
        }
        if self.worker_event.is_none() {
            self.worker_event = self.worker.next_event();
        }
        // Models are replaced between sweeps only.
        let sweeping = self.fingers.iter().any(|f| f.segmenter.is_sweeping());
        match &self.worker_event {
            None => return Ok(()),
            Some(WorkerEvent::Ready { .. }) if sweeping || self.retired.is_some() => return Ok(()),
            Some(_) => {}
        }
        match self.worker_event.take() {
            Some(WorkerEvent::Ready {
                classifiers,
                names,
                event,
                finger,
                text,
            }) => {
                // Fused beliefs of a former mask or before an adaptation are wrong.
                let (discarded, reason) = match event {
                    Event::Masked => (Discarded::Finger(finger as usize), "other mask"),
                    Event::Adapted => (Discarded::All, "adapted model"),
                    _ => (Discarded::OtherMaterials, "other materials"),
                };
                let forgotten = self.replace_classifiers(classifiers, discarded);
                self.names = names;
                self.metrics.serve(self.names.version);
                self.model.put_copy(&[*self.names])?;
                if matches!(event, Event::Masked | Event::Adapted) {
                    self.messages.push(text.as_str().into());
                }
                self.publish_status(event, finger, format_args!("{}", text.as_str()))?;
                for (number, forgotten) in forgotten.into_iter().enumerate() {
                    if forgotten {
                        let text = format_args!("fused sweeps discarded: {reason}");
                        self.publish_status(Event::Reset, number as u32, text)?;
                    }
                }
                Ok(())
            }
            Some(WorkerEvent::Compared { id, event, text }) => {
                self.report_likeness(id, event, text.as_str())
            }
            Some(WorkerEvent::Failed {
                event,
                finger,
                text,
            }) => self.publish_status(event, finger, format_args!("{}", text.as_str())),
            None => Ok(()),
        }
    }

    /// Replaces the classifiers of all fingers. Returns true for the fingers whose fused beliefs are discarded: all if the
    /// materials differ.
    ///
    /// - `discarded`: beliefs that are discarded in any case
    fn replace_classifiers(
        &mut self,
        mut classifiers: Vec<OnlineClassifier>,
        discarded: Discarded,
    ) -> [bool; MAX_FINGERS] {
        let mut forgotten = [false; MAX_FINGERS];
        let fingers = self.fingers.iter_mut().zip(&mut classifiers);
        for ((number, (finger, classifier)), forgotten) in fingers.enumerate().zip(&mut forgotten) {
            std::mem::swap(&mut finger.classifier, classifier);
            // Another network may have other value limits.
            let set = self.config.segmenter.values;
            if let Some(values) = set.or_else(|| limits(finger.classifier.config())) {
                finger.segmenter.set_values(values);
            }
            let dead = finger.classifier.dead().0.keys();
            finger.segmenter.set_dead(dead.copied());
            let kept = !discarded.holds(number) && finger.classifier.take_fused(classifier);
            *forgotten = !kept && classifier.fused().sweeps() > 0;
        }
        self.retired = Some(classifiers);
        forgotten
    }

    /// Publishes a comparison with the training data, and tells the operator when it changes to `unlike` and back.
    fn report_likeness(&mut self, id: SweepId, event: Event, text: &str) -> Result<(), ServeError> {
        let known = &mut self.fingers[id.finger as usize].likeness;
        let before = known.replace(event);
        if (event == Event::Unlike) != (before == Some(Event::Unlike)) {
            self.messages.push(format!("sweep {}: {text}", id.sweep));
        }
        self.publish_status_of(event, id, format_args!("{text}"))
    }
}
