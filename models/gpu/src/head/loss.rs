//! Cross entropy of several networks and the gradient of the output layer's bias.

use cubecl::client::Client;
use cubecl::prelude::*;

use super::{Head, UNITS, element, launch, row};
use crate::networks::{Place, Stacked, begin};

/// Inputs of the loss.
pub(crate) struct LossInputs<'a> {
    /// `[batch][materials]`, without the bias
    pub(crate) logits: &'a Stacked,
    pub(crate) bias: &'a Stacked,
    /// `[batch]`
    pub(crate) labels: &'a Stacked,
    pub(crate) counts: &'a Stacked,
}

impl Head {
    /// Returns the gradient of the logits, `[batch][materials]`, and `[2]`: mean cross entropy and number of correct predictions.
    ///
    /// - `weight`: factor of the cross entropy in the gradient
    pub(crate) fn losses(
        &self,
        client: &Client,
        networks: usize,
        inputs: &LossInputs<'_>,
        weight: f32,
    ) -> [Stacked; 2] {
        let LossInputs {
            logits,
            bias,
            labels,
            counts,
        } = inputs;
        let gradient = Stacked::floats(client, networks, self.batch * self.materials);
        let measured = Stacked::floats(client, networks, 2);
        // SAFETY: lengths are those of the buffers, and the kernel stays within the head's sizes.
        unsafe {
            cross_entropy::launch_unchecked(
                client,
                CubeCount::Static(networks as u32, 1, 1),
                CubeDim::new_1d(UNITS as u32),
                logits.arg(),
                bias.arg(),
                labels.arg(),
                counts.arg(),
                gradient.arg(),
                measured.arg(),
                weight,
                *self,
                [bias.place, labels.place],
            );
        }
        [gradient, measured]
    }

    /// Sums the rows of `gradient`, `[batch][materials]`, to `into`, `[materials]`.
    pub(crate) fn bias_gradient(
        &self,
        client: &Client,
        networks: usize,
        gradient: &Stacked,
        into: &Stacked,
    ) {
        let (count, dim) = launch(self.materials, networks);
        // SAFETY: lengths are those of the buffers, and the kernel stays within the head's sizes.
        unsafe {
            sum_rows::launch_unchecked(
                client,
                count,
                dim,
                gradient.arg(),
                into.arg(),
                *self,
                into.place,
                row(self.materials),
            );
        }
    }
}

/// Each cube handles one network, and each of its units every `UNITS`-th sweep.
#[cube(launch_unchecked)]
fn cross_entropy(
    logits: &[f32],
    bias: &[f32],
    labels: &[u32],
    counts: &[u32],
    gradient: &mut [f32],
    measured: &mut [f32],
    weight: f32,
    #[comptime] s: Head,
    #[comptime] places: [Place; 2],
) {
    let network = CUBE_POS_X as usize;
    let unit = UNIT_POS as usize;
    let sweeps = counts[begin(network, s.counts)] as usize;
    let count = f32::cast_from(sweeps.max(1));
    let share = weight / count;
    let of_bias = begin(network, comptime!(places[0]));
    let of_labels = begin(network, comptime!(places[1]));
    let mut all = Shared::<[f32]>::new_slice(comptime!(2 * UNITS));
    let mut loss = 0.0f32;
    let mut recognised = 0.0f32;
    let mut sweep = unit;
    while sweep < s.batch {
        let from = (network * s.batch + sweep) * s.materials;
        if sweep < sweeps {
            let label = labels[of_labels + sweep] as usize;
            let mut most = logits[from] + bias[of_bias];
            let mut probable = 0u32;
            for material in 1..s.materials {
                let logit = logits[from + material] + bias[of_bias + material];
                if logit > most {
                    most = logit;
                    probable = material as u32;
                }
            }
            let mut sum = 0.0f32;
            for material in 0..s.materials {
                sum += (logits[from + material] + bias[of_bias + material] - most).exp();
            }
            let log_sum = sum.ln();
            loss += log_sum - (logits[from + label] + bias[of_bias + label] - most);
            if probable as usize == label {
                recognised += 1.0f32;
            }
            for material in 0..s.materials {
                let logit = logits[from + material] + bias[of_bias + material];
                let mut off = (logit - most - log_sum).exp();
                if material == label {
                    off -= 1.0f32;
                }
                gradient[from + material] = off * share;
            }
        } else {
            for material in 0..s.materials {
                gradient[from + material] = 0.0f32;
            }
        }
        sweep += UNITS;
    }
    all[unit] = loss;
    all[unit + UNITS] = recognised;
    sync_cube();
    if unit == 0 {
        let mut loss = 0.0f32;
        let mut recognised = 0.0f32;
        for i in 0..UNITS {
            loss += all[i];
            recognised += all[i + UNITS];
        }
        measured[network * 2] = loss / count;
        measured[network * 2 + 1] = recognised;
    }
}

#[cube(launch_unchecked)]
fn sum_rows(
    values: &[f32],
    out: &mut [f32],
    #[comptime] s: Head,
    #[comptime] place: Place,
    #[comptime] cubes: usize,
) {
    let column = element(cubes);
    if column < s.materials {
        let network = CUBE_POS_Z as usize;
        let mut sum = 0.0f32;
        for row in 0..s.batch {
            sum += values[(network * s.batch + row) * s.materials + column];
        }
        out[begin(network, place) + column] = sum;
    }
}
