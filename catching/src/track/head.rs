//! Head pose as used by the tracker: pose, error covariance, and its change between pictures.
//!
//! The error of the head pose is almost the same in consecutive pictures. A filter that treats it as independent noise
//! would average it away. The errors of position, velocity, rotation and IMU biases are therefore part of the ball's
//! joint covariance as consider states (Schmidt), which circles do not correct. They evolve like IMU errors: a velocity
//! error moves the head, an attitude error tilts the measured acceleration, and biases integrate. Any further growth of
//! the reported covariance enters as noise.

use nalgebra::{Matrix3, Quaternion, SMatrix, UnitQuaternion, Vector3};
use tactnet_catching_packets::packets::HeadPose;

use super::triangular::lower;
use crate::pose::GRAVITY;

/// Number of error states: position, velocity, rotation, accelerometer bias, gyroscope bias.
pub(super) const HEAD: usize = 15;
/// Matrix of the error states.
pub(super) type HeadMatrix = SMatrix<f64, HEAD, HEAD>;

/// Sets a block of a matrix, given its first row and column.
pub(super) fn set<const R: usize, const C: usize, const A: usize, const B: usize>(
    matrix: &mut SMatrix<f64, R, C>,
    first: [usize; 2],
    block: &SMatrix<f64, A, B>,
) {
    matrix
        .fixed_view_mut::<A, B>(first[0], first[1])
        .copy_from(block);
}

/// Validated head pose.
#[derive(Debug, Clone, Copy)]
pub struct Head {
    /// Time of the pose, in ns.
    pub t_ns: u64,
    /// Rotation from the head frame to the inertial frame.
    pub rotation: Matrix3<f64>,
    /// Position of the head frame, in m.
    pub position: Vector3<f64>,
    /// Velocity, in m/s.
    pub velocity: Vector3<f64>,
    covariance: HeadMatrix,
}

impl Head {
    /// Validates a pose. Returns `None` if values are not finite or inconsistent.
    pub fn new(pose: &HeadPose) -> Option<Self> {
        let numbers = pose.position.iter().chain(&pose.quaternion);
        let mut numbers = numbers
            .chain(&pose.velocity)
            .chain(pose.covariance.as_flattened());
        let sound = numbers.all(|x| x.abs() < 1e6);
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

    pub(super) fn root(&self) -> HeadMatrix {
        lower(root(&self.covariance))
    }

    /// Returns the change of the errors since an `earlier` pose.
    pub(super) fn drift(&self, earlier: &Head) -> HeadDrift {
        let dt = (self.t_ns as f64 - earlier.t_ns as f64) * 1e-9;
        // Integral of the measured acceleration.
        let felt =
            (self.velocity - earlier.velocity + Vector3::z() * (GRAVITY * dt)).cross_matrix();
        let mut phi = HeadMatrix::identity();
        set(&mut phi, [0, 3], &(Matrix3::identity() * dt));
        // Double integral of the measured acceleration since the earlier pose.
        let moved = (self.position - earlier.position - earlier.velocity * dt
            + Vector3::z() * (GRAVITY * dt * dt / 2.0))
            .cross_matrix();
        set(&mut phi, [0, 6], &-moved);
        set(&mut phi, [3, 6], &-felt);
        let turned = self.rotation * dt;
        set(&mut phi, [0, 9], &(turned * (-dt / 2.0)));
        set(&mut phi, [3, 9], &-turned);
        set(&mut phi, [0, 12], &(felt * turned * (dt / 6.0)));
        set(&mut phi, [3, 12], &(felt * turned / 2.0));
        set(&mut phi, [6, 12], &-turned);
        let grown = self.covariance - phi * earlier.covariance * phi.transpose();
        HeadDrift {
            phi,
            noise: root(&((grown + grown.transpose()) * 0.5)),
        }
    }
}

/// Linear model of the head's errors: `e -> phi e + noise n`, with `n` of unit variance.
#[derive(Debug, Clone)]
pub(super) struct HeadDrift {
    pub phi: HeadMatrix,
    pub noise: HeadMatrix,
}

/// Returns a root of the positive part of a symmetric matrix.
fn root(m: &HeadMatrix) -> HeadMatrix {
    if m.amax() == 0.0 {
        return HeadMatrix::zeros();
    }
    let Some(eigen) = m.try_symmetric_eigen(1e-15, 1000) else {
        // Fallback without convergence; an upper bound is safe.
        return HeadMatrix::identity() * m.norm().sqrt();
    };
    let mut root = eigen.eigenvectors;
    for (mut column, value) in root.column_iter_mut().zip(eigen.eigenvalues.iter()) {
        column *= value.max(0.0).sqrt();
    }
    root
}
