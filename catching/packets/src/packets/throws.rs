//! Throwing back: motion of a throw, opening of the hand, status of the thrower, and outcome.

use tactnet_packet::{Text, choices, packets};

use super::RampPacket;
use crate::THROW_JOINTS;

packets! {
    /// Motion of a throw in absolute time, in three parts: from the waiting pose to the start of the swing, a rest, and
    /// the swing. Joints are the torso's vertical joint, then the arm's joints from the shoulder; all others rest.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ThrowPath {
        /// Arm: 0 left, 1 right.
        #[recorded(1)]
        pub arm: u64,
        /// Number of the grip whose ball is thrown, as counted in [`HandState`].
        #[recorded(2)]
        pub grip: u64,
        /// Start of the approach to the swing, in ns.
        #[recorded(3)]
        pub start_ns: u64,
        /// Start of the swing, in ns.
        #[recorded(4)]
        pub swing_ns: u64,
        /// Time at which the ball must leave the hand, in ns.
        #[recorded(5)]
        pub open_ns: u64,
        /// Target position of the ball, in m.
        #[recorded(6)]
        pub target: [f64; 3],
        /// Ramps of the approach.
        #[recorded(7)]
        pub way: [RampPacket; THROW_JOINTS],
        /// Ramps of the swing.
        #[recorded(8)]
        pub swing: [RampPacket; THROW_JOINTS],
    }

    /// Opening command of a hand. The hand obeys only if it has received this packet shortly before its fingers begin
    /// to open.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct HandOpening {
        /// Arm: 0 left, 1 right.
        #[recorded(1)]
        pub arm: u64,
        /// Time at which the ball must leave the hand, in ns.
        #[recorded(2)]
        pub open_ns: u64,
    }

    /// Phase of the thrower and reason of its last failure.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ThrowStatus {
        /// Time, in ns.
        #[recorded(1)]
        pub t_ns: u64,
        /// A [`ThrowPhase`].
        #[recorded(2)]
        pub phase: u64,
        /// Number of the current grip, as counted in [`HandState`].
        #[recorded(3)]
        pub grip: u64,
        /// Number of failed throws since the start.
        #[recorded(4)]
        pub failed: u64,
        /// Reason of the last failure.
        #[recorded(5)]
        pub reason: Text<64>,
    }

    /// Outcome of a ball that was thrown back.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ThrownBack {
        /// Number of balls thrown back so far.
        #[recorded(1)]
        pub number: u64,
        /// Number of the grip, as counted in [`HandState`].
        #[recorded(2)]
        pub grip: u64,
        /// Arm: 0 left, 1 right.
        #[recorded(3)]
        pub arm: u64,
        /// Planned release time, in ns.
        #[recorded(4)]
        pub open_ns: u64,
        /// Actual release time, in ns.
        #[recorded(5)]
        pub left_ns: u64,
        /// Target position, in m.
        #[recorded(6)]
        pub target: [f64; 3],
        /// Position at which the ball fell through the target's height, in m. For a ball that stayed lower: its closest
        /// point to the target.
        #[recorded(7)]
        pub came_down: [f64; 3],
        /// Distance between target and landing position, in m.
        #[recorded(8)]
        pub miss: f64,
        /// Release speed, in m/s.
        #[recorded(9)]
        pub speed: f64,
        /// Horizontal distance from the hand to the landing position, in m.
        #[recorded(10)]
        pub length: f64,
    }
}

choices! {
    /// Phase of the thrower.
    pub enum ThrowPhase {
        /// No hand holds a ball.
        Empty = 1,
        /// A hand holds a ball, but the robot is outside its waiting pose or the material is not measured yet.
        Waiting = 2,
        /// Executes a throw.
        Throwing = 3,
        /// Drops the ball because no throw is possible.
        Dropping = 4,
    }
}

impl ThrowStatus {
    /// Returns the phase, or `None` for an unknown number.
    pub fn phase(&self) -> Option<ThrowPhase> {
        ThrowPhase::of(u32::try_from(self.phase).ok()?)
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    /// Returns the bytes at an offset, as little-endian numbers of 8 bytes.
    fn at<T: bytemuck::Pod, const N: usize>(packet: &T, offset: usize) -> [[u8; 8]; N] {
        let bytes = bytemuck::bytes_of(packet);
        std::array::from_fn(|i| bytes[offset + 8 * i..][..8].try_into().unwrap())
    }

    #[test]
    fn bytes_are_where_they_are_documented() {
        let ramp = |q0: f64| RampPacket {
            q0,
            end: 1.5,
            ..RampPacket::zeroed()
        };
        let path = ThrowPath {
            arm: 1,
            grip: 2,
            start_ns: 3,
            swing_ns: 4,
            open_ns: 5,
            target: [4.0, -0.5, 1.25],
            way: std::array::from_fn(|i| ramp(i as f64)),
            swing: std::array::from_fn(|i| ramp(10.0 + i as f64)),
        };
        assert_eq!(size_of::<ThrowPath>(), 832);
        assert_eq!(at(&path, 0), [1, 2, 3, 4, 5].map(u64::to_le_bytes));
        assert_eq!(at(&path, 40), [4.0, -0.5, 1.25].map(f64::to_le_bytes));
        // Ramps of the last joint.
        assert_eq!(at(&path, 64 + 7 * 48), [7.0_f64.to_le_bytes()]);
        assert_eq!(at(&path, 448 + 7 * 48), [17.0_f64.to_le_bytes()]);
        assert_eq!(at(&path, 824), [[0, 0, 0, 0, 0, 0, 0xf8, 0x3f]], "1.5");
        let opening = HandOpening { arm: 1, open_ns: 7 };
        assert_eq!(size_of::<HandOpening>(), 16);
        assert_eq!(at(&opening, 0), [1, 7].map(u64::to_le_bytes));
        let status = ThrowStatus {
            t_ns: 1,
            phase: ThrowPhase::Throwing as u64,
            grip: 9,
            failed: 2,
            reason: Text::new("brakes"),
        };
        assert_eq!(size_of::<ThrowStatus>(), 96);
        assert_eq!(at(&status, 0), [1, 3, 9, 2].map(u64::to_le_bytes));
        assert_eq!(at(&status, 32), [*b"brakes\0\0"]);
        let back = ThrownBack {
            number: 1,
            grip: 2,
            arm: 1,
            open_ns: 4,
            left_ns: 5,
            target: [4.0, 0.0, 1.2],
            came_down: [4.5, 0.1, 1.2],
            miss: 0.5,
            speed: 6.0,
            length: 3.5,
        };
        assert_eq!(size_of::<ThrownBack>(), 112);
        assert_eq!(at(&back, 0), [1, 2, 1, 4, 5].map(u64::to_le_bytes));
        let numbers = [4.0, 0.0, 1.2, 4.5, 0.1, 1.2, 0.5, 6.0, 3.5];
        assert_eq!(at(&back, 40), numbers.map(f64::to_le_bytes));
    }

    #[test]
    fn phases_that_are_none_are_refused() {
        let status = |phase| ThrowStatus {
            phase,
            ..ThrowStatus::zeroed()
        };
        assert_eq!(status(4).phase(), Some(ThrowPhase::Dropping));
        assert_eq!((status(0).phase(), status(5).phase()), (None, None));
    }
}
