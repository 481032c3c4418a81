//! Batch statistics, normalisation, ReLU and max-pool, forward and backward.

mod backward;

use cubecl::client::Client;
use cubecl::prelude::*;
use tactnet_conv::BlockShape;

pub(crate) use backward::{PassedBlock, gradient_at, gradients, spread};

use crate::networks::{LayerParameters, Place, Stacked, Statistics, begin};

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
pub(crate) fn statistics(run: &Run<'_>, convolved: &Stacked, into: &Statistics) {
    let Statistics { mean, variance } = into;
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
    parameters: &LayerParameters,
    statistics: &Statistics,
) -> [Stacked; 2] {
    let LayerParameters { gamma, beta, .. } = parameters;
    let Statistics { mean, variance } = statistics;
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
