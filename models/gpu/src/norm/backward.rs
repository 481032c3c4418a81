//! Backward pass of batch normalisation, ReLU and max-pool.

use cubecl::prelude::*;

use super::{EPSILON, Places, Run, Sizes, Sums, UNITS, filled, position, store_sums, total, units};
use crate::networks::{Place, Stacked, Statistics, begin};

/// Results of the forward pass, gradient of the pooled output, and targets of the gradients of scale and shift.
pub(crate) struct PassedBlock<'a> {
    pub(crate) convolved: &'a Stacked,
    pub(crate) gamma: &'a Stacked,
    pub(crate) statistics: &'a Statistics,
    pub(crate) pooled: &'a Stacked,
    pub(crate) winners: &'a Stacked,
    pub(crate) gradient: &'a Stacked,
    pub(crate) of_gamma: &'a Stacked,
    pub(crate) of_beta: &'a Stacked,
}

impl PassedBlock<'_> {
    pub(crate) fn places(&self, counts: &Stacked) -> Places {
        Places {
            gamma: self.gamma.place,
            beta: Place::default(),
            mean: self.statistics.mean.place,
            variance: self.statistics.variance.place,
            of_gamma: self.of_gamma.place,
            of_beta: self.of_beta.place,
            counts: counts.place,
        }
    }
}

/// Writes the gradients of scale and shift.
pub(crate) fn gradients(run: &Run<'_>, passed: &PassedBlock<'_>) {
    let shape = run.shape;
    let sums = Sums::of(run, shape.pooled_steps() * shape.taxels);
    let partial = sums.partial(run);
    // SAFETY: lengths are those of the buffers, and the kernels stay within their sizes.
    unsafe {
        sum_up_gradients::launch_unchecked(
            run.client,
            sums.cubes(run.networks),
            units(),
            passed.convolved.arg(),
            passed.statistics.mean.arg(),
            passed.statistics.variance.arg(),
            passed.pooled.arg(),
            passed.winners.arg(),
            passed.gradient.arg(),
            run.counts.arg(),
            partial.arg(),
            sums,
            Sizes::of(shape, shape.output_len()),
            passed.places(run.counts),
        );
        finish_gradients::launch_unchecked(
            run.client,
            CubeCount::Static(sums.maps as u32, 1, run.networks as u32),
            units(),
            partial.arg(),
            passed.of_gamma.arg(),
            passed.of_beta.arg(),
            sums,
            passed.places(run.counts),
        );
    }
}

/// Returns the gradient of the convolution's output, zero for padding sweeps.
pub(crate) fn spread(run: &Run<'_>, passed: &PassedBlock<'_>) -> Stacked {
    let all = run.shape.count() * run.shape.maps_out;
    let sizes = Sizes::of(run.shape, all);
    let spread = Stacked::floats(run.client, run.networks, all);
    // SAFETY: lengths are those of the buffers, and the kernel stays within `sizes`.
    unsafe {
        spread_gradient::launch_unchecked(
            run.client,
            sizes.cubes(run.networks),
            units(),
            passed.convolved.arg(),
            passed.gamma.arg(),
            passed.statistics.mean.arg(),
            passed.statistics.variance.arg(),
            passed.of_gamma.arg(),
            passed.of_beta.arg(),
            passed.pooled.arg(),
            passed.winners.arg(),
            passed.gradient.arg(),
            run.counts.arg(),
            spread.arg(),
            sizes,
            passed.places(run.counts),
        );
    }
    spread
}

#[cube(launch_unchecked)]
fn sum_up_gradients(
    convolved: &[f32],
    mean: &[f32],
    variance: &[f32],
    pooled: &[f32],
    winners: &[u32],
    gradient: &[f32],
    counts: &[u32],
    partial: &mut [f32],
    #[comptime] s: Sums,
    #[comptime] sizes: Sizes,
    #[comptime] p: Places,
) {
    let network = CUBE_POS_Z as usize;
    let from_out = network * sizes.out;
    let lane = UNIT_POS as usize % s.lanes;
    let map = CUBE_POS_Y as usize * s.lanes + lane;
    let first_row = CUBE_POS_X as usize * s.chunk;
    let end = (first_row + s.chunk).min(filled(network, counts, s));
    let mut first = 0.0f32;
    let mut second = 0.0f32;
    if map < s.maps {
        let mean = mean[begin(network, p.mean) + map];
        let scale = 1.0f32 / (variance[begin(network, p.variance) + map] + EPSILON).sqrt();
        let mut row = first_row + UNIT_POS as usize / s.lanes;
        while row < end {
            let at = row * s.maps + map;
            if pooled[from_out + at] > 0.0f32 {
                let value = gradient[from_out + at];
                let won = winners[from_out + at] as usize;
                let step = at / sizes.row % sizes.pooled * sizes.pool + won;
                let sweep = at / comptime!(sizes.row * sizes.pooled);
                let from = network * sizes.convolved
                    + (sweep * sizes.steps + step) * sizes.row
                    + at % sizes.row;
                first += value;
                second += value * (convolved[from] - mean) * scale;
            }
            row += comptime!(UNITS / s.lanes);
        }
    }
    store_sums(first, second, map, partial, s);
}

#[cube(launch_unchecked)]
fn finish_gradients(
    partial: &[f32],
    gamma: &mut [f32],
    beta: &mut [f32],
    #[comptime] s: Sums,
    #[comptime] p: Places,
) {
    let network = CUBE_POS_Z as usize;
    let map = CUBE_POS_X as usize;
    let (first, second) = total(partial, s);
    if UNIT_POS == 0 {
        beta[begin(network, p.of_beta) + map] = first;
        gamma[begin(network, p.of_gamma) + map] = second;
    }
}

#[cube(launch_unchecked)]
fn spread_gradient(
    convolved: &[f32],
    gamma: &[f32],
    mean: &[f32],
    variance: &[f32],
    of_gamma: &[f32],
    of_beta: &[f32],
    pooled: &[f32],
    winners: &[u32],
    gradient: &[f32],
    counts: &[u32],
    spread: &mut [f32],
    #[comptime] s: Sizes,
    #[comptime] p: Places,
) {
    let at = position(s);
    if at < s.len {
        let network = CUBE_POS_Z as usize;
        let from = network * s.convolved + at;
        let value = gradient_at(
            network,
            at,
            convolved[from],
            gamma,
            mean,
            variance,
            of_gamma,
            of_beta,
            pooled,
            winners,
            gradient,
            counts,
            s,
            p,
        );
        spread[from] = value;
    }
}

/// Returns the gradient of a network's convolution output at `at`, zero for padding sweeps:
/// `gamma / deviation x (winner's gradient - mean of all - normalised value x mean of (gradient x normalised value))`.
#[cube]
pub(crate) fn gradient_at(
    network: usize,
    at: usize,
    convolved: f32,
    gamma: &[f32],
    mean: &[f32],
    variance: &[f32],
    of_gamma: &[f32],
    of_beta: &[f32],
    pooled: &[f32],
    winners: &[u32],
    gradient: &[f32],
    counts: &[u32],
    #[comptime] s: Sizes,
    #[comptime] p: Places,
) -> f32 {
    let sweeps = counts[begin(network, p.counts)] as usize;
    let map = at % s.maps;
    let row = at / s.row;
    let mut found = 0.0f32;
    if row / s.steps < sweeps {
        let t = row % s.steps;
        let out = network * s.out + (row / s.steps * s.pooled + t / s.pool) * s.row + at % s.row;
        let mut won = 0.0f32;
        if winners[out] as usize == t % s.pool && pooled[out] > 0.0f32 {
            won = gradient[out];
        }
        let scale = 1.0f32 / (variance[begin(network, p.variance) + map] + EPSILON).sqrt();
        let count = 1.0f32 / f32::cast_from(sweeps * s.sweep);
        let normal = (convolved - mean[begin(network, p.mean) + map]) * scale;
        let rest = (of_beta[begin(network, p.of_beta) + map]
            + normal * of_gamma[begin(network, p.of_gamma) + map])
            * count;
        found = gamma[begin(network, p.gamma) + map] * scale * (won - rest);
    }
    found
}
