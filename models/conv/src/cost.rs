//! What a spectral route costs, so that the cheapest tiling of a shape can be chosen before anything is computed.
//!
//! The model counts what one training step does, forward and backward with the input's gradient, in operations on eight values, for `P` parts
//! (sweeps times bands of taxels times ranges of steps) of `C` columns and `F` time frequencies:
//!
//! | term | operations |
//! |---|---|
//! | taxel transforms, dense | `2 P C (taxels of a band, padded) (steps seen * ins + steps * outs)` |
//! | time transforms | `2 P C F log2 F (ins + outs) + 2 C F log2 F (maps_in * outs)`, the latter for weights |
//! | products | `12 P C F maps_in * outs`, half of it in columns that mirror themselves |
//! | memory | octets written and read again: rows, spectra, products and weights |
//! | calls | products of small matrices, one a frequency, column and block of maps |
//!
//! with `ins` and `outs` the octets of maps. The prices of an operation were fitted to measurements over a grid of shapes; `cargo bench -p
//! tactnet-conv --bench planner` measures all tilings of that grid again and says how far the choice is from the best.

use super::bands::Bands;
use super::fft::TimePlan;
use super::shape::BlockShape;
use super::simd::Isa;
use super::taxel::{MAX_TAXELS, padded_pairs};

/// How the taxels and steps of a shape are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tiling {
    pub(super) bands: Bands,
    pub(super) ranges: Bands,
}

/// Taxels of a band that fill the transform's pairs.
const WIDTHS: [usize; 4] = [MAX_TAXELS, 24, 16, 10];
/// About how many steps of a range.
const SPANS: [usize; 5] = [1000, 480, 240, 120, 60];
/// Most octets of the weights' spectra (128 MiB); a tiling that needs more is chosen only if there is no other.
const MAX_WEIGHTS: f64 = (1 << 22) as f64;

/// Nanoseconds of an operation on one thread.
struct Prices {
    dense: f64,
    time: f64,
    product: f64,
    memory: f64,
    call: f64,
}

fn prices(isa: Isa, shape: &BlockShape) -> Prices {
    // Vectors of two octets halve what is computed where both counts of maps fill them.
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
    /// All tilings worth a thought.
    pub(super) fn candidates(shape: &BlockShape) -> Vec<Self> {
        let [pad_steps, pad_taxels] = shape.padding();
        let mut found = Vec::new();
        let mut spans = vec![shape.steps];
        spans.extend(SPANS.map(|span| (span / shape.pool).max(1) * shape.pool));
        for width in WIDTHS {
            // A kernel may be wider than a band.
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

    /// All steps at once.
    pub(super) fn over_taxels(shape: &BlockShape) -> Self {
        let pad = shape.padding()[1];
        Self {
            bands: Bands::at_most(MAX_TAXELS.max(2 * pad + 1), shape.taxels, pad),
            ranges: Bands::one(shape.steps),
        }
    }

    /// The candidate that is predicted to cost least; `None` if no band is wide enough for the kernel.
    pub(super) fn cheapest(shape: &BlockShape, isa: Isa) -> Option<Self> {
        let costs = Self::candidates(shape)
            .into_iter()
            .map(|tiling| (tiling.cost(shape, isa), tiling));
        costs
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, tiling)| tiling)
    }

    /// Points of the transform over steps, at least.
    pub(super) fn least_length(&self, shape: &BlockShape) -> usize {
        let zeros = if self.ranges.is_cut() {
            0
        } else {
            shape.padding()[0]
        };
        self.ranges.width + zeros
    }

    /// Points of the transform over taxels.
    pub(super) fn taxel_length(&self, shape: &BlockShape) -> usize {
        let pad = shape.padding()[1];
        self.bands.width + if self.bands.is_cut() { 0 } else { pad }
    }

    /// Predicted nanoseconds of a training step on one thread.
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
