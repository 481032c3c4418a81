//! Events of the model worker: new models, enrolled materials, failures.

use tactnet_skin::MAX_FINGERS;
use tactnet_skin::packets::Event;

use super::Service;
use crate::ServeError;
use crate::model_worker::{Job, WorkerEvent};
use crate::skin_limits::limits;

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
                mut classifiers,
                names,
                event,
                finger: asked,
                text,
            }) => {
                let mut forgotten = [false; MAX_FINGERS];
                let fingers = self.fingers.iter_mut().zip(&mut classifiers);
                for ((finger, classifier), forgotten) in fingers.zip(&mut forgotten) {
                    std::mem::swap(&mut finger.classifier, classifier);
                    // Another network may have other value limits.
                    let set = self.config.segmenter.values;
                    if let Some(values) = set.or_else(|| limits(finger.classifier.config())) {
                        finger.segmenter.set_values(values);
                    }
                    // Fused beliefs do not carry over to other materials.
                    *forgotten = !finger.classifier.take_fused(classifier)
                        && classifier.fused().sweeps() > 0;
                }
                self.names = names;
                self.metrics.serve(self.names.version);
                self.retired = Some(classifiers);
                self.model.put_copy(&[*self.names])?;
                self.publish_status(event, asked, format_args!("{}", text.as_str()))?;
                for (number, forgotten) in forgotten.into_iter().enumerate() {
                    if forgotten {
                        let text = format_args!("fused sweeps discarded: other materials");
                        self.publish_status(Event::Reset, number as u32, text)?;
                    }
                }
                Ok(())
            }
            Some(WorkerEvent::Failed {
                event,
                finger,
                text,
            }) => self.publish_status(event, finger, format_args!("{}", text.as_str())),
            None => Ok(()),
        }
    }
}
