//! Cost model of the spectral route, which selects the fastest tiling of a shape.
//!
//! The model counts the operations on octets of one training step, forward and backward with the input's gradient, for `P` parts
//! (sweeps times bands of taxels times ranges of steps) with `C` columns and `F` time frequencies:
//!
//! | term | operations |
//! |---|---|
//! | taxel transforms, dense | `2 P C (taxels of a band, padded) (input steps * ins + output steps * outs)` |
//! | time transforms | `2 P C F log2 F (ins + outs) + 2 C F log2 F (maps_in * outs)`, the latter for weights |
//! | products | `12 P C F maps_in * outs`, half of it in columns that mirror themselves |
//! | memory | octets written and read again: rows, spectra, products and weights |
//! | calls | products of small matrices: one per frequency, column and block of maps |
//!
//! `ins` and `outs` are the octets of input and output maps. The time per operation was fitted to measurements over a grid of shapes.
//! The benchmark `planner` of this crate measures all tilings of that grid and compares the model's choice with the fastest.

use super::bands::Bands;
use super::fft::TimePlan;
use super::shape::BlockShape;
use super::simd::Isa;
use super::taxel::{MAX_TAXELS, padded_pairs};

/// Division of a shape's taxels and steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tiling {
    pub(super) bands: Bands,
    pub(super) ranges: Bands,
}

/// Band widths in taxels that fill the transform's pairs.
const WIDTHS: [usize; 4] = [MAX_TAXELS, 24, 16, 10];
/// Approximate range lengths in steps.
const SPANS: [usize; 5] = [1000, 480, 240, 120, 60];
/// Maximum number of octets in the weights' spectra (128 MiB); larger tilings are used only if all are larger.
const MAX_WEIGHTS: f64 = (1 << 22) as f64;

/// Nanoseconds per operation on one thread.
struct Prices {
    dense: f64,
    time: f64,
    product: f64,
    memory: f64,
    call: f64,
}

fn prices(isa: Isa, shape: &BlockShape) -> Prices {
    // If both counts of maps fill vectors of two octets, these halve the number of vector operations.
    let wide = isa.group(shape.maps_in / 8) + isa.group(shape.maps_out / 8) > 2;
    if wide {
        Prices {
            dense: 0.10,
            time: 0.28,
            product: 0.11,
            memory: 1.2,
            call: 60.0,
        }
    } else {
        Prices {
            dense: 0.20,
            time: 0.50,
            product: 0.20,
            memory: 1.2,
            call: 60.0,
        }
    }
}

impl std::fmt::Display for Tiling {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { bands, ranges } = self;
        write!(
            f,
            "{} x {} taxels, {} x {} steps",
            bands.count(),
            bands.width,
            ranges.count(),
            ranges.width
        )
    }
}

impl Tiling {
    /// Returns all tilings that are worth comparing.
    pub(super) fn candidates(shape: &BlockShape) -> Vec<Self> {
        let [pad_steps, pad_taxels] = shape.padding();
        let mut found = Vec::new();
        let mut spans = vec![shape.steps];
        spans.extend(SPANS.map(|span| (span / shape.pool).max(1) * shape.pool));
        for width in WIDTHS {
            // A band is at least as wide as the kernel.
            let bands = Bands::at_most(width.max(2 * pad_taxels + 1), shape.taxels, pad_taxels);
            for &span in &spans {
                let tiling = Self {
                    bands,
                    ranges: Bands::of_span(span, shape.steps, pad_steps),
                };
                if bands.width <= MAX_TAXELS && !found.contains(&tiling) {
                    found.push(tiling);
                }
            }
        }
        found
    }

    /// Returns the tiling with all steps in one range.
    pub(super) fn over_taxels(shape: &BlockShape) -> Self {
        let pad = shape.padding()[1];
        Self {
            bands: Bands::at_most(MAX_TAXELS.max(2 * pad + 1), shape.taxels, pad),
            ranges: Bands::one(shape.steps),
        }
    }

    /// Returns the candidate with the lowest predicted cost; `None` if no band is wide enough for the kernel.
    pub(super) fn cheapest(shape: &BlockShape, isa: Isa) -> Option<Self> {
        let costs = Self::candidates(shape)
            .into_iter()
            .map(|tiling| (tiling.cost(shape, isa), tiling));
        costs
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, tiling)| tiling)
    }

    /// Returns the minimum length of the transform over steps.
    pub(super) fn least_length(&self, shape: &BlockShape) -> usize {
        let zeros = if self.ranges.is_cut() {
            0
        } else {
            shape.padding()[0]
        };
        self.ranges.width + zeros
    }

    /// Returns the length of the transform over taxels.
    pub(super) fn taxel_length(&self, shape: &BlockShape) -> usize {
        let pad = shape.padding()[1];
        self.bands.width + if self.bands.is_cut() { 0 } else { pad }
    }

    /// Returns the predicted time of a training step on one thread in nanoseconds.
    pub(super) fn cost(&self, shape: &BlockShape, isa: Isa) -> f64 {
        let prices = prices(isa, shape);
        let float = |count: usize| count as f64;
        let parts = float(shape.batch * self.bands.count() * self.ranges.count());
        let taxel_length = self.taxel_length(shape);
        let columns = float(taxel_length / 2 + 1);
        let mirrored = float(2 - taxel_length % 2).min(columns);
        let length = float(TimePlan::length_for(self.least_length(shape)));
        let (ins, outs) = (float(shape.maps_in) / 8.0, float(shape.maps_out) / 8.0);
        let kernels = float(shape.maps_in) * outs;
        let (seen, steps) = (float(self.ranges.width), float(self.ranges.span));
        let row = 2.0 * float(padded_pairs(self.bands.width));
        let dense = 2.0 * parts * columns * row * (seen * ins + steps * outs);
        let passes = length * length.log2();
        let time = 2.0 * columns * passes * (parts * (ins + outs) + kernels);
        let product = 12.0 * parts * (columns - mirrored / 2.0) * length * kernels;
        let weights = 2.0 * columns * length * kernels;
        let memory = parts * columns * (8.0 * (seen * ins + steps * outs) + 4.0 * length * ins)
            + 4.0 * weights;
        let calls = 3.0 * columns * length * (outs / 2.0).ceil();
        let too_large = if weights > MAX_WEIGHTS { 1e3 } else { 1.0 };
        too_large
            * (prices.dense * dense
                + prices.time * time
                + prices.product * product
                + prices.memory * memory
                + prices.call * calls)
    }
}
