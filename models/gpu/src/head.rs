//! Layers behind the blocks for several networks: dropout, normalised dense layer, output layer and loss.

mod loss;

use cubecl::client::Client;
use cubecl::prelude::*;

use crate::networks::{LayerParameters, Place, Stacked, Statistics, begin};
use crate::norm::EPSILON;
use crate::stack_shape::WORD;
pub(crate) use loss::LossInputs;

/// Number of units per cube.
const UNITS: usize = 256;

/// Sizes of one network's head.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Head {
    pub(crate) batch: usize,
    /// Pooled steps of the last block.
    pub(crate) steps: usize,
    pub(crate) taxels: usize,
    pub(crate) maps: usize,
    /// Number of words in a dropout mask.
    pub(crate) words: usize,
    pub(crate) hidden: usize,
    pub(crate) materials: usize,
    /// Location of each network's number of sweeps.
    pub(crate) counts: Place,
}

/// Results of the normalised dense layer, gradient of its output, and targets of the gradients of scale and shift.
pub(crate) struct PassedDense<'a> {
    /// `[batch][hidden]`, before normalisation
    pub(crate) dense: &'a Stacked,
    /// `[batch][hidden]`, rectified output
    pub(crate) hidden: &'a Stacked,
    /// `[batch][hidden]`, gradient of `hidden`
    pub(crate) gradient: &'a Stacked,
    pub(crate) counts: &'a Stacked,
    pub(crate) gamma: &'a Stacked,
    pub(crate) statistics: &'a Statistics,
    pub(crate) of_gamma: &'a Stacked,
    pub(crate) of_beta: &'a Stacked,
}

/// Returns the grid of an elementwise kernel over `len` values of each network.
fn elements(len: usize, networks: usize) -> CubeCount {
    let cubes = len.div_ceil(UNITS);
    let grid = row(len);
    CubeCount::Static(grid as u32, cubes.div_ceil(grid) as u32, networks as u32)
}

/// Returns the number of cubes along the first axis of the grid.
pub(crate) fn row(len: usize) -> usize {
    len.div_ceil(UNITS).clamp(1, 65_535)
}

/// Returns the index of a unit's value within its network.
#[cube]
pub(crate) fn element(#[comptime] row: usize) -> usize {
    (CUBE_POS_Y as usize * row + CUBE_POS_X as usize) * UNITS + UNIT_POS as usize
}

/// Returns grid and cube size of an elementwise kernel over `len` values of each of `networks`.
pub(crate) fn launch(len: usize, networks: usize) -> (CubeCount, CubeDim) {
    (elements(len, networks), CubeDim::new_1d(UNITS as u32))
}

impl Head {
    fn features(&self) -> usize {
        self.maps * self.steps * self.taxels
    }

    /// Applies dropout to the last block's `[batch][steps][taxels][maps]`; returns `[batch][features]` in the order of the dense layer's weights.
    ///
    /// - `masks`: `[batch][words]` of each network
    /// - `kept`: factor of kept features
    pub(crate) fn drop_out(
        &self,
        client: &Client,
        networks: usize,
        pooled: &Stacked,
        masks: &Stacked,
        kept: f32,
    ) -> Stacked {
        self.dropped(client, networks, [pooled, masks], kept, false)
    }

    /// Returns the gradient of [`Self::drop_out`]'s input, given that of its output.
    pub(crate) fn drop_out_gradient(
        &self,
        client: &Client,
        networks: usize,
        gradient: &Stacked,
        masks: &Stacked,
        kept: f32,
    ) -> Stacked {
        self.dropped(client, networks, [gradient, masks], kept, true)
    }

    fn dropped(
        &self,
        client: &Client,
        networks: usize,
        [values, masks]: [&Stacked; 2],
        kept: f32,
        back: bool,
    ) -> Stacked {
        let len = self.batch * self.features();
        let out = Stacked::floats(client, networks, len);
        let (count, dim) = launch(len, networks);
        // SAFETY: lengths are those of the buffers, and the kernel stays below `len`.
        unsafe {
            drop_features::launch_unchecked(
                client,
                count,
                dim,
                values.arg(),
                masks.arg(),
                out.arg(),
                kept,
                *self,
                [values.place, masks.place, out.place],
                row(len),
                back,
            );
        }
        out
    }

    /// Returns `relu(batch_norm(dense))`, `[batch][hidden]`, zero for padding sweeps; writes mean and variance to `statistics`.
    pub(crate) fn normalise(
        &self,
        client: &Client,
        networks: usize,
        dense: &Stacked,
        counts: &Stacked,
        parameters: &LayerParameters,
        statistics: &Statistics,
    ) -> Stacked {
        let LayerParameters { gamma, beta, .. } = parameters;
        let Statistics { mean, variance } = statistics;
        let out = Stacked::floats(client, networks, self.batch * self.hidden);
        let (count, dim) = launch(self.hidden, networks);
        // SAFETY: lengths are those of the buffers, and the kernel stays within the head's sizes.
        unsafe {
            normalise_rows::launch_unchecked(
                client,
                count,
                dim,
                dense.arg(),
                counts.arg(),
                gamma.arg(),
                beta.arg(),
                mean.arg(),
                variance.arg(),
                out.arg(),
                *self,
                [gamma.place, beta.place, mean.place, variance.place],
                row(self.hidden),
            );
        }
        out
    }

    /// Returns the gradient of `dense`, given that of `hidden`; writes those of scale and shift.
    pub(crate) fn normalise_gradient(
        &self,
        client: &Client,
        networks: usize,
        passed: &PassedDense<'_>,
    ) -> Stacked {
        let PassedDense {
            dense,
            hidden,
            gradient,
            counts,
            gamma,
            statistics: Statistics { mean, variance },
            of_gamma,
            of_beta,
        } = passed;
        let out = Stacked::floats(client, networks, self.batch * self.hidden);
        let (count, dim) = launch(self.hidden, networks);
        // SAFETY: lengths are those of the buffers, and the kernel stays within the head's sizes.
        unsafe {
            normalise_rows_gradient::launch_unchecked(
                client,
                count,
                dim,
                dense.arg(),
                hidden.arg(),
                gradient.arg(),
                counts.arg(),
                gamma.arg(),
                mean.arg(),
                variance.arg(),
                of_gamma.arg(),
                of_beta.arg(),
                out.arg(),
                *self,
                [
                    gamma.place,
                    mean.place,
                    variance.place,
                    of_gamma.place,
                    of_beta.place,
                ],
                row(self.hidden),
            );
        }
        out
    }
}

/// Reorders from the blocks' order `[steps][taxels][maps]` to the dense layer's `[maps][steps][taxels]`, or `back`, and applies the mask.
#[cube(launch_unchecked)]
fn drop_features(
    values: &[f32],
    masks: &[u32],
    out: &mut [f32],
    kept: f32,
    #[comptime] s: Head,
    #[comptime] places: [Place; 3],
    #[comptime] cubes: usize,
    #[comptime] back: bool,
) {
    let at = element(cubes);
    let features = comptime!(s.maps * s.steps * s.taxels);
    if at < comptime!(s.batch * features) {
        let network = CUBE_POS_Z as usize;
        let sweep = at / features;
        // Units are numbered in the blocks' order, so that neighbours access neighbouring addresses there.
        let map = at % s.maps;
        let position = at % features / s.maps;
        let feature = map * comptime!(s.steps * s.taxels) + position;
        let word = masks[begin(network, comptime!(places[1])) + sweep * s.words + feature / WORD];
        let bit = (word >> ((feature % WORD) as u32)) & 1u32;
        let by_feature = sweep * features + feature;
        let mut from = begin(network, comptime!(places[0])) + at;
        let mut into = begin(network, comptime!(places[2])) + by_feature;
        if back {
            from = begin(network, comptime!(places[0])) + by_feature;
            into = begin(network, comptime!(places[2])) + at;
        }
        let mut value = 0.0f32;
        if bit == 1u32 {
            value = values[from] * kept;
        }
        out[into] = value;
    }
}

/// Each unit computes one output of the dense layer for all sweeps.
#[cube(launch_unchecked)]
fn normalise_rows(
    dense: &[f32],
    counts: &[u32],
    gamma: &[f32],
    beta: &[f32],
    mean: &mut [f32],
    variance: &mut [f32],
    out: &mut [f32],
    #[comptime] s: Head,
    #[comptime] places: [Place; 4],
    #[comptime] cubes: usize,
) {
    let unit = element(cubes);
    if unit < s.hidden {
        let network = CUBE_POS_Z as usize;
        let sweeps = counts[begin(network, s.counts)] as usize;
        let from = network * comptime!(s.batch * s.hidden) + unit;
        let count = f32::cast_from(sweeps.max(1));
        let mut sum = 0.0f32;
        for row in 0..sweeps {
            sum += dense[from + row * s.hidden];
        }
        let middle = sum / count;
        let mut squares = 0.0f32;
        for row in 0..sweeps {
            let off = dense[from + row * s.hidden] - middle;
            squares += off * off;
        }
        let spread = squares / count;
        mean[begin(network, comptime!(places[2])) + unit] = middle;
        variance[begin(network, comptime!(places[3])) + unit] = spread;
        let scale = gamma[begin(network, comptime!(places[0])) + unit] / (spread + EPSILON).sqrt();
        let shift = beta[begin(network, comptime!(places[1])) + unit];
        for row in 0..s.batch {
            let at = from + row * s.hidden;
            let mut value = 0.0f32;
            if row < sweeps {
                value = ((dense[at] - middle) * scale + shift).max(0.0f32);
            }
            out[at] = value;
        }
    }
}

/// Gradient of [`normalise_rows`].
#[cube(launch_unchecked)]
fn normalise_rows_gradient(
    dense: &[f32],
    hidden: &[f32],
    gradient: &[f32],
    counts: &[u32],
    gamma: &[f32],
    mean: &[f32],
    variance: &[f32],
    of_gamma: &mut [f32],
    of_beta: &mut [f32],
    out: &mut [f32],
    #[comptime] s: Head,
    #[comptime] places: [Place; 5],
    #[comptime] cubes: usize,
) {
    let unit = element(cubes);
    if unit < s.hidden {
        let network = CUBE_POS_Z as usize;
        let sweeps = counts[begin(network, s.counts)] as usize;
        let from = network * comptime!(s.batch * s.hidden) + unit;
        let middle = mean[begin(network, comptime!(places[1])) + unit];
        let spread = variance[begin(network, comptime!(places[2])) + unit];
        let scale = 1.0f32 / (spread + EPSILON).sqrt();
        let mut sum = 0.0f32;
        let mut with_normal = 0.0f32;
        for row in 0..sweeps {
            let at = from + row * s.hidden;
            if hidden[at] > 0.0f32 {
                let value = gradient[at];
                sum += value;
                with_normal += value * (dense[at] - middle) * scale;
            }
        }
        of_gamma[begin(network, comptime!(places[3])) + unit] = with_normal;
        of_beta[begin(network, comptime!(places[4])) + unit] = sum;
        let share = 1.0f32 / f32::cast_from(sweeps.max(1));
        let factor = gamma[begin(network, comptime!(places[0])) + unit] * scale;
        for row in 0..s.batch {
            let at = from + row * s.hidden;
            let mut found = 0.0f32;
            if row < sweeps {
                let mut passed = 0.0f32;
                if hidden[at] > 0.0f32 {
                    passed = gradient[at];
                }
                let normal = (dense[at] - middle) * scale;
                found = factor * (passed - (sum + normal * with_normal) * share);
            }
            out[at] = found;
        }
    }
}
