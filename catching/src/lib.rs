//! The catching stack (thesis, chapter 3): head pose, ball tracking, and catching with two arms.
//!
//! The crate contains logic only: no clocks, threads or channels. Time is an argument, so the same code runs live and
//! in simulation.
//!
//! ```text
//! imu ─> pose ─> track <─ circles <─ pictures        track ─> coordinate ─> plan ─> arm paths, hand commands
//! ```

// Formulas of joints and states index several arrays at once.
#![allow(clippy::needless_range_loop)]

pub mod calibrate;
mod catch_space;
mod chain_delays;
pub mod circles;
pub mod control;
pub mod coordinate;
pub mod flight;
pub mod map;
pub mod plan;
pub mod pose;
pub mod ramp;
mod robot;
pub mod safety;
pub mod throw;
pub mod track;

pub use catch_space::CatchSpace;
pub use chain_delays::ChainDelays;
pub use robot::{
    ArmKinematics, ElbowCircle, HandPose, LinkFrame, Robot, angle_between, rotation_towards,
};
