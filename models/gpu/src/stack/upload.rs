//! Upload of one step's inputs, in two buffers for all networks.

use cubecl::prelude::*;

use super::Stack;
use crate::networks::{Place, Stacked};
use crate::stack_data::{StackBatch, StackSweeps};

/// Inputs of one step on the device.
pub(super) struct OnDevice {
    pub(super) counts: Stacked,
    pub(super) labels: Stacked,
    pub(super) masks: Vec<Stacked>,
    pub(super) chosen: Option<Stacked>,
    /// `[rate, epsilon, correction of each layer's variance]`
    pub(super) of_step: Stacked,
}

/// Buffer of words with several parts.
struct Words(Vec<u32>);

impl Words {
    /// Appends `[networks][len]` words and returns their location.
    fn add(&mut self, networks: usize, words: &[u32]) -> Place {
        assert_eq!(words.len() % networks, 0, "as many words for each network");
        let place = Place {
            offset: self.0.len(),
            stride: words.len() / networks,
        };
        self.0.extend_from_slice(words);
        place
    }
}

impl Stack {
    pub(super) fn upload(&self, batch: &StackBatch<'_>) -> OnDevice {
        let shape = &self.shape;
        let networks = shape.networks;
        let passes = 1 + usize::from(self.method.attack.is_some());
        let masks = networks * shape.batch * shape.mask_words();
        assert!(
            batch.counts.len() == networks
                && batch
                    .counts
                    .iter()
                    .all(|count| *count as usize <= shape.batch)
                && batch.rates.len() == networks
                && batch.labels.len() == networks * shape.batch
                && batch.masks.len() == passes
                && batch.masks.iter().all(|mask| mask.len() == masks),
            "a batch has the sizes of {shape:?}"
        );
        let mut words = Words(Vec::with_capacity(2 * batch.labels.len() + passes * masks));
        let counts = words.add(networks, batch.counts);
        let labels = words.add(networks, batch.labels);
        let masks: Vec<Place> = batch
            .masks
            .iter()
            .map(|mask| words.add(networks, mask))
            .collect();
        let chosen = match batch.sweeps {
            StackSweeps::Chosen(numbers) => Some(words.add(networks, numbers)),
            StackSweeps::Values(_) => None,
        };
        let handle = self.client.create_from_slice(u32::as_bytes(&words.0));
        let buffer = (handle, words.0.len());
        let part = |place| Stacked {
            buffer: buffer.clone(),
            place,
        };
        let mut of_step = Vec::with_capacity(networks * (2 + shape.layers()));
        for (rates, count) in batch.rates.iter().zip(batch.counts) {
            of_step.extend(rates);
            of_step.extend((0..shape.layers()).map(|layer| {
                let values = f64::from(*count) * shape.values_of_sweep(layer) as f64;
                let bessel = if values > 1.0 {
                    values / (values - 1.0)
                } else {
                    1.0
                };
                bessel as f32
            }));
        }
        let handle = self.client.create_from_slice(f32::as_bytes(&of_step));
        OnDevice {
            counts: part(counts),
            labels: part(labels),
            masks: masks.into_iter().map(part).collect(),
            chosen: chosen.map(part),
            of_step: Stacked::each(&handle, networks, 2 + shape.layers()),
        }
    }
}
