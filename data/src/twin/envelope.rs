//! Slow variation of a texture's strength along the stroke.

use rand_chacha::ChaCha8Rng;

use super::gaussian::{innovation, normal};
use super::materials::{BANDS, SurfaceEnvelope};
use super::signal::TAXELS;

/// Number of steps between two values of the process; in between the factor is interpolated linearly.
const STRIDE: usize = 8;
/// Number of envelopes per taxel: one of the coarse band, one of the medium and fine bands. The undulation is steady.
const ENVELOPES: usize = 2;

/// Envelopes of one sweep.
pub(super) struct Envelopes {
    depth: f64,
    keep: f64,
    drive: f64,
    value: [[f64; ENVELOPES]; TAXELS],
    factor: [[f64; ENVELOPES]; TAXELS],
    rise: [[f64; ENVELOPES]; TAXELS],
    steps: usize,
}

impl Envelopes {
    /// Returns the envelopes at the start of a sweep.
    ///
    /// - `speed`: speed of the stroke, relative to 3 cm/s
    pub(super) fn new(surface: SurfaceEnvelope, speed: f64, rng: &mut ChaCha8Rng) -> Self {
        let keep = (-(STRIDE as f64) * speed / surface.steps).exp();
        let value = std::array::from_fn(|_| std::array::from_fn(|_| normal(rng)));
        Self {
            depth: surface.depth,
            keep,
            drive: (1.0 - keep * keep).sqrt(),
            value,
            factor: value.map(|values| values.map(|v| factor(surface.depth, v))),
            rise: [[0.0; ENVELOPES]; TAXELS],
            steps: 0,
        }
    }

    /// Advances all taxels by one step.
    pub(super) fn step(&mut self, rng: &mut ChaCha8Rng) {
        let new_line = self.steps.is_multiple_of(STRIDE);
        self.steps += 1;
        for taxel in 0..TAXELS {
            for band in 0..ENVELOPES {
                let now = self.factor[taxel][band];
                if new_line {
                    let value = &mut self.value[taxel][band];
                    *value = self.keep * *value + self.drive * innovation(rng);
                    let next = factor(self.depth, *value);
                    self.rise[taxel][band] = (next - now) / STRIDE as f64;
                }
                self.factor[taxel][band] = now + self.rise[taxel][band];
            }
        }
    }

    /// Returns the factors on the bands of a taxel.
    pub(super) fn factors(&self, taxel: usize) -> [f64; BANDS] {
        let [coarse, fine] = self.factor[taxel];
        [1.0, coarse, fine, fine]
    }
}

/// Returns `exp(s V - s^2)`, whose mean square is 1.
fn factor(depth: f64, value: f64) -> f64 {
    (depth * value - depth * depth).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Seed;

    #[test]
    fn the_power_stays_and_its_logarithm_has_the_given_depth() {
        let surface = SurfaceEnvelope {
            depth: 0.35,
            steps: 80.0,
        };
        let mut rng = Seed(1).rng("envelope");
        let (mut power, mut logs, mut squares, mut count) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..200 {
            let mut envelopes = Envelopes::new(surface, 1.0, &mut rng);
            for step in 0..1000 {
                envelopes.step(&mut rng);
                // At the ends of the lines the factors equal those of the process.
                if (step + 1) % STRIDE != 0 {
                    continue;
                }
                for taxel in 0..TAXELS {
                    let [steady, coarse, medium, fine] = envelopes.factors(taxel);
                    assert_eq!((steady, medium), (1.0, fine));
                    for f in [coarse, fine] {
                        power += f * f;
                        logs += f.ln();
                        squares += f.ln().powi(2);
                        count += 1.0;
                    }
                }
            }
        }
        let (mean, variance) = (logs / count, squares / count - (logs / count).powi(2));
        assert!((power / count - 1.0).abs() < 0.02, "{}", power / count);
        assert!((mean + 0.35 * 0.35).abs() < 0.01, "{mean}");
        assert!((variance.sqrt() - 0.35).abs() < 0.01, "{}", variance.sqrt());
    }
}
