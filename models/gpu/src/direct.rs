//! Sums behind the products of the direct route.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use tactnet_conv::BlockShape;

use crate::device::{buffer, floats};

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
pub(crate) fn sum_parts(
    client: &Client,
    shape: &BlockShape,
    parts: usize,
    partial: &(Handle, usize),
) -> Handle {
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
pub(crate) fn gather(client: &Client, shape: &BlockShape, shares: &(Handle, usize)) -> Handle {
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
