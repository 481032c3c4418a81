//! Mean and logarithmic power spectrum of every taxel: a linear classifier can read band powers from these.

use std::sync::Arc;

use realfft::{RealFftPlanner, RealToComplex};
use tactnet_data::SweepShape;

use crate::PipelineError;

/// Number of bands from the lowest frequency to half the rate, with widths in geometric progression. Bands without a frequency are left out.
const BANDS: usize = 14;
/// Floor added to the power of a band: a thousandth of a squared digit.
const LEAST_POWER: f64 = 1e-3;

/// Extractor of logarithmic spectra for sweeps of one shape and rate.
pub struct LogSpectra {
    taxels: usize,
    steps: usize,
    transform: Arc<dyn RealToComplex<f64>>,
    /// Frequency bins of each band.
    bands: Vec<std::ops::Range<usize>>,
    /// Factor of each band's power that makes up for another number of bins than in the longest sweep.
    gains: Vec<f64>,
}

impl LogSpectra {
    /// For sweeps of `shape`.
    ///
    /// # Errors
    /// Sweeps of fewer than four steps.
    pub fn new(shape: SweepShape, rate: f64) -> Result<Self, PipelineError> {
        Self::check(shape, rate)?;
        let last = (shape.steps / 2) as f64;
        let edge = |band: usize| last.powf(band as f64 / BANDS as f64);
        // From bin 1, which is one period per sweep, to the last bin.
        let bins = |band: usize| {
            let end = edge(band + 1).round() as usize + usize::from(band + 1 == BANDS);
            edge(band).round() as usize..end
        };
        let bands: Vec<_> = (0..BANDS)
            .map(bins)
            .filter(|bins| !bins.is_empty())
            .collect();
        Ok(Self {
            taxels: shape.taxels(),
            steps: shape.steps,
            transform: RealFftPlanner::new().plan_fft_forward(shape.steps),
            gains: vec![1.0; bands.len()],
            bands,
        })
    }

    /// Returns the extractor of sweeps of another length, with bands at the same frequencies. A band that is narrower than the distance of two
    /// frequencies takes the nearest one.
    pub(crate) fn at_length(&self, steps: usize) -> Self {
        let ratio = steps as f64 / self.steps as f64;
        let last = steps / 2;
        let scaled = |bins: &std::ops::Range<usize>| {
            // Edges lie between two bins.
            let edge = |bin: usize| ((bin as f64 - 0.5) * ratio + 0.5).round() as usize;
            let start = edge(bins.start).clamp(1, last.max(1));
            start..edge(bins.end).clamp(start + 1, last.max(1) + 1)
        };
        let bands: Vec<_> = self.bands.iter().map(scaled).collect();
        let pairs = self.bands.iter().zip(&bands);
        let gains = pairs.map(|(known, own)| known.len() as f64 / own.len() as f64);
        Self {
            taxels: self.taxels,
            steps,
            transform: RealFftPlanner::new().plan_fft_forward(steps),
            gains: gains.collect(),
            bands,
        }
    }

    /// Succeeds if the features exist for sweeps of this shape.
    ///
    /// # Errors
    /// Sweeps of fewer than four steps.
    pub fn check(shape: SweepShape, rate: f64) -> Result<(), PipelineError> {
        if shape.steps >= 4 {
            return Ok(());
        }
        let found = format!("{} steps at {rate} Hz", shape.steps);
        Err(PipelineError::incompatible(
            "sweeps",
            "at least 4 steps for a spectrum",
            found,
        ))
    }

    /// Returns the number of bands of each taxel.
    pub fn bands(&self) -> usize {
        self.bands.len()
    }

    /// Returns the number of features, including the taxels' means.
    pub fn width(&self) -> usize {
        self.taxels * (1 + self.bands.len())
    }

    /// Writes `ln(0.001 + sum of |S|^2 over the band)`, `[taxels][bands]`, of the unitary spectrum of one sweep, `[steps][taxels]`.
    pub fn write(&self, sweep: &[f32], out: &mut [f32]) {
        let mut input = self.transform.make_input_vec();
        let mut spectrum = self.transform.make_output_vec();
        for (taxel, out) in out.chunks_exact_mut(self.bands.len()).enumerate() {
            for (value, frame) in input.iter_mut().zip(sweep.chunks_exact(self.taxels)) {
                *value = f64::from(frame[taxel]);
            }
            // The buffers have the plan's own lengths, so this cannot fail.
            let _ = self.transform.process(&mut input, &mut spectrum);
            let bands = self.bands.iter().zip(&self.gains);
            for (out, (bins, gain)) in out.iter_mut().zip(bands) {
                let band = &spectrum[bins.clone()];
                let power: f64 = band.iter().map(|x| x.norm_sqr()).sum();
                *out = (gain * power / self.steps as f64 + LEAST_POWER).ln() as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_every_frequency_once_and_a_tone_stands_in_one() {
        for steps in [4, 5, 20, 333, 1000, 8800] {
            let shape = SweepShape {
                steps,
                rows: 1,
                cols: 1,
            };
            let spectra = LogSpectra::new(shape, 750.0).unwrap();
            let mut next = 1;
            for bins in &spectra.bands {
                assert_eq!(bins.start, next, "{steps} steps");
                next = bins.end;
            }
            assert_eq!(next, steps / 2 + 1, "{steps} steps");
        }
        let shape = SweepShape {
            steps: 1000,
            rows: 1,
            cols: 2,
        };
        let spectra = LogSpectra::new(shape, 750.0).unwrap();
        let tone = |t: usize| (std::f64::consts::TAU * 50.0 * t as f64 / 1000.0).sin();
        let sweep: Vec<f32> = (0..1000)
            .flat_map(|t| [7.0, 3.0 + tone(t) as f32])
            .collect();
        let mut found = vec![0.0; spectra.width() - 2];
        spectra.write(&sweep, &mut found);
        let bands = spectra.bands.len();
        let nothing = LEAST_POWER.ln() as f32;
        assert!(found[..bands].iter().all(|x| (x - nothing).abs() < 1e-3));
        for (band, x) in spectra.bands.iter().zip(&found[bands..]) {
            // 1000 steps times half the mean square of the sine.
            let expected = if band.contains(&50) {
                250.0_f32.ln()
            } else {
                nothing
            };
            assert!((x - expected).abs() < 1e-2, "{band:?}: {x}");
        }
    }

    #[test]
    fn a_sweep_of_another_length_has_the_same_powers() {
        let shape = SweepShape {
            steps: 1000,
            rows: 1,
            cols: 1,
        };
        let spectra = LogSpectra::new(shape, 750.0).unwrap();
        let power = |steps: usize, cycle: usize| {
            let sweep: Vec<f32> = (0..steps)
                .map(|t| (std::f64::consts::TAU * t as f64 / cycle as f64).sin() as f32)
                .collect();
            let mut found = vec![0.0; spectra.width() - 1];
            match steps {
                1000 => spectra.write(&sweep, &mut found),
                steps => spectra.at_length(steps).write(&sweep, &mut found),
            }
            found
        };
        // A period of 20 steps is bin 50 of 1000 and bin 25 of 500, a period of 5 steps is bin 200 and 80 of 400.
        for (cycle, steps) in [(20, 500), (20, 400), (5, 400), (5, 600)] {
            let (whole, short) = (power(1000, cycle), power(steps, cycle));
            let largest = |powers: &[f32]| {
                let greater = |a: &usize, b: &usize| powers[*a].total_cmp(&powers[*b]);
                (0..powers.len()).max_by(greater).unwrap()
            };
            let band = largest(&whole);
            assert_eq!(largest(&short), band, "{cycle} {steps}");
            // A band of a shorter sweep has a whole number of frequencies, here at least six.
            assert!((short[band] - whole[band]).abs() < 0.2, "{cycle} {steps}");
        }
        assert_eq!(power(1000, 20), {
            let sweep: Vec<f32> = (0..1000)
                .map(|t| (std::f64::consts::TAU * f64::from(t) / 20.0).sin() as f32)
                .collect();
            let mut found = vec![0.0; spectra.width() - 1];
            spectra.at_length(1000).write(&sweep, &mut found);
            found
        });
    }
}
