//! The sweeps that the skin plays, and the classifier's labels of them.

use tactnet_data::{Dataset, LabelSet, Seed};

use crate::{SimulationError, play_order};

/// The sweeps that the skin plays, and the classifier's labels of them.
#[derive(Debug)]
pub struct Played<'a> {
    dataset: &'a Dataset,
    order: Vec<usize>,
    /// The classifier's label of each of the data set's.
    labels: Vec<usize>,
}

impl<'a> Played<'a> {
    /// Those of materials that are known.
    ///
    /// - `sweeps`: numbers of those to choose from
    /// - `known`: the classifier's materials
    ///
    /// # Errors
    /// No material of the data set is known, or one has no sweep.
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

    /// The classifier's label of the sweep that a motion plays.
    pub(super) fn label_of(&self, motion: u64) -> usize {
        let sweep = self.order[(motion - 1) as usize % self.order.len()];
        self.labels[self.dataset.records()[sweep].label]
    }
}
