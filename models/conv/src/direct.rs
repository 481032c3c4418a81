//! Direct route: convolution tap by tap, for any shape.
//!
//! It stores the map `y` at full resolution and needs far more arithmetic and memory than the spectral routes, so it serves only shapes that
//! they do not support.

use rayon::prelude::*;

use super::norm::{Moments, OutputGradient, Pooled};
use super::shape::BlockShape;

/// State for the direct backward pass.
#[derive(Debug, Clone)]
pub(super) struct SavedDirect {
    input: Vec<f32>,
    weight: Vec<f32>,
    maps: Vec<f32>,
}

/// Reorders weights from `[out][in][tap]` to `[tap][in][out]`.
fn by_tap(shape: &BlockShape, weight: &[f32]) -> Vec<f32> {
    let (taps, ins, outs) = (
        shape.kernel[0] * shape.kernel[1],
        shape.maps_in,
        shape.maps_out,
    );
    let mut turned = vec![0.0; weight.len()];
    for (row, values) in weight.chunks_exact(taps).enumerate() {
        for (tap, &value) in values.iter().enumerate() {
            turned[(tap * ins + row % ins) * outs + row / ins] = value;
        }
    }
    turned
}

/// Calls `visit(tap, output position, input position)` for every pair of cells in one sweep that a tap connects.
fn for_each_tap(
    shape: &BlockShape,
    taps: std::ops::Range<usize>,
    mut visit: impl FnMut(usize, usize, usize),
) {
    let [pad_steps, pad_taxels] = shape.padding();
    for tap in taps {
        let (row, column) = (tap / shape.kernel[1], tap % shape.kernel[1]);
        for step in pad_steps.saturating_sub(row)
            ..(shape.steps + pad_steps)
                .saturating_sub(row)
                .min(shape.steps)
        {
            let ends = (shape.taxels + pad_taxels)
                .saturating_sub(column)
                .min(shape.taxels);
            for taxel in pad_taxels.saturating_sub(column)..ends {
                let from = (step + row - pad_steps) * shape.taxels + taxel + column - pad_taxels;
                visit(tap, step * shape.taxels + taxel, from);
            }
        }
    }
}

/// Adds `factor * row` to `out`.
fn add_scaled(out: &mut [f32], factor: f32, row: &[f32]) {
    for (out, &value) in out.iter_mut().zip(row) {
        *out += factor * value;
    }
}

/// Convolves, pools and saves the state for the backward pass.
pub(super) fn forward(
    shape: &BlockShape,
    input: &[f32],
    weight: &[f32],
    gamma: &[f32],
) -> (Pooled, SavedDirect) {
    let (ins, outs) = (shape.maps_in, shape.maps_out);
    let weight = by_tap(shape, weight);
    let cells = shape.steps * shape.taxels;
    let mut maps = vec![0f32; shape.count() * outs];
    maps.par_chunks_exact_mut(cells * outs)
        .zip(input.par_chunks_exact(cells * ins))
        .for_each(|(y, x)| {
            for_each_tap(
                shape,
                0..shape.kernel[0] * shape.kernel[1],
                |tap, to, from| {
                    let rows = weight[tap * ins * outs..(tap + 1) * ins * outs].chunks_exact(outs);
                    for (&x, row) in x[from * ins..(from + 1) * ins].iter().zip(rows) {
                        add_scaled(&mut y[to * outs..(to + 1) * outs], x, row);
                    }
                },
            );
        });
    let pooled = pool(shape, &maps, gamma);
    (
        pooled,
        SavedDirect {
            input: input.to_vec(),
            weight,
            maps,
        },
    )
}

fn pool(shape: &BlockShape, maps: &[f32], gamma: &[f32]) -> Pooled {
    let row = shape.taxels * shape.maps_out;
    let mut moments = Moments::new(shape.maps_out);
    let mut winners = Vec::with_capacity(shape.output_len());
    let mut positions = Vec::with_capacity(shape.output_len());
    let (mut sum, mut squares) = (vec![0f32; shape.maps_out], vec![0f32; shape.maps_out]);
    for sweep in maps.chunks_exact(shape.steps * row) {
        for window in sweep.chunks(shape.pool * row) {
            let pivot = window[..shape.maps_out].to_vec();
            sum.fill(0.0);
            squares.fill(0.0);
            let first = winners.len();
            winners.extend_from_slice(&window[..row]);
            positions.resize(first + row, 0);
            for (step, values) in window.chunks_exact(row).enumerate() {
                for (at, &y) in values.iter().enumerate() {
                    let map = at % shape.maps_out;
                    sum[map] += y - pivot[map];
                    squares[map] += (y - pivot[map]) * (y - pivot[map]);
                    let best = winners[first + at];
                    if if gamma[map] < 0.0 { y < best } else { y > best } {
                        winners[first + at] = y;
                        positions[first + at] = step as u8;
                    }
                }
            }
            moments.add_shifted(window.len() / shape.maps_out, &pivot, &sum, &squares);
        }
    }
    Pooled {
        winners,
        positions,
        moments: Some(moments),
    }
}

/// Returns the gradients of the weights and, if requested, of the input.
pub(super) fn backward(
    shape: &BlockShape,
    saved: SavedDirect,
    output: OutputGradient<'_>,
    need_input: bool,
) -> (Vec<f32>, Option<Vec<f32>>) {
    let SavedDirect {
        input,
        weight,
        maps: mut dy,
    } = saved;
    spread(shape, &mut dy, output);
    let (ins, outs) = (shape.maps_in, shape.maps_out);
    let (cells, taps) = (
        shape.steps * shape.taxels,
        shape.kernel[0] * shape.kernel[1],
    );
    let mut turned = vec![0f32; weight.len()];
    turned
        .par_chunks_exact_mut(ins * outs)
        .enumerate()
        .for_each(|(tap, sums)| {
            for (y, x) in dy
                .chunks_exact(cells * outs)
                .zip(input.chunks_exact(cells * ins))
            {
                for_each_tap(shape, tap..tap + 1, |_, to, from| {
                    for (&x, row) in x[from * ins..(from + 1) * ins]
                        .iter()
                        .zip(sums.chunks_exact_mut(outs))
                    {
                        add_scaled(row, x, &y[to * outs..(to + 1) * outs]);
                    }
                });
            }
        });
    let mut by_map = vec![0f32; weight.len()];
    for (row, values) in by_map.chunks_exact_mut(taps).enumerate() {
        for (tap, value) in values.iter_mut().enumerate() {
            *value = turned[(tap * ins + row % ins) * outs + row / ins];
        }
    }
    let input = need_input.then(|| {
        let mut dx = vec![0f32; shape.input_len()];
        dx.par_chunks_exact_mut(cells * ins)
            .zip(dy.par_chunks_exact(cells * outs))
            .for_each(|(dx, dy)| {
                for_each_tap(shape, 0..taps, |tap, to, from| {
                    let rows = weight[tap * ins * outs..(tap + 1) * ins * outs].chunks_exact(outs);
                    for (dx, row) in dx[from * ins..(from + 1) * ins].iter_mut().zip(rows) {
                        *dx += row
                            .iter()
                            .zip(&dy[to * outs..(to + 1) * outs])
                            .map(|(w, d)| w * d)
                            .sum::<f32>();
                    }
                });
            });
        dx
    });
    (by_map, input)
}

/// Replaces the maps `y` by their gradient.
fn spread(shape: &BlockShape, maps: &mut [f32], output: OutputGradient<'_>) {
    let OutputGradient {
        gradient,
        positions,
        affine,
    } = output;
    let row = shape.taxels * shape.maps_out;
    let pooled_sweep = shape.pooled_steps() * row;
    maps.par_chunks_exact_mut(shape.steps * row)
        .enumerate()
        .for_each(|(sweep, maps)| {
            for (window, values) in maps.chunks_mut(shape.pool * row).enumerate() {
                let first = sweep * pooled_sweep + window * row;
                for (step, values) in values.chunks_exact_mut(row).enumerate() {
                    for (at, value) in values.iter_mut().enumerate() {
                        let map = at % shape.maps_out;
                        let won = usize::from(positions[first + at]) == step;
                        let sparse = if won {
                            affine.ka[map] * gradient[first + at]
                        } else {
                            0.0
                        };
                        *value = sparse + affine.kb[map] + affine.kc[map] * *value;
                    }
                }
            }
        });
}
