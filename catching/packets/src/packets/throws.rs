//! Throwing back: motion of a throw, opening of the hand, status of the thrower, and outcome.

use tactnet_packet::{Text, choices, packets};

use super::RampPacket;
use crate::THROW_JOINTS;

packets! {
    /// Motion of a throw in absolute time, in three parts: from the waiting pose to the start of the swing, a rest, and
    /// the swing. Joints are the torso's vertical joint, then the arm's joints from the shoulder; all others rest.
    #[derive(PartialEq)] #[version(1)]
    pub struct ThrowPath {
        /// Arm: 0 left, 1 right.
        #[recorded(1)] pub arm: u64,
        /// Number of the grip whose ball is thrown, as counted in [`HandState`].
        #[recorded(2)] pub grip: u64,
        /// Start of the approach to the swing, in ns.
        #[recorded(3)] pub start_ns: u64,
        /// Start of the swing, in ns.
        #[recorded(4)] pub swing_ns: u64,
        /// Time at which the ball must leave the hand, in ns.
        #[recorded(5)] pub open_ns: u64,
        /// Target position of the ball, in m.
        #[recorded(6)] pub target: [f64; 3],
        /// Ramps of the approach.
        #[recorded(7)] pub way: [RampPacket; THROW_JOINTS],
        /// Ramps of the swing.
        #[recorded(8)] pub swing: [RampPacket; THROW_JOINTS],
    }

    /// Opening command of a hand. The hand obeys only if it has received this packet shortly before its fingers begin
    /// to open.
    #[derive(PartialEq)] #[version(1)]
    pub struct HandOpening {
        /// Arm: 0 left, 1 right.
        #[recorded(1)] pub arm: u64,
        /// Time at which the ball must leave the hand, in ns.
        #[recorded(2)] pub open_ns: u64,
    }

    /// Phase of the thrower and reason of its last failure.
    #[derive(PartialEq)] #[version(1)]
    pub struct ThrowStatus {
        /// Time, in ns.
        #[recorded(1)] pub t_ns: u64,
        /// A [`ThrowPhase`].
        #[recorded(2)] pub phase: u64,
        /// Number of the current grip, as counted in [`HandState`].
        #[recorded(3)] pub grip: u64,
        /// Number of failed throws since the start.
        #[recorded(4)] pub failed: u64,
        /// Reason of the last failure.
        #[recorded(5)] pub reason: Text<64>,
    }

    /// Outcome of a ball that was thrown back.
    #[derive(PartialEq)] #[version(1)]
    pub struct ThrownBack {
        /// Number of balls thrown back so far.
        #[recorded(1)] pub number: u64,
        /// Number of the grip, as counted in [`HandState`].
        #[recorded(2)] pub grip: u64,
        /// Arm: 0 left, 1 right.
        #[recorded(3)] pub arm: u64,
        /// Planned release time, in ns.
        #[recorded(4)] pub open_ns: u64,
        /// Actual release time, in ns.
        #[recorded(5)] pub left_ns: u64,
        /// Target position, in m.
        #[recorded(6)] pub target: [f64; 3],
        /// Position at which the ball fell through the target's height, in m. For a ball that stayed lower: its closest
        /// point to the target.
        #[recorded(7)] pub came_down: [f64; 3],
        /// Distance between target and landing position, in m.
        #[recorded(8)] pub miss: f64,
        /// Release speed, in m/s.
        #[recorded(9)] pub speed: f64,
        /// Horizontal distance from the hand to the landing position, in m.
        #[recorded(10)] pub length: f64,
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
