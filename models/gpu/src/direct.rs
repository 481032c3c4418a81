//! The convolution as one product over the kernel's taps.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use tactnet_conv::BlockShape;

use crate::device::{Buffer, buffer, floats};
use crate::matrix::{InOrder, Layout, Patches, Shared2, Taps, Transposed};
use crate::product::{Problem, Side, product};

/// Parts that the sum over positions is cut into: the weights' gradient is one small product over many positions.
const PARTS: usize = 256;

/// Taps of one output map.
fn taps(shape: &BlockShape) -> usize {
    shape.kernel[0] * shape.kernel[1] * shape.maps_in
}

/// Returns the convolution `[batch][steps][taxels][maps out]`.
pub(crate) fn convolve(
    client: &Client,
    shape: &BlockShape,
    input: &Buffer,
    weight: &Buffer,
) -> Handle {
    let layout = Layout::of(shape);
    let out = floats(client, shape.count() * shape.maps_out);
    let patches = if shape.maps_in > 1 {
        Side::along_depth(layout)
    } else {
        Side::across(layout)
    };
    let sizes = [shape.count(), taps(shape), shape.maps_out];
    let problem = Problem::of(sizes, patches, Side::along_depth(layout));
    product::<Patches, Taps, InOrder>(client, problem, input, weight, &out);
    out.0
}

/// Returns the gradient of the weights.
pub(crate) fn weight_gradient(
    client: &Client,
    shape: &BlockShape,
    input: &Buffer,
    gradient: &Buffer,
) -> Handle {
    let (positions, maps) = (shape.count(), shape.maps_out);
    let parts = PARTS.min(positions.div_ceil(64));
    let partial = floats(client, parts * shape.weight_len());
    let layout = Layout::of(shape);
    let patches = if shape.maps_in > 1 {
        Side::across(layout)
    } else {
        Side::along_depth(layout)
    };
    let by_map = Side::across(Layout::in_order(positions, maps));
    let problem = Problem::of([taps(shape), positions, maps], patches, by_map).parts(parts);
    product::<Transposed<Patches>, Shared2, InOrder>(client, problem, input, gradient, &partial);
    sum_parts(client, shape, parts, &partial)
}

/// Returns the gradient of the input: what each position gives to each tap, gathered. Holds `[positions][taps]` meanwhile.
pub(crate) fn input_gradient(
    client: &Client,
    shape: &BlockShape,
    gradient: &Buffer,
    weight: &Buffer,
) -> Handle {
    let (positions, maps) = (shape.count(), shape.maps_out);
    let shares = floats(client, positions * taps(shape));
    let by_map = Side::along_depth(Layout::in_order(positions, maps));
    let weights = Side::across(Layout::of(shape));
    let problem = Problem::of([positions, maps, taps(shape)], by_map, weights);
    product::<Shared2, Transposed<Taps>, InOrder>(client, problem, gradient, weight, &shares);
    gather(client, shape, &shares)
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

    fn cubes(&self) -> CubeCount {
        let rest = self.len.div_ceil(UNITS).div_ceil(self.grid);
        CubeCount::Static(self.grid as u32, rest as u32, 1)
    }
}

#[cube]
fn position(#[comptime] s: Sizes) -> usize {
    (CUBE_POS_Y as usize * s.grid + CUBE_POS_X as usize) * UNITS + UNIT_POS as usize
}

/// Sums `parts` of `[parts][taps x maps in][maps out]` into weights `[maps out][maps in][taps]`.
fn sum_parts(client: &Client, shape: &BlockShape, parts: usize, partial: &Buffer) -> Handle {
    let out = floats(client, shape.weight_len());
    let sizes = Sizes::of(shape, out.1, parts);
    // SAFETY: lengths are those of the buffers, and the kernel stays inside of `sizes`.
    unsafe {
        sum_weights::launch_unchecked(
            client,
            sizes.cubes(),
            CubeDim::new_1d(UNITS as u32),
            buffer(partial),
            buffer(&out),
            sizes,
        );
    }
    out.0
}

#[cube(launch_unchecked)]
fn sum_weights(partial: &[f32], out: &mut [f32], #[comptime] s: Sizes) {
    let at = position(s);
    if at < s.len {
        let taps = comptime!(s.kernel[0] * s.kernel[1]);
        let tap = at % taps;
        let map = at / taps % s.maps;
        let other = at / comptime!(taps * s.maps);
        let from = (tap * s.maps + map) * s.others + other;
        let mut sum = 0.0f32;
        for part in 0..s.parts {
            sum += partial[part * s.len + from];
        }
        out[at] = sum;
    }
}

/// Adds up what each position gives to each tap, `[positions][taps][maps in]`, into the gradient of the input `[positions][maps in]`.
fn gather(client: &Client, shape: &BlockShape, shares: &Buffer) -> Handle {
    let out = floats(client, shape.input_len());
    let sizes = Sizes::of(shape, out.1, 1);
    // SAFETY: lengths are those of the buffers, and the kernel stays inside of `sizes`.
    unsafe {
        gather_taps::launch_unchecked(
            client,
            sizes.cubes(),
            CubeDim::new_1d(UNITS as u32),
            buffer(shares),
            buffer(&out),
            sizes,
        );
    }
    out.0
}

#[cube(launch_unchecked)]
fn gather_taps(shares: &[f32], out: &mut [f32], #[comptime] s: Sizes) {
    let at = position(s);
    if at < s.len {
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
                        sum += shares[(from * comptime!(kernel_t * kernel_x) + tap) * s.maps + map];
                    }
                }
            }
        }
        out[at] = sum;
    }
}
