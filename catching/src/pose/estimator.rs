//! The estimator: validates samples and updates the filter.

use nalgebra::{Isometry3, Vector3};
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_packets::packets::{HeadPose, ImuSample};

use super::error_state::{Block, Covariance, ErrorState};
use super::{PoseConfig, PoseError};

/// Largest plausible accelerometer value, in m/s^2.
const MAX_ACCELERATION: f64 = 500.0;
/// Largest plausible gyroscope value, in rad/s.
const MAX_RATE: f64 = 100.0;
/// Step back in time, in ns, from which a sample counts as a clock change instead of a late sample.
const CLOCK_SET_NS: u64 = 1_000_000_000;
/// Standard deviations of position (m) and rotation (rad) above which a pose at rest restarts the estimate.
const RESTART_SIGMAS: [f64; 2] = [0.5, 0.2];

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
}

impl PoseEstimator {
    /// Creates an estimator without a pose.
    ///
    /// # Errors
    /// Returns an error if a setting is not greater than 0.
    pub fn new(robot: &RobotDescription, config: PoseConfig) -> Result<Self, PoseError> {
        config.check_settings()?;
        Ok(Self {
            config,
            lever: Vector3::from(robot.imu.position),
            rate: robot.imu.rate,
            state: ErrorState::new(&config),
            last: None,
        })
    }

    /// Forgets pose and biases.
    pub fn restart(&mut self) {
        self.state = ErrorState::new(&self.config);
        self.last = None;
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
        Ok(self.pose(sample))
    }

    fn start(&mut self, pose: &Isometry3<f64>) {
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
        if self.state.sigma(Block::Position) > RESTART_SIGMAS[0]
            || self.state.sigma(Block::Rotation) > RESTART_SIGMAS[1]
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
        let mut set = |row: Block, column: Block, block| row.set(&mut jacobian, column, block);
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
    let mut numbers = accelerations.into_iter().chain(rates);
    match numbers.find(|(x, most)| x.is_nan() || x.abs() > *most) {
        Some((found, _)) => Err(PoseError::Value {
            number: sample.number,
            found,
        }),
        None => Ok(()),
    }
}

fn finite(pose: &Isometry3<f64>) -> bool {
    let (place, turn) = (&pose.translation.vector, &pose.rotation);
    let mut numbers = place.iter().chain(turn.coords.iter());
    numbers.all(|x| x.is_finite()) && (turn.norm() - 1.0).abs() < 1e-6
}

#[cfg(test)]
mod tests;
