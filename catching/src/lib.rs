//! The catching stack (thesis, chapter 3): head pose, ball tracking, and catching with two arms.
//!
//! The crate contains logic only: no clocks, threads or channels. Time is an argument. These parts are step functions
//! that live processes, stepped trials and replay share:
//!
//! - [`pose::HeadEstimator`]: inertial samples to head poses
//! - [`track::PairTracker`]: circles and head poses to predictions
//! - [`coordinate::Coordinator`]: predictions, plans and states to requests, paths, closing times and phases
//! - [`coordinate::answer`]: plan request to plan
//! - [`control::Controller`]: paths to joint commands
//!
//! Throws, touch, the safety monitor's stop and the hands have a separate shell in each.
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
