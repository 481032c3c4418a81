//! Adam step in one kernel.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use tactnet_conv::AdamStep;

use crate::device::{buffer, floats};

const UNITS: usize = 256;

/// Returns parameter and moments after a step from `[parameter, gradient, first moment, second moment]`, each of `len` values.
///
/// The step writes new buffers: CubeCL orders writes before reads of other threads by the thread that created a buffer.
pub fn adam_update(
    client: &Client,
    step: AdamStep,
    len: usize,
    [parameter, gradient, first, second]: [&Handle; 4],
) -> [Handle; 3] {
    let cubes = len.div_ceil(UNITS);
    let grid = cubes.clamp(1, 65_535);
    let all = |handle: &Handle| (handle.clone(), len);
    let out = [(); 3].map(|()| floats(client, len));
    // SAFETY: every buffer holds `len` values, and the kernel checks that bound.
    unsafe {
        update::launch_unchecked(
            client,
            CubeCount::Static(grid as u32, cubes.div_ceil(grid) as u32, 1),
            CubeDim::new_1d(UNITS as u32),
            buffer(&all(parameter)),
            buffer(&all(gradient)),
            buffer(&all(first)),
            buffer(&all(second)),
            buffer(&out[0]),
            buffer(&out[1]),
            buffer(&out[2]),
            step.l2,
            step.beta[0],
            step.beta[1],
            step.rate,
            step.epsilon,
            len,
            grid,
        );
    }
    out.map(|(handle, _)| handle)
}

#[cube(launch_unchecked)]
fn update(
    parameter: &[f32],
    gradient: &[f32],
    first: &[f32],
    second: &[f32],
    new_parameter: &mut [f32],
    new_first: &mut [f32],
    new_second: &mut [f32],
    l2: f32,
    beta_1: f32,
    beta_2: f32,
    rate: f32,
    epsilon: f32,
    #[comptime] len: usize,
    #[comptime] grid: usize,
) {
    let at = (CUBE_POS_Y as usize * grid + CUBE_POS_X as usize) * UNITS + UNIT_POS as usize;
    if at < len {
        let value = parameter[at];
        let gradient = gradient[at] + l2 * value;
        let mean = beta_1 * first[at] + (1.0f32 - beta_1) * gradient;
        let square = beta_2 * second[at] + (1.0f32 - beta_2) * gradient * gradient;
        new_first[at] = mean;
        new_second[at] = square;
        new_parameter[at] = value - rate * mean / (square.sqrt() + epsilon);
    }
}
