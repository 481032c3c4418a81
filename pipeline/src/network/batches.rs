//! Selection and preprocessing of the sweeps of a batch. Every random choice is derived from seed, epoch and batch.

use rand::RngExt;
use rayon::prelude::*;
use tactnet_data::{Seed, SweepShape, SweepView, shuffle};

use crate::{Augmentation, Normalizer};

/// Number of a batch within a training.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BatchNumber {
    /// Epoch, counted from 0.
    pub(crate) epoch: usize,
    /// Batch of the epoch, counted from 0.
    pub(crate) batch: usize,
}

/// Largest change of a sweep's length before sweeps are grouped by it, as a natural logarithm: sweeps of 10 % more or less share a batch, so that
/// batches differ between epochs.
const LENGTH_SPREAD: f64 = 0.1;

/// Returns the positions of the sweeps of a batch. Each epoch has its own random order, cut into `batches` whose sizes differ by at most one.
/// Sweeps of unequal length are grouped: a batch has sweeps of about one length, and the groups are in random order.
pub(crate) fn batch_positions(
    train: &SweepView<'_>,
    batches: usize,
    seed: Seed,
    number: BatchNumber,
) -> Vec<usize> {
    let BatchNumber { epoch, mut batch } = number;
    let sweeps = train.len();
    let mut order: Vec<usize> = (0..sweeps).collect();
    shuffle(&mut order, &mut seed.rng(("shuffle", epoch)));
    if train.dataset().lengths().is_some() {
        let mut rng = seed.rng(("lengths", epoch));
        let mut keyed: Vec<(f64, usize)> = order
            .into_iter()
            .map(|position| {
                let length = (train.steps(position) as f64).ln();
                let change = rng.random_range(-LENGTH_SPREAD..LENGTH_SPREAD);
                (length + change, position)
            })
            .collect();
        keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
        order = keyed.into_iter().map(|(_, position)| position).collect();
        let mut groups: Vec<usize> = (0..batches).collect();
        shuffle(&mut groups, &mut rng);
        batch = groups[batch];
    }
    order[batch * sweeps / batches..(batch + 1) * sweeps / batches].to_vec()
}

/// Returns the shape of a batch of the sweeps at `positions`: that of the shortest one, to which the others are cut, so that no padding enters the
/// statistics of a batch.
///
/// - `most`: maximum number of steps
pub(crate) fn batch_shape(from: &SweepView<'_>, positions: &[usize], most: usize) -> SweepShape {
    let lengths = positions.iter().map(|position| from.steps(*position));
    SweepShape {
        steps: lengths.fold(most, usize::min),
        ..from.shape()
    }
}

/// Writes the sweeps at `positions` into `values`, cut to `shape`, changed by `change` and normalised: `[positions][steps][taxels]`.
pub(crate) fn fill_batch(
    values: &mut [f32],
    from: &SweepView<'_>,
    positions: &[usize],
    shape: SweepShape,
    normalizer: &Normalizer,
    change: impl Fn(usize, &mut [f32]) + Sync,
) {
    values
        .par_chunks_exact_mut(shape.values())
        .zip(positions)
        .for_each(|(sweep, &position)| {
            from.copy_sweep(position, sweep);
            change(position, sweep);
            normalizer.apply(sweep, shape);
        });
}

/// Augments the training sweep at a position, and makes some conditions unknown, differently in every epoch.
pub(crate) fn augment(
    augmentation: Augmentation,
    normalizer: &Normalizer,
    seed: Seed,
    epoch: usize,
    position: usize,
    sweep: &mut [f32],
) {
    if augmentation.changes(normalizer) {
        let mut rng = seed.rng(("augmentation", epoch, position));
        augmentation.apply(sweep, normalizer, &mut rng);
    }
}
