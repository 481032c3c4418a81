//! Batch statistics, normalisation, ReLU and max-pool, forward and backward.

use cubecl::client::Client;
use cubecl::prelude::*;
use tactnet_conv::BlockShape;

use crate::networks::{Place, Stacked, begin};

/// Number of units per cube.
const UNITS: usize = 256;
/// Maximum number of partial sums per map.
const CHUNKS: usize = 512;
/// Added to the variance before its square root.
pub(crate) const EPSILON: f32 = 1e-5;

/// Arguments that all passes of a block share.
#[derive(Clone, Copy)]
pub(crate) struct Run<'a> {
    pub(crate) client: &'a Client,
    pub(crate) shape: &'a BlockShape,
    pub(crate) networks: usize,
    /// Number of valid sweeps of each network, which come before padding sweeps: `[1]` each, integers.
    pub(crate) counts: &'a Stacked,
}

/// Division of sums over rows of `[rows][maps]`. It does not depend on the number of valid rows, so that results do not either.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Sums {
    rows: usize,
    /// Number of rows per sweep.
    sweep: usize,
    maps: usize,
    /// Number of neighbouring maps per cube.
    lanes: usize,
    /// Number of rows per cube.
    chunk: usize,
    chunks: usize,
    counts: Place,
}

impl Sums {
    fn of(run: &Run<'_>, sweep: usize) -> Self {
        let (rows, maps) = (run.shape.batch * sweep, run.shape.maps_out);
        let lanes = maps.next_power_of_two().min(64);
        let chunk = rows.div_ceil(CHUNKS).max(UNITS / lanes);
        Self {
            rows,
            sweep,
            maps,
            lanes,
            chunk,
            chunks: rows.div_ceil(chunk),
            counts: run.counts.place,
        }
    }

    fn cubes(&self, networks: usize) -> CubeCount {
        let groups = self.maps.div_ceil(self.lanes);
        CubeCount::Static(self.chunks as u32, groups as u32, networks as u32)
    }

    fn partial(&self, run: &Run<'_>) -> Stacked {
        Stacked::floats(run.client, run.networks, 2 * self.maps * self.chunks)
    }
}

/// Locations of the values per map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Places {
    gamma: Place,
    beta: Place,
    mean: Place,
    variance: Place,
    of_gamma: Place,
    of_beta: Place,
    counts: Place,
}

/// Sizes of a block that the kernels use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Sizes {
    steps: usize,
    pooled: usize,
    pool: usize,
    /// Taxels times maps.
    row: usize,
    maps: usize,
    /// Number of values that a kernel writes.
    len: usize,
    /// Number of values of one map in a sweep.
    sweep: usize,
    /// Number of values of a network's convolution.
    convolved: usize,
    /// Number of values of a network's pooled output.
    out: usize,
    grid: usize,
}

impl Sizes {
    pub(crate) fn of(shape: &BlockShape, len: usize) -> Self {
        Self {
            steps: shape.steps,
            pooled: shape.pooled_steps(),
            pool: shape.pool,
            row: shape.taxels * shape.maps_out,
            maps: shape.maps_out,
            len,
            sweep: shape.steps * shape.taxels,
            convolved: shape.count() * shape.maps_out,
            out: shape.output_len(),
            grid: len.div_ceil(UNITS).min(65_535),
        }
    }

    fn cubes(&self, networks: usize) -> CubeCount {
        let cubes = self.len.div_ceil(UNITS).div_ceil(self.grid);
        CubeCount::Static(self.grid as u32, cubes as u32, networks as u32)
    }
}

fn units() -> CubeDim {
    CubeDim::new_1d(UNITS as u32)
}

/// Writes mean and biased variance of each map of `convolved` `[rows][maps]`.
pub(crate) fn statistics(run: &Run<'_>, convolved: &Stacked, [mean, variance]: [&Stacked; 2]) {
    let sums = Sums::of(run, run.shape.steps * run.shape.taxels);
    let partial = sums.partial(run);
    // SAFETY: lengths are those of the buffers, and the kernels stay within `sums`.
    unsafe {
        sum_up::launch_unchecked(
            run.client,
            sums.cubes(run.networks),
            units(),
            convolved.arg(),
            run.counts.arg(),
            partial.arg(),
            sums,
        );
        finish_statistics::launch_unchecked(
            run.client,
            CubeCount::Static(sums.maps as u32, 1, run.networks as u32),
            units(),
            convolved.arg(),
            run.counts.arg(),
            partial.arg(),
            mean.arg(),
            variance.arg(),
            sums,
            [mean.place, variance.place],
        );
    }
}

/// Returns the number of valid rows of a network.
#[cube]
fn filled(network: usize, counts: &[u32], #[comptime] s: Sums) -> usize {
    counts[begin(network, s.counts)] as usize * s.sweep
}

/// Sums values and their squares after subtracting the first row, which is near the mean, so that squares do not cancel.
#[cube(launch_unchecked)]
fn sum_up(values: &[f32], counts: &[u32], partial: &mut [f32], #[comptime] s: Sums) {
    let network = CUBE_POS_Z as usize;
    let from = network * comptime!(s.rows * s.maps);
    let lane = UNIT_POS as usize % s.lanes;
    let map = CUBE_POS_Y as usize * s.lanes + lane;
    let first_row = CUBE_POS_X as usize * s.chunk;
    let end = (first_row + s.chunk).min(filled(network, counts, s));
    let mut first = 0.0f32;
    let mut second = 0.0f32;
    if map < s.maps {
        let near = values[from + map];
        let mut row = first_row + UNIT_POS as usize / s.lanes;
        while row < end {
            let value = values[from + row * s.maps + map] - near;
            first += value;
            second += value * value;
            row += comptime!(UNITS / s.lanes);
        }
    }
    store_sums(first, second, map, partial, s);
}

/// Adds the sums of a cube's units for each map, in a fixed order.
#[cube]
fn store_sums(first: f32, second: f32, map: usize, partial: &mut [f32], #[comptime] s: Sums) {
    let unit = UNIT_POS as usize;
    let mut all = Shared::<[f32]>::new_slice(comptime!(2 * UNITS));
    all[unit] = first;
    all[unit + UNITS] = second;
    sync_cube();
    if unit < s.lanes && map < s.maps {
        let mut first = 0.0f32;
        let mut second = 0.0f32;
        for i in 0..comptime!(UNITS / s.lanes) {
            first += all[unit + i * s.lanes];
            second += all[unit + i * s.lanes + UNITS];
        }
        let chunk = CUBE_POS_Z as usize * s.chunks + CUBE_POS_X as usize;
        let at = chunk * comptime!(2 * s.maps) + map;
        partial[at] = first;
        partial[at + s.maps] = second;
    }
}

/// Adds the partial sums of this cube's map; every unit receives both totals.
#[cube]
fn total(partial: &[f32], #[comptime] s: Sums) -> (f32, f32) {
    let unit = UNIT_POS as usize;
    let map = CUBE_POS_X as usize;
    let from = CUBE_POS_Z as usize * s.chunks;
    let mut all = Shared::<[f32]>::new_slice(comptime!(2 * UNITS));
    let mut first = 0.0f32;
    let mut second = 0.0f32;
    let mut chunk = unit;
    while chunk < s.chunks {
        let at = (from + chunk) * comptime!(2 * s.maps) + map;
        first += partial[at];
        second += partial[at + s.maps];
        chunk += UNITS;
    }
    all[unit] = first;
    all[unit + UNITS] = second;
    sync_cube();
    let mut half = comptime!(UNITS / 2).runtime();
    while half > 0 {
        if unit < half {
            let other = all[unit + half];
            all[unit] += other;
            let other = all[unit + half + UNITS];
            all[unit + UNITS] += other;
        }
        sync_cube();
        half /= 2;
    }
    (all[0], all[UNITS])
}

#[cube(launch_unchecked)]
fn finish_statistics(
    values: &[f32],
    counts: &[u32],
    partial: &[f32],
    mean: &mut [f32],
    variance: &mut [f32],
    #[comptime] s: Sums,
    #[comptime] places: [Place; 2],
) {
    let network = CUBE_POS_Z as usize;
    let map = CUBE_POS_X as usize;
    let (first, second) = total(partial, s);
    if UNIT_POS == 0 {
        let count = f32::cast_from(filled(network, counts, s).max(1));
        let off = first / count;
        let near = values[network * comptime!(s.rows * s.maps) + map];
        mean[begin(network, comptime!(places[0])) + map] = near + off;
        variance[begin(network, comptime!(places[1])) + map] =
            (second / count - off * off).max(0.0f32);
    }
}

/// Returns the pooled output `[batch][pooled steps][taxels][maps]` and the step of the winner in each pool.
pub(crate) fn pool(
    run: &Run<'_>,
    convolved: &Stacked,
    [gamma, beta, mean, variance]: [&Stacked; 4],
) -> [Stacked; 2] {
    let len = run.shape.output_len();
    let sizes = Sizes::of(run.shape, len);
    let [pooled, winners] = [(); 2].map(|()| Stacked::floats(run.client, run.networks, len));
    let places = Places {
        gamma: gamma.place,
        beta: beta.place,
        mean: mean.place,
        variance: variance.place,
        of_gamma: Place::default(),
        of_beta: Place::default(),
        counts: run.counts.place,
    };
    // SAFETY: lengths are those of the buffers, and the kernel stays within `sizes`.
    unsafe {
        normalise_and_pool::launch_unchecked(
            run.client,
            sizes.cubes(run.networks),
            units(),
            convolved.arg(),
            gamma.arg(),
            beta.arg(),
            mean.arg(),
            variance.arg(),
            pooled.arg(),
            winners.arg(),
            sizes,
            places,
        );
    }
    [pooled, winners]
}

#[cube]
fn position(#[comptime] s: Sizes) -> usize {
    (CUBE_POS_Y as usize * s.grid + CUBE_POS_X as usize) * UNITS + UNIT_POS as usize
}

#[cube(launch_unchecked)]
fn normalise_and_pool(
    convolved: &[f32],
    gamma: &[f32],
    beta: &[f32],
    mean: &[f32],
    variance: &[f32],
    pooled: &mut [f32],
    winners: &mut [u32],
    #[comptime] s: Sizes,
    #[comptime] p: Places,
) {
    let at = position(s);
    if at < s.len {
        let network = CUBE_POS_Z as usize;
        let map = at % s.maps;
        let step = at / s.row % s.pooled;
        let sweep = at / comptime!(s.row * s.pooled);
        let first = step * s.pool;
        let from = network * s.convolved + (sweep * s.steps + first) * s.row + at % s.row;
        let steps = (s.steps - first).min(s.pool);
        let gamma = gamma[begin(network, p.gamma) + map];
        // Normalised values increase or decrease with those of the convolution.
        let mut sign = 1.0f32;
        if gamma < 0.0f32 {
            sign = -1.0f32;
        }
        let mut best = sign * convolved[from];
        let mut winner = 0u32;
        for i in 1..steps {
            let value = sign * convolved[from + i * s.row];
            if value > best {
                best = value;
                winner = i as u32;
            }
        }
        let scale = gamma / (variance[begin(network, p.variance) + map] + EPSILON).sqrt();
        let value = (sign * best - mean[begin(network, p.mean) + map]) * scale
            + beta[begin(network, p.beta) + map];
        pooled[network * s.out + at] = value.max(0.0f32);
        winners[network * s.out + at] = winner;
    }
}

/// Results of the forward pass, gradient of the pooled output, and targets of the gradients of scale and shift.
pub(crate) struct Passed<'a> {
    pub(crate) convolved: &'a Stacked,
    pub(crate) gamma: &'a Stacked,
    pub(crate) mean: &'a Stacked,
    pub(crate) variance: &'a Stacked,
    pub(crate) pooled: &'a Stacked,
    pub(crate) winners: &'a Stacked,
    pub(crate) gradient: &'a Stacked,
    pub(crate) of_gamma: &'a Stacked,
    pub(crate) of_beta: &'a Stacked,
}

impl Passed<'_> {
    pub(crate) fn places(&self, counts: &Stacked) -> Places {
        Places {
            gamma: self.gamma.place,
            beta: Place::default(),
            mean: self.mean.place,
            variance: self.variance.place,
            of_gamma: self.of_gamma.place,
            of_beta: self.of_beta.place,
            counts: counts.place,
        }
    }
}

/// Writes the gradients of scale and shift.
pub(crate) fn gradients(run: &Run<'_>, passed: &Passed<'_>) {
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
            passed.mean.arg(),
            passed.variance.arg(),
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
pub(crate) fn spread(run: &Run<'_>, passed: &Passed<'_>) -> Stacked {
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
            passed.mean.arg(),
            passed.variance.arg(),
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
