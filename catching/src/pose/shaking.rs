//! Test data: a head at rest that then shakes, measured by an IMU with errors as configured.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_packets::packets::{HeadPose, ImuSample};

use super::{PoseConfig, PoseEstimator};

/// Time between two samples, in ns.
pub(crate) const DT_NS: u64 = 1_953_125;
/// Start of the shaking, in s.
pub(crate) const REST: f64 = 2.0;

pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

pub(crate) fn vector(rng: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| normal(rng) * sigma)
}

/// Returns the chi-square quantile at `z` standard deviations of a normal distribution, by the approximation of Wilson
/// and Hilferty. It is accurate to 0.1 % at the sizes used in tests.
pub(crate) fn chi_square(freedom: f64, z: f64) -> f64 {
    freedom * (1.0 - 2.0 / (9.0 * freedom) + z * (2.0 / (9.0 * freedom)).sqrt()).powi(3)
}

/// Returns the head pose at time `t`, in s. After [`REST`] it shakes by 2 cm and 1.5 deg at 3 to 5 Hz.
pub(crate) fn head(t: f64) -> Isometry3<f64> {
    let s = ((t - REST) / 0.3).clamp(0.0, 1.0);
    let begun = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    let wave = |hertz: f64, phase: f64| begun * (std::f64::consts::TAU * hertz * t + phase).sin();
    let p = Vector3::new(0.1, 0.0, 1.45)
        + Vector3::new(wave(3.1, 0.4), wave(4.2, 1.3), wave(5.0, 2.1)) * 0.02;
    let turn = Vector3::new(wave(3.7, 2.0), wave(4.9, 0.1), wave(3.0, 0.9)) * 0.026;
    Isometry3::from_parts(
        Translation3::from(p),
        UnitQuaternion::from_scaled_axis(turn),
    )
}

/// Returns the measurement of a perfect IMU at the end of its lever, by finite differences.
fn felt(t: f64, lever: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let h = 1e-4;
    let at = |t: f64| head(t).translation.vector + head(t).rotation * lever;
    let acceleration = (at(t + h) - at(t) * 2.0 + at(t - h)) / (h * h);
    let turn = head(t - h).rotation.inverse() * head(t + h).rotation;
    let force = head(t).rotation.inverse() * (acceleration + Vector3::z() * 9.81);
    (force, turn.scaled_axis() / (2.0 * h))
}

pub(crate) struct Run {
    pub estimator: PoseEstimator,
    pub poses: Vec<HeadPose>,
    pub last: ImuSample,
    pub accelerometer_bias: Vector3<f64>,
}

/// Simulates the rest and one second of shaking, with random errors as configured.
pub(crate) fn run(seed: u64, config: PoseConfig) -> Run {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let robot = RobotDescription::nominal();
    let mut estimator = PoseEstimator::new(&robot, config).unwrap();
    let lever = Vector3::from(robot.imu.position);
    let mut accelerometer_bias = vector(&mut rng, config.accelerometer_bias);
    let mut gyroscope_bias = vector(&mut rng, config.gyroscope_bias);
    let kinematics = Isometry3::from_parts(
        Translation3::from(head(0.0).translation.vector + vector(&mut rng, config.rest_position)),
        UnitQuaternion::from_scaled_axis(vector(&mut rng, config.rest_attitude))
            * head(0.0).rotation,
    );
    let mut poses = Vec::new();
    let step = (DT_NS as f64 * 1e-9).sqrt();
    let sample = |number: u64, force: Vector3<f64>, rate: Vector3<f64>| ImuSample {
        number,
        sensor_ns: number * DT_NS,
        acceleration: force.into(),
        rate: rate.into(),
    };
    let mut last = sample(0, Vector3::zeros(), Vector3::zeros());
    for number in 0..((REST + 1.0) * 512.0) as u64 {
        let t = number as f64 * DT_NS as f64 * 1e-9;
        let (force, rate) = felt(t, &lever);
        accelerometer_bias += vector(&mut rng, config.accelerometer_walk * step);
        gyroscope_bias += vector(&mut rng, config.gyroscope_walk * step);
        last = sample(
            number,
            force + accelerometer_bias + vector(&mut rng, config.accelerometer_noise),
            rate + gyroscope_bias + vector(&mut rng, config.gyroscope_noise),
        );
        poses.push(
            estimator
                .push(&last, (t < REST - 0.01).then_some(kinematics))
                .unwrap(),
        );
    }
    Run {
        estimator,
        poses,
        last,
        accelerometer_bias,
    }
}
