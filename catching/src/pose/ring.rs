//! Ring buffer of recent poses, for pictures that arrive later than they were taken.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use tactnet_catching_packets::packets::HeadPose;

use super::PoseError;

/// Number of poses that covers the delay of pictures: 0.6 s.
pub const POSES: usize = 307;

/// Poses by time. New poses overwrite the oldest.
#[derive(Debug, Clone)]
pub struct PoseRing {
    poses: Vec<HeadPose>,
    /// Index of the oldest pose once the buffer is full.
    oldest: usize,
}

impl PoseRing {
    /// Creates a buffer for `places` poses.
    pub fn new(places: usize) -> Self {
        Self {
            poses: Vec::with_capacity(places.max(2)),
            oldest: 0,
        }
    }

    /// Removes all poses.
    pub fn clear(&mut self) {
        self.poses.clear();
        self.oldest = 0;
    }

    /// Returns the latest pose.
    pub fn last(&self) -> Option<&HeadPose> {
        let count = self.poses.len();
        (count > 0).then(|| self.get(count - 1))
    }

    /// Stores a pose. A pose that is not later than the last one comes from a restarted estimator and replaces all
    /// stored ones.
    pub fn put(&mut self, pose: HeadPose) {
        if self.last().is_some_and(|last| pose.t_ns <= last.t_ns) {
            self.clear();
        }
        if self.poses.len() < self.poses.capacity() {
            self.poses.push(pose);
        } else {
            self.poses[self.oldest] = pose;
            self.oldest = (self.oldest + 1) % self.poses.len();
        }
    }

    fn get(&self, i: usize) -> &HeadPose {
        &self.poses[(self.oldest + i) % self.poses.len()]
    }

    /// Returns the interpolated pose at a time between the oldest and the latest.
    ///
    /// # Errors
    /// Returns an error if the time is out of range.
    pub fn at(&self, t_ns: u64) -> Result<HeadPose, PoseError> {
        let count = self.poses.len();
        if count == 0 {
            return Err(PoseError::Unknown);
        }
        let (first_ns, last_ns) = (self.get(0).t_ns, self.get(count - 1).t_ns);
        if !(first_ns..=last_ns).contains(&t_ns) {
            return Err(PoseError::NotKept {
                first_ns,
                last_ns,
                found_ns: t_ns,
            });
        }
        // Binary search for the first later pose.
        let (mut low, mut high) = (0, count);
        while low < high {
            let middle = (low + high) / 2;
            if self.get(middle).t_ns <= t_ns {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        let before = self.get(low - 1);
        Ok(if before.t_ns == t_ns {
            *before
        } else {
            between(before, self.get(low), t_ns)
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
