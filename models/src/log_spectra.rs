//! Short-time log spectra of all taxels, forward and backward, on plain slices.
//!
//! A window of `W` steps of one taxel gives `bands` values `log10(energy + floor) + 1.5` and, last, the window's mean. A band's energy is a
//! weighted mean of the squared Fourier coefficients of `(x - mean) hann`. The weights are triangles with logarithmically spaced centres from
//! the first bin to the Nyquist frequency, as in a mel filter bank (Davis & Mermelstein, 1980). `hann` has unit energy, so white noise of
//! variance 1 gives energies around 1 for any window length.

use std::f64::consts::PI;
use std::sync::OnceLock;

use pulp::{Arch, NullaryFnOnce};

use crate::filter_bank::{Band, triangles};
use crate::folded_dft::{Folded, FoldedDft, LANES, chunk};

/// Added to energies before the logarithm, in squared units of the sweep.
pub const ENERGY_FLOOR: f32 = 1e-3;
/// Factor that converts natural to decimal logarithms.
pub const LOG_GAIN: f32 = std::f32::consts::LOG10_E;
/// Added to decimal logarithms, so that zero lies halfway between the floor and the energy 1.
pub const LOG_OFFSET: f32 = 1.5;
/// Minimum number of lanes in a block of windows; a block's working memory fits into a core's private cache.
const BLOCK: usize = 256;

/// Plan for the log spectra of all windows of a sweep.
#[derive(Debug, Clone)]
pub(crate) struct LogSpectra {
    transform: FoldedDft,
    hop: usize,
    taxels: usize,
    bands: Vec<Band>,
    tables: OnceLock<SpectralTables>,
}

/// Working memory for one block of windows.
#[derive(Debug, Clone)]
pub(crate) struct Scratch {
    /// Number of windows in a block.
    windows: usize,
    /// Number of taxels in all windows of a block, rounded up to whole vectors.
    lanes: usize,
    folded: Folded,
    /// `[window / 2][lanes]`
    real: Vec<f32>,
    imaginary: Vec<f32>,
    /// `[lanes]`
    mean: Vec<f32>,
    /// `[bands + 1][LANES]`
    rows: Vec<f32>,
}

impl LogSpectra {
    /// - `window`: in steps, a multiple of 4
    /// - `hop`: steps from one window to the next
    /// - `bands`: at most `window / 2`
    pub(crate) fn new(window: usize, hop: usize, bands: usize, taxels: usize) -> Self {
        debug_assert!(hop > 0 && taxels > 0);
        Self {
            transform: FoldedDft::new(window),
            hop,
            taxels,
            bands: triangles(window / 2, bands),
            tables: OnceLock::new(),
        }
    }

    /// Returns the number of values per window and taxel: the bands and the mean.
    pub(crate) fn values(&self) -> usize {
        self.bands.len() + 1
    }

    /// Returns the number of complete windows in a sweep of `steps` steps.
    pub(crate) fn windows(&self, steps: usize) -> usize {
        windows(steps, self.window(), self.hop)
    }

    /// Returns the number of taxels in a sweep.
    pub(crate) fn taxels(&self) -> usize {
        self.taxels
    }

    /// Returns the number of steps in a window.
    pub(crate) fn window(&self) -> usize {
        self.transform.window()
    }

    /// Returns the number of steps from one window to the next.
    pub(crate) fn hop(&self) -> usize {
        self.hop
    }

    /// Allocates working memory for blocks of at most `windows` windows.
    pub(crate) fn scratch(&self, windows: usize) -> Scratch {
        let windows = BLOCK.div_ceil(self.taxels).clamp(1, windows.max(1));
        let lanes = (windows * self.taxels).next_multiple_of(LANES);
        let half = self.window() / 2;
        Scratch {
            windows,
            lanes,
            folded: self.transform.folded(lanes),
            real: vec![0.0; half * lanes],
            imaginary: vec![0.0; half * lanes],
            mean: vec![0.0; lanes],
            rows: vec![0.0; self.values() * LANES],
        }
    }

    /// Computes the log spectra of a sweep.
    ///
    /// - `sweep`: `[steps][taxels]`
    /// - `output`: `[windows][taxels][bands + 1]`
    pub(crate) fn forward(&self, sweep: &[f32], output: &mut [f32], scratch: &mut Scratch) {
        Arch::new().dispatch(Forward {
            plan: self,
            sweep,
            output,
            scratch,
        });
    }

    /// Computes the Fourier coefficients and means of `windows`.
    #[inline(always)]
    fn coefficients(&self, sweep: &[f32], windows: std::ops::Range<usize>, scratch: &mut Scratch) {
        let (window, taxels, lanes) = (self.window(), self.taxels, scratch.lanes);
        let share = 1.0 / window as f32;
        for (place, number) in windows.enumerate() {
            let steps = &sweep[number * self.hop * taxels..][..window * taxels];
            let lane = place * taxels;
            let mean = &mut scratch.mean[lane..lane + taxels];
            mean.fill(0.0);
            for frame in steps.chunks_exact(taxels) {
                mean.iter_mut().zip(frame).for_each(|(m, x)| *m += x);
            }
            mean.iter_mut().for_each(|m| *m *= share);
            self.transform
                .fold(steps, mean, &mut scratch.folded, lane, lanes);
        }
        let (real, imaginary) = (&mut scratch.real, &mut scratch.imaginary);
        self.transform
            .transform(&scratch.folded, real, imaginary, lanes);
    }

    /// Returns a band's energy in sixteen lanes from `lane` on.
    #[inline(always)]
    fn energy(band: &Band, scratch: &Scratch, lane: usize) -> [f32; LANES] {
        let mut energy = [0.0f32; LANES];
        for (bin, weight) in band.weights.iter().enumerate() {
            let at = (band.first + bin) * scratch.lanes + lane;
            let (real, imaginary) = (chunk(&scratch.real, at), chunk(&scratch.imaginary, at));
            for ((sum, re), im) in energy.iter_mut().zip(real).zip(imaginary) {
                *sum += weight * (re * re + im * im);
            }
        }
        energy
    }

    #[inline(always)]
    fn logarithms(&self, output: &mut [f32], scratch: &mut Scratch) {
        let values = self.values();
        for (block, output) in output.chunks_mut(LANES * values).enumerate() {
            let lane = block * LANES;
            for (band, number) in self.bands.iter().zip(0..) {
                let energy = Self::energy(band, scratch, lane);
                let row = &mut scratch.rows[number * LANES..][..LANES];
                for (log, energy) in row.iter_mut().zip(energy) {
                    *log = ln(energy + ENERGY_FLOOR).mul_add(LOG_GAIN, LOG_OFFSET);
                }
            }
            for (lane_in_block, output) in output.chunks_exact_mut(values).enumerate() {
                for (band, value) in output[..values - 1].iter_mut().enumerate() {
                    *value = scratch.rows[band * LANES + lane_in_block];
                }
                output[values - 1] = scratch.mean[lane + lane_in_block];
            }
        }
    }

    /// Adds the gradient with respect to the sweep to `found`.
    ///
    /// - `sweep`, `found`: `[steps][taxels]`
    /// - `gradient`: gradient of the output, `[windows][taxels][bands + 1]`
    pub(crate) fn backward(
        &self,
        sweep: &[f32],
        gradient: &[f32],
        found: &mut [f32],
        scratch: &mut Scratch,
    ) {
        Arch::new().dispatch(Backward {
            plan: self,
            sweep,
            gradient,
            found,
            scratch,
        });
    }

    /// Replaces coefficients and means by the gradients with respect to them.
    #[inline(always)]
    fn of_coefficients(&self, gradient: &[f32], scratch: &mut Scratch) {
        let (values, bins) = (self.values(), self.window() / 2);
        let mut of_bins = vec![0.0f32; bins * LANES];
        for (block, gradient) in gradient.chunks(LANES * values).enumerate() {
            let lane = block * LANES;
            of_bins.fill(0.0);
            for (number, band) in self.bands.iter().enumerate() {
                let energy = Self::energy(band, scratch, lane);
                let mut own = [0.0f32; LANES];
                for (own, gradient) in own.iter_mut().zip(gradient.chunks_exact(values)) {
                    *own = gradient[number];
                }
                for (own, energy) in own.iter_mut().zip(energy) {
                    *own *= 2.0 * LOG_GAIN / (energy + ENERGY_FLOOR);
                }
                for (bin, weight) in band.weights.iter().enumerate() {
                    let bins = &mut of_bins[(band.first + bin) * LANES..][..LANES];
                    for (bin, own) in bins.iter_mut().zip(own) {
                        *bin += weight * own;
                    }
                }
            }
            for (bin, own) in of_bins.chunks_exact(LANES).enumerate() {
                let at = bin * scratch.lanes + lane;
                for part in [&mut scratch.real, &mut scratch.imaginary] {
                    let part = &mut part[at..at + LANES];
                    part.iter_mut().zip(own).for_each(|(p, own)| *p *= own);
                }
            }
            for (lane_in_block, gradient) in gradient.chunks_exact(values).enumerate() {
                scratch.mean[lane + lane_in_block] = gradient[values - 1];
            }
        }
    }

    #[inline(always)]
    fn of_steps(&self, found: &mut [f32], windows: std::ops::Range<usize>, scratch: &mut Scratch) {
        let (window, taxels, lanes) = (self.window(), self.taxels, scratch.lanes);
        for (place, number) in windows.enumerate() {
            let found = &mut found[number * self.hop * taxels..][..window * taxels];
            let lane = place * taxels;
            let mean = &mut scratch.mean[lane..lane + taxels];
            self.transform
                .unfold(&scratch.folded, mean, found, lane, lanes);
        }
    }

    /// Returns the transform as matrices, for devices and programs without this operation.
    pub(crate) fn tables(&self) -> &SpectralTables {
        self.tables.get_or_init(|| self.new_tables())
    }

    fn new_tables(&self) -> SpectralTables {
        let (window, hann) = (self.window(), self.transform.hann());
        let bins = window / 2;
        let angle =
            |n: usize, bin: usize| 2.0 * PI * ((n * (bin + 1)) % window) as f64 / window as f64;
        let mut fourier = Vec::with_capacity(2 * bins * window);
        for wave in [f64::cos, f64::sin] {
            for bin in 0..bins {
                let of = |n: usize| f64::from(hann[n]) * wave(angle(n, bin));
                let mean = (0..window).map(of).sum::<f64>() / window as f64;
                fourier.extend((0..window).map(|n| (of(n) - mean) as f32));
            }
        }
        let mut bands = vec![0.0; self.bands.len() * bins];
        for (band, weights) in self.bands.iter().zip(bands.chunks_exact_mut(bins)) {
            weights[band.first..][..band.weights.len()].copy_from_slice(&band.weights);
        }
        SpectralTables {
            bins,
            fourier,
            bands,
        }
    }
}

/// See [`LogSpectra::forward`].
struct Forward<'a> {
    plan: &'a LogSpectra,
    sweep: &'a [f32],
    output: &'a mut [f32],
    scratch: &'a mut Scratch,
}

impl NullaryFnOnce for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let (plan, scratch) = (self.plan, self.scratch);
        let row = plan.taxels * plan.values();
        let windows = plan.windows(self.sweep.len() / plan.taxels);
        debug_assert_eq!(self.output.len(), windows * row);
        for first in (0..windows).step_by(scratch.windows) {
            let count = (windows - first).min(scratch.windows);
            plan.coefficients(self.sweep, first..first + count, scratch);
            let output = &mut self.output[first * row..(first + count) * row];
            plan.logarithms(output, scratch);
        }
    }
}

/// See [`LogSpectra::backward`].
struct Backward<'a> {
    plan: &'a LogSpectra,
    sweep: &'a [f32],
    gradient: &'a [f32],
    found: &'a mut [f32],
    scratch: &'a mut Scratch,
}

impl NullaryFnOnce for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let (plan, scratch) = (self.plan, self.scratch);
        let row = plan.taxels * plan.values();
        let windows = plan.windows(self.sweep.len() / plan.taxels);
        for first in (0..windows).step_by(scratch.windows) {
            let count = (windows - first).min(scratch.windows);
            plan.coefficients(self.sweep, first..first + count, scratch);
            let gradient = &self.gradient[first * row..(first + count) * row];
            plan.of_coefficients(gradient, scratch);
            let lanes = scratch.lanes;
            let (real, imaginary) = (&scratch.real, &scratch.imaginary);
            plan.transform
                .transform_back(real, imaginary, &mut scratch.folded, lanes);
            plan.of_steps(self.found, first..first + count, scratch);
        }
    }
}

/// Log spectra of a window as matrices: `LOG_GAIN ln(bands (real^2 + imaginary^2) + ENERGY_FLOOR) + LOG_OFFSET`.
///
/// `fourier` maps the raw window to real and imaginary parts.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralTables {
    /// Number of frequencies, without the constant one.
    pub bins: usize,
    /// `[2 x bins][window]`: real parts, then imaginary parts; includes the window function and the subtraction of the mean.
    pub fourier: Vec<f32>,
    /// `[bands][bins]`
    pub bands: Vec<f32>,
}

/// Returns the number of complete windows among `steps` steps, one every `hop`.
pub(crate) fn windows(steps: usize, window: usize, hop: usize) -> usize {
    match steps.checked_sub(window) {
        Some(left) => left / hop + 1,
        None => 0,
    }
}

/// Returns the natural logarithm of a positive normal number to about one ulp, in operations that vectorise.
///
/// Polynomial: S. Moshier, Cephes mathematical library, `logf`.
#[inline(always)]
fn ln(x: f32) -> f32 {
    const HALF_ROOT: u32 = 0x3f35_04f3;
    let exponent = (x.to_bits().wrapping_sub(HALF_ROOT) as i32) >> 23;
    let mantissa = f32::from_bits(x.to_bits().wrapping_sub((exponent as u32) << 23));
    let f = mantissa - 1.0;
    let square = f * f;
    let coefficients = [
        -1.151_461e-1_f32,
        1.167_699_9e-1,
        -1.242_014_1e-1,
        1.424_932_3e-1,
        -1.666_805_8e-1,
        2.000_071_5e-1,
        -2.499_999_4e-1,
        0.333_333_3,
    ];
    let mut sum = 7.037_684e-2_f32;
    for coefficient in coefficients {
        sum = sum.mul_add(f, coefficient);
    }
    let exponent = exponent as f32;
    let small = exponent.mul_add(-2.121_944_4e-4, sum * f * square);
    let result = f + (small - 0.5 * square);
    exponent.mul_add(0.693_359_4, result)
}

#[cfg(test)]
mod tests;
