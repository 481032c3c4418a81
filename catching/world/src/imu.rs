//! Inertial unit in the head: samples with noise, bias and scale errors.

use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::packets::ImuSample;

use crate::drives::TICK;
use crate::error::{WorldError, not_negative};
use crate::planted::{PlantedErrors, StampDelay};
use crate::robot::{Felt, SUBSTEPS};
use crate::stream::Stream;

tactnet_catching_packets::settings! {
    /// Errors of the inertial unit, each a standard deviation per axis.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct ImuConfig in "imu.": WorldError {
        /// White noise of the accelerometer per sample, in m/s^2.
        pub accelerometer_noise: f64 = 0.02 => not_negative,
        /// White noise of the gyroscope per sample, in rad/s.
        pub gyroscope_noise: f64 = 0.002 => not_negative,
        /// Bias of the accelerometer, constant for a run, in m/s^2.
        pub accelerometer_bias: f64 = 0.05 => not_negative,
        /// Bias of the gyroscope, constant for a run, in rad/s.
        pub gyroscope_bias: f64 = 0.005 => not_negative,
        /// Relative scale error, constant for a run.
        pub scale: f64 = 0.002 => not_negative,
    }
}

/// Three axes of one sensor with their errors.
#[derive(Debug, Clone)]
struct Axes {
    noise: f64,
    bias: Vector3<f64>,
    scale: Vector3<f64>,
}

impl Axes {
    fn draw(noise: f64, bias: f64, scale: f64, rng: &mut ChaCha8Rng) -> Self {
        Self {
            noise,
            bias: normal(rng) * bias,
            scale: Vector3::repeat(1.0) + normal(rng) * scale,
        }
    }

    fn measure(&self, value: &Vector3<f64>, rng: &mut ChaCha8Rng) -> [f64; 3] {
        (value.component_mul(&self.scale) + self.bias + normal(rng) * self.noise).into()
    }
}

fn normal(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(rng))
}

/// Inertial unit.
#[derive(Debug, Clone)]
pub(crate) struct Imu {
    accelerometer: Axes,
    gyroscope: Axes,
    noise: ChaCha8Rng,
    /// Rotation from its frame to the frame in the description.
    turn: Matrix3<f64>,
    /// Delay of the timestamps.
    late: StampDelay,
    /// Samples per second.
    rate: f64,
    /// Number of samples so far.
    count: u64,
    /// Measured quantities in the middle of the previous substep.
    before: Felt,
}

impl Imu {
    pub(crate) fn new(
        config: &ImuConfig,
        errors: &PlantedErrors,
        rate: f64,
        seed: u64,
        felt: Felt,
    ) -> Self {
        let [_, late] = errors.clocks(seed);
        let mut rng = Stream::ImuErrors.rng(seed, 0);
        let mut axes = |noise, bias| Axes::draw(noise, bias, config.scale, &mut rng);
        Self {
            accelerometer: axes(config.accelerometer_noise, config.accelerometer_bias),
            gyroscope: axes(config.gyroscope_noise, config.gyroscope_bias),
            noise: Stream::ImuNoise.rng(seed, 0),
            turn: errors.imu_turn(seed),
            late,
            rate,
            count: 0,
            before: felt,
        }
    }

    /// Returns the sample within the tick that ends at `end_ns`, if there is one. `felt` has the measured quantities
    /// in the middle of each substep.
    ///
    /// Sample `n` is at `(n + 1) / rate`. Values between the middles of substeps are interpolated linearly. A tick
    /// returns at most its first sample; at 512 Hz there is never a second one.
    pub(crate) fn sample(&mut self, end_ns: u64, felt: &[Felt; SUBSTEPS]) -> Option<ImuSample> {
        let sensor_ns = ((self.count + 1) as f64 / self.rate * 1e9).round() as u64;
        let sample = (sensor_ns <= end_ns).then(|| {
            let h = TICK / SUBSTEPS as f64;
            // Time in substeps from the middle of the last substep of the previous tick.
            let since = (TICK - (end_ns - sensor_ns) as f64 * 1e-9) / h + 0.5;
            let after = (since as usize).min(SUBSTEPS - 1);
            let first = after.checked_sub(1).map_or(self.before, |i| felt[i]);
            let part = since - after as f64;
            let between = |a: &Vector3<f64>, b: &Vector3<f64>| a + (b - a) * part;
            let turned = |a: &Vector3<f64>, b: &Vector3<f64>| self.turn.tr_mul(&between(a, b));
            let force = turned(&first.specific_force, &felt[after].specific_force);
            let rate = turned(&first.rate, &felt[after].rate);
            ImuSample {
                number: self.count,
                sensor_ns: sensor_ns + self.late.of(self.count),
                acceleration: self.accelerometer.measure(&force, &mut self.noise),
                rate: self.gyroscope.measure(&rate, &mut self.noise),
            }
        });
        self.count += u64::from(sample.is_some());
        self.before = felt[SUBSTEPS - 1];
        sample
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn felt(x: f64) -> Felt {
        Felt {
            specific_force: Vector3::new(x, 0.0, 9.81),
            rate: Vector3::new(0.0, x, 0.0),
        }
    }

    #[test]
    fn samples_come_at_their_rate_and_follow_the_motion() {
        let exact = ImuConfig {
            accelerometer_noise: 0.0,
            gyroscope_noise: 0.0,
            accelerometer_bias: 0.0,
            gyroscope_bias: 0.0,
            scale: 0.0,
        };
        // The measured quantity grows by 1 per second.
        let middle = |tick: i32, substep: i32| {
            felt(f64::from(tick) * 1e-3 + (f64::from(substep) + 0.5) * 5e-4)
        };
        let mut imu = Imu::new(&exact, &PlantedErrors::default(), 512.0, 1, middle(-1, 1));
        let mut sample = |tick: i32| {
            let felt = [middle(tick, 0), middle(tick, 1)];
            imu.sample((tick as u64 + 1) * 1_000_000, &felt)
        };
        let samples: Vec<ImuSample> = (0..1000).filter_map(&mut sample).collect();
        assert_eq!(samples.len(), 512);
        for (number, sample) in samples.iter().enumerate() {
            assert_eq!(sample.number, number as u64);
            let t = sample.sensor_ns as f64 * 1e-9;
            // Timestamps are whole nanoseconds.
            assert!((t - (number + 1) as f64 / 512.0).abs() < 1e-9);
            // Linear interpolation is exact for a straight line, except for rounding.
            assert!((sample.acceleration[0] - t).abs() < 1e-12);
            assert!((sample.rate[1] - t).abs() < 1e-12);
        }
    }

    #[test]
    fn noise_and_bias_have_the_given_size() {
        let config = ImuConfig::default();
        let mut biases = 0.0;
        let runs = 300;
        for seed in 0..runs {
            let mut imu = Imu::new(&config, &PlantedErrors::default(), 1000.0, seed, felt(0.0));
            let samples: Vec<f64> = (1..=400)
                .filter_map(|tick| imu.sample(tick * 1_000_000, &[felt(0.0); SUBSTEPS]))
                .map(|sample| sample.acceleration[0])
                .collect();
            let mean = samples.iter().sum::<f64>() / samples.len() as f64;
            let spread = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
            let spread = (spread / samples.len() as f64).sqrt();
            // The estimate from 400 samples has a standard error of 3.5 %; the limit is five times that.
            assert!((spread / config.accelerometer_noise - 1.0).abs() < 0.18);
            biases += mean * mean;
        }
        let bias = (biases / runs as f64).sqrt();
        // The estimate from 300 runs has a standard error of 4 %; the limit is four times that.
        let off = bias / config.accelerometer_bias - 1.0;
        assert!(off.abs() < 0.16, "{bias}");
    }
}
