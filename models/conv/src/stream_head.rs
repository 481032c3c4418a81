//! Dense and output layer for one sweep, without dropout and with many dropout masks, without allocation.
//!
//! The masks are known in advance. A sample drops few features (or keeps few), so its dense layer is computed as the one without dropout minus
//! the dropped features. With a keep probability of 0.8 this takes a fifth of the products of a masked matrix product. The dense layer
//! is computed in panels whose weights stay in the L2 cache for all Monte Carlo samples.

use super::simd::{Isa, Kernel, Lanes, Octet, Octets, floats};

/// Octets of hidden units per panel; with 2048 features a panel's weights take half a megabyte.
const PANEL: usize = 8;

/// Layers behind the features: dense, ReLU, output.
///
/// Only [`StreamHead::new`] allocates. Everything runs on the calling thread.
#[derive(Debug, Clone)]
pub struct StreamHead {
    isa: Isa,
    features: usize,
    materials: usize,
    /// `[panels][features][PANEL]`
    hidden: Octets,
    /// `[panels][PANEL]`
    bias: Octets,
    /// `[hidden rounded up][octets of materials]`
    output: Octets,
    /// `[octets of materials]`
    output_bias: Octets,
    masks: Vec<Mask>,
    /// `[mc_samples or 1][panels][PANEL]`
    activations: Octets,
    /// `[octets of materials]`
    scores: Octets,
}

/// Weights of a layer: `y = weight x + bias`.
#[derive(Debug, Clone, Copy)]
pub struct StreamLayer<'a> {
    /// `[outputs][inputs]`
    pub weight: &'a [f32],
    /// `[outputs]`
    pub bias: &'a [f32],
}

/// One dropout mask.
#[derive(Debug, Clone)]
struct Mask {
    /// Indices of the dropped or of the kept features, whichever are fewer.
    features: Vec<u32>,
    dropped: bool,
    /// Factor of the kept features.
    gain: f32,
}

impl Mask {
    /// - `mask`: `[features]`, one positive value for all kept features, else zero
    fn new(mask: &[f32]) -> Self {
        let set = |dropped: bool| -> Vec<u32> {
            let chosen = mask.iter().enumerate();
            chosen
                .filter(|(_, gain)| (**gain == 0.0) == dropped)
                .map(|(feature, _)| feature as u32)
                .collect()
        };
        let (kept, gone) = (set(false), set(true));
        let dropped = gone.len() <= kept.len();
        Self {
            dropped,
            features: if dropped { gone } else { kept },
            gain: mask.iter().copied().fold(0.0, f32::max),
        }
    }
}

impl StreamHead {
    /// Copies the weights and converts the masks.
    ///
    /// - `dense`: from features to hidden units, with batch normalisation folded in
    /// - `output`: from hidden units to materials
    /// - `masks`: `[mc_samples][features]`, zero or one positive gain per sample; may be empty
    pub fn new(dense: StreamLayer<'_>, output: StreamLayer<'_>, masks: &[f32]) -> Self {
        let (hidden, materials) = (dense.bias.len(), output.bias.len());
        let features = dense.weight.len() / hidden;
        let panels = hidden.div_ceil(8 * PANEL);
        let octets = materials.div_ceil(8).next_multiple_of(2);
        let mut head = Self {
            isa: Isa::detect(),
            features,
            materials,
            hidden: Octets::zeros(panels * features * PANEL),
            bias: Octets::zeros(panels * PANEL),
            output: Octets::zeros(panels * PANEL * 8 * octets),
            output_bias: Octets::zeros(octets),
            masks: masks.chunks_exact(features).map(Mask::new).collect(),
            activations: Octets::zeros(panels * PANEL * (masks.len() / features).max(1)),
            scores: Octets::zeros(octets),
        };
        for unit in 0..hidden {
            let (panel, octet, lane) = (unit / 8 / PANEL, unit / 8 % PANEL, unit % 8);
            head.bias[panel * PANEL + octet].0[lane] = dense.bias[unit];
            for feature in 0..features {
                let row = (panel * features + feature) * PANEL;
                head.hidden[row + octet].0[lane] = dense.weight[unit * features + feature];
            }
        }
        for material in 0..materials {
            let (octet, lane) = (material / 8, material % 8);
            head.output_bias[octet].0[lane] = output.bias[material];
            for unit in 0..hidden {
                let weight = output.weight[material * hidden + unit];
                head.output[unit * octets + octet].0[lane] = weight;
            }
        }
        head
    }

    /// Returns the number of dropout masks.
    pub fn mc_samples(&self) -> usize {
        self.masks.len()
    }

    /// Calls `visit` with the scores `[materials]` without dropout.
    ///
    /// - `features`: `[features]`
    ///
    /// # Panics
    /// If `features` has the wrong length.
    pub fn plain(&mut self, features: &[f32], visit: impl FnMut(&[f32])) {
        self.hidden(features, 0);
        self.visit_scores(1, visit);
    }

    /// Calls `visit` with the scores `[materials]` of every dropout mask, in order.
    ///
    /// # Panics
    /// If `features` has the wrong length.
    pub fn monte_carlo(&mut self, features: &[f32], visit: impl FnMut(&[f32])) {
        self.hidden(features, self.masks.len());
        self.visit_scores(self.masks.len(), visit);
    }

    /// Computes the activations of `mc_samples` masks, or without dropout if it is 0.
    fn hidden(&mut self, features: &[f32], mc_samples: usize) {
        assert_eq!(features.len(), self.features, "number of features");
        let units = self.bias.len();
        for panel in 0..units / PANEL {
            let stretch = panel * self.features * PANEL..(panel + 1) * self.features * PANEL;
            self.isa.run(
                PANEL,
                Hidden {
                    features,
                    weights: &self.hidden[stretch],
                    bias: &self.bias[panel * PANEL..][..PANEL],
                    masks: &self.masks[..mc_samples],
                    activations: &mut self.activations[panel * PANEL..],
                    units,
                },
            );
        }
    }

    fn visit_scores(&mut self, mc_samples: usize, mut visit: impl FnMut(&[f32])) {
        let units = self.bias.len();
        for sample in 0..mc_samples {
            self.isa.run(
                2,
                Output {
                    activations: floats(&self.activations[sample * units..][..units]),
                    weights: &self.output,
                    bias: &self.output_bias,
                    scores: &mut self.scores,
                },
            );
            visit(&floats(&self.scores)[..self.materials]);
        }
    }
}

/// One panel of the dense layer.
struct Hidden<'a> {
    features: &'a [f32],
    /// `[features][PANEL]`
    weights: &'a [Octet],
    bias: &'a [Octet],
    /// Empty without dropout.
    masks: &'a [Mask],
    /// `[mc_samples]`, `units` octets apart
    activations: &'a mut [Octet],
    units: usize,
}

impl Kernel for Hidden<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Hidden {
            features,
            weights,
            bias,
            masks,
            activations,
            units,
        } = self;
        let zero = L::splat(0.0);
        let plain = weighted::<L>(features, weights, 0..features.len() as u32);
        let mut finish = |sample: usize, sum: &[L; PANEL], gain: f32| {
            for v in 0..PANEL / L::OCTETS {
                let at = v * L::OCTETS;
                let value = sum[v].mul_add(L::splat(gain), L::load(bias, at));
                value.max(zero).store(activations, sample * units + at);
            }
        };
        if masks.is_empty() {
            finish(0, &plain, 1.0);
        }
        for (sample, mask) in masks.iter().enumerate() {
            let mut sum = weighted::<L>(features, weights, mask.features.iter().copied());
            if mask.dropped {
                for v in 0..PANEL / L::OCTETS {
                    sum[v] = plain[v].sub(sum[v]);
                }
            }
            finish(sample, &sum, mask.gain);
        }
    }
}

/// Returns the sum of the `chosen` features' weight rows times their features, in the first `PANEL / L::OCTETS` vectors.
#[inline(always)]
fn weighted<L: Lanes>(
    features: &[f32],
    weights: &[Octet],
    chosen: impl Iterator<Item = u32>,
) -> [L; PANEL] {
    let mut sum = [L::splat(0.0); PANEL];
    for feature in chosen {
        let feature = feature as usize;
        let value = L::splat(features[feature]);
        let row = &weights[feature * PANEL..][..PANEL];
        for v in 0..PANEL / L::OCTETS {
            sum[v] = value.mul_add(L::load(row, v * L::OCTETS), sum[v]);
        }
    }
    sum
}

/// Output layer.
struct Output<'a> {
    activations: &'a [f32],
    /// `[units][octets]`
    weights: &'a [Octet],
    bias: &'a [Octet],
    scores: &'a mut [Octet],
}

impl Kernel for Output<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let octets = self.bias.len();
        for octet in (0..octets).step_by(L::OCTETS) {
            // Four sums hide the latency of multiply-add.
            let mut sums = [L::splat(0.0); 4];
            sums[0] = L::load(self.bias, octet);
            for (four, values) in self.activations.chunks_exact(4).enumerate() {
                for lane in 0..4 {
                    let weights = L::load(self.weights, (4 * four + lane) * octets + octet);
                    sums[lane] = L::splat(values[lane]).mul_add(weights, sums[lane]);
                }
            }
            let sum = sums[0].add(sums[1]).add(sums[2].add(sums[3]));
            sum.store(self.scores, octet);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;

    /// Returns the scores of masked features in double precision.
    fn masked(
        dense: StreamLayer<'_>,
        output: StreamLayer<'_>,
        input: &[f32],
        mask: &[f32],
    ) -> Vec<f64> {
        let rows = dense.weight.chunks_exact(input.len()).zip(dense.bias);
        let units: Vec<f64> = rows
            .map(|(row, bias)| {
                let terms = row.iter().zip(input).zip(mask);
                let sum: f64 = terms
                    .map(|((w, x), m)| f64::from(*w) * f64::from(*x) * f64::from(*m))
                    .sum();
                (sum + f64::from(*bias)).max(0.0)
            })
            .collect();
        let rows = output.weight.chunks_exact(units.len()).zip(output.bias);
        rows.map(|(row, bias)| {
            let terms = row.iter().zip(&units);
            terms.map(|(w, u)| f64::from(*w) * u).sum::<f64>() + f64::from(*bias)
        })
        .collect()
    }

    #[test]
    fn masked_rows_are_those_of_a_masked_product() {
        for (features, hidden, materials, keep) in
            [(40, 70, 5, 0.8_f32), (33, 8, 36, 0.2), (7, 64, 17, 1.0)]
        {
            let mc_samples = 6;
            let hidden_weight = noise(hidden * features, 1);
            let hidden_bias = noise(hidden, 2);
            let output_weight = noise(materials * hidden, 3);
            let output_bias = noise(materials, 4);
            let masks: Vec<f32> = noise(mc_samples * features, 5)
                .iter()
                .map(|v| {
                    if (v + 1.0) / 2.0 < keep {
                        1.0 / keep
                    } else {
                        0.0
                    }
                })
                .collect();
            let input = noise(features, 6);
            let dense = StreamLayer {
                weight: &hidden_weight,
                bias: &hidden_bias,
            };
            let output = StreamLayer {
                weight: &output_weight,
                bias: &output_bias,
            };
            for isa in Isa::all() {
                let mut head = StreamHead::new(dense, output, &masks);
                head.isa = isa;
                let mut found = Vec::new();
                head.plain(&input, |scores| found.push(scores.to_vec()));
                head.monte_carlo(&input, |scores| found.push(scores.to_vec()));
                let whole = vec![1.0; features];
                let all = std::iter::once(whole.as_slice()).chain(masks.chunks_exact(features));
                assert_eq!(found.len(), 1 + mc_samples);
                for (found, mask) in found.iter().zip(all) {
                    for (found, expected) in found.iter().zip(masked(dense, output, &input, mask)) {
                        assert!(
                            (f64::from(*found) - expected).abs() < 1e-4,
                            "{found} {expected}"
                        );
                    }
                }
            }
        }
    }
}
