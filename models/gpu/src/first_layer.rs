//! Convolution of one input map, tap by tap with values in registers; a matrix product has too few multiplications per load here.

use cubecl::prelude::*;
use tactnet_conv::BlockShape;

use crate::networks::{Place, Stacked, begin};
use crate::norm::{PassedBlock, Places, Run, Sizes as NormSizes, gradient_at};

/// Number of steps per unit.
const STRIP: usize = 8;
/// Number of maps per unit.
const MAPS: usize = 4;
/// Approximate number of units per cube.
const UNITS: usize = 256;
/// Number of time taps per unit in the weights' gradient.
const TAPS: usize = 2;
/// Shared memory in bytes that every GPU has.
const SHARED: usize = 16 << 10;
/// Maximum number of partial sums of the weights' gradient.
const PARTS: usize = 528;
/// Maximum number of kernel steps for which a strip fits into registers.
const MAX_KERNEL: usize = 33;

/// Sizes that the kernels use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Sizes {
    steps: usize,
    taxels: usize,
    maps: usize,
    kernel_t: usize,
    kernel_x: usize,
    /// Number of neighbouring units that share positions and compute [`MAPS`] maps each.
    groups: usize,
    /// Columns of weights and gradients in shared memory: the maps, rounded up to whole groups.
    columns: usize,
    strips: usize,
    /// Number of strips in all sweeps and taxels.
    pairs: usize,
    /// Number of strips per cube.
    pairs_of_cube: usize,
    grid: usize,
    /// Number of units per cube of the weights' gradient that share its steps.
    teams: usize,
    /// Number of steps in all sweeps.
    rows: usize,
    /// Number of steps per cube of the weights' gradient.
    rows_of_part: usize,
    /// Number of steps in shared memory at a time.
    rows_at_once: usize,
    parts: usize,
}

/// Route of a shape with one input map.
#[derive(Debug)]
pub(crate) struct FirstLayer {
    shape: BlockShape,
    sizes: Sizes,
}

impl FirstLayer {
    /// Returns `None` if the weights or a frame's gradients exceed shared memory, or a strip exceeds the registers.
    pub(crate) fn of(shape: &BlockShape) -> Option<Self> {
        let [kernel_t, kernel_x] = shape.kernel;
        let groups = shape.maps_out.div_ceil(MAPS);
        let columns = groups * MAPS;
        let frame = shape.taxels * columns * size_of::<f32>();
        let weights = kernel_t * kernel_x * columns * size_of::<f32>();
        let fits = shape.maps_in == 1
            && frame <= SHARED
            && weights <= SHARED
            && kernel_t <= MAX_KERNEL
            && kernel_x <= 9
            && groups * kernel_t.div_ceil(TAPS) <= UNITS;
        if !fits {
            return None;
        }
        let strips = shape.steps.div_ceil(STRIP);
        let pairs = shape.batch * strips * shape.taxels;
        let pairs_of_cube = (UNITS / groups).max(1);
        let rows = shape.batch * shape.steps;
        let rows_of_part = rows.div_ceil(PARTS);
        let teams = UNITS / (groups * kernel_t.div_ceil(TAPS));
        let sizes = Sizes {
            steps: shape.steps,
            taxels: shape.taxels,
            maps: shape.maps_out,
            kernel_t,
            kernel_x,
            groups,
            columns,
            strips,
            pairs,
            pairs_of_cube,
            grid: pairs.div_ceil(pairs_of_cube).min(65_535),
            rows,
            rows_of_part,
            rows_at_once: (SHARED / 2 / frame).clamp(1, rows_of_part.max(teams)),
            teams,
            parts: rows.div_ceil(rows_of_part) * teams,
        };
        Some(Self {
            shape: *shape,
            sizes,
        })
    }

    /// Returns the convolution `[batch][steps][taxels][maps]`.
    pub(crate) fn convolve(&self, run: &Run<'_>, input: &Stacked, weight: &Stacked) -> Stacked {
        let s = self.sizes;
        let out = Stacked::floats(run.client, run.networks, self.shape.count() * s.maps);
        let cubes = s.pairs.div_ceil(s.pairs_of_cube).div_ceil(s.grid);
        // SAFETY: lengths are those of the buffers, and the kernel stays within `s`.
        unsafe {
            convolve_strips::launch_unchecked(
                run.client,
                CubeCount::Static(s.grid as u32, cubes as u32, run.networks as u32),
                CubeDim::new_1d((s.groups * s.pairs_of_cube) as u32),
                input.arg(),
                weight.arg(),
                out.arg(),
                s,
                [input.place, weight.place, out.place],
            );
        }
        out
    }

    /// Writes the gradient of the weights to `out`, from the convolution's output and the parts of its gradient.
    pub(crate) fn weight_gradient(
        &self,
        run: &Run<'_>,
        input: &Stacked,
        passed: &PassedBlock<'_>,
        out: &Stacked,
    ) {
        let s = self.sizes;
        let len = self.shape.weight_len();
        let partial = Stacked::floats(run.client, run.networks, s.parts * len);
        // SAFETY: lengths are those of the buffers, and the kernels stay within `s`.
        unsafe {
            correlate::launch_unchecked(
                run.client,
                CubeCount::Static((s.parts / s.teams) as u32, 1, run.networks as u32),
                CubeDim::new_1d((s.teams * s.groups * s.kernel_t.div_ceil(TAPS)) as u32),
                input.arg(),
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
                partial.arg(),
                s,
                NormSizes::of(&self.shape, self.shape.count() * s.maps),
                passed.places(run.counts),
                [input.place, passed.convolved.place, partial.place],
            );
            sum_parts::launch_unchecked(
                run.client,
                CubeCount::Static(len.div_ceil(LANES) as u32, 1, run.networks as u32),
                CubeDim::new_1d(UNITS as u32),
                partial.arg(),
                out.arg(),
                s,
                [partial.place, out.place],
            );
        }
    }
}

/// Each unit computes a strip of steps of one taxel for every `groups`-th map, so that neighbouring units write to neighbouring addresses.
#[cube(launch_unchecked)]
fn convolve_strips(
    input: &[f32],
    weight: &[f32],
    out: &mut [f32],
    #[comptime] s: Sizes,
    #[comptime] places: [Place; 3],
) {
    let network = CUBE_POS_Z as usize;
    let from_input = begin(network, comptime!(places[0]));
    let from_weight = begin(network, comptime!(places[1]));
    let into = begin(network, comptime!(places[2]));
    let units = comptime!(s.groups * s.pairs_of_cube);
    let taps = comptime!(s.kernel_t * s.kernel_x);
    let (half_t, half_x) = comptime!((s.kernel_t / 2, s.kernel_x / 2));
    let window = comptime!(STRIP + s.kernel_t - 1);
    let unit = UNIT_POS as usize;
    let mut weights = Shared::<[f32]>::new_slice(comptime!(taps * s.columns));
    let mut e = unit;
    while e < comptime!(taps * s.columns) {
        let map = e % s.columns;
        let mut value = 0.0f32;
        if map < s.maps {
            value = weight[from_weight + map * taps + e / s.columns];
        }
        weights[e] = value;
        e += units;
    }
    sync_cube();

    let group = unit % s.groups;
    let cube = CUBE_POS_Y as usize * s.grid + CUBE_POS_X as usize;
    let pair = cube * s.pairs_of_cube + unit / s.groups;
    if pair < s.pairs {
        let x = pair % s.taxels;
        let first = pair / s.taxels % s.strips * STRIP;
        let sweep = pair / comptime!(s.taxels * s.strips);
        let mut sums = Array::<f32>::new(comptime!(STRIP * MAPS));
        let mut values = Array::<f32>::new(window);
        #[unroll]
        for i in 0..comptime!(STRIP * MAPS) {
            sums[i] = 0.0f32;
        }
        for dx in 0..s.kernel_x {
            let inside = x + dx >= half_x && x + dx < comptime!(s.taxels + half_x);
            #[unroll]
            for i in 0..window {
                let t = first + i;
                let mut value = 0.0f32;
                if inside && t >= half_t && t < comptime!(s.steps + half_t) {
                    let row = sweep * s.steps + t - half_t;
                    value = input[from_input + row * s.taxels + x + dx - half_x];
                }
                values[i] = value;
            }
            #[unroll]
            for dt in 0..s.kernel_t {
                #[unroll]
                for j in 0..MAPS {
                    let at = (comptime!(dt * s.kernel_x) + dx) * s.columns;
                    let weight = weights[at + comptime!(j * s.groups) + group];
                    #[unroll]
                    for i in 0..STRIP {
                        sums[comptime!(i * MAPS + j)] += values[comptime!(i + dt)] * weight;
                    }
                }
            }
        }
        #[unroll]
        for i in 0..STRIP {
            let t = first + i;
            #[unroll]
            for j in 0..MAPS {
                let map = comptime!(j * s.groups) + group;
                if t < s.steps && map < s.maps {
                    let at = ((sweep * s.steps + t) * s.taxels + x) * s.maps + map;
                    out[into + at] = sums[comptime!(i * MAPS + j)];
                }
            }
        }
    }
}

/// Each unit computes two time taps, all taxel taps and every `groups`-th map; a cube sums over its share of all steps.
#[cube(launch_unchecked)]
fn correlate(
    input: &[f32],
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
    partial: &mut [f32],
    #[comptime] s: Sizes,
    #[comptime] norm: NormSizes,
    #[comptime] of_norm: Places,
    #[comptime] places: [Place; 3],
) {
    let network = CUBE_POS_Z as usize;
    let from_input = begin(network, comptime!(places[0]));
    let from_convolved = begin(network, comptime!(places[1]));
    let into = begin(network, comptime!(places[2]));
    let apart = comptime!(s.kernel_t.div_ceil(TAPS));
    let units = comptime!(s.teams * s.groups * apart);
    let (half_t, half_x) = comptime!((s.kernel_t / 2, s.kernel_x / 2));
    let frame = comptime!(s.taxels * s.columns);
    // Steps around the current ones, and taxels with zeros around them.
    let (slab_rows, slab_row) =
        comptime!((s.rows_at_once + s.kernel_t - 1, s.taxels + s.kernel_x - 1));
    let unit = UNIT_POS as usize;
    let group = unit % s.groups;
    let tap = unit / s.groups % apart;
    let team = unit / comptime!(s.groups * apart);
    let mut gradients = Shared::<[f32]>::new_slice(comptime!(s.rows_at_once * frame));
    let mut slab = Shared::<[f32]>::new_slice(comptime!(slab_rows * slab_row));
    let mut sums = Array::<f32>::new(comptime!(TAPS * s.kernel_x * MAPS));
    let mut values = Array::<f32>::new(comptime!(TAPS * s.kernel_x));
    #[unroll]
    for i in 0..comptime!(TAPS * s.kernel_x * MAPS) {
        sums[i] = 0.0f32;
    }
    let first_row = CUBE_POS_X as usize * s.rows_of_part;
    let end = (first_row + s.rows_of_part).min(s.rows);
    let mut first = first_row;
    while first < end {
        let mut e = unit;
        while e < comptime!(s.rows_at_once * frame) {
            let map = e % s.columns;
            let position = e / s.columns;
            let mut value = 0.0f32;
            if map < s.maps && first + position / s.taxels < end {
                let at = (first * s.taxels + position) * s.maps + map;
                value = gradient_at(
                    network,
                    at,
                    convolved[from_convolved + at],
                    gamma,
                    mean,
                    variance,
                    of_gamma,
                    of_beta,
                    pooled,
                    winners,
                    gradient,
                    counts,
                    norm,
                    of_norm,
                );
            }
            gradients[e] = value;
            e += units;
        }
        let mut e = unit;
        while e < comptime!(slab_rows * slab_row) {
            let (row, x) = (first + e / slab_row, e % slab_row);
            let mut value = 0.0f32;
            if row >= half_t
                && row < comptime!(s.rows + half_t)
                && x >= half_x
                && x < comptime!(s.taxels + half_x)
            {
                value = input[from_input + (row - half_t) * s.taxels + x - half_x];
            }
            slab[e] = value;
            e += units;
        }
        sync_cube();
        let mut row = team;
        while row < s.rows_at_once {
            let t = (first + row) % s.steps;
            #[unroll]
            for q in 0..TAPS {
                #[unroll]
                for k in 1..s.kernel_x {
                    let at = (row + tap + comptime!(q * apart)).min(slab_rows - 1) * slab_row;
                    values[comptime!(q * s.kernel_x + k)] = slab[at + comptime!(k - 1)];
                }
            }
            for x in 0..s.taxels {
                #[unroll]
                for q in 0..TAPS {
                    let at = (row + tap + comptime!(q * apart)).min(slab_rows - 1) * slab_row;
                    #[unroll]
                    for k in 1..s.kernel_x {
                        values[comptime!(q * s.kernel_x + k - 1)] =
                            values[comptime!(q * s.kernel_x + k)];
                    }
                    values[comptime!((q + 1) * s.kernel_x - 1)] =
                        slab[at + x + comptime!(s.kernel_x - 1)];
                }
                // Steps of other sweeps do not contribute.
                let mut inside = Array::<f32>::new(TAPS);
                #[unroll]
                for q in 0..TAPS {
                    let at = t + tap + comptime!(q * apart);
                    inside[q] = f32::cast_from(at >= half_t && at < comptime!(s.steps + half_t));
                }
                #[unroll]
                for j in 0..MAPS {
                    let at = row * frame + x * s.columns + comptime!(j * s.groups) + group;
                    let gradient = gradients[at];
                    #[unroll]
                    for q in 0..TAPS {
                        let gradient = gradient * inside[q];
                        #[unroll]
                        for k in 0..s.kernel_x {
                            let i = comptime!(q * s.kernel_x + k);
                            sums[comptime!(i * MAPS + j)] += values[i] * gradient;
                        }
                    }
                }
            }
            row += s.teams;
        }
        sync_cube();
        first += s.rows_at_once;
    }
    #[unroll]
    for q in 0..TAPS {
        let dt = tap + comptime!(q * apart);
        #[unroll]
        for k in 0..s.kernel_x {
            #[unroll]
            for j in 0..MAPS {
                let map = comptime!(j * s.groups) + group;
                if dt < s.kernel_t && map < s.maps {
                    let part = CUBE_POS_X as usize * s.teams + team;
                    let of = (part * s.kernel_t + dt) * s.kernel_x + k;
                    partial[into + of * s.maps + map] =
                        sums[comptime!((q * s.kernel_x + k) * MAPS + j)];
                }
            }
        }
    }
}

/// Number of values that a cube sums in parallel.
const LANES: usize = 32;

/// Sums `[parts][taps][maps]` to `[maps][taps]`.
#[cube(launch_unchecked)]
fn sum_parts(
    partial: &[f32],
    out: &mut [f32],
    #[comptime] s: Sizes,
    #[comptime] places: [Place; 2],
) {
    let network = CUBE_POS_Z as usize;
    let from = begin(network, comptime!(places[0]));
    let into = begin(network, comptime!(places[1]));
    let taps = comptime!(s.kernel_t * s.kernel_x);
    let len = comptime!(taps * s.maps);
    let unit = UNIT_POS as usize;
    let at = CUBE_POS_X as usize * LANES + unit % LANES;
    let mut all = Shared::<[f32]>::new_slice(UNITS);
    let mut sum = 0.0f32;
    if at < len {
        let mut part = unit / LANES;
        while part < s.parts {
            sum += partial[from + part * len + at];
            part += comptime!(UNITS / LANES);
        }
    }
    all[unit] = sum;
    sync_cube();
    if unit < LANES && at < len {
        let mut sum = 0.0f32;
        for i in 0..comptime!(UNITS / LANES) {
            sum += all[unit + i * LANES];
        }
        out[into + at % s.maps * taps + at / s.maps] = sum;
    }
}
