//! Named random streams from one seed.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Purpose of random numbers. Each purpose and index has a separate stream, so a change of one part does not affect
/// the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stream {
    /// Origin and target of a ball; index: the ball.
    Thrower = 1,
    /// Drag and spin; index: the ball.
    Ball = 2,
    /// Slip of the platform.
    Slip = 3,
    /// Mounting errors of the arms; index: the arm.
    ArmMount = 4,
    /// Common mounting errors of the cameras.
    CameraMount = 5,
    /// Bias and scale errors of the inertial unit.
    ImuErrors = 6,
    /// Noise of the inertial unit.
    ImuNoise = 7,
    /// Time of the first picture.
    CameraPhase = 8,
    /// Noise and detection of a ball in a picture; index: [`picture`] with the ball.
    Outline = 9,
    /// False detections; index: [`picture`].
    Clutter = 10,
    /// Order of the circles of a picture; index: [`picture`].
    Order = 11,
    /// Walls, furniture and stains; index: the face of the room.
    Surroundings = 12,
    People = 13,
    /// Brightness of a ball; index: the ball.
    BallBrightness = 14,
    /// Noise of a picture; index: [`picture`].
    PictureNoise = 15,
    /// Places of obstacles; index: the rearrangement with the box.
    Obstacles = 16,
    /// Noise and invalid pixels of depth pictures; index: the picture.
    Depth = 17,
    /// Jitter of a release; index: the release.
    Release = 18,
    /// Individual errors of a camera; index: the camera.
    EachCamera = 19,
    /// Offsets and compliances of an arm's joints; index: the arm.
    ArmJoints = 20,
    /// Offsets of the neck's joints.
    NeckJoints = 21,
    /// Displacement of a marker; index: the arm.
    MarkerPlace = 22,
    /// Rotation of the inertial unit.
    ImuTurn = 23,
    /// Delays of timestamps.
    Clocks = 24,
    /// Noise and detection of a marker in a picture; index: [`picture`] with the arm.
    Marker = 25,
    /// Lengths of an arm's links; index: the arm.
    ArmLengths = 26,
    /// Jitter of a timestamp; index: the packet with the sensor.
    StampJitter = 27,
}

impl Stream {
    /// Returns the stream of this purpose and an index below 2^56.
    pub(crate) fn rng(self, seed: u64, index: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(((self as u64) << 56) | (index & ((1 << 56) - 1)));
        rng
    }
}

/// Returns the stream index of a ball (0 for none) in a picture of a camera.
pub(crate) fn picture(frame: u64, camera: usize, ball: u64) -> u64 {
    ((ball & 0xff_ffff) << 32) | ((frame & 0x7fff_ffff) << 1) | camera as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    #[test]
    fn a_name_an_index_and_a_seed_each_make_another_stream() {
        let first = Stream::Ball.rng(1, 0).next_u64();
        assert_eq!(first, Stream::Ball.rng(1, 0).next_u64());
        assert_ne!(first, Stream::Ball.rng(1, 1).next_u64());
        assert_ne!(first, Stream::Ball.rng(2, 0).next_u64());
        assert_ne!(first, Stream::Slip.rng(1, 0).next_u64());
        assert_ne!(picture(3, 1, 2), picture(3, 0, 2));
        assert_ne!(picture(3, 1, 2), picture(2, 1, 3));
    }
}
