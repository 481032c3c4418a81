use super::*;
use crate::pose::PoseRing;
use crate::pose::shaking::{DT_NS, REST, chi_square, head, run};
use nalgebra::{SMatrix, SVector, UnitQuaternion};

fn estimator(config: PoseConfig) -> PoseEstimator {
    PoseEstimator::new(&RobotDescription::nominal(), config).unwrap()
}

fn error(pose: &HeadPose) -> SVector<f64, 9> {
    let h = 1e-5;
    let t = pose.t_ns as f64 * 1e-9;
    let truth = head(t);
    let velocity = (head(t + h).translation.vector - head(t - h).translation.vector) / (2.0 * h);
    let [x, y, z, w] = pose.quaternion;
    let q = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
    let p = truth.translation.vector - Vector3::from(pose.position);
    let v = velocity - Vector3::from(pose.velocity);
    let turn = (truth.rotation * q.inverse()).scaled_axis();
    SVector::from_iterator(p.iter().chain(v.iter()).chain(turn.iter()).copied())
}

fn covariance(pose: &HeadPose) -> SMatrix<f64, 9, 9> {
    SMatrix::from_fn(|i, j| pose.covariance[i][j])
}

#[test]
fn a_head_that_stands_finds_the_planted_biases() {
    let config = PoseConfig {
        rest_attitude: 1e-4,
        ..PoseConfig::default()
    };
    for seed in 0..5 {
        let run = run(seed, config);
        let (estimator, at_rest) = (run.estimator, run.poses[((REST - 0.02) * 512.0) as usize]);
        let missing = run.accelerometer_bias - Vector3::from(at_rest.accelerometer_bias);
        // Gravity times an attitude error of 1e-4 rad, three standard deviations, plus the remaining noise after
        // two seconds.
        assert!(missing.amax() < 9.81 * 3e-4 + 1e-3, "{missing}");
        assert!(estimator.state.sigma(Block::GyroscopeBias) < 2e-4);
        assert!(estimator.state.sigma(Block::AccelerometerBias) < 2e-3);
    }
}

/// Normalised squared error after one second without kinematics: 9 values in each of 30 runs.
#[test]
fn a_shaking_head_stays_within_its_own_covariance() {
    let runs = 30;
    let mut sum = 0.0;
    for seed in 0..runs {
        let pose = *run(seed, PoseConfig::default()).poses.last().unwrap();
        let e = error(&pose);
        sum += (e.transpose() * covariance(&pose).try_inverse().unwrap() * e)[0];
    }
    let freedom = 9.0 * runs as f64;
    let band = [-1.96, 1.96].map(|z| chi_square(freedom, z) / runs as f64);
    let nees = sum / runs as f64;
    assert!((band[0]..band[1]).contains(&nees), "{nees} {band:?}");
}

/// A remaining bias of 0.02 m/s^2 moves the head by 10 mm in one second. The covariance must contain that.
#[test]
fn a_bias_that_is_left_over_is_in_the_covariance() {
    // No time at rest to estimate the bias, and no other uncertainty.
    let config = PoseConfig {
        accelerometer_bias: 0.02,
        gyroscope_bias: 1e-6,
        rest_position: 1e-6,
        rest_attitude: 1e-6,
        rest_velocity: 1e-6,
        accelerometer_noise: 1e-6,
        gyroscope_noise: 1e-6,
        ..PoseConfig::default()
    };
    let mut estimator = estimator(config);
    let sample = |number: u64| ImuSample {
        number,
        sensor_ns: number * DT_NS,
        acceleration: [0.02, 0.0, 9.81],
        rate: [0.0; 3],
    };
    let mut pose = estimator
        .push(&sample(0), Some(Isometry3::identity()))
        .unwrap();
    // One sample at rest determines the velocity, not the bias.
    for number in 1..=512 {
        pose = estimator.push(&sample(number), None).unwrap();
    }
    let (x, sigma) = (pose.position[0], pose.covariance[0][0].sqrt());
    assert!((x - 0.01).abs() < 1e-4, "{x}");
    assert!((sigma - 0.01).abs() < 3e-4, "{sigma}");
}

/// Returns the sample after the last one of a run, later by the given time.
fn next(last: &ImuSample, later_ns: u64) -> ImuSample {
    ImuSample {
        sensor_ns: last.sensor_ns + DT_NS + later_ns,
        ..*last
    }
}

#[test]
fn invalid_samples_change_nothing() {
    let run = run(1, PoseConfig::default());
    let (mut estimator, next) = (run.estimator, next(&run.last, 0));
    let mut untouched = estimator.clone();
    for bad in [f64::NAN, f64::INFINITY, 1e30] {
        let spoils: [fn(&mut ImuSample) -> &mut f64; 2] = [
            |sample| &mut sample.acceleration[1],
            |sample| &mut sample.rate[2],
        ];
        for spoil in spoils {
            let mut sample = next;
            *spoil(&mut sample) = bad;
            let refused = estimator.push(&sample, None);
            assert!(matches!(refused, Err(PoseError::Value { .. })));
        }
    }
    let again = estimator.push(&run.last, None);
    assert!(matches!(again, Err(PoseError::Backwards { .. })));
    let mut nowhere = Isometry3::identity();
    nowhere.translation.x = f64::NAN;
    let refused = estimator.push(&next, Some(nowhere));
    assert_eq!(refused, Err(PoseError::Kinematics));
    assert_eq!(estimator.push(&next, None), untouched.push(&next, None));
}

#[test]
fn a_gap_loses_the_pose_and_keeps_the_biases() {
    let run = run(1, PoseConfig::default());
    let (mut estimator, last) = (run.estimator, run.last);
    let far = estimator.push(&next(&last, 60_000_000), None);
    assert!(matches!(far, Err(PoseError::Gap { .. })));
    let lost = estimator.push(&next(&last, 62_000_000), None);
    assert_eq!(lost, Err(PoseError::Unknown));
    let again = estimator.push(&next(&last, 64_000_000), Some(head(0.0)));
    let again = again.unwrap().accelerometer_bias;
    assert_eq!(again, estimator.state.accelerometer_bias.data.0[0]);
    let before = Vector3::from(run.poses.last().unwrap().accelerometer_bias);
    assert!((Vector3::from(again) - before).norm() < 0.01);
}

#[test]
fn poses_between_samples_lie_between_them() {
    let run = run(2, PoseConfig::default());
    let poses = run.poses;
    let mut ring = PoseRing::new(155);
    poses.iter().for_each(|pose| ring.put(*pose));
    let middle = poses[poses.len() - 51];
    assert_eq!(ring.at(middle.t_ns).unwrap(), middle);
    // Interpolation over half a step of 2 ms at 20 m/s^2 is exact to a micrometre; the tolerance covers the true
    // motion.
    let pose = ring.at(middle.t_ns + DT_NS / 2).unwrap();
    let moved = error(&pose) - error(&middle);
    assert!(moved.fixed_rows::<3>(0).norm() < 2e-5, "{moved}");
    assert!(moved.fixed_rows::<3>(3).norm() < 5e-3, "{moved}");
    assert_eq!(ring.at(0), None);
    let kept = poses.last().unwrap().t_ns - 299_000_000;
    assert!(ring.at(kept).is_some());
}

#[test]
fn a_covariance_stays_symmetric_and_positive() {
    let run = run(3, PoseConfig::default());
    let (estimator, poses) = (run.estimator, run.poses);
    let p = estimator.state.covariance;
    assert_eq!(p, p.transpose());
    assert!(p.cholesky().is_some());
    let factor = |pose: &HeadPose| covariance(pose).cholesky();
    assert!(poses.iter().all(|pose| factor(pose).is_some()));
}

#[test]
fn settings_that_make_no_sense_are_named() {
    let config = PoseConfig {
        rest_velocity: f64::NAN,
        ..PoseConfig::default()
    };
    let error = PoseEstimator::new(&RobotDescription::nominal(), config).unwrap_err();
    assert!(error.to_string().contains("rest_velocity"));
}
