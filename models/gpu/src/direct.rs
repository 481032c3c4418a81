//! Convolution as one product over the kernel's taps.

use cubecl::prelude::*;
use tactnet_conv::BlockShape;

use crate::matrix::{InOrder, Layout, Patches, Shared2, Taps, Transposed};
use crate::networks::{Place, Stacked, begin};
use crate::norm::Run;
use crate::product::{Problem, Side, product};

/// Number of parts of the sum over positions: the weights' gradient is one small product over many positions.
const PARTS: usize = 256;
/// Maximum size in bytes of the products of positions and taps, which limits the number of networks processed at a time.
const SHARES: usize = 1 << 30;

/// Returns the number of taps of one output map.
fn taps(shape: &BlockShape) -> usize {
    shape.kernel[0] * shape.kernel[1] * shape.maps_in
}

/// Returns the convolution `[batch][steps][taxels][maps out]`.
pub(crate) fn convolve(run: &Run<'_>, input: &Stacked, weight: &Stacked) -> Stacked {
    let shape = run.shape;
    let layout = Layout::of(shape);
    let out = Stacked::floats(run.client, run.networks, shape.count() * shape.maps_out);
    let patches = if shape.maps_in > 1 {
        Side::along_depth(layout)
    } else {
        Side::across(layout)
    };
    let sizes = [shape.count(), taps(shape), shape.maps_out];
    let weights = Side::along_depth(layout).of(weight.place);
    let problem =
        Problem::of(sizes, patches.of(input.place), weights).networks(run.networks, out.place);
    let [input, weight, target] = [&input.buffer, &weight.buffer, &out.buffer];
    product::<Patches, Taps, InOrder>(run.client, problem, input, weight, target);
    out
}

/// Writes the gradient of the weights to `out`.
pub(crate) fn weight_gradient(run: &Run<'_>, input: &Stacked, gradient: &Stacked, out: &Stacked) {
    let shape = run.shape;
    let (positions, maps) = (shape.count(), shape.maps_out);
    let parts = PARTS.min(positions.div_ceil(64));
    let partial = Stacked::floats(run.client, run.networks, parts * shape.weight_len());
    let layout = Layout::of(shape);
    let patches = if shape.maps_in > 1 {
        Side::across(layout)
    } else {
        Side::along_depth(layout)
    };
    let by_map = Side::across(Layout::in_order(positions, maps)).of(gradient.place);
    let problem = Problem::of(
        [taps(shape), positions, maps],
        patches.of(input.place),
        by_map,
    )
    .parts(parts)
    .networks(run.networks, partial.place);
    let [input, gradient, target] = [&input.buffer, &gradient.buffer, &partial.buffer];
    product::<Transposed<Patches>, Shared2, InOrder>(run.client, problem, input, gradient, target);
    sum_parts(run, parts, &partial, out);
}

/// Returns the gradient of the input, gathered from the products of positions and taps.
///
/// It temporarily holds `[positions][taps]`, for as many networks at a time as fit.
pub(crate) fn input_gradient(run: &Run<'_>, gradient: &Stacked, weight: &Stacked) -> Stacked {
    let shape = run.shape;
    let (positions, maps) = (shape.count(), shape.maps_out);
    let len = positions * taps(shape);
    let out = Stacked::floats(run.client, run.networks, shape.input_len());
    let at_once = (SHARES / (len * size_of::<f32>())).clamp(1, run.networks);
    for first in (0..run.networks).step_by(at_once) {
        let networks = at_once.min(run.networks - first);
        let shares = Stacked::floats(run.client, networks, len);
        let by_map = Side::along_depth(Layout::in_order(positions, maps));
        let weights = Side::across(Layout::of(shape));
        let problem = Problem::of(
            [positions, maps, taps(shape)],
            by_map.of(gradient.place.from(first)),
            weights.of(weight.place.from(first)),
        )
        .networks(networks, shares.place);
        let [left, right, target] = [&gradient.buffer, &weight.buffer, &shares.buffer];
        product::<Shared2, Transposed<Taps>, InOrder>(run.client, problem, left, right, target);
        gather(run, networks, &shares, &out, out.place.from(first));
    }
    out
}

const UNITS: usize = 256;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Sizes {
    len: usize,
    grid: usize,
    steps: usize,
    taxels: usize,
    maps: usize,
    others: usize,
    kernel: [usize; 2],
    parts: usize,
}

impl Sizes {
    fn of(shape: &BlockShape, len: usize, parts: usize) -> Self {
        Self {
            len,
            grid: len.div_ceil(UNITS).clamp(1, 65_535),
            steps: shape.steps,
            taxels: shape.taxels,
            maps: shape.maps_in,
            others: shape.maps_out,
            kernel: shape.kernel,
            parts,
        }
    }

    fn cubes(&self, networks: usize) -> CubeCount {
        let rest = self.len.div_ceil(UNITS).div_ceil(self.grid);
        CubeCount::Static(self.grid as u32, rest as u32, networks as u32)
    }
}

#[cube]
fn position(#[comptime] s: Sizes) -> usize {
    (CUBE_POS_Y as usize * s.grid + CUBE_POS_X as usize) * UNITS + UNIT_POS as usize
}

/// Sums `parts` of `[parts][taps x maps in][maps out]` to weights `[maps out][maps in][taps]`.
fn sum_parts(run: &Run<'_>, parts: usize, partial: &Stacked, out: &Stacked) {
    let sizes = Sizes::of(run.shape, run.shape.weight_len(), parts);
    // SAFETY: lengths are those of the buffers, and the kernel stays within `sizes`.
    unsafe {
        sum_weights::launch_unchecked(
            run.client,
            sizes.cubes(run.networks),
            CubeDim::new_1d(UNITS as u32),
            partial.arg(),
            out.arg(),
            sizes,
            [partial.place, out.place],
        );
    }
}

#[cube(launch_unchecked)]
fn sum_weights(
    partial: &[f32],
    out: &mut [f32],
    #[comptime] s: Sizes,
    #[comptime] places: [Place; 2],
) {
    let at = position(s);
    if at < s.len {
        let network = CUBE_POS_Z as usize;
        let start = begin(network, comptime!(places[0]));
        let taps = comptime!(s.kernel[0] * s.kernel[1]);
        let tap = at % taps;
        let map = at / taps % s.maps;
        let other = at / comptime!(taps * s.maps);
        let from = (tap * s.maps + map) * s.others + other;
        let mut sum = 0.0f32;
        for part in 0..s.parts {
            sum += partial[start + part * s.len + from];
        }
        out[begin(network, comptime!(places[1])) + at] = sum;
    }
}

/// Sums the products of positions and taps, `[positions][taps][maps in]`, to the gradient of the input `[positions][maps in]` at `place`.
fn gather(run: &Run<'_>, networks: usize, shares: &Stacked, out: &Stacked, place: Place) {
    let sizes = Sizes::of(run.shape, run.shape.input_len(), 1);
    // SAFETY: lengths are those of the buffers, and the kernel stays within `sizes`.
    unsafe {
        gather_taps::launch_unchecked(
            run.client,
            sizes.cubes(networks),
            CubeDim::new_1d(UNITS as u32),
            shares.arg(),
            out.arg(),
            sizes,
            [shares.place, place],
        );
    }
}

#[cube(launch_unchecked)]
fn gather_taps(
    shares: &[f32],
    out: &mut [f32],
    #[comptime] s: Sizes,
    #[comptime] places: [Place; 2],
) {
    let at = position(s);
    if at < s.len {
        let network = CUBE_POS_Z as usize;
        let start = begin(network, comptime!(places[0]));
        let (half_t, half_x) = comptime!((s.kernel[0] / 2, s.kernel[1] / 2));
        let (kernel_t, kernel_x) = comptime!((s.kernel[0], s.kernel[1]));
        let map = at % s.maps;
        let x = at / s.maps % s.taxels;
        let row = at / comptime!(s.maps * s.taxels);
        let t = row % s.steps;
        let mut sum = 0.0f32;
        for dt in 0..kernel_t {
            if t + half_t >= dt && t + half_t < s.steps + dt {
                for dx in 0..kernel_x {
                    if x + half_x >= dx && x + half_x < s.taxels + dx {
                        let from = (row + half_t - dt) * s.taxels + x + half_x - dx;
                        let tap = dt * kernel_x + dx;
                        let place = (from * comptime!(kernel_t * kernel_x) + tap) * s.maps + map;
                        sum += shares[start + place];
                    }
                }
            }
        }
        out[begin(network, comptime!(places[1])) + at] = sum;
    }
}
