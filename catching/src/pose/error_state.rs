//! State of the filter, its prediction and its correction.

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};

use super::{GRAVITY, PoseConfig};

/// Number of error states: position, velocity, rotation and two biases, three each.
pub(super) const STATES: usize = 15;
pub(super) type Covariance = SMatrix<f64, STATES, STATES>;

/// Block of three error states, identified by the index of its first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Block {
    Position = 0,
    Velocity = 3,
    Rotation = 6,
    AccelerometerBias = 9,
    GyroscopeBias = 12,
}

impl Block {
    /// Sets the derivatives of these error states with respect to the states of another block.
    pub fn set(self, jacobian: &mut Covariance, of: Self, block: Matrix3<f64>) {
        jacobian
            .fixed_view_mut::<3, 3>(self as usize, of as usize)
            .copy_from(&block);
    }
}

/// Motion of the IMU in the inertial frame, its biases, and their error covariance.
#[derive(Debug, Clone)]
pub(super) struct ErrorState {
    pub p: Vector3<f64>,
    pub v: Vector3<f64>,
    pub q: UnitQuaternion<f64>,
    pub accelerometer_bias: Vector3<f64>,
    pub gyroscope_bias: Vector3<f64>,
    pub covariance: Covariance,
}

impl ErrorState {
    pub fn new(config: &PoseConfig) -> Self {
        let mut state = Self {
            p: Vector3::zeros(),
            v: Vector3::zeros(),
            q: UnitQuaternion::identity(),
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            covariance: Covariance::zeros(),
        };
        state.forget(Block::AccelerometerBias, config.accelerometer_bias);
        state.forget(Block::GyroscopeBias, config.gyroscope_bias);
        state
    }

    /// Initialises the pose at rest; biases are kept.
    pub fn start(&mut self, p: Vector3<f64>, q: UnitQuaternion<f64>, config: &PoseConfig) {
        self.p = p;
        self.v = Vector3::zeros();
        self.q = q;
        self.forget(Block::Position, config.rest_position);
        self.forget(Block::Velocity, config.rest_velocity);
        self.forget(Block::Rotation, config.rest_attitude);
    }

    /// Decorrelates a block from all others and sets its standard deviation.
    fn forget(&mut self, block: Block, sigma: f64) {
        let i = block as usize;
        self.covariance.fixed_rows_mut::<3>(i).fill(0.0);
        self.covariance.fixed_columns_mut::<3>(i).fill(0.0);
        for i in i..i + 3 {
            self.covariance[(i, i)] = sigma * sigma;
        }
    }

    /// Returns the largest standard deviation of a block.
    pub fn sigma(&self, block: Block) -> f64 {
        let i = block as usize;
        (i..i + 3)
            .map(|i| self.covariance[(i, i)])
            .fold(0.0, f64::max)
            .sqrt()
    }

    /// Integrates over `dt` s with the mean of the samples at both ends: specific force in m/s^2 and angular velocity
    /// in rad/s.
    pub fn integrate(
        &mut self,
        force: &Vector3<f64>,
        rate: &Vector3<f64>,
        dt: f64,
        config: &PoseConfig,
    ) {
        let rate = rate - self.gyroscope_bias;
        let half = UnitQuaternion::from_scaled_axis(rate * (dt / 2.0));
        let middle = (self.q * half).to_rotation_matrix().into_inner();
        let felt = middle * (force - self.accelerometer_bias);
        let acceleration = felt - Vector3::z() * GRAVITY;
        self.p += (self.v + acceleration * (dt / 2.0)) * dt;
        self.v += acceleration * dt;
        self.q = UnitQuaternion::new_normalize((self.q * half * half).into_inner());

        let mut phi = Covariance::identity();
        let mut set = |row: Block, column: Block, block| row.set(&mut phi, column, block);
        let felt = felt.cross_matrix();
        set(Block::Position, Block::Velocity, Matrix3::identity() * dt);
        set(Block::Position, Block::Rotation, felt * (-dt * dt / 2.0));
        set(
            Block::Position,
            Block::AccelerometerBias,
            middle * (-dt * dt / 2.0),
        );
        set(Block::Velocity, Block::Rotation, felt * -dt);
        set(Block::Velocity, Block::AccelerometerBias, middle * -dt);
        set(
            Block::Velocity,
            Block::GyroscopeBias,
            felt * middle * (dt * dt / 2.0),
        );
        set(Block::Rotation, Block::GyroscopeBias, middle * -dt);
        let mut moved = phi * self.covariance * phi.transpose();
        // A sample represents the time from half a step before it to half a step after it.
        let shake = (config.accelerometer_noise * dt).powi(2);
        let turn = (config.gyroscope_noise * dt).powi(2);
        for i in 0..3 {
            moved[(i, i)] += shake * dt * dt / 4.0;
            moved[(i, i + 3)] += shake * dt / 2.0;
            moved[(i + 3, i)] += shake * dt / 2.0;
            moved[(i + 3, i + 3)] += shake;
            moved[(i + 6, i + 6)] += turn;
            moved[(i + 9, i + 9)] += config.accelerometer_walk.powi(2) * dt;
            moved[(i + 12, i + 12)] += config.gyroscope_walk.powi(2) * dt;
        }
        self.covariance = (moved + moved.transpose()) * 0.5;
    }

    /// Processes a measurement of one block: its difference from the estimate and its standard deviation per axis. The
    /// covariance update uses Joseph's form, which stays positive for any gain.
    pub fn measure(&mut self, block: Block, difference: &Vector3<f64>, sigma: f64) {
        let i = block as usize;
        let noise = Matrix3::identity() * (sigma * sigma);
        let columns = self.covariance.fixed_columns::<3>(i).into_owned();
        let innovation = columns.fixed_rows::<3>(i) + noise;
        let Some(inverse) = innovation.try_inverse() else {
            return;
        };
        let gain = columns * inverse;
        let mut keep = Covariance::identity();
        let mut part = keep.fixed_columns_mut::<3>(i);
        part -= gain;
        let after = keep * self.covariance * keep.transpose() + gain * noise * gain.transpose();
        self.covariance = (after + after.transpose()) * 0.5;
        let error = gain * difference;
        let part = |block: Block| error.fixed_rows::<3>(block as usize).into_owned();
        self.p += part(Block::Position);
        self.v += part(Block::Velocity);
        self.q = UnitQuaternion::from_scaled_axis(part(Block::Rotation)) * self.q;
        self.accelerometer_bias += part(Block::AccelerometerBias);
        self.gyroscope_bias += part(Block::GyroscopeBias);
    }
}
