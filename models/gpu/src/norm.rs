//! Batch statistics, normalisation, ReLU and max-pool, forward and backward.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use tactnet_conv::BlockShape;

use crate::device::{buffer, floats};

/// Units of a cube.
const UNITS: usize = 256;
/// Most partial sums per map.
const CHUNKS: usize = 512;
/// Added to the variance before its root.
const EPSILON: f32 = 1e-5;

/// How sums over rows of `[rows][maps]` are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Sums {
    rows: usize,
    maps: usize,
    /// Maps of a cube, side by side.
    lanes: usize,
    /// Rows of a cube.
    chunk: usize,
    chunks: usize,
}

impl Sums {
    fn of(rows: usize, maps: usize) -> Self {
        let lanes = maps.next_power_of_two().min(64);
        let chunk = rows.div_ceil(CHUNKS).max(UNITS / lanes);
        Self {
            rows,
            maps,
            lanes,
            chunk,
            chunks: rows.div_ceil(chunk),
        }
    }

    fn cubes(&self) -> CubeCount {
        CubeCount::Static(self.chunks as u32, self.maps.div_ceil(self.lanes) as u32, 1)
    }

    fn partial(&self, client: &Client) -> (Handle, usize) {
        floats(client, 2 * self.maps * self.chunks)
    }
}

/// Sizes of a block as kernels take them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Sizes {
    steps: usize,
    pooled: usize,
    pool: usize,
    /// Taxels times maps.
    row: usize,
    maps: usize,
    /// Values of what a kernel writes.
    len: usize,
    /// Values that `len` is an average over, per map.
    count: usize,
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
            count: shape.count(),
            grid: len.div_ceil(UNITS).min(65_535),
        }
    }

    fn cubes(&self) -> CubeCount {
        let cubes = self.len.div_ceil(UNITS);
        CubeCount::Static(self.grid as u32, cubes.div_ceil(self.grid) as u32, 1)
    }
}

fn units() -> CubeDim {
    CubeDim::new_1d(UNITS as u32)
}

/// Returns mean and biased variance of each map of `convolved` `[rows][maps]`.
pub(crate) fn statistics(client: &Client, shape: &BlockShape, convolved: &Handle) -> [Handle; 2] {
    let (rows, maps) = (shape.count(), shape.maps_out);
    let sums = Sums::of(rows, maps);
    let partial = sums.partial(client);
    let (mean, variance) = (floats(client, maps), floats(client, maps));
    // SAFETY: lengths are those of the buffers, and kernels stay inside of `sums`.
    unsafe {
        sum_up::launch_unchecked(
            client,
            sums.cubes(),
            units(),
            BufferArg::from_raw_parts(convolved.clone(), rows * maps),
            buffer(&partial),
            sums,
        );
        finish_statistics::launch_unchecked(
            client,
            CubeCount::Static(maps as u32, 1, 1),
            units(),
            BufferArg::from_raw_parts(convolved.clone(), rows * maps),
            buffer(&partial),
            buffer(&mean),
            buffer(&variance),
            sums,
        );
    }
    [mean.0, variance.0]
}

/// Sums of values and of their squares, both less the first row, which lies near the mean: so squares do not cancel.
#[cube(launch_unchecked)]
fn sum_up(values: &[f32], partial: &mut [f32], #[comptime] s: Sums) {
    let lane = UNIT_POS as usize % s.lanes;
    let map = CUBE_POS_Y as usize * s.lanes + lane;
    let begin = CUBE_POS_X as usize * s.chunk;
    let end = (begin + s.chunk).min(s.rows);
    let mut first = 0.0f32;
    let mut second = 0.0f32;
    if map < s.maps {
        let near = values[map];
        let mut row = begin + UNIT_POS as usize / s.lanes;
        while row < end {
            let value = values[row * s.maps + map] - near;
            first += value;
            second += value * value;
            row += comptime!(UNITS / s.lanes);
        }
    }
    store_sums(first, second, map, partial, s);
}

/// Adds what the units of a cube summed for each map, always in one order.
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
        let at = CUBE_POS_X as usize * comptime!(2 * s.maps) + map;
        partial[at] = first;
        partial[at + s.maps] = second;
    }
}

/// Sums the partial sums of the map that is this cube's; every unit gets both.
#[cube]
fn total(partial: &[f32], #[comptime] s: Sums) -> (f32, f32) {
    let unit = UNIT_POS as usize;
    let map = CUBE_POS_X as usize;
    let mut all = Shared::<[f32]>::new_slice(comptime!(2 * UNITS));
    let mut first = 0.0f32;
    let mut second = 0.0f32;
    let mut chunk = unit;
    while chunk < s.chunks {
        let at = chunk * comptime!(2 * s.maps) + map;
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
    partial: &[f32],
    mean: &mut [f32],
    variance: &mut [f32],
    #[comptime] s: Sums,
) {
    let map = CUBE_POS_X as usize;
    let (first, second) = total(partial, s);
    if UNIT_POS == 0 {
        let count = f32::cast_from(s.rows);
        let off = first / count;
        mean[map] = values[map] + off;
        variance[map] = (second / count - off * off).max(0.0f32);
    }
}

/// The pooled output `[batch][pooled steps][taxels][maps]`, and the step that won in each pool.
pub(crate) fn pool(
    client: &Client,
    shape: &BlockShape,
    convolved: &Handle,
    [gamma, beta, mean, variance]: [&Handle; 4],
) -> [Handle; 2] {
    let len = shape.output_len();
    let sizes = Sizes::of(shape, len);
    let (pooled, winners) = (floats(client, len), floats(client, len));
    let map = |handle: &Handle| (handle.clone(), shape.maps_out);
    // SAFETY: lengths are those of the buffers, and the kernel stays inside of `sizes`.
    unsafe {
        normalise_and_pool::launch_unchecked(
            client,
            sizes.cubes(),
            units(),
            BufferArg::from_raw_parts(convolved.clone(), shape.count() * shape.maps_out),
            buffer(&map(gamma)),
            buffer(&map(beta)),
            buffer(&map(mean)),
            buffer(&map(variance)),
            buffer(&pooled),
            buffer(&winners),
            sizes,
        );
    }
    [pooled.0, winners.0]
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
) {
    let at = position(s);
    if at < s.len {
        let map = at % s.maps;
        let step = at / s.row % s.pooled;
        let sweep = at / comptime!(s.row * s.pooled);
        let begin = step * s.pool;
        let from = (sweep * s.steps + begin) * s.row + at % s.row;
        let steps = (s.steps - begin).min(s.pool);
        let gamma = gamma[map];
        // Normalised values rise or fall with those of the convolution.
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
        let scale = gamma / (variance[map] + EPSILON).sqrt();
        let value = (sign * best - mean[map]) * scale + beta[map];
        pooled[at] = value.max(0.0f32);
        winners[at] = winner;
    }
}

/// What the backward pass of normalisation, ReLU and max-pool finds.
pub(crate) struct NormGradients {
    pub(crate) gamma: Handle,
    pub(crate) beta: Handle,
}

/// What the forward pass left, and the gradient of the pooled output.
pub(crate) struct Passed<'a> {
    pub(crate) gamma: &'a Handle,
    pub(crate) mean: &'a Handle,
    pub(crate) variance: &'a Handle,
    pub(crate) pooled: &'a Handle,
    pub(crate) winners: &'a Handle,
    pub(crate) gradient: &'a Handle,
}

/// Returns the gradients of scale and shift.
pub(crate) fn gradients(
    client: &Client,
    shape: &BlockShape,
    convolved: &Handle,
    passed: &Passed<'_>,
) -> NormGradients {
    let (len, maps) = (shape.output_len(), shape.maps_out);
    let sums = Sums::of(len / maps, maps);
    let partial = sums.partial(client);
    let (gamma, beta) = (floats(client, maps), floats(client, maps));
    let map = |handle: &Handle| (handle.clone(), maps);
    let out = |handle: &Handle| (handle.clone(), len);
    // SAFETY: lengths are those of the buffers, and kernels stay inside of their sizes.
    unsafe {
        sum_up_gradients::launch_unchecked(
            client,
            sums.cubes(),
            units(),
            BufferArg::from_raw_parts(convolved.clone(), shape.count() * maps),
            buffer(&map(passed.mean)),
            buffer(&map(passed.variance)),
            buffer(&out(passed.pooled)),
            buffer(&out(passed.winners)),
            buffer(&out(passed.gradient)),
            buffer(&partial),
            sums,
            Sizes::of(shape, len),
        );
        finish_gradients::launch_unchecked(
            client,
            CubeCount::Static(maps as u32, 1, 1),
            units(),
            buffer(&partial),
            buffer(&gamma),
            buffer(&beta),
            sums,
        );
    }
    NormGradients {
        gamma: gamma.0,
        beta: beta.0,
    }
}

/// Returns the gradient of the convolution's output.
pub(crate) fn spread(
    client: &Client,
    shape: &BlockShape,
    convolved: &Handle,
    passed: &Passed<'_>,
    found: &NormGradients,
) -> Handle {
    let maps = shape.maps_out;
    let all = shape.count() * maps;
    let map = |handle: &Handle| (handle.clone(), maps);
    let out = |handle: &Handle| (handle.clone(), shape.output_len());
    let sizes = Sizes::of(shape, all);
    let spread = floats(client, all);
    // SAFETY: lengths are those of the buffers, and the kernel stays inside of `sizes`.
    unsafe {
        spread_gradient::launch_unchecked(
            client,
            sizes.cubes(),
            units(),
            BufferArg::from_raw_parts(convolved.clone(), all),
            buffer(&map(passed.gamma)),
            buffer(&map(passed.mean)),
            buffer(&map(passed.variance)),
            buffer(&map(&found.gamma)),
            buffer(&map(&found.beta)),
            buffer(&out(passed.pooled)),
            buffer(&out(passed.winners)),
            buffer(&out(passed.gradient)),
            buffer(&spread),
            sizes,
        );
    }
    spread.0
}

#[cube(launch_unchecked)]
fn sum_up_gradients(
    convolved: &[f32],
    mean: &[f32],
    variance: &[f32],
    pooled: &[f32],
    winners: &[u32],
    gradient: &[f32],
    partial: &mut [f32],
    #[comptime] s: Sums,
    #[comptime] sizes: Sizes,
) {
    let lane = UNIT_POS as usize % s.lanes;
    let map = CUBE_POS_Y as usize * s.lanes + lane;
    let begin = CUBE_POS_X as usize * s.chunk;
    let end = (begin + s.chunk).min(s.rows);
    let mut first = 0.0f32;
    let mut second = 0.0f32;
    if map < s.maps {
        let mean = mean[map];
        let scale = 1.0f32 / (variance[map] + EPSILON).sqrt();
        let mut row = begin + UNIT_POS as usize / s.lanes;
        while row < end {
            let at = row * s.maps + map;
            if pooled[at] > 0.0f32 {
                let value = gradient[at];
                let step = at / sizes.row % sizes.pooled * sizes.pool + winners[at] as usize;
                let sweep = at / comptime!(sizes.row * sizes.pooled);
                let from = (sweep * sizes.steps + step) * sizes.row + at % sizes.row;
                first += value;
                second += value * (convolved[from] - mean) * scale;
            }
            row += comptime!(UNITS / s.lanes);
        }
    }
    store_sums(first, second, map, partial, s);
}

#[cube(launch_unchecked)]
fn finish_gradients(partial: &[f32], gamma: &mut [f32], beta: &mut [f32], #[comptime] s: Sums) {
    let (first, second) = total(partial, s);
    if UNIT_POS == 0 {
        beta[CUBE_POS_X as usize] = first;
        gamma[CUBE_POS_X as usize] = second;
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
    spread: &mut [f32],
    #[comptime] s: Sizes,
) {
    let at = position(s);
    if at < s.len {
        let value = gradient_at(
            at,
            convolved[at],
            gamma,
            mean,
            variance,
            of_gamma,
            of_beta,
            pooled,
            winners,
            gradient,
            s,
        );
        spread[at] = value;
    }
}

/// The gradient of the convolution's output at `at`:
/// `gamma / deviation x (winner's gradient - mean of all - normalised value x mean of (gradient x normalised value))`.
#[cube]
pub(crate) fn gradient_at(
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
    #[comptime] s: Sizes,
) -> f32 {
    let map = at % s.maps;
    let row = at / s.row;
    let t = row % s.steps;
    let out = (row / s.steps * s.pooled + t / s.pool) * s.row + at % s.row;
    let mut won = 0.0f32;
    if winners[out] as usize == t % s.pool && pooled[out] > 0.0f32 {
        won = gradient[out];
    }
    let scale = 1.0f32 / (variance[map] + EPSILON).sqrt();
    let count = 1.0f32 / f32::cast_from(s.count);
    let normal = (convolved - mean[map]) * scale;
    let rest = (of_beta[map] + normal * of_gamma[map]) * count;
    gamma[map] * scale * (won - rest)
}
