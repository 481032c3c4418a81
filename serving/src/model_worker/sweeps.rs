//! Complete sweeps: comparison with the training data, dead taxels, and the sweeps from which the model changes.

use std::collections::BTreeSet;

use tactnet_pipeline::{Difference, LikenessVerdict};
use tactnet_skin::packets::{Event, Text};

use super::{Worker, WorkerEvent, classifiers};
use crate::ServeError;
use crate::recent_sweeps::{CompleteSweep, KEPT_SWEEPS, RecentSweeps, SweepId};

/// Number of sweeps in succession in which a dead taxel does not change.
const DEAD_SWEEPS: usize = 3;
/// Maximum number of sweeps of an object that are compared.
const COMPARED_SWEEPS: usize = 20;

/// A finger as its complete sweeps show it.
pub(super) struct SweptFinger {
    recent: RecentSweeps,
    /// Dead taxels that were found in its sweeps.
    dead: BTreeSet<usize>,
    /// True if its taxels are in another order, so that a constant one need not be dead.
    reordered: bool,
}

impl SweptFinger {
    /// - `values`: number of values of a sweep
    pub(super) fn new(values: usize) -> Self {
        Self {
            recent: RecentSweeps::new(values),
            dead: BTreeSet::new(),
            reordered: false,
        }
    }
}

impl Worker {
    /// Keeps a sweep, returns its buffer, compares the object's sweeps with the training data and looks for dead taxels.
    /// Returns false if the service has ended.
    pub(super) fn take_sweep(&mut self, sweep: CompleteSweep) -> bool {
        let (id, object) = (sweep.id, sweep.object);
        self.swept[id.finger as usize].recent.keep(&sweep);
        // The channel holds all buffers.
        let _ = self.free.try_send(sweep.digits);
        match self.compare(id, object) {
            Ok(true) => {}
            Ok(false) => return false,
            Err(error) => return self.fail(Event::Refused, id.finger, &error),
        }
        if !self.mask_dead {
            return true;
        }
        match self.dead_taxels(id.finger) {
            Ok(dead) => self.set_dead(id.finger, dead),
            Err(error) => self.fail(Event::Refused, id.finger, &error),
        }
    }

    /// Compares the sweeps of an object with the training data. Returns false if the service has ended.
    fn compare(&mut self, id: SweepId, object: u64) -> Result<bool, ServeError> {
        let recent = &self.swept[id.finger as usize].recent;
        let Some(digits) = recent.newest(recent.kept_of(object).min(COMPARED_SWEEPS)) else {
            return Ok(true);
        };
        let Some(report) = self.model.assess(digits)? else {
            return Ok(true);
        };
        let is_order = |of: &Difference| matches!(of, Difference::Order { .. });
        self.swept[id.finger as usize].reordered = report.differences.iter().any(is_order);
        Ok(self.send(WorkerEvent::Compared {
            id,
            event: match report.verdict {
                LikenessVerdict::Like => Event::Like,
                LikenessVerdict::OtherBlock => Event::OtherBlock,
                LikenessVerdict::Unlike => Event::Unlike,
            },
            text: Text::new(&report.text_with_last_sweep()),
        }))
    }

    /// Returns the dead taxels of a finger, except those of the settings: the former ones that have not changed in the newest
    /// sweep, and new ones.
    fn dead_taxels(&self, finger: u32) -> Result<BTreeSet<usize>, ServeError> {
        let SweptFinger {
            recent,
            dead,
            reordered,
        } = &self.swept[finger as usize];
        let taxels = self.model.classifier().config().shape.taxels();
        let newest = recent.newest(1).unwrap_or_default();
        let changes = |taxel: usize| {
            let mut values = newest[taxel..].iter().step_by(taxels);
            values.any(|value| *value != newest[taxel])
        };
        let mut found: BTreeSet<usize> = dead.iter().copied().filter(|at| !changes(*at)).collect();
        if let Some(digits) = recent.newest(DEAD_SWEEPS).filter(|_| !reordered) {
            let new = self.model.dead_taxels(digits)?;
            found.extend(new.into_iter().filter(|taxel| !self.dead.contains(taxel)));
        }
        Ok(found)
    }

    /// Masks these taxels, in place of those found before. Returns false if the service has ended.
    fn set_dead(&mut self, finger: u32, dead: BTreeSet<usize>) -> bool {
        let before = std::mem::replace(&mut self.swept[finger as usize].dead, dead);
        let dead = &self.swept[finger as usize].dead;
        let parts: Vec<String> = [
            named(
                dead - &before,
                ["never changes: masked", "never change: masked"],
            ),
            named(
                &before - dead,
                ["changes again: not masked", "change again: not masked"],
            ),
        ]
        .into_iter()
        .flatten()
        .collect();
        if parts.is_empty() {
            return true;
        }
        let masks = self.all_masks();
        match classifiers(&mut self.model, self.mc_samples, &masks) {
            Ok(classifiers) => {
                self.send_ready(classifiers, Event::Masked, finger, &parts.join("; "))
            }
            Err(error) => self.fail(Event::Refused, finger, &error),
        }
    }

    /// Returns the masked taxels of every finger.
    pub(super) fn all_masks(&self) -> Vec<Vec<usize>> {
        (0..self.swept.len() as u32)
            .map(|finger| self.masks(finger))
            .collect()
    }

    /// Returns all masked taxels of a finger.
    pub(super) fn masks(&self, finger: u32) -> Vec<usize> {
        let found = &self.swept[finger as usize].dead;
        self.dead.iter().chain(found).copied().collect()
    }

    /// Returns the newest sweeps of an object, `[sweeps][steps][taxels]`.
    ///
    /// # Errors
    /// Fails with a sentence if fewer sweeps are kept.
    pub(super) fn digits_of(
        &self,
        finger: u32,
        object: u64,
        material: Text<56>,
        sweeps: usize,
    ) -> Result<Vec<f32>, String> {
        let recent = &self.swept[finger as usize].recent;
        let kept = recent.kept_of(object);
        let digits = recent.newest(sweeps).filter(|_| sweeps <= kept);
        digits.ok_or_else(|| {
            format!(
                "enroll `{}`: {sweeps} sweeps requested, {kept} complete sweeps since the last reset",
                material.as_str()
            )
        })
    }

    /// Returns the newest sweeps of all fingers, `[sweeps][steps][taxels]`, with the readings of masked taxels.
    ///
    /// - `sweeps`: number of sweeps of each finger; one that has fewer gives all that are kept
    ///
    /// # Errors
    /// Fails with a sentence if no finger has so many.
    pub(super) fn digits_of_all(&mut self, sweeps: usize) -> Result<Vec<f32>, String> {
        let kept: Vec<usize> = self.swept.iter().map(|of| of.recent.kept()).collect();
        let most = kept.iter().copied().max().unwrap_or(0);
        if sweeps == 0 || sweeps > most {
            return Err(format!(
                "adapt: {sweeps} sweeps requested, {most} complete sweeps kept (at most {KEPT_SWEEPS})"
            ));
        }
        let mut all = Vec::new();
        for (finger, kept) in kept.into_iter().enumerate() {
            let recent = &self.swept[finger].recent;
            let mut digits = recent.newest(sweeps.min(kept)).unwrap_or_default();
            let masks = self.masks(finger as u32);
            self.model
                .write_masked(&masks, &mut digits)
                .map_err(|error| error.to_string())?;
            all.append(&mut digits);
        }
        Ok(all)
    }
}

/// Returns taxels with a predicate for one or several of them; `None` without taxels.
fn named(taxels: BTreeSet<usize>, [of_one, of_several]: [&str; 2]) -> Option<String> {
    let names: Vec<String> = taxels.iter().map(usize::to_string).collect();
    match names.as_slice() {
        [] => None,
        [one] => Some(format!("taxel {one} {of_one}")),
        several => Some(format!("taxels {} {of_several}", several.join(", "))),
    }
}
