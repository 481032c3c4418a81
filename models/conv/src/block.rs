//! Planned block, forward and backward.

use super::batch_one::BatchOne;
use super::buffers::{BYTES, Buffers, VALUES};
use super::cost::Tiling;
use super::direct::{self, SavedDirect};
use super::first_layer::{FirstLayer, SavedFirstLayer};
use super::norm::{Normalizer, OutputGradient, Pooled};
use super::pooling::{Goal, PoolBuffers, octets, signs};
use super::shape::BlockShape;
use super::simd::Isa;
use super::spare;
use super::spectral::{SavedSpectral, Spectral};
use super::trim::Trim;
use super::weight::Weight;

/// Minimum number of output maps for which zero maps are added to the input.
const MIN_PADDED_MAPS: usize = 16;

/// Block planned for one shape. All blocks share process-wide workspace pools.
///
/// All methods take `&self` and may run on several threads at once; parallel parts run on rayon's current pool. Results do not depend
/// on the number of threads, to the bit. Between instruction sets they differ by rounding.
#[derive(Debug)]
pub struct Block {
    shape: BlockShape,
    /// Shape with a kernel restricted to taps that can reach a sweep.
    met: BlockShape,
    trim: Option<Trim>,
    route: Route,
    /// Faster route over time only, for single sweeps with fixed statistics.
    batch_one: Option<BatchOne>,
    values: &'static Buffers<Vec<f32>>,
    bytes: &'static Buffers<Vec<u8>>,
}

/// Algorithm for a shape.
#[derive(Debug)]
enum Route {
    /// Tap by tap, for any shape.
    Direct,
    /// Spectral: maps in multiples of eight, bands of at most 32 taxels, kernels of at most that width.
    Spectral(Spectral),
    /// Spectral, with zero maps added to the input.
    Padded(Spectral),
    /// First layer: one input map, output maps in multiples of eight, bands of at most 16 taxels, a kernel of at most 15 x 5.
    FirstLayer(FirstLayer),
}

/// Tiling of taxels and steps for the spectral route; displayed as bands and their taxels, ranges and their steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Predicted time of a training step on one thread in milliseconds.
    pub predicted_ms: f64,
    tiling: Tiling,
}

impl std::fmt::Display for Candidate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.tiling.fmt(f)
    }
}

/// Result of [`Block::forward_train`].
#[derive(Debug)]
pub struct ForwardTrain {
    /// `[batch, pooled_steps, taxels, maps_out]`
    pub pooled: Vec<f32>,
    /// `[maps_out]`: mean of the convolution over batch, steps and taxels.
    pub mean: Vec<f32>,
    /// `[maps_out]`: biased variance of the convolution.
    pub variance: Vec<f32>,
    /// State for [`Block::backward`] or [`Block::recycle`].
    pub saved: Saved,
}

/// State of a forward pass for its backward pass: winners, their positions, and spectra or maps of the input.
#[derive(Debug)]
pub struct Saved {
    normalizer: Normalizer,
    winners: Vec<f32>,
    positions: Vec<u8>,
    route: SavedRoute,
}

#[derive(Debug)]
enum SavedRoute {
    Direct(SavedDirect),
    Spectral(SavedSpectral),
    FirstLayer(SavedFirstLayer),
}

/// Gradients of a scalar with respect to the inputs of a block.
#[derive(Debug)]
pub struct Gradients {
    /// `[maps_out, maps_in, kernel steps, kernel taxels]`
    pub weight: Vec<f32>,
    /// `[maps_out]`
    pub gamma: Vec<f32>,
    /// `[maps_out]`
    pub beta: Vec<f32>,
    /// `[batch, steps, taxels, maps_in]`, if `need_input` was set.
    pub input: Option<Vec<f32>>,
}

impl Block {
    /// Plans a block for the best instruction set of this processor.
    ///
    /// # Panics
    /// If a kernel size is even, the pool is outside 1 to 256, or a dimension is empty.
    pub fn plan(shape: BlockShape) -> Self {
        Self::plan_for(shape, Isa::detect())
    }

    /// Plans a block for the instruction set `isa`, one of [`Isa::all`].
    ///
    /// # Panics
    /// As [`Block::plan`], and if this processor lacks `isa`.
    pub fn plan_for(shape: BlockShape, isa: Isa) -> Self {
        shape.check();
        let (whole, trim) = (shape, Trim::of(&shape));
        let shape = trim.map_or(whole, |trim| trim.shape(whole));
        assert!(Isa::all().contains(&isa), "this processor lacks {isa:?}");
        let padded = BlockShape {
            maps_in: shape.maps_in.next_multiple_of(8),
            ..shape
        };
        let route = if let Some(first_layer) = FirstLayer::new(shape, isa) {
            Route::FirstLayer(first_layer)
        } else if let Some(spectral) = Spectral::new(shape, isa) {
            Route::Spectral(spectral)
        } else if shape.maps_out >= MIN_PADDED_MAPS {
            Spectral::new(padded, isa).map_or(Route::Direct, Route::Padded)
        } else {
            // With few maps all routes are fast; this one has the smallest rounding error.
            Route::Direct
        };
        Self {
            shape: whole,
            met: shape,
            trim,
            batch_one: match route {
                Route::Spectral(_) => BatchOne::new(shape, isa),
                _ => None,
            },
            route,
            values: &VALUES,
            bytes: &BYTES,
        }
    }

    /// Returns the planner's tilings for the spectral route, fastest predicted first; empty for shapes of other routes.
    ///
    /// [`Block::plan`] uses the first; [`Block::plan_candidate`] accepts any, to compare predictions with measurements.
    pub fn candidates(shape: BlockShape, isa: Isa) -> Vec<Candidate> {
        let shape = Trim::of(&shape).map_or(shape, |trim| trim.shape(shape));
        if Spectral::new(shape, isa).is_none() || FirstLayer::new(shape, isa).is_some() {
            return Vec::new();
        }
        let candidate = |tiling: Tiling| Candidate {
            predicted_ms: tiling.cost(&shape, isa) * 1e-6,
            tiling,
        };
        let mut found: Vec<_> = Tiling::candidates(&shape)
            .into_iter()
            .map(candidate)
            .collect();
        found.sort_by(|a, b| a.predicted_ms.total_cmp(&b.predicted_ms));
        found
    }

    /// Plans a block with `candidate`, one of [`Block::candidates`] for the same shape.
    ///
    /// # Panics
    /// As [`Block::plan_for`], and if `candidate` belongs to another shape.
    pub fn plan_candidate(shape: BlockShape, isa: Isa, candidate: &Candidate) -> Self {
        let planned = Self::plan_for(shape, isa);
        let spectral = Spectral::tiled(planned.met, isa, candidate.tiling);
        let spectral = spectral.unwrap_or_else(|| panic!("a candidate of another shape"));
        Self {
            route: Route::Spectral(spectral),
            ..planned
        }
    }

    /// Writes winners (or outputs) to the buffer that `out` returns; the direct route allocates its own buffer for winners.
    fn convolve(
        &self,
        input: &[f32],
        weight: &Weight<'_>,
        gamma: &[f32],
        goal: Goal<'_>,
        out: impl FnOnce(usize) -> Vec<f32>,
    ) -> (Pooled, SavedRoute) {
        let outputs = self.met.output_len();
        let to = || PoolBuffers {
            winners: out(outputs),
            positions: self.bytes.take(outputs),
        };
        match &self.route {
            Route::Direct => {
                let (pooled, saved) = direct::forward(&self.met, input, &weight.values(), gamma);
                (pooled, SavedRoute::Direct(saved))
            }
            Route::Spectral(spectral) => {
                let (pooled, saved) = spectral.forward(input, weight, goal, to());
                (pooled, SavedRoute::Spectral(saved))
            }
            Route::Padded(spectral) => {
                let maps = self.met.maps_in;
                let input = padded(input, maps, 1, spectral.plan.shape.maps_in);
                let taps = self.taps();
                let weight = padded(&weight.values(), maps, taps, spectral.plan.shape.maps_in);
                let (pooled, saved) = spectral.forward(&input, &Weight::from(&weight), goal, to());
                (pooled, SavedRoute::Spectral(saved))
            }
            Route::FirstLayer(first_layer) => {
                let (pooled, saved) = first_layer.forward(input, weight, goal, to());
                (pooled, SavedRoute::FirstLayer(saved))
            }
        }
    }

    /// Returns the planned shape.
    pub fn shape(&self) -> &BlockShape {
        &self.shape
    }

    /// Runs the forward pass with the statistics of this batch.
    ///
    /// - `input`: `[batch, steps, taxels, maps_in]`
    /// - `weight`: `[maps_out, maps_in, kernel steps, kernel taxels]`
    /// - `gamma`, `beta`: `[maps_out]`
    ///
    /// # Panics
    /// If a slice has the wrong length.
    pub fn forward_train<'a>(
        &self,
        input: &[f32],
        weight: impl Into<Weight<'a>>,
        gamma: &[f32],
        beta: &[f32],
    ) -> ForwardTrain {
        let weight = weight.into().of_taps(self.trim);
        self.check(input, &weight, gamma, beta);
        let signs = signs(gamma);
        let winners = |len| self.values.take(len);
        let (pooled, route) = self.convolve(input, &weight, gamma, Goal::winners(&signs), winners);
        let moments = pooled
            .moments
            .unwrap_or_else(|| panic!("winners come with moments"));
        let (mean, variance) = (moments.mean(), moments.variance());
        let normalizer = Normalizer::new(&mean, &variance, gamma, beta);
        let mut out = spare::take(self.met.output_len());
        normalizer.rectify(&pooled.winners, &mut out);
        let saved = Saved {
            normalizer,
            winners: pooled.winners,
            positions: pooled.positions,
            route,
        };
        ForwardTrain {
            pooled: out,
            mean,
            variance,
            saved,
        }
    }

    /// Runs the forward pass with the given mean and variance; returns `[batch, pooled_steps, taxels, maps_out]`.
    ///
    /// - `input`, `weight`, `gamma`, `beta`: as for [`Block::forward_train`]
    /// - `mean`, `variance`: `[maps_out]`
    ///
    /// # Panics
    /// If a slice has the wrong length.
    pub fn forward_eval<'a>(
        &self,
        input: &[f32],
        weight: impl Into<Weight<'a>>,
        gamma: &[f32],
        beta: &[f32],
        mean: &[f32],
        variance: &[f32],
    ) -> Vec<f32> {
        let weight = weight.into().of_taps(self.trim);
        self.check(input, &weight, gamma, beta);
        let normalizer = Normalizer::new(mean, variance, gamma, beta);
        let [scale, shift] = [&normalizer.scale, &normalizer.shift].map(|values| octets(values));
        let goal = Goal::outputs(&scale, &shift);
        if let Some(batch_one) = &self.batch_one {
            let mut out = spare::take(self.met.output_len());
            batch_one.forward(input, &weight, goal, &mut out);
            return out;
        }
        let (pooled, saved) = self.convolve(input, &weight, gamma, goal, spare::take);
        self.recycle_route(saved);
        if matches!(self.route, Route::Direct) {
            let mut out = spare::take(self.met.output_len());
            normalizer.rectify(&pooled.winners, &mut out);
            return out;
        }
        self.bytes.give(pooled.positions);
        pooled.winners
    }

    /// Returns the gradients of a forward pass with batch statistics.
    ///
    /// - `saved`: state of that forward pass, from this block
    /// - `gradient`: `[batch, pooled_steps, taxels, maps_out]`, gradient of the pooled output
    ///
    /// # Panics
    /// If `gradient` has the wrong length, or `saved` comes from a block with another route.
    pub fn backward(&self, saved: Saved, gradient: &[f32], need_input: bool) -> Gradients {
        assert_eq!(
            gradient.len(),
            self.met.output_len(),
            "the gradient must have the pooled output's size"
        );
        let mut gated = self.values.take(gradient.len());
        let affine = saved
            .normalizer
            .backward(&self.met, gradient, &saved.winners, &mut gated);
        let output = OutputGradient {
            gradient: &gated,
            positions: &saved.positions,
            affine: &affine,
        };
        let (weight, input) = match (&self.route, saved.route) {
            (Route::Spectral(spectral), SavedRoute::Spectral(route)) => {
                spectral.backward(route, output, need_input)
            }
            (Route::Padded(spectral), SavedRoute::Spectral(route)) => {
                let (weight, input) = spectral.backward(route, output, need_input);
                let (maps, wide) = (self.met.maps_in, spectral.plan.shape.maps_in);
                let taps = self.taps();
                let input = input.map(|input| unpadded(&input, maps, 1, wide));
                (unpadded(&weight, maps, taps, wide), input)
            }
            (Route::FirstLayer(first_layer), SavedRoute::FirstLayer(route)) => {
                first_layer.backward(route, output, need_input)
            }
            (Route::Direct, SavedRoute::Direct(route)) => {
                direct::backward(&self.met, route, output, need_input)
            }
            _ => panic!("the saved state must come from this block"),
        };
        self.values.give(gated);
        self.give_back(saved.winners, saved.positions);
        Gradients {
            weight: match self.trim {
                Some(trim) => trim.expanded(weight),
                None => weight,
            },
            gamma: affine.gamma,
            beta: affine.beta,
            input,
        }
    }

    /// Returns the buffers of a forward pass whose gradient is not needed.
    pub fn recycle(&self, saved: Saved) {
        self.recycle_route(saved.route);
        self.give_back(saved.winners, saved.positions);
    }

    /// Returns buffers to the pools; buffers of the direct route are freed.
    fn give_back(&self, winners: Vec<f32>, positions: Vec<u8>) {
        if !matches!(self.route, Route::Direct) {
            self.values.give(winners);
            self.bytes.give(positions);
        }
    }

    fn recycle_route(&self, saved: SavedRoute) {
        if let (Route::Spectral(spectral) | Route::Padded(spectral), SavedRoute::Spectral(saved)) =
            (&self.route, saved)
        {
            spectral.recycle(saved);
        }
    }

    fn taps(&self) -> usize {
        self.met.kernel[0] * self.met.kernel[1]
    }

    fn check(&self, input: &[f32], weight: &Weight<'_>, gamma: &[f32], beta: &[f32]) {
        let shape = &self.met;
        assert_eq!(
            input.len(),
            shape.input_len(),
            "the input must have the planned size"
        );
        assert_eq!(
            weight.len(),
            self.shape.weight_len(),
            "the weights must have the planned size"
        );
        assert_eq!(
            [gamma.len(), beta.len()],
            [shape.maps_out; 2],
            "gamma and beta must have one value per map"
        );
    }
}

/// Pads `[…, maps, run]` with zeros to `[…, wide, run]`.
fn padded(values: &[f32], maps: usize, run: usize, wide: usize) -> Vec<f32> {
    let mut out = vec![0.0; values.len() / maps * wide];
    for (out, values) in out
        .chunks_exact_mut(wide * run)
        .zip(values.chunks_exact(maps * run))
    {
        out[..maps * run].copy_from_slice(values);
    }
    out
}

/// Cuts `[…, wide, run]` to the first maps, `[…, maps, run]`.
fn unpadded(values: &[f32], maps: usize, run: usize, wide: usize) -> Vec<f32> {
    let mut out = Vec::with_capacity(values.len() / wide * maps);
    for values in values.chunks_exact(wide * run) {
        out.extend_from_slice(&values[..maps * run]);
    }
    out
}

impl Saved {
    /// Returns the step of the winner within each pooling window, `[batch, pooled_steps, taxels, maps_out]`.
    pub fn positions(&self) -> &[u8] {
        &self.positions
    }
}
