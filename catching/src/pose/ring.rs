//! Ring buffer of recent poses, for pictures that arrive later than they were taken.

use std::collections::VecDeque;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use tactnet_catching_packets::packets::HeadPose;

/// Number of poses that covers the delay of pictures: 0.6 s.
pub const POSES: usize = 307;

/// Poses by time. New poses overwrite the oldest.
#[derive(Debug, Clone)]
pub struct PoseRing {
    poses: VecDeque<HeadPose>,
    places: usize,
}

impl PoseRing {
    /// Creates a buffer for `places` poses.
    pub fn new(places: usize) -> Self {
        let places = places.max(2);
        Self {
            poses: VecDeque::with_capacity(places),
            places,
        }
    }

    /// Returns the latest pose.
    pub fn last(&self) -> Option<&HeadPose> {
        self.poses.back()
    }

    /// Stores a pose. A pose that is not later than the last one comes from a restarted estimator and replaces all
    /// stored ones.
    pub fn put(&mut self, pose: HeadPose) {
        if self.last().is_some_and(|last| pose.t_ns <= last.t_ns) {
            self.poses.clear();
        }
        if self.poses.len() == self.places {
            self.poses.pop_front();
        }
        self.poses.push_back(pose);
    }

    /// Returns the interpolated pose at a time between the oldest and the latest.
    pub fn at(&self, t_ns: u64) -> Option<HeadPose> {
        if !(self.poses.front()?.t_ns..=self.last()?.t_ns).contains(&t_ns) {
            return None;
        }
        let later = self.poses.partition_point(|pose| pose.t_ns <= t_ns);
        let before = &self.poses[later - 1];
        Some(if before.t_ns == t_ns {
            *before
        } else {
            between(before, &self.poses[later], t_ns)
        })
    }
}

/// Interpolates between two poses: cubic in position and velocity, constant angular velocity, linear in covariance and
/// biases.
fn between(a: &HeadPose, b: &HeadPose, t_ns: u64) -> HeadPose {
    let span = (b.t_ns - a.t_ns) as f64 * 1e-9;
    let s = (t_ns - a.t_ns) as f64 * 1e-9 / span;
    let mix = |a: f64, b: f64| a + (b - a) * s;
    let [pa, pb, va, vb] = [a.position, b.position, a.velocity, b.velocity].map(Vector3::from);
    let chord = (pb - pa) / span;
    let (from, to) = (va - chord, vb - chord);
    let position = pa + (pb - pa) * s + (from * (1.0 - s) - to * s) * (s * (1.0 - s) * span);
    let velocity = chord + from * ((1.0 - s) * (1.0 - 3.0 * s)) + to * (s * (3.0 * s - 2.0));
    let [qa, qb] = [a.quaternion, b.quaternion]
        .map(|[x, y, z, w]| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)));
    let q = qa * (qa.inverse() * qb).powf(s);
    HeadPose {
        t_ns,
        position: position.into(),
        quaternion: q.coords.into(),
        velocity: velocity.into(),
        accelerometer_bias: std::array::from_fn(|i| {
            mix(a.accelerometer_bias[i], b.accelerometer_bias[i])
        }),
        gyroscope_bias: std::array::from_fn(|i| mix(a.gyroscope_bias[i], b.gyroscope_bias[i])),
        covariance: std::array::from_fn(|i| {
            std::array::from_fn(|j| mix(a.covariance[i][j], b.covariance[i][j]))
        }),
    }
}
