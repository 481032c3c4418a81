//! Sweeps that the skin plays, with the classifier's labels.

use tactnet_data::{Dataset, LabelSet, Seed};

use crate::{SimulationError, play_order};

/// Sweeps that the skin plays, with the classifier's labels.
#[derive(Debug)]
pub struct Played<'a> {
    dataset: &'a Dataset,
    order: Vec<usize>,
    /// The classifier's label of each label of the data set.
    labels: Vec<usize>,
}

impl<'a> Played<'a> {
    /// Selects the sweeps of materials that the classifier knows.
    ///
    /// - `sweeps`: indices of the sweeps to choose from
    /// - `known`: materials of the classifier
    ///
    /// # Errors
    /// Fails if no material of the data set is known, or one has no sweep.
    pub fn new(
        dataset: &'a Dataset,
        sweeps: &[usize],
        known: &LabelSet,
    ) -> Result<Self, SimulationError> {
        let label_of = |name: &str| known.names().position(|known| known == name);
        let labels: Vec<usize> = dataset
            .labels()
            .names()
            .map(|name| label_of(name).unwrap_or(usize::MAX))
            .collect();
        let materials: Vec<String> = dataset
            .labels()
            .names()
            .filter(|name| label_of(name).is_some())
            .map(Into::into)
            .collect();
        if materials.is_empty() {
            return Err(SimulationError::NothingKnown {
                data: dataset.name().into(),
            });
        }
        Ok(Self {
            order: play_order(dataset, sweeps, &materials, 1, Seed(1))?,
            dataset,
            labels,
        })
    }

    pub(super) fn dataset(&self) -> &'a Dataset {
        self.dataset
    }

    pub(super) fn order(&self) -> &[usize] {
        &self.order
    }

    /// Returns the classifier's label of the sweep that a motion plays.
    pub(super) fn label_of(&self, motion: u64) -> usize {
        let sweep = self.order[(motion - 1) as usize % self.order.len()];
        self.labels[self.dataset.records()[sweep].label]
    }
}
