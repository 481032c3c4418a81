//! Spectral part of the signal statistics.

use super::statistics::{BAND_EDGES_HZ, LAGS};
use rustfft::{Fft, FftPlanner, num_complex::Complex};
use std::sync::Arc;

/// Bands of the power law between level and fluctuation, Hz.
const LEVEL_BANDS_HZ: [[f64; 2]; 2] = [[2.0, 60.0], [150.0, 375.0]];
/// Bands of the correlation between taxels, Hz.
const CORRELATION_BANDS_HZ: [[f64; 2]; 2] = [[2.0, 20.0], [20.0, 200.0]];
/// Band of the intermittency, Hz.
const INTERMITTENCY_HZ: [f64; 2] = [20.0, 60.0];
/// Number of windows of the intermittency: 100 steps each in a sweep of 1000.
const WINDOWS: usize = 8;
/// Frequency range of the spectral slope, Hz.
const SLOPE_HZ: [f64; 2] = [5.0, 100.0];
/// Minimum mean level of a taxel for the power law, digits: the dead zone cuts lower levels.
const LEAST_LEVEL: f64 = 5.0;

/// Contributions of one sweep to the spectral figures.
pub(super) struct SweepSpectra {
    /// Sum over the taxels of their periodograms, each divided by its own sum; bin 0 is 0.
    shares: Vec<f64>,
    /// Number of taxels in that sum.
    moving: usize,
    /// Autocorrelation at [`LAGS`] of each taxel that changes in the tail.
    autocorrelation: Vec<[f64; 4]>,
    /// Logarithms of the level and of the rms fluctuation of each taxel, in each band.
    fluctuation: [Vec<[f64; 2]>; 2],
    /// Standard deviation of the logarithm of a window's power, for each taxel with a sufficient level.
    intermittency: Vec<f64>,
    /// Sum of the correlations of taxel pairs, and number of pairs, in each band.
    correlation: [(f64, f64); 2],
}

/// Fourier transforms of a sweep and of its tail.
struct Transforms {
    whole: Arc<dyn Fft<f64>>,
    tail: Arc<dyn Fft<f64>>,
    tail_back: Arc<dyn Fft<f64>>,
    sample_rate_hz: f64,
}

impl Transforms {
    fn new(steps: usize, tail_steps: usize, sample_rate_hz: f64) -> Self {
        let mut planner = FftPlanner::new();
        Self {
            whole: planner.plan_fft_forward(steps),
            tail: planner.plan_fft_forward(tail_steps),
            tail_back: planner.plan_fft_inverse(tail_steps),
            sample_rate_hz,
        }
    }

    /// Returns true if a bin of a transform of `n` steps is in the band, in Hz.
    fn in_band(&self, bin: usize, n: usize, [low, high]: [f64; 2]) -> bool {
        let frequency = bin as f64 * self.sample_rate_hz / n as f64;
        (low..high).contains(&frequency)
    }
}

impl SweepSpectra {
    /// Analyses one sweep, `[steps][taxels]`.
    pub(super) fn measure(sweep: &[f32], taxels: usize, sample_rate_hz: f64) -> Self {
        let steps = sweep.len() / taxels;
        let tail_start = steps / 5;
        let transforms = Transforms::new(steps, steps - tail_start, sample_rate_hz);
        let bins = steps / 2 + 1;
        let mut found = Self {
            shares: vec![0.0; bins],
            moving: 0,
            autocorrelation: Vec::new(),
            fluctuation: [Vec::new(), Vec::new()],
            intermittency: Vec::new(),
            correlation: [(0.0, 0.0); 2],
        };
        let mut directions = [0, 1].map(|_| (vec![Complex::new(0.0, 0.0); bins], 0.0));
        for taxel in 0..taxels {
            let series: Vec<f64> = sweep[taxel..]
                .iter()
                .step_by(taxels)
                .map(|&x| f64::from(x))
                .collect();
            let centred = without_mean(&series);
            if centred.iter().all(|&x| x == 0.0) {
                continue;
            }
            let powers = one_sided(&transform(&*transforms.whole, &centred), steps);
            let sum: f64 = powers.iter().sum();
            found
                .shares
                .iter_mut()
                .zip(&powers)
                .for_each(|(share, power)| *share += power / sum);
            found.moving += 1;

            let spectrum = transform(&*transforms.whole, &without_trend(&series));
            for (band, (direction, members)) in
                CORRELATION_BANDS_HZ.into_iter().zip(&mut directions)
            {
                let bins = || (0..bins).filter(|&bin| transforms.in_band(bin, steps, band));
                let norm = bins()
                    .map(|bin| spectrum[bin].norm_sqr())
                    .sum::<f64>()
                    .sqrt();
                if norm > 0.0 {
                    bins().for_each(|bin| direction[bin] += spectrum[bin] / norm);
                    *members += 1.0;
                }
            }
            found.add_tail(&series[tail_start..], &transforms);
        }
        // |sum of unit vectors|^2 = n + 2 (sum of the cosines of all pairs)
        found.correlation = directions.map(|(direction, n)| {
            let square: f64 = direction.iter().map(Complex::norm_sqr).sum();
            ((square - n) / 2.0, n * (n - 1.0) / 2.0)
        });
        found
    }

    /// Adds the figures of a taxel that are measured without the first fifth of the sweep.
    fn add_tail(&mut self, tail: &[f64], transforms: &Transforms) {
        let level = tail.iter().sum::<f64>() / tail.len() as f64;
        let detrended = without_trend(tail);
        let energy: f64 = detrended.iter().map(|x| x * x).sum();
        if energy <= 1e-9 || tail.len() <= LAGS[3] {
            return;
        }
        self.autocorrelation.push(LAGS.map(|lag| {
            detrended
                .iter()
                .zip(&detrended[lag..])
                .map(|(a, b)| a * b)
                .sum::<f64>()
                / energy
        }));
        if level < LEAST_LEVEL {
            return;
        }
        let spectrum = transform(&*transforms.tail, &detrended);
        let band = spectrum.iter().enumerate().map(|(bin, &value)| {
            let bin = bin.min(tail.len() - bin);
            if transforms.in_band(bin, tail.len(), INTERMITTENCY_HZ) {
                value
            } else {
                Complex::default()
            }
        });
        self.intermittency
            .extend(unsteadiness(&*transforms.tail_back, band.collect()));
        let powers = one_sided(&spectrum, tail.len());
        for (band, points) in LEVEL_BANDS_HZ.into_iter().zip(&mut self.fluctuation) {
            let power: f64 = powers
                .iter()
                .enumerate()
                .filter(|(bin, _)| transforms.in_band(*bin, tail.len(), band))
                .map(|(_, p)| p)
                .sum();
            if power > 0.0 {
                points.push([level.ln(), power.ln() / 2.0]);
            }
        }
    }

    fn mean_shares(sweeps: &[&Self]) -> Vec<f64> {
        let moving: usize = sweeps.iter().map(|s| s.moving).sum();
        let bins = sweeps.first().map_or(0, |s| s.shares.len());
        (0..bins)
            .map(|bin| sweeps.iter().map(|s| s.shares[bin]).sum::<f64>() / moving as f64)
            .collect()
    }

    pub(super) fn energy_bands(sweeps: &[&Self], steps: usize, sample_rate_hz: f64) -> [f64; 5] {
        let shares = Self::mean_shares(sweeps);
        std::array::from_fn(|band| {
            let high = BAND_EDGES_HZ
                .get(band + 1)
                .copied()
                .unwrap_or(f64::INFINITY);
            let inside = |bin: usize| {
                (BAND_EDGES_HZ[band]..high).contains(&(bin as f64 * sample_rate_hz / steps as f64))
            };
            shares
                .iter()
                .enumerate()
                .filter(|(bin, _)| inside(*bin))
                .map(|(_, share)| share)
                .sum()
        })
    }

    pub(super) fn slope(sweeps: &[&Self], steps: usize, sample_rate_hz: f64) -> f64 {
        let points: Vec<[f64; 2]> = Self::mean_shares(sweeps)
            .into_iter()
            .enumerate()
            .map(|(bin, share)| (bin as f64 * sample_rate_hz / steps as f64, share))
            .filter(|&(hz, share)| (SLOPE_HZ[0]..=SLOPE_HZ[1]).contains(&hz) && share > 0.0)
            .map(|(hz, share)| [hz.ln(), share.ln()])
            .collect();
        slope(&points)
    }

    pub(super) fn autocorrelation(sweeps: &[&Self]) -> [f64; 4] {
        std::array::from_fn(|lag| {
            let values = sweeps
                .iter()
                .flat_map(|s| s.autocorrelation.iter().map(|r| r[lag]));
            median(values.collect())
        })
    }

    pub(super) fn level_exponents(sweeps: &[&Self]) -> [f64; 2] {
        [0, 1].map(|band| {
            slope(
                &sweeps
                    .iter()
                    .flat_map(|s| s.fluctuation[band].iter().copied())
                    .collect::<Vec<_>>(),
            )
        })
    }

    /// Returns the standard deviation of the logarithm of the fluctuation from the power law.
    pub(super) fn level_residuals(sweeps: &[&Self]) -> [f64; 2] {
        [0, 1].map(|band| {
            let points: Vec<[f64; 2]> = sweeps
                .iter()
                .flat_map(|s| s.fluctuation[band].iter().copied())
                .collect();
            let rest: Vec<f64> = points
                .iter()
                .map(|[level, fluctuation]| fluctuation - slope(&points) * level)
                .collect();
            let centred = without_mean(&rest);
            (centred.iter().map(|x| x * x).sum::<f64>() / centred.len() as f64).sqrt()
        })
    }

    pub(super) fn intermittency(sweeps: &[&Self]) -> f64 {
        let all = sweeps.iter().flat_map(|s| s.intermittency.iter().copied());
        median(all.collect())
    }

    pub(super) fn taxel_correlation(sweeps: &[&Self]) -> [f64; 2] {
        [0, 1].map(|band| {
            let (sum, pairs) = sweeps
                .iter()
                .map(|s| s.correlation[band])
                .fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
            sum / pairs
        })
    }
}

/// Returns the upper median; NaN for an empty list.
fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Returns the standard deviation over the windows of the logarithm of a window's power; `None` for a sweep that is too
/// short.
///
/// - `band`: two-sided spectrum of the analysed band
fn unsteadiness(back: &dyn Fft<f64>, mut band: Vec<Complex<f64>>) -> Option<f64> {
    // Smallest power of a window, below the resolution of 8-bit digits.
    const LEAST_POWER: f64 = 1e-6;
    let n = band.len();
    back.process(&mut band);
    let width = n / WINDOWS;
    if width < 2 {
        return None;
    }
    let logs: Vec<f64> = band
        .chunks_exact(width)
        .take(WINDOWS)
        .map(|window| {
            let sum: f64 = window.iter().map(|x| (x.re / n as f64).powi(2)).sum();
            (sum / width as f64).max(LEAST_POWER).ln()
        })
        .collect();
    let centred = without_mean(&logs);
    Some((centred.iter().map(|x| x * x).sum::<f64>() / (WINDOWS - 1) as f64).sqrt())
}

fn without_mean(series: &[f64]) -> Vec<f64> {
    let mean = series.iter().sum::<f64>() / series.len() as f64;
    series.iter().map(|x| x - mean).collect()
}

fn without_trend(series: &[f64]) -> Vec<f64> {
    let centre = (series.len() as f64 - 1.0) / 2.0;
    let centred = without_mean(series);
    let moment: f64 = centred
        .iter()
        .enumerate()
        .map(|(t, x)| (t as f64 - centre) * x)
        .sum();
    let spread: f64 = (0..series.len()).map(|t| (t as f64 - centre).powi(2)).sum();
    let slope = if spread > 0.0 { moment / spread } else { 0.0 };
    centred
        .iter()
        .enumerate()
        .map(|(t, x)| x - slope * (t as f64 - centre))
        .collect()
}

fn transform(fft: &dyn Fft<f64>, series: &[f64]) -> Vec<Complex<f64>> {
    let mut spectrum: Vec<Complex<f64>> = series.iter().map(|&x| Complex::new(x, 0.0)).collect();
    fft.process(&mut spectrum);
    spectrum
}

/// Returns the power per bin from 0 to half the sample rate; bin 0 is set to 0.
fn one_sided(spectrum: &[Complex<f64>], n: usize) -> Vec<f64> {
    (0..n / 2 + 1)
        .map(|bin| match bin {
            0 => 0.0,
            _ if 2 * bin == n => spectrum[bin].norm_sqr(),
            _ => 2.0 * spectrum[bin].norm_sqr(),
        })
        .collect()
}

/// Returns the least-squares slope through `[x, y]` points; NaN for fewer than two.
fn slope(points: &[[f64; 2]]) -> f64 {
    let n = points.len() as f64;
    let mean = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
    let moment = |k: usize| {
        points
            .iter()
            .map(|p| (p[0] - mean[0]) * (p[k] - mean[k]))
            .sum::<f64>()
    };
    moment(1) / moment(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 750.0;

    fn sweep(taxel: impl Fn(usize, f64) -> f64) -> Vec<f32> {
        (0..1000)
            .flat_map(|t| [0, 1].map(|k| taxel(k, t as f64 / RATE_HZ) as f32))
            .collect()
    }

    #[test]
    fn a_tone_lies_in_its_band_and_decorrelates_as_a_cosine() {
        let tau = std::f64::consts::TAU;
        let spectra =
            SweepSpectra::measure(&sweep(|_, t| 10.0 + (tau * 37.5 * t).sin()), 2, RATE_HZ);
        let bands = SweepSpectra::energy_bands(&[&spectra], 1000, RATE_HZ);
        for (found, wanted) in bands.into_iter().zip([0.0, 0.0, 1.0, 0.0, 0.0]) {
            assert!((found - wanted).abs() < 1e-6, "{bands:?}");
        }
        // 20 steps are one period; the estimate is biased by (n - lag) / n, with n = 800.
        let [_, quarter, period, _] = SweepSpectra::autocorrelation(&[&spectra]);
        assert!(
            quarter.abs() < 0.01 && (period - 780.0 / 800.0).abs() < 0.01,
            "{quarter} {period}"
        );
        let [slow, fast] = SweepSpectra::taxel_correlation(&[&spectra]);
        assert!(!slow.is_nan() && (fast - 1.0).abs() < 1e-6, "{slow} {fast}");
    }

    #[test]
    fn fluctuation_in_proportion_to_the_level_has_exponent_one() {
        let tau = std::f64::consts::TAU;
        let level = |k: usize| [8.0, 32.0][k];
        let tones = |t: f64| (tau * 15.0 * t).sin() + (tau * 300.0 * t).sin();
        let spectra =
            SweepSpectra::measure(&sweep(|k, t| level(k) * (1.0 + 0.1 * tones(t))), 2, RATE_HZ);
        for exponent in SweepSpectra::level_exponents(&[&spectra]) {
            assert!((exponent - 1.0).abs() < 1e-3, "{exponent}");
        }
    }

    #[test]
    fn a_texture_that_comes_and_goes_is_intermittent() {
        let tau = std::f64::consts::TAU;
        let measured = |strength: fn(f64) -> f64| {
            let x = |_, t: f64| 20.0 + strength(t) * (tau * 37.5 * t).sin();
            SweepSpectra::intermittency(&[&SweepSpectra::measure(&sweep(x), 2, RATE_HZ)])
        };
        assert!(measured(|_| 2.0) < 0.01);
        // Two of eight windows with a tenth of the amplitude: ln of the power is lower by 4.6; cut at a band's edges, a little less.
        let found = measured(|t| if t < 400.0 / RATE_HZ { 0.2 } else { 2.0 });
        assert!((found - 2.1).abs() < 0.3, "{found}");
    }

    #[test]
    fn constant_taxels_are_left_out() {
        let spectra = SweepSpectra::measure(&sweep(|k, t| k as f64 * (20.0 * t).sin()), 2, RATE_HZ);
        assert_eq!(spectra.moving, 1);
        assert_eq!(spectra.correlation[1].1, 0.0);
    }
}
