//! The catching stack (thesis, chapter 3): head pose, ball tracking, and catching with two arms.
//!
//! The crate contains logic only: no clocks, threads or channels. Time is an argument. These parts are step functions
//! that live processes, stepped trials and replay share:
//!
//! - [`pose::HeadEstimator`]: inertial samples to head poses
//! - [`track::PairTracker`]: circles and head poses to predictions
//! - [`coordinate::Coordinator`]: predictions, plans and states to requests, paths, closing times and phases
//! - [`coordinate::answer`]: plan request to plan
//! - [`control::ControlLoop`]: paths to joint commands
//! - [`safety::SafetyWatch`]: joint commands to verdicts
//! - [`hand::HandRelay`]: closing times and releases to the hands
//! - [`throw_back::ThrowTask`]: a held ball to a throw and its release
//! - [`feel::Exploration`]: a held ball to sweeps and its material
//! - [`calibrate::MarkerWatch`]: markers to the state of the calibration
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
pub mod feel;
pub mod flight;
pub mod hand;
pub mod map;
pub mod plan;
pub mod pose;
pub mod ramp;
mod robot;
pub mod safety;
pub mod throw;
pub mod throw_back;
pub mod track;

pub use catch_space::CatchSpace;
pub use chain_delays::ChainDelays;
pub use robot::{ArmKinematics, ElbowCircle, HandPose, LinkFrame, Robot, rotation_towards};
