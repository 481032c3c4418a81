//! The estimator: validates samples, updates the filter and stores recent poses.

use nalgebra::{Isometry3, Matrix3, Vector3};
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_packets::packets::{HeadPose, ImuSample};

use super::error_state::{Block, Covariance, ErrorState};
use super::ring::PoseRing;
use super::{PoseConfig, PoseError};

/// Largest plausible accelerometer value, in m/s^2.
const MAX_ACCELERATION: f64 = 500.0;
/// Largest plausible gyroscope value, in rad/s.
const MAX_RATE: f64 = 100.0;
/// Step back in time, in ns, from which a sample counts as a clock change instead of a late sample.
const CLOCK_SET_NS: u64 = 1_000_000_000;
/// Standard deviations of position (m) and rotation (rad) above which a pose at rest restarts the estimate.
const LOST: [f64; 2] = [0.5, 0.2];

/// Estimator of the head pose.
#[derive(Debug, Clone)]
pub struct PoseEstimator {
    config: PoseConfig,
    /// Position of the IMU in the head frame, in m.
    lever: Vector3<f64>,
    rate: f64,
    state: ErrorState,
    /// Last sample, while the pose is known.
    last: Option<ImuSample>,
    ring: PoseRing,
}

impl PoseEstimator {
    /// Creates an estimator without a pose.
    ///
    /// # Errors
    /// Returns an error if a setting is not greater than 0.
    pub fn new(robot: &RobotDescription, config: PoseConfig) -> Result<Self, PoseError> {
        config.check()?;
        Ok(Self {
            config,
            lever: Vector3::from(robot.imu.position),
            rate: robot.imu.rate,
            state: ErrorState::new(&config),
            last: None,
            ring: PoseRing::new((config.ring * robot.imu.rate).ceil() as usize + 1),
        })
    }

    /// Processes a sample and returns the pose at its time. `at_rest` is the kinematic head pose in the inertial frame
    /// while the robot rests, and `None` while it moves. Does not allocate.
    ///
    /// # Errors
    /// Returns an error for an invalid sample ([`PoseError`]) or while the pose is unknown. The first pose needs
    /// `at_rest`.
    pub fn push(
        &mut self,
        sample: &ImuSample,
        at_rest: Option<Isometry3<f64>>,
    ) -> Result<HeadPose, PoseError> {
        check(sample)?;
        if at_rest.is_some_and(|pose| !finite(&pose)) {
            return Err(PoseError::Kinematics);
        }
        match self.last {
            None => match at_rest {
                Some(pose) => self.start(&pose),
                None => return Err(PoseError::Unknown),
            },
            Some(last) => self.integrate(&last, sample)?,
        }
        if let Some(pose) = at_rest {
            self.rest(sample, &pose);
        }
        self.last = Some(*sample);
        let pose = self.pose(sample);
        self.ring.put(pose);
        Ok(pose)
    }

    /// Corrects the pose weakly with the kinematic head pose at the time of the last sample: 2 cm and 2 deg per
    /// correlation time.
    ///
    /// # Errors
    /// Returns an error if the pose is not finite or the estimate is unknown.
    pub fn correct(&mut self, kinematics: &Isometry3<f64>) -> Result<HeadPose, PoseError> {
        if !finite(kinematics) {
            return Err(PoseError::Kinematics);
        }
        let last = self.last.ok_or(PoseError::Unknown)?;
        let share = (self.config.motion_correlation * self.rate).sqrt().max(1.0);
        self.place(
            kinematics,
            self.config.motion_position * share,
            self.config.motion_attitude * share,
        );
        Ok(self.pose(&last))
    }

    /// Returns the pose at a time in the last 0.3 s ([`PoseConfig::ring`]), interpolated between samples.
    ///
    /// # Errors
    /// Returns an error if no pose is stored for this time.
    pub fn at(&self, t_ns: u64) -> Result<HeadPose, PoseError> {
        self.ring.at(t_ns)
    }

    fn start(&mut self, pose: &Isometry3<f64>) {
        self.ring.clear();
        let p = pose.translation.vector + pose.rotation * self.lever;
        self.state.start(p, pose.rotation, &self.config);
    }

    fn integrate(&mut self, last: &ImuSample, sample: &ImuSample) -> Result<(), PoseError> {
        let (last_ns, found_ns) = (last.sensor_ns, sample.sensor_ns);
        if found_ns <= last_ns {
            if last_ns - found_ns > CLOCK_SET_NS {
                self.last = None;
            }
            return Err(PoseError::Backwards { last_ns, found_ns });
        }
        let dt = (found_ns - last_ns) as f64 * 1e-9;
        if dt > self.config.longest_gap {
            self.last = None;
            return Err(PoseError::Gap { last_ns, found_ns });
        }
        let mean = |a: [f64; 3], b: [f64; 3]| (Vector3::from(a) + Vector3::from(b)) * 0.5;
        let force = mean(last.acceleration, sample.acceleration);
        self.state
            .integrate(&force, &mean(last.rate, sample.rate), dt, &self.config);
        Ok(())
    }

    fn rest(&mut self, sample: &ImuSample, pose: &Isometry3<f64>) {
        if self.state.sigma(Block::Position) > LOST[0]
            || self.state.sigma(Block::Rotation) > LOST[1]
        {
            self.start(pose);
        }
        // The kinematic error is constant, so repeated measurements must not improve the estimate beyond it.
        let (position, attitude) = (self.config.rest_position, self.config.rest_attitude);
        if self.state.sigma(Block::Position) > position
            || self.state.sigma(Block::Rotation) > attitude
        {
            let share = (self.config.rest_correlation * self.rate).sqrt().max(1.0);
            self.place(pose, position * share, attitude * share);
        }
        let still = -self.state.v;
        self.state
            .measure(Block::Velocity, &still, self.config.rest_velocity);
        let bias = Vector3::from(sample.rate) - self.state.gyroscope_bias;
        self.state
            .measure(Block::GyroscopeBias, &bias, self.config.gyroscope_noise);
    }

    fn place(&mut self, pose: &Isometry3<f64>, position: f64, attitude: f64) {
        let p = pose.translation.vector + pose.rotation * self.lever;
        self.state
            .measure(Block::Position, &(p - self.state.p), position);
        let turn = (pose.rotation * self.state.q.inverse()).scaled_axis();
        self.state.measure(Block::Rotation, &turn, attitude);
    }

    /// Converts the state of the IMU to the pose of the head, across the lever between them.
    fn pose(&self, sample: &ImuSample) -> HeadPose {
        let state = &self.state;
        let rotation = state.q.to_rotation_matrix().into_inner();
        let rate = Vector3::from(sample.rate) - state.gyroscope_bias;
        let lever = rotation * self.lever;
        let swing = rotation * rate.cross(&self.lever);
        let mut jacobian = Covariance::identity();
        let mut set = |row: Block, column: Block, block: Matrix3<f64>| {
            jacobian
                .fixed_view_mut::<3, 3>(row as usize, column as usize)
                .copy_from(&block);
        };
        set(Block::Position, Block::Rotation, lever.cross_matrix());
        set(Block::Velocity, Block::Rotation, swing.cross_matrix());
        let by_rate = -rotation * self.lever.cross_matrix();
        set(Block::Velocity, Block::GyroscopeBias, by_rate);
        let mut covariance = jacobian * state.covariance * jacobian.transpose();
        let noise = by_rate * by_rate.transpose() * self.config.gyroscope_noise.powi(2);
        let mut velocity = covariance.fixed_view_mut::<3, 3>(3, 3);
        velocity += noise;
        HeadPose {
            t_ns: sample.sensor_ns,
            position: (state.p - lever).into(),
            quaternion: state.q.coords.into(),
            velocity: (state.v - swing).into(),
            accelerometer_bias: state.accelerometer_bias.into(),
            gyroscope_bias: state.gyroscope_bias.into(),
            covariance: std::array::from_fn(|i| {
                std::array::from_fn(|j| (covariance[(i, j)] + covariance[(j, i)]) / 2.0)
            }),
        }
    }
}

fn check(sample: &ImuSample) -> Result<(), PoseError> {
    let accelerations = sample.acceleration.map(|x| (x, MAX_ACCELERATION));
    let rates = sample.rate.map(|x| (x, MAX_RATE));
    match accelerations
        .into_iter()
        .chain(rates)
        .find(|(x, most)| x.is_nan() || x.abs() > *most)
    {
        Some((found, _)) => Err(PoseError::Value {
            number: sample.number,
            found,
        }),
        None => Ok(()),
    }
}

fn finite(pose: &Isometry3<f64>) -> bool {
    let numbers = pose
        .translation
        .vector
        .iter()
        .chain(pose.rotation.coords.iter());
    numbers.into_iter().all(|x| x.is_finite()) && (pose.rotation.norm() - 1.0).abs() < 1e-6
}

#[cfg(test)]
mod tests {
    use super::super::shaking::{DT_NS, REST, Run, chi_square, head, run};
    use super::*;
    use nalgebra::{SMatrix, SVector, UnitQuaternion};

    fn estimator(config: PoseConfig) -> PoseEstimator {
        PoseEstimator::new(&RobotDescription::nominal(), config).unwrap()
    }

    fn error(pose: &HeadPose) -> SVector<f64, 9> {
        let h = 1e-5;
        let t = pose.t_ns as f64 * 1e-9;
        let truth = head(t);
        let velocity =
            (head(t + h).translation.vector - head(t - h).translation.vector) / (2.0 * h);
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
            let Run {
                estimator,
                poses,
                accelerometer_bias,
                ..
            } = run(seed, config);
            let at_rest = poses[((REST - 0.02) * 512.0) as usize];
            let missing = accelerometer_bias - Vector3::from(at_rest.accelerometer_bias);
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
        let mut squares = 0.0;
        let mut parts = [0.0; 3];
        for seed in 0..runs {
            let pose = *run(seed, PoseConfig::default()).poses.last().unwrap();
            let e = error(&pose);
            sum += (e.transpose() * covariance(&pose).try_inverse().unwrap() * e)[0];
            squares += e.fixed_rows::<3>(0).norm_squared();
            for (i, part) in parts.iter_mut().enumerate() {
                let e = e.fixed_rows::<3>(3 * i).into_owned();
                let p = covariance(&pose)
                    .fixed_view::<3, 3>(3 * i, 3 * i)
                    .into_owned();
                *part += (e.transpose() * p.try_inverse().unwrap() * e)[0] / runs as f64;
            }
        }
        let freedom = 9.0 * runs as f64;
        let band = [
            chi_square(freedom, -1.96) / runs as f64,
            chi_square(freedom, 1.96) / runs as f64,
        ];
        let nees = sum / runs as f64;
        println!(
            "NEES {nees:.2} (parts {parts:.2?}), band {band:.2?}; position after a second: {:.1} mm rms",
            (squares / runs as f64).sqrt() * 1e3
        );
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
        assert!(
            (pose.position[0] - 0.01).abs() < 1e-4,
            "{}",
            pose.position[0]
        );
        assert!(
            (pose.covariance[0][0].sqrt() - 0.01).abs() < 3e-4,
            "{}",
            pose.covariance[0][0].sqrt()
        );
    }

    #[test]
    fn kinematics_bound_the_drift_weakly() {
        let run = |correct: bool| {
            let mut estimator = estimator(PoseConfig::default());
            let mut worst: f64 = 0.0;
            for number in 0..512 * 20 {
                let sample = ImuSample {
                    number,
                    sensor_ns: number * DT_NS,
                    acceleration: [0.05, 0.0, 9.81],
                    rate: [0.003, 0.0, 0.0],
                };
                let mut pose = estimator
                    .push(&sample, (number == 0).then_some(Isometry3::identity()))
                    .unwrap();
                if correct {
                    pose = estimator.correct(&Isometry3::identity()).unwrap();
                }
                worst = worst.max(Vector3::from(pose.position).norm());
            }
            worst
        };
        assert!(run(true) < 0.05, "{}", run(true));
        assert!(run(false) > 1.0);
    }

    #[test]
    fn what_is_no_sample_changes_nothing() {
        let Run {
            mut estimator,
            poses,
            last,
            ..
        } = run(1, PoseConfig::default());
        let next = |change: fn(&mut ImuSample)| {
            let mut sample = last;
            sample.sensor_ns += DT_NS;
            change(&mut sample);
            sample
        };
        let mut untouched = estimator.clone();
        for bad in [f64::NAN, f64::INFINITY, 1e30] {
            let mut sample = next(|_| ());
            sample.acceleration[1] = bad;
            assert!(matches!(
                estimator.push(&sample, None),
                Err(PoseError::Value { .. })
            ));
            sample.acceleration[1] = 0.0;
            sample.rate[2] = bad;
            assert!(matches!(
                estimator.push(&sample, None),
                Err(PoseError::Value { .. })
            ));
        }
        assert!(matches!(
            estimator.push(&last, None),
            Err(PoseError::Backwards { .. })
        ));
        let mut nowhere = Isometry3::identity();
        nowhere.translation.x = f64::NAN;
        assert_eq!(
            estimator.push(&next(|_| ()), Some(nowhere)),
            Err(PoseError::Kinematics)
        );
        assert_eq!(
            estimator.push(&next(|_| ()), None),
            untouched.push(&next(|_| ()), None)
        );
        let far = next(|sample| sample.sensor_ns += 60_000_000);
        assert!(matches!(
            estimator.push(&far, None),
            Err(PoseError::Gap { .. })
        ));
        assert_eq!(
            estimator.push(&next(|sample| sample.sensor_ns += 62_000_000), None),
            Err(PoseError::Unknown)
        );
        let again = estimator
            .push(
                &next(|sample| sample.sensor_ns += 64_000_000),
                Some(head(0.0)),
            )
            .unwrap();
        assert_eq!(
            again.accelerometer_bias,
            estimator.state.accelerometer_bias.data.0[0]
        );
        assert!(
            (Vector3::from(again.accelerometer_bias)
                - Vector3::from(poses.last().unwrap().accelerometer_bias))
            .norm()
                < 0.01
        );
    }

    #[test]
    fn poses_between_samples_lie_between_them() {
        let Run {
            estimator, poses, ..
        } = run(2, PoseConfig::default());
        let middle = poses[poses.len() - 51];
        assert_eq!(estimator.at(middle.t_ns).unwrap(), middle);
        // Interpolation over half a step of 2 ms at 20 m/s^2 is exact to a micrometre; the tolerance covers the true
        // motion.
        let pose = estimator.at(middle.t_ns + DT_NS / 2).unwrap();
        let moved = error(&pose) - error(&middle);
        assert!(moved.fixed_rows::<3>(0).norm() < 2e-5, "{moved}");
        assert!(moved.fixed_rows::<3>(3).norm() < 5e-3, "{moved}");
        assert!(matches!(estimator.at(0), Err(PoseError::NotKept { .. })));
        let kept = poses.last().unwrap().t_ns - 299_000_000;
        assert!(estimator.at(kept).is_ok());
    }

    #[test]
    fn a_covariance_stays_symmetric_and_positive() {
        let Run {
            estimator, poses, ..
        } = run(3, PoseConfig::default());
        let p = estimator.state.covariance;
        assert_eq!(p, p.transpose());
        assert!(p.cholesky().is_some());
        assert!(
            poses
                .iter()
                .all(|pose| covariance(pose).cholesky().is_some())
        );
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
}
