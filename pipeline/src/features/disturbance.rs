//! Changes of a sweep by the sensor or the robot: dead taxels, gain, offset, drift, speed.

use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Change of a sweep by the sensor or the robot.
///
/// ```
/// use tactnet_pipeline::{DeadTaxels, Disturbance};
///
/// // Two taxels, three steps.
/// let changed = |by: Disturbance| {
///     let mut sweep = vec![0.0, 8.0, 1.0, 6.0, 2.0, 4.0];
///     by.apply(&mut sweep, 2);
///     sweep
/// };
/// let dead = DeadTaxels([(1, 5.0)].into());
/// assert_eq!(changed(Disturbance::Dead(dead)), [0.0, 5.0, 1.0, 5.0, 2.0, 5.0]);
/// assert_eq!(changed(Disturbance::Drift(vec![0.0, 2.0])), [0.0, 8.0, 1.0, 7.0, 2.0, 6.0]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub enum Disturbance {
    /// Some taxels read a constant.
    Dead(DeadTaxels),
    /// Distances from a reading are multiplied by a factor.
    Gain {
        /// Factor of each taxel, `[taxels]`.
        factors: Vec<f32>,
        /// Reading of each taxel that stays as it is, in digits, `[taxels]`.
        about: Vec<f32>,
    },
    /// Digits added to each taxel, `[taxels]`.
    Offset(Vec<f32>),
    /// Digits added to each taxel at the last frame, `[taxels]`; nothing at the first frame, linear in between.
    Drift(Vec<f32>),
    /// Factor on the speed of the motion, above 0. Values in between are interpolated without loss of high frequencies. A faster sweep
    /// ends early and repeats its last frame; a slower one is cut.
    Speed(f64),
}

impl Disturbance {
    /// Changes one sweep in place: `[steps][taxels]`, in digits.
    ///
    /// # Panics
    /// If the number of taxels differs.
    pub fn apply(&self, sweep: &mut [f32], taxels: usize) {
        match self {
            Self::Dead(dead) => dead.apply(sweep, taxels),
            Self::Gain { factors, about } => {
                assert_eq!([factors.len(), about.len()], [taxels; 2], "taxels");
                for frame in sweep.chunks_exact_mut(taxels) {
                    for ((value, factor), about) in frame.iter_mut().zip(factors).zip(about) {
                        *value = about + factor * (*value - about);
                    }
                }
            }
            Self::Offset(digits) => {
                assert_eq!(digits.len(), taxels, "taxels");
                for frame in sweep.chunks_exact_mut(taxels) {
                    frame
                        .iter_mut()
                        .zip(digits)
                        .for_each(|(value, by)| *value += by);
                }
            }
            Self::Drift(digits) => {
                assert_eq!(digits.len(), taxels, "taxels");
                let last = (sweep.len() / taxels).saturating_sub(1).max(1) as f32;
                for (step, frame) in sweep.chunks_exact_mut(taxels).enumerate() {
                    let share = step as f32 / last;
                    for (value, by) in frame.iter_mut().zip(digits) {
                        *value += share * by;
                    }
                }
            }
            Self::Speed(factor) => stretch(sweep, taxels, *factor),
        }
    }
}

/// Dead taxels with their constant readings in digits.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DeadTaxels(pub BTreeMap<usize, f32>);

impl DeadTaxels {
    /// Writes the readings into frames: `[frames][taxels]`, in digits.
    ///
    /// # Panics
    /// If a dead taxel is none of `taxels`.
    pub fn apply(&self, frames: &mut [f32], taxels: usize) {
        for frame in frames.chunks_exact_mut(taxels) {
            for (&taxel, &reading) in &self.0 {
                frame[taxel] = reading;
            }
        }
    }
}

/// Number of zeros of the interpolation kernel on either side.
const LOBES: f64 = 3.0;

/// Reads frame `t` at the time `t * speed`, at most that of the last frame. A faster sweep is low-pass filtered, as a sensor would.
fn stretch(sweep: &mut [f32], taxels: usize, speed: f64) {
    if speed == 1.0 {
        return;
    }
    let original = sweep.to_vec();
    let last = (sweep.len() / taxels - 1) as f64;
    // A wider kernel than one of a whole sweep would give the mean.
    let width = speed.clamp(1.0, last.max(1.0));
    for (step, frame) in sweep.chunks_exact_mut(taxels).enumerate() {
        let time = (step as f64 * speed).min(last);
        frame.fill(0.0);
        let (first, end) = (time - LOBES * width, time + LOBES * width);
        let taps = (first.ceil() as i64)..=(end.floor() as i64);
        let weight = |tap: i64| lanczos((tap as f64 - time) / width);
        let total: f64 = taps.clone().map(weight).sum();
        for tap in taps {
            let share = (weight(tap) / total) as f32;
            let from = tap.clamp(0, last as i64) as usize * taxels;
            for (value, original) in frame.iter_mut().zip(&original[from..]) {
                *value += share * original;
            }
        }
    }
}

/// Returns Lanczos's kernel: a sinc, windowed by a wider one.
fn lanczos(x: f64) -> f64 {
    let sinc = |x: f64| match x == 0.0 {
        true => 1.0,
        false => (PI * x).sin() / (PI * x),
    };
    sinc(x) * sinc(x / LOBES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Four steps of two taxels.
    const SWEEP: [f32; 8] = [1.0, 10.0, 2.0, 30.0, 4.0, 20.0, 8.0, 50.0];

    fn changed(by: &Disturbance) -> Vec<f32> {
        let mut sweep = SWEEP.to_vec();
        by.apply(&mut sweep, 2);
        sweep
    }

    #[test]
    fn each_disturbance_equals_the_values_computed_by_hand() {
        let dead = DeadTaxels([(0, -3.0)].into());
        let gain = Disturbance::Gain {
            factors: vec![2.0, 0.5],
            about: vec![2.0, 20.0],
        };
        for (by, expected) in [
            (
                Disturbance::Dead(dead),
                [-3.0, 10.0, -3.0, 30.0, -3.0, 20.0, -3.0, 50.0],
            ),
            (gain, [0.0, 15.0, 2.0, 25.0, 6.0, 20.0, 14.0, 35.0]),
            (
                Disturbance::Offset(vec![0.5, -10.0]),
                [1.5, 0.0, 2.5, 20.0, 4.5, 10.0, 8.5, 40.0],
            ),
            (
                Disturbance::Drift(vec![3.0, -6.0]),
                [1.0, 10.0, 3.0, 28.0, 6.0, 16.0, 11.0, 44.0],
            ),
        ] {
            assert_eq!(changed(&by), expected, "{by:?}");
        }
    }

    proptest! {
        #[test]
        fn disturbances_of_size_zero_keep_every_bit(
            frames in prop::collection::vec([1e-3f32..1e6, 1e-3f32..1e6], 1..20)
        ) {
            let sweep: Vec<f32> = frames.concat();
            let none = [
                Disturbance::Dead(DeadTaxels::default()),
                Disturbance::Gain { factors: vec![1.0; 2], about: vec![0.0; 2] },
                Disturbance::Offset(vec![0.0; 2]),
                Disturbance::Drift(vec![0.0; 2]),
                Disturbance::Speed(1.0),
            ];
            for by in none {
                let mut same = sweep.clone();
                by.apply(&mut same, 2);
                let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                prop_assert_eq!(bits(&same), bits(&sweep), "{:?}", by);
            }
        }

        #[test]
        fn constants_have_no_speed(speed in 0.01f64..100.0, frames in 1usize..30) {
            let mut sweep = vec![7.0; frames];
            Disturbance::Speed(speed).apply(&mut sweep, 1);
            // Rounding of a sum of at most 180 shares.
            prop_assert!(sweep.iter().all(|value| (value - 7.0).abs() < 1e-4), "{:?}", sweep);
        }
    }

    /// Returns a sine of `periods` per frame at another speed, from frame 20 on.
    fn sine(periods: f64, speed: f64) -> Vec<f32> {
        let value = |step: usize| (2.0 * PI * periods * step as f64).sin() as f32;
        let mut sweep: Vec<f32> = (0..400).map(value).collect();
        Disturbance::Speed(speed).apply(&mut sweep, 1);
        sweep[20..180].to_vec()
    }

    #[test]
    fn speeds_move_frequencies_and_keep_amplitudes() {
        for (periods, speed) in [(0.02, 0.5), (0.25, 0.95), (0.3, 1.05), (0.15, 2.0)] {
            let expected = (20..180).map(|step| (2.0 * PI * periods * speed * step as f64).sin());
            for (found, expected) in sine(periods, speed).into_iter().zip(expected) {
                // The kernel's ripple up to 0.3 periods per frame; linear interpolation loses up to 40 %.
                assert!(
                    (f64::from(found) - expected).abs() < 0.06,
                    "{periods} x {speed}: {found} {expected}"
                );
            }
        }
        // Above half a period per frame after the change, nothing is left.
        let folded = sine(0.4, 2.0);
        assert!(folded.iter().all(|value| value.abs() < 0.1), "{folded:?}");
    }
}
