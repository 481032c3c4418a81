//! Selection and preprocessing of the sweeps of a batch. Every random choice is derived from seed, epoch and batch.

use rayon::prelude::*;
use tactnet_data::{Seed, SweepView, shuffle};

use crate::{Augmentation, Normalizer};

/// Number of a batch within a training.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BatchNumber {
    /// Epoch, counted from 0.
    pub(crate) epoch: usize,
    /// Batch of the epoch, counted from 0.
    pub(crate) batch: usize,
}

/// Returns the positions of the sweeps of a batch. Each epoch has its own random order, cut into `batches` whose sizes differ by at most one.
pub(crate) fn batch_positions(
    sweeps: usize,
    batches: usize,
    seed: Seed,
    number: BatchNumber,
) -> Vec<usize> {
    let BatchNumber { epoch, batch } = number;
    let mut order: Vec<usize> = (0..sweeps).collect();
    shuffle(&mut order, &mut seed.rng(("shuffle", epoch)));
    order[batch * sweeps / batches..(batch + 1) * sweeps / batches].to_vec()
}

/// Writes the sweeps at `positions` into `values`, changed by `change` and normalised: `[positions][steps][taxels]`.
pub(crate) fn fill_batch(
    values: &mut [f32],
    from: &SweepView<'_>,
    positions: &[usize],
    normalizer: &Normalizer,
    change: impl Fn(usize, &mut [f32]) + Sync,
) {
    let shape = from.shape();
    values
        .par_chunks_exact_mut(shape.values())
        .zip(positions)
        .for_each(|(sweep, &position)| {
            from.copy_batch(&[position], sweep);
            change(position, sweep);
            normalizer.apply(sweep, shape);
        });
}

/// Augments the training sweep at a position, differently in every epoch.
pub(crate) fn augment(
    augmentation: Augmentation,
    normalizer: &Normalizer,
    seed: Seed,
    epoch: usize,
    position: usize,
    sweep: &mut [f32],
) {
    if !augmentation.is_none() {
        let mut rng = seed.rng(("augmentation", epoch, position));
        augmentation.apply(sweep, normalizer, &mut rng);
    }
}
