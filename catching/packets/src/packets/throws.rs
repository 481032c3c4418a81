//! Throwing back: the motion of a throw, when the hand lets go, what the thrower is about, what became of the ball.

use tactnet_packet::{Text, choices, packets};

use super::RampPacket;
use crate::THROW_JOINTS;

packets! {
    /// The motion of a throw in absolute time: from where the robot waits to where the swing begins, a rest, the swing; and when the hand
    /// lets go. Joints are the turn about the vertical, then the arm's from the shoulder; all others stand.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ThrowPath {
        /// 0 left, 1 right.
        #[recorded(1)]
        pub arm: u64,
        /// Which grip it throws, as `HandState` counts.
        #[recorded(2)]
        pub grip: u64,
        /// When the way to the swing begins.
        #[recorded(3)]
        pub start_ns: u64,
        /// When the swing begins.
        #[recorded(4)]
        pub swing_ns: u64,
        /// When the ball is to leave the hand.
        #[recorded(5)]
        pub open_ns: u64,
        /// Where the ball is to come down, m.
        #[recorded(6)]
        pub target: [f64; 3],
        /// The way to the swing.
        #[recorded(7)]
        pub way: [RampPacket; THROW_JOINTS],
        /// The swing.
        #[recorded(8)]
        pub swing: [RampPacket; THROW_JOINTS],
    }

    /// When a hand lets go of its ball. It does so only if it has heard of it in the last moments before its fingers begin to open.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct HandOpening {
        /// 0 left, 1 right.
        #[recorded(1)]
        pub arm: u64,
        /// When the ball is to leave the hand.
        #[recorded(2)]
        pub open_ns: u64,
    }

    /// What the thrower is about, and why.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ThrowStatus {
        /// When.
        #[recorded(1)]
        pub t_ns: u64,
        /// A [`ThrowPhase`].
        #[recorded(2)]
        pub phase: u64,
        /// Which grip it is about, as [`HandState`] counts.
        #[recorded(3)]
        pub grip: u64,
        /// Throws that came to nothing since it started.
        #[recorded(4)]
        pub failed: u64,
        /// Why the last of them did.
        #[recorded(5)]
        pub reason: Text<64>,
    }

    /// What became of a ball that was thrown back.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ThrownBack {
        /// Counts balls that were thrown back.
        #[recorded(1)]
        pub number: u64,
        /// Which grip it was, as [`HandState`] counts.
        #[recorded(2)]
        pub grip: u64,
        /// 0 left, 1 right.
        #[recorded(3)]
        pub arm: u64,
        /// When the ball was to leave the hand.
        #[recorded(4)]
        pub open_ns: u64,
        /// When it left.
        #[recorded(5)]
        pub left_ns: u64,
        /// Where it was to come down, m.
        #[recorded(6)]
        pub target: [f64; 3],
        /// Where it came down to that height, m; one that did not rise so high: where it was nearest to it.
        #[recorded(7)]
        pub came_down: [f64; 3],
        /// From one to the other, m.
        #[recorded(8)]
        pub miss: f64,
        /// Speed at which it left the hand, m/s.
        #[recorded(9)]
        pub speed: f64,
        /// From the hand to where it came down, over the ground, m.
        #[recorded(10)]
        pub length: f64,
    }
}

choices! {
    /// What the thrower is about.
    pub enum ThrowPhase {
        /// No hand holds a ball.
        Empty = 1,
        /// A hand holds a ball, and the robot does not stand where it waits, or the ball has not been felt yet.
        Waiting = 2,
        /// A throw is carried out.
        Throwing = 3,
        /// Lets the ball drop, since it cannot be thrown.
        Dropping = 4,
    }
}

impl ThrowStatus {
    /// Returns what the thrower is about; `None` for a number that is no phase.
    pub fn phase(&self) -> Option<ThrowPhase> {
        ThrowPhase::of(u32::try_from(self.phase).ok()?)
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    /// What is at an offset, as little-endian numbers of 8 bytes.
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
        // The last joint's ramps.
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
