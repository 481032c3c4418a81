//! Named random streams from one seed.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// What numbers are drawn for. Each name and index has a stream of its own, so one part that draws more, or nothing, shifts no other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stream {
    /// Where a ball comes from and goes to; index: the ball.
    Thrower = 1,
    /// Drag and spin; index: the ball.
    Ball = 2,
    /// How far the platform slips.
    Slip = 3,
    /// Where arms are mounted; index: the arm.
    ArmMount = 4,
    /// Where cameras are mounted.
    CameraMount = 5,
    /// Biases and scales of the inertial unit.
    ImuErrors = 6,
    /// Noise of the inertial unit.
    ImuNoise = 7,
    /// When the first picture is taken.
    CameraPhase = 8,
    /// Noise and chance of a ball in a picture; index: [`picture`] with the ball.
    Outline = 9,
    /// Circles that are no balls; index: [`picture`].
    Clutter = 10,
    /// Order of a picture's circles; index: [`picture`].
    Order = 11,
    /// Walls, furniture and stains; index: the side of the room.
    Surroundings = 12,
    /// Who stands about.
    People = 13,
    /// Brightness of a ball; index: the ball.
    BallBrightness = 14,
    /// Noise of a picture; index: [`picture`].
    PictureNoise = 15,
    /// Where obstacles stand; index: the rearrangement with the box.
    Obstacles = 16,
    /// Noise and holes of depth; index: the picture.
    Depth = 17,
    /// When a hand lets go; index: the release.
    Release = 18,
    /// What is wrong with a camera on its own; index: the camera.
    EachCamera = 19,
    /// Offsets and compliances of an arm's joints; index: the arm.
    ArmJoints = 20,
    /// Offsets of the neck's joints.
    NeckJoints = 21,
    /// Where markers are glued; index: the arm.
    MarkerPlace = 22,
    /// How the inertial unit is turned.
    ImuTurn = 23,
    /// By how much stamps are late.
    Clocks = 24,
    /// Noise and chance of a marker in a picture; index: [`picture`] with the arm.
    Marker = 25,
    /// Lengths of an arm's links; index: the arm.
    ArmLengths = 26,
}

impl Stream {
    /// Returns the stream of that name and index (below 2^56).
    pub(crate) fn rng(self, seed: u64, index: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(((self as u64) << 56) | (index & ((1 << 56) - 1)));
        rng
    }
}

/// Returns the index of a ball (0 where none is meant) in a picture of a camera.
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
