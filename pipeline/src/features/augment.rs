//! Augmentation: random changes of training sweeps that keep the material.

use rand::Rng;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::error::InvalidSetting;
use crate::{DeadTaxels, Disturbance, Normalizer};

/// Share of the training sweeps of an epoch whose condition is unknown, so that a network predicts without it, too.
const UNKNOWN_CONDITIONS: f64 = 0.2;
/// Distance of a dropped taxel's reading from the taxel's mean, at most, in spreads.
const STUCK_WITHIN: f32 = 3.0;

/// Sizes of random changes, drawn anew for every sweep in every epoch. The default, all zero, changes nothing.
///
/// Strokes over the same material differ in the time of contact, the contact force, the speed, and the noise and age of the skin; none of
/// these depends on the material.
///
/// Mean and spread of a taxel are those of the normaliser: mean and standard deviation over the training sweeps with per-taxel scaling, zero
/// and one digit without scaling.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Augmentation {
    /// Maximum shift in time steps, either way; the first or last frame fills the gap.
    pub shift_steps: usize,
    /// Standard deviation of the logarithm of a factor on all values: `exp(gain * z)` with z standard normal.
    pub gain: f64,
    /// Standard deviation of the noise added to every value, in digits.
    pub noise: f64,
    /// Probability with which a taxel is dropped from a sweep: it reads its mean, or, in every second such sweep, a constant within three
    /// spreads of it, as an undetected dead taxel.
    #[serde(skip_serializing_if = "is_zero")]
    pub taxel_dropout: f64,
    /// Standard deviation of the logarithm of a factor on each taxel's distance from its mean.
    #[serde(skip_serializing_if = "is_zero")]
    pub taxel_gain: f64,
    /// Standard deviation of a constant that is added to each taxel, in spreads.
    #[serde(skip_serializing_if = "is_zero")]
    pub offset: f64,
    /// Standard deviation of each taxel's linear drift from the first frame to the last, in spreads.
    #[serde(skip_serializing_if = "is_zero")]
    pub drift: f64,
    /// Standard deviation of the logarithm of the speed; see [`Disturbance::Speed`].
    #[serde(skip_serializing_if = "is_zero")]
    pub stretch: f64,
}

fn is_zero(size: &f64) -> bool {
    *size == 0.0
}

impl Augmentation {
    /// Returns true if the taxels stay unchanged.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Returns true if sweeps change from epoch to epoch: by these changes, or since conditions are unknown in some epochs.
    pub(crate) fn changes(&self, normalizer: &Normalizer) -> bool {
        !self.is_none() || normalizer.conditions() > 0
    }

    /// Validates the ranges.
    ///
    /// # Errors
    /// A setting that is negative or not finite, or a probability of 1 or more.
    pub(crate) fn validate(&self) -> Result<(), InvalidSetting> {
        let sizes = [
            ("training.augmentation.gain", self.gain),
            ("training.augmentation.noise", self.noise),
            ("training.augmentation.taxel_dropout", self.taxel_dropout),
            ("training.augmentation.taxel_gain", self.taxel_gain),
            ("training.augmentation.offset", self.offset),
            ("training.augmentation.drift", self.drift),
            ("training.augmentation.stretch", self.stretch),
        ];
        let is_wrong = |(_, value): &(_, f64)| !(value.is_finite() && *value >= 0.0);
        if let Some((setting, value)) = sizes.into_iter().find(is_wrong) {
            return Err(InvalidSetting {
                setting,
                expected: "a number of at least 0",
                found: value.to_string(),
            });
        }
        if self.taxel_dropout >= 1.0 {
            return Err(InvalidSetting {
                setting: "training.augmentation.taxel_dropout",
                expected: "a probability below 1",
                found: self.taxel_dropout.to_string(),
            });
        }
        Ok(())
    }

    /// Changes one sweep in place: `[steps][taxels]`, in digits. Of conditions behind the taxels, each becomes unknown, that is
    /// the mean of the training sweeps, in a fifth of the sweeps, independently of the others; the rest keep their value.
    pub fn apply(&self, sweep: &mut [f32], normalizer: &Normalizer, rng: &mut impl Rng) {
        let (taxels, skin) = (
            normalizer.taxels(),
            normalizer.taxels() - normalizer.conditions(),
        );
        let mut conditions = sweep[skin..taxels].to_vec();
        for (value, mean) in conditions.iter_mut().zip(&normalizer.offset()[skin..]) {
            if rng.random_bool(UNKNOWN_CONDITIONS) {
                *value = *mean;
            }
        }
        self.apply_to_taxels(sweep, normalizer, rng);
        for frame in sweep.chunks_exact_mut(taxels) {
            frame[skin..].copy_from_slice(&conditions);
        }
    }

    /// Changes all columns of one sweep in place.
    fn apply_to_taxels(&self, sweep: &mut [f32], normalizer: &Normalizer, rng: &mut impl Rng) {
        let taxels = normalizer.taxels();
        if self.stretch > 0.0 {
            let speed = log_normal(self.stretch, rng);
            Disturbance::Speed(speed).apply(sweep, taxels);
        }
        if self.shift_steps > 0 {
            let reach = self.shift_steps.min(sweep.len() / taxels - 1) as i64;
            shift(sweep, taxels, rng.random_range(-reach..=reach));
        }
        if self.gain > 0.0 {
            let factor = log_normal(self.gain, rng) as f32;
            sweep.iter_mut().for_each(|value| *value *= factor);
        }
        if self.taxel_gain > 0.0 {
            let factors = (0..taxels).map(|_| log_normal(self.taxel_gain, rng) as f32);
            let gain = Disturbance::Gain {
                factors: factors.collect(),
                about: normalizer.offset().to_vec(),
            };
            gain.apply(sweep, taxels);
        }
        if self.offset > 0.0 {
            Disturbance::Offset(spreads(self.offset, normalizer, rng)).apply(sweep, taxels);
        }
        if self.drift > 0.0 {
            Disturbance::Drift(spreads(self.drift, normalizer, rng)).apply(sweep, taxels);
        }
        if self.noise > 0.0 {
            let noise = self.noise as f32;
            for value in sweep.iter_mut() {
                let z: f32 = StandardNormal.sample(rng);
                *value += noise * z;
            }
        }
        if self.taxel_dropout > 0.0 {
            self.dropped(normalizer, rng).apply(sweep, taxels);
        }
    }

    /// Draws the taxels that are dropped from a sweep, and their readings.
    fn dropped(&self, normalizer: &Normalizer, rng: &mut impl Rng) -> DeadTaxels {
        let noticed = rng.random_bool(0.5);
        let mut dead = DeadTaxels::default();
        let scales = normalizer.offset().iter().zip(normalizer.gain());
        for (taxel, (mean, gain)) in scales.enumerate() {
            if rng.random_bool(self.taxel_dropout) {
                let reading = match noticed {
                    true => *mean,
                    false => mean + rng.random_range(-STUCK_WITHIN..=STUCK_WITHIN) / gain,
                };
                dead.0.insert(taxel, reading);
            }
        }
        dead
    }
}

/// Draws a factor whose logarithm has this standard deviation.
fn log_normal(deviation: f64, rng: &mut impl Rng) -> f64 {
    let z: f64 = StandardNormal.sample(rng);
    (deviation * z).exp()
}

/// Draws a number of digits for each taxel, with a standard deviation of `size` spreads.
fn spreads(size: f64, normalizer: &Normalizer, rng: &mut impl Rng) -> Vec<f32> {
    let digits = normalizer.gain().iter().map(|gain| {
        let z: f32 = StandardNormal.sample(rng);
        size as f32 * z / gain
    });
    digits.collect()
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

    /// Means 100, 101, … and spreads 1, 2, ….
    fn scales(taxels: usize) -> Normalizer {
        let frame = |sign: f32| (0..taxels).map(move |t| 100.0 + t as f32 + sign * (t + 1) as f32);
        Normalizer::of_frames(&frame(-1.0).chain(frame(1.0)).collect::<Vec<_>>(), taxels)
    }

    #[test]
    fn nothing_asked_for_changes_nothing() {
        let mut sweep = vec![1.0, 2.0, 3.0, 4.0];
        Augmentation::default().apply(&mut sweep, &scales(2), &mut Seed(1).rng("augmentation"));
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
        noisy.apply(&mut sweep, &scales(16), &mut rng);
        let power = sweep.iter().map(|v| v * v).sum::<f32>() / sweep.len() as f32;
        assert!((power - 4.0).abs() < 0.15, "{power}");
        let louder = Augmentation {
            gain: 0.1,
            ..Augmentation::default()
        };
        let logs: Vec<f32> = (0..4000)
            .map(|_| {
                let mut sweep = vec![1.0; 2];
                louder.apply(&mut sweep, &scales(1), &mut rng);
                assert_eq!(sweep[0], sweep[1]);
                sweep[0].ln()
            })
            .collect();
        let variance = logs.iter().map(|v| v * v).sum::<f32>() / logs.len() as f32;
        assert!((variance.sqrt() - 0.1).abs() < 0.005, "{variance}");
    }

    /// Returns the changes of a taxel in 4000 sweeps of its mean: at the first frame and at the last, in spreads.
    fn changes(by: Augmentation, taxel: usize) -> Vec<[f32; 2]> {
        let scales = scales(3);
        let mut rng = Seed(2).rng("augmentation");
        let changed = |_| {
            let mut sweep = scales.offset().repeat(5);
            by.apply(&mut sweep, &scales, &mut rng);
            [taxel, 12 + taxel]
                .map(|at| (sweep[at] - scales.offset()[taxel]) * scales.gain()[taxel])
        };
        (0..4000).map(changed).collect()
    }

    fn deviation(values: impl Iterator<Item = f32>) -> f32 {
        let (mut sum, mut count) = (0.0, 0);
        for value in values {
            sum += value * value;
            count += 1;
        }
        (sum / count as f32).sqrt()
    }

    // A deviation of 4000 draws has a standard error of 1.1 %; the bounds are four of them.
    #[test]
    fn offset_and_drift_are_in_spreads_of_the_taxel() {
        for taxel in [0, 2] {
            let offset = Augmentation {
                offset: 0.5,
                ..Augmentation::default()
            };
            let found = changes(offset, taxel);
            assert!(
                found
                    .iter()
                    .all(|[first, last]| (first - last).abs() < 1e-4)
            );
            let size = deviation(found.iter().map(|ends| ends[0]));
            assert!((size - 0.5).abs() < 0.022, "{size}");
            let drift = Augmentation {
                drift: 2.0,
                ..Augmentation::default()
            };
            let found = changes(drift, taxel);
            assert!(found.iter().all(|[first, _]| *first == 0.0));
            let size = deviation(found.iter().map(|ends| ends[1]));
            assert!((size - 2.0).abs() < 0.088, "{size}");
        }
    }

    #[test]
    fn taxels_are_dropped_at_the_stated_rate_to_their_mean_or_a_constant() {
        let scales = scales(3);
        let by = Augmentation {
            taxel_dropout: 0.1,
            ..Augmentation::default()
        };
        let mut rng = Seed(3).rng("augmentation");
        let (mut means, mut constants) = (0, 0);
        for _ in 0..4000 {
            // Far from the means, and changing.
            let mut sweep: Vec<f32> = (0..12).map(|at| 1000.0 + at as f32).collect();
            let before = sweep.clone();
            by.apply(&mut sweep, &scales, &mut rng);
            for taxel in 0..3 {
                let read = |values: &[f32]| values.iter().skip(taxel).step_by(3).copied().collect();
                let (found, original): (Vec<f32>, Vec<f32>) = (read(&sweep), read(&before));
                if found == original {
                    continue;
                }
                assert!(found.iter().all(|value| *value == found[0]), "{found:?}");
                let away = (found[0] - scales.offset()[taxel]) * scales.gain()[taxel];
                assert!(away.abs() <= 3.001, "{away}");
                *if away == 0.0 {
                    &mut means
                } else {
                    &mut constants
                } += 1;
            }
        }
        // 12000 draws at 10 %: standard error 33; of each half 23, or more, since the sweep decides.
        assert!(
            (means + constants - 1200_i32).abs() < 165,
            "{means} {constants}"
        );
        assert!((means - constants).abs() < 165, "{means} {constants}");
    }

    #[test]
    fn gains_of_taxels_are_about_the_mean_and_speeds_about_one() {
        let scales = scales(2);
        let mut rng = Seed(4).rng("augmentation");
        let gain = Augmentation {
            taxel_gain: 0.2,
            ..Augmentation::default()
        };
        let mut logs = Vec::new();
        for _ in 0..4000 {
            let mut sweep = vec![110.0, 111.0];
            gain.apply(&mut sweep, &scales, &mut rng);
            assert_ne!(sweep[0] - 100.0, sweep[1] - 101.0);
            logs.push(((sweep[0] - 100.0) / 10.0).ln());
        }
        let size = deviation(logs.into_iter());
        assert!((size - 0.2).abs() < 0.009, "{size}");
        let stretch = Augmentation {
            stretch: 0.1,
            ..Augmentation::default()
        };
        let mut logs = Vec::new();
        for _ in 0..4000 {
            // A ramp shows the speed at its middle, far from the ends.
            let mut sweep: Vec<f32> = (0..80).map(|at| (at / 2) as f32).collect();
            stretch.apply(&mut sweep, &scales, &mut rng);
            logs.push((sweep[40] / 20.0).ln());
        }
        let size = deviation(logs.into_iter());
        assert!((size - 0.1).abs() < 0.0045, "{size}");
    }

    #[test]
    fn sizes_out_of_range_are_refused_by_name() {
        for (by, named) in [
            (
                Augmentation {
                    taxel_dropout: 1.0,
                    ..Augmentation::default()
                },
                "taxel_dropout",
            ),
            (
                Augmentation {
                    drift: -1.0,
                    ..Augmentation::default()
                },
                "drift",
            ),
            (
                Augmentation {
                    stretch: f64::NAN,
                    ..Augmentation::default()
                },
                "stretch",
            ),
        ] {
            let refused = by.validate().unwrap_err().to_string();
            assert!(refused.contains(named), "{refused}");
        }
    }
}
