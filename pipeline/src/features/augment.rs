//! Augmentation: random changes of training sweeps that keep the material.

use rand::Rng;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::error::InvalidSetting;

/// Sizes of random changes, drawn anew for every sweep in every epoch. The default, all zero, changes nothing.
///
/// Strokes over the same material differ in the time of contact, the contact force and the noise of the skin; none of these depends on the
/// material.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Augmentation {
    /// Maximum shift in time steps, either way; the first or last frame fills the gap.
    pub shift_steps: usize,
    /// Standard deviation of the logarithm of a factor on all values: `exp(gain * z)` with z standard normal.
    pub gain: f64,
    /// Standard deviation of the noise added to every value, in digits.
    pub noise: f64,
}

impl Augmentation {
    /// Returns true if sweeps stay unchanged.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Validates the ranges.
    ///
    /// # Errors
    /// A setting that is negative or not finite.
    pub(crate) fn validate(&self) -> Result<(), InvalidSetting> {
        let wrong = [
            ("training.augmentation.gain", self.gain),
            ("training.augmentation.noise", self.noise),
        ]
        .into_iter()
        .find(|(_, value)| !(value.is_finite() && *value >= 0.0));
        match wrong {
            None => Ok(()),
            Some((setting, value)) => Err(InvalidSetting {
                setting,
                expected: "a number of at least 0",
                found: value.to_string(),
            }),
        }
    }

    /// Changes one sweep in place: `[steps][taxels]`, in digits.
    pub fn apply(&self, sweep: &mut [f32], taxels: usize, rng: &mut impl Rng) {
        if self.shift_steps > 0 {
            let reach = self.shift_steps.min(sweep.len() / taxels - 1) as i64;
            shift(sweep, taxels, rng.random_range(-reach..=reach));
        }
        if self.gain > 0.0 {
            let z: f64 = StandardNormal.sample(rng);
            let factor = (self.gain * z).exp() as f32;
            sweep.iter_mut().for_each(|value| *value *= factor);
        }
        if self.noise > 0.0 {
            let noise = self.noise as f32;
            for value in sweep {
                let z: f32 = StandardNormal.sample(rng);
                *value += noise * z;
            }
        }
    }
}

/// Shifts a sweep by `steps` (earlier if negative) and repeats the frame at the edge.
fn shift(sweep: &mut [f32], taxels: usize, steps: i64) {
    let moved = steps.unsigned_abs() as usize * taxels;
    let len = sweep.len();
    if steps > 0 {
        sweep.copy_within(..len - moved, moved);
        for at in (taxels..moved).step_by(taxels) {
            sweep.copy_within(..taxels, at);
        }
    } else if steps < 0 {
        sweep.copy_within(moved.., 0);
        for at in (len - moved..len).step_by(taxels) {
            sweep.copy_within(len - moved - taxels..len - moved, at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tactnet_data::Seed;

    #[test]
    fn nothing_asked_for_changes_nothing() {
        let mut sweep = vec![1.0, 2.0, 3.0, 4.0];
        Augmentation::default().apply(&mut sweep, 2, &mut Seed(1).rng("augmentation"));
        assert_eq!(sweep, [1.0, 2.0, 3.0, 4.0]);
    }

    proptest! {
        #[test]
        fn a_shift_repeats_the_edge(frames in 1usize..20, taxels in 1usize..4, by in -19i64..20) {
            let by = by.clamp(1 - frames as i64, frames as i64 - 1);
            let sweep: Vec<f32> = (0..frames * taxels).map(|at| at as f32).collect();
            let mut moved = sweep.clone();
            shift(&mut moved, taxels, by);
            for frame in 0..frames {
                let from = (frame as i64 - by).clamp(0, frames as i64 - 1) as usize;
                for taxel in 0..taxels {
                    prop_assert_eq!(moved[frame * taxels + taxel], sweep[from * taxels + taxel]);
                }
            }
        }
    }

    #[test]
    fn gain_and_noise_have_the_stated_size() {
        let mut rng = Seed(1).rng("augmentation");
        let noisy = Augmentation {
            noise: 2.0,
            ..Augmentation::default()
        };
        let mut sweep = vec![0.0; 40_000];
        noisy.apply(&mut sweep, 16, &mut rng);
        let power = sweep.iter().map(|v| v * v).sum::<f32>() / sweep.len() as f32;
        assert!((power - 4.0).abs() < 0.15, "{power}");
        let louder = Augmentation {
            gain: 0.1,
            ..Augmentation::default()
        };
        let logs: Vec<f32> = (0..4000)
            .map(|_| {
                let mut sweep = vec![1.0; 2];
                louder.apply(&mut sweep, 1, &mut rng);
                assert_eq!(sweep[0], sweep[1]);
                sweep[0].ln()
            })
            .collect();
        let variance = logs.iter().map(|v| v * v).sum::<f32>() / logs.len() as f32;
        assert!((variance.sqrt() - 0.1).abs() < 0.005, "{variance}");
    }
}
