//! Hand-designed spectral features: L (three numbers) and H (short-time spectrum).
//!
//! Both follow Baishya & Bäuml (IROS 2016, section III), the baselines of the thesis (section 4.4.1). Spectra are unitary (factor `1/sqrt(N)`).
//! Taxels are combined with weights `w_m`: the sum of a taxel over the sweep divided by the sum over all taxels. If means are removed, these sums
//! are zero and all taxels have equal weights.

use std::sync::Arc;

use realfft::{RealFftPlanner, RealToComplex, num_complex::Complex};
use tactnet_data::SweepShape;

use crate::{MeanRemoval, PipelineError};

/// Width of a frequency band of the H-features, and limit between the two bands of the L-features, in Hz.
const BAND_HZ: f64 = 20.0;
/// Lowest frequency in the L-features, in Hz.
const LOWEST_HZ: f64 = 2.0;
/// Window of the short-time spectrum, in seconds.
const WINDOW_SECONDS: f64 = 0.1;
/// Lowest sample rate of L- and H-features, in Hz. Below it half the rate lies in the first band: the L-features lack their second band, and
/// the H-features, which are shares of the power, are all 1.
const LEAST_RATE_HZ: f64 = 2.0 * BAND_HZ;
/// Time between successive windows, in seconds.
const HOP_SECONDS: f64 = 0.05;

/// Extractor of L-features for sweeps of one shape and rate.
pub struct LowFeatures {
    shape: SweepShape,
    rate: f64,
    levels: MeanRemoval,
    transform: Arc<dyn RealToComplex<f64>>,
}

impl LowFeatures {
    /// Number of features: roughness, centroid above and below 20 Hz.
    pub const WIDTH: usize = 3;

    /// Creates an extractor for sweeps of `shape` at `rate` frames per second.
    ///
    /// # Errors
    /// A rate or length that leaves one of the two bands without a frequency.
    pub fn new(shape: SweepShape, rate: f64, levels: MeanRemoval) -> Result<Self, PipelineError> {
        Self::check(shape, rate)?;
        Ok(Self {
            shape,
            rate,
            levels,
            transform: RealFftPlanner::new().plan_fft_forward(shape.steps),
        })
    }

    /// Succeeds if the features exist for sweeps of this shape and rate.
    ///
    /// # Errors
    /// As [`LowFeatures::new`].
    pub fn check(shape: SweepShape, rate: f64) -> Result<(), PipelineError> {
        enough_bands("L-features", rate)?;
        for (low, high) in [(LOWEST_HZ, BAND_HZ), (BAND_HZ, rate / 2.0)] {
            if bins(shape.steps, rate, low, high).is_empty() {
                let needed = format!("a frequency between {low} and {high:.0} Hz");
                return Err(too_short("L-features", needed, shape, rate));
            }
        }
        Ok(())
    }

    /// Returns the extractor of sweeps of another length.
    ///
    /// # Panics
    /// If [`LowFeatures::check`] refuses this length.
    pub(crate) fn at_length(&self, steps: usize) -> Self {
        let shape = SweepShape {
            steps,
            ..self.shape
        };
        Self::new(shape, self.rate, self.levels)
            .unwrap_or_else(|error| panic!("the length was checked: {error}"))
    }

    fn bins(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        bins(self.shape.steps, self.rate, low, high)
    }

    /// Returns the features of one sweep, `[steps][taxels]`:
    ///
    /// - `ln(sum over taxels of the mean |S|^2)`, 20 Hz to half the rate;
    /// - centroids `sum |S_q| f_q / sum |S_q|` of that band and of 2 to 20 Hz, in Hz, weighted over taxels.
    pub fn of(&self, sweep: &[f32]) -> [f32; Self::WIDTH] {
        let taxels = self.shape.taxels();
        let weights = taxel_weights(sweep, taxels, self.levels);
        let low = self.bins(LOWEST_HZ, BAND_HZ);
        let high = self.bins(BAND_HZ, self.rate / 2.0);
        let per_bin = self.rate / self.shape.steps as f64;
        let mut input = self.transform.make_input_vec();
        let mut spectrum = self.transform.make_output_vec();
        let (mut power, mut centroids) = (0.0, [0.0; 2]);
        for taxel in 0..taxels {
            for (value, frame) in input.iter_mut().zip(sweep.chunks_exact(taxels)) {
                *value = f64::from(frame[taxel]);
            }
            transform(&self.transform, &mut input, &mut spectrum);
            let band = &spectrum[high.clone()];
            let mean = band.iter().map(Complex::norm_sqr).sum::<f64>() / band.len() as f64;
            power += mean / self.shape.steps as f64;
            for (centroid, bins) in centroids.iter_mut().zip([&high, &low]) {
                let (mut sum, mut moment) = (0.0, 0.0);
                for bin in bins.clone() {
                    let amplitude = spectrum[bin].norm();
                    sum += amplitude;
                    moment += amplitude * bin as f64 * per_bin;
                }
                if sum > 0.0 {
                    *centroid += weights[taxel] * moment / sum;
                }
            }
        }
        // The floor replaces the logarithm of rounding noise for a constant sweep.
        [
            power.max(1e-12).ln() as f32,
            centroids[0] as f32,
            centroids[1] as f32,
        ]
    }
}

/// Extractor of H-features for sweeps of one shape and rate.
pub struct HighFeatures {
    shape: SweepShape,
    rate: f64,
    levels: MeanRemoval,
    transform: Arc<dyn RealToComplex<f64>>,
    /// First step of every window.
    starts: Vec<usize>,
    bands: usize,
}

impl HighFeatures {
    /// Creates an extractor for sweeps of `shape` at `rate` frames per second.
    ///
    /// # Errors
    /// A sweep shorter than one window of 0.1 s; a rate below [`LEAST_RATE_HZ`].
    pub fn new(shape: SweepShape, rate: f64, levels: MeanRemoval) -> Result<Self, PipelineError> {
        Self::check(shape, rate)?;
        let window = (WINDOW_SECONDS * rate).round() as usize;
        let hop = HOP_SECONDS * rate;
        let windows = windows(shape.steps, rate);
        Ok(Self {
            shape,
            rate,
            levels,
            transform: RealFftPlanner::new().plan_fft_forward(window),
            starts: (0..windows)
                .map(|window| (window as f64 * hop).round() as usize)
                .collect(),
            bands: (rate / 2.0 / BAND_HZ + 1e-9).floor() as usize + 1,
        })
    }

    /// Succeeds if the features exist for sweeps of this shape and rate.
    ///
    /// # Errors
    /// As [`HighFeatures::new`].
    pub fn check(shape: SweepShape, rate: f64) -> Result<(), PipelineError> {
        enough_bands("H-features", rate)?;
        let window = (WINDOW_SECONDS * rate).round() as usize;
        if shape.steps < window {
            let needed = format!("a window of {WINDOW_SECONDS} s");
            return Err(too_short("H-features", needed, shape, rate));
        }
        Ok(())
    }

    /// Returns the number of features: windows times bands (760 for 1500 steps at 750 Hz).
    pub fn width(&self) -> usize {
        self.starts.len() * self.bands
    }

    /// Writes the features of one sweep (`[steps][taxels]`), `[windows][bands]`: power in bands of 20 Hz, weighted over taxels, divided by the sum over
    /// the bands of the window. Windows that a shorter sweep does not have get the mean of those that it has.
    ///
    /// # Panics
    /// If `out` has another length.
    pub fn write(&self, sweep: &[f32], out: &mut [f32]) {
        assert_eq!(out.len(), self.width(), "features of a sweep");
        let taxels = self.shape.taxels();
        let weights = taxel_weights(sweep, taxels, self.levels);
        let per_bin = self.rate / self.transform.len() as f64;
        let mut input = self.transform.make_input_vec();
        let mut spectrum = self.transform.make_output_vec();
        let mut power = vec![0.0_f64; self.bands];
        let windows = windows(sweep.len() / taxels, self.rate).min(self.starts.len());
        let (out, missing) = out.split_at_mut(windows * self.bands);
        for (&start, out) in self.starts.iter().zip(out.chunks_exact_mut(self.bands)) {
            power.fill(0.0);
            for taxel in 0..taxels {
                let frames = sweep[start * taxels..].chunks_exact(taxels);
                input.fill(0.0);
                for (value, frame) in input.iter_mut().zip(frames) {
                    *value = f64::from(frame[taxel]);
                }
                transform(&self.transform, &mut input, &mut spectrum);
                for (bin, value) in spectrum.iter().enumerate() {
                    let band = (bin as f64 * per_bin / BAND_HZ + 1e-9).floor() as usize;
                    power[band.min(self.bands - 1)] += weights[taxel] * value.norm_sqr();
                }
            }
            let sum: f64 = power.iter().sum();
            for (out, power) in out.iter_mut().zip(&power) {
                *out = if sum > 0.0 { (power / sum) as f32 } else { 0.0 };
            }
        }
        for missing in missing.chunks_exact_mut(self.bands) {
            for (band, missing) in missing.iter_mut().enumerate() {
                let of_band = out.iter().skip(band).step_by(self.bands);
                *missing = of_band.sum::<f32>() / windows as f32;
            }
        }
    }
}

/// Returns the number of windows of a sweep: as many hops as fit (40 for 1500 steps at 750 Hz). Zeros fill a window that reaches beyond the
/// end.
fn windows(steps: usize, rate: f64) -> usize {
    (steps as f64 / (HOP_SECONDS * rate) + 1e-9).floor() as usize
}

/// Returns the weight of each taxel; the weights sum to one.
fn taxel_weights(sweep: &[f32], taxels: usize, levels: MeanRemoval) -> Vec<f64> {
    let equal = || vec![1.0 / taxels as f64; taxels];
    if levels == MeanRemoval::PerSweep {
        return equal();
    }
    let mut sums = vec![0.0_f64; taxels];
    for frame in sweep.chunks_exact(taxels) {
        sums.iter_mut()
            .zip(frame)
            .for_each(|(sum, v)| *sum += f64::from(*v));
    }
    let total: f64 = sums.iter().sum();
    if total == 0.0 {
        return equal();
    }
    sums.iter().map(|sum| sum / total).collect()
}

/// Transforms `input`, which is overwritten.
fn transform(
    transform: &Arc<dyn RealToComplex<f64>>,
    input: &mut [f64],
    spectrum: &mut [Complex<f64>],
) {
    transform
        .process(input, spectrum)
        .unwrap_or_else(|error| panic!("buffers were made by the plan: {error}"));
}

/// Returns the bins from `low` to below `high`; up to the Nyquist frequency inclusive if `high` reaches it.
fn bins(steps: usize, rate: f64, low: f64, high: f64) -> std::ops::Range<usize> {
    let per_bin = rate / steps as f64;
    let bins = steps / 2 + 1;
    // A bin that equals the limit up to rounding belongs above it.
    let first = |hz: f64| (hz / per_bin - 1e-9).ceil().max(0.0) as usize;
    let end = if high >= rate / 2.0 {
        bins
    } else {
        first(high)
    };
    first(low).min(end)..end
}

/// Succeeds if half the rate reaches the second frequency band.
fn enough_bands(what: &str, rate: f64) -> Result<(), PipelineError> {
    if rate >= LEAST_RATE_HZ {
        return Ok(());
    }
    let needed = format!("at least {LEAST_RATE_HZ} Hz for {what}");
    Err(PipelineError::incompatible(
        "sample rate",
        needed,
        format!("{rate} Hz"),
    ))
}

fn too_short(what: &str, needed: String, shape: SweepShape, rate: f64) -> PipelineError {
    PipelineError::incompatible(
        "sweeps",
        format!("sweeps with {needed} for {what}"),
        format!("{} steps at {rate} Hz", shape.steps),
    )
}
