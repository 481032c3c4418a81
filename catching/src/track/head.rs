//! The head as the tracker takes it: where it is, how wrong that may be, and how the error grows from picture to picture.
//!
//! The error of a head's pose is nearly the same in one picture and the next. A filter that took it as noise of each picture would believe
//! to average it away. So it is part of the ball's joint covariance: errors of position, velocity, rotation and of the inertial unit's
//! biases that the ball's circles do not correct (Schmidt, consider states), and that move on as those of an inertial unit do: a wrong
//! velocity moves the head, a wrong attitude tilts gravity and whatever else is felt, biases are felt. What the reported covariance grows
//! by beyond that comes in as noise.

use nalgebra::{Matrix3, Quaternion, SMatrix, UnitQuaternion, Vector3};
use tactnet_catching_packets::packets::HeadPose;

use super::triangular::lower;

/// Errors of position, velocity, rotation, of accelerometer and gyroscope.
pub(super) const HEAD: usize = 15;
/// A matrix of them.
pub(super) type HeadMatrix = SMatrix<f64, HEAD, HEAD>;

/// As an inertial unit feels it, m/s^2.
const GRAVITY: f64 = 9.81;

/// A head's pose that was checked.
#[derive(Debug, Clone, Copy)]
pub struct Head {
    /// Of which moment.
    pub t_ns: u64,
    /// From the head's frame to the inertial one.
    pub rotation: Matrix3<f64>,
    /// Of the head's frame, m.
    pub position: Vector3<f64>,
    /// m/s.
    pub velocity: Vector3<f64>,
    covariance: HeadMatrix,
}

impl Head {
    /// Takes a pose; `None` if numbers are missing or contradict each other.
    pub fn new(pose: &HeadPose) -> Option<Self> {
        let numbers = pose
            .position
            .iter()
            .chain(&pose.quaternion)
            .chain(&pose.velocity);
        let sound = numbers
            .chain(pose.covariance.as_flattened())
            .all(|x| x.abs() < 1e6);
        let [x, y, z, w] = pose.quaternion;
        let q = Quaternion::new(w, x, y, z);
        let covariance =
            HeadMatrix::from_fn(|i, j| (pose.covariance[i][j] + pose.covariance[j][i]) / 2.0);
        let unit = (q.norm() - 1.0).abs() < 1e-3;
        if !(sound && unit && (0..HEAD).all(|i| covariance[(i, i)] >= 0.0)) {
            return None;
        }
        let rotation = UnitQuaternion::new_normalize(q).to_rotation_matrix();
        Some(Self {
            t_ns: pose.t_ns,
            rotation: rotation.into_inner(),
            position: Vector3::from(pose.position),
            velocity: Vector3::from(pose.velocity),
            covariance,
        })
    }

    /// Returns a root of the covariance.
    pub(super) fn root(&self) -> HeadMatrix {
        lower(root(&self.covariance))
    }

    /// Returns how errors moved on since an `earlier` pose.
    pub(super) fn drift(&self, earlier: &Head) -> HeadDrift {
        let dt = (self.t_ns as f64 - earlier.t_ns as f64) * 1e-9;
        // What was felt meanwhile, times the time.
        let felt =
            (self.velocity - earlier.velocity + Vector3::z() * (GRAVITY * dt)).cross_matrix();
        let mut phi = HeadMatrix::identity();
        phi.fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&(Matrix3::identity() * dt));
        // The same, felt since the earlier pose and integrated twice.
        let moved = (self.position - earlier.position - earlier.velocity * dt
            + Vector3::z() * (GRAVITY * dt * dt / 2.0))
            .cross_matrix();
        phi.fixed_view_mut::<3, 3>(0, 6).copy_from(&-moved);
        phi.fixed_view_mut::<3, 3>(3, 6).copy_from(&-felt);
        let turned = self.rotation * dt;
        let mut set = |row: usize, column: usize, block: Matrix3<f64>| {
            phi.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
        };
        set(0, 9, turned * (-dt / 2.0));
        set(3, 9, -turned);
        set(0, 12, felt * turned * (dt / 6.0));
        set(3, 12, felt * turned / 2.0);
        set(6, 12, -turned);
        let grown = self.covariance - phi * earlier.covariance * phi.transpose();
        HeadDrift {
            phi,
            noise: root(&((grown + grown.transpose()) * 0.5)),
        }
    }
}

/// How a head's errors move on: `e -> phi e + noise n`, `n` of unit variance.
#[derive(Debug, Clone)]
pub(super) struct HeadDrift {
    pub phi: HeadMatrix,
    pub noise: HeadMatrix,
}

/// Returns a root of a symmetric matrix without what is negative of it.
fn root(m: &HeadMatrix) -> HeadMatrix {
    if m.amax() == 0.0 {
        return HeadMatrix::zeros();
    }
    let Some(eigen) = m.try_symmetric_eigen(1e-15, 1000) else {
        // Never seen; too large is safe.
        return HeadMatrix::identity() * m.norm().sqrt();
    };
    let mut root = eigen.eigenvectors;
    for (mut column, value) in root.column_iter_mut().zip(eigen.eigenvalues.iter()) {
        column *= value.max(0.0).sqrt();
    }
    root
}
