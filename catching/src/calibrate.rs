//! Self-calibration (thesis, section 3.4.2). Each arm carries a marker that the head's cameras observe. One nonlinear
//! least-squares problem estimates the parameters that the robot description does not contain.
//!
//! ```text
//! q_link = q_measured + offset + compliance * load                                  arms; neck: offset only
//! pixel  = project(camera, T_camera^-1 T_neck(t - delay)^-1 (mount + T_arm(q_link) marker))
//! rest   = M^-1 T_neck^-1 (0, 0, g) + bias        turn = M^-1 rate_neck(t - delay) + bias
//! ```
//!
//! Gauge freedom: an offset of the tilt joint is equivalent to a rotation of cameras and IMU about the tilt axis. An
//! offset of an arm's last joint is equivalent to a rotation of its marker. Priors fix both; neither changes the
//! estimated hand positions. With unknown camera baseline and arm lengths the scale is not observable. It follows from
//! the priors of the four lengths, and a marker cannot improve it.

mod choose;
mod corrections;
mod error;
mod gravity;
mod identity;
mod joint_history;
mod kept;
mod marker_circles;
mod marker_watch;
mod model;
mod parameters;
mod problem;
mod recorder;
mod routine;
mod session;
mod slip;
mod solve;
mod stamps;
mod unknowns;

pub use choose::{Candidate, choose, draw_candidate, gain};
pub use corrections::Corrections;
pub use error::CalibrationError;
pub use gravity::loads;
pub use identity::robot_identity;
pub use kept::{KeptCalibration, KeptError};
pub use marker_watch::MarkerWatch;
pub use model::{Block, Model, seen_from_camera};
pub use parameters::{
    ArmCalibration, Calibration, CameraCalibration, ClockCalibration, ImuCalibration,
    NeckCalibration,
};
pub use problem::{CalibrationConfig, Noise, Problem};
pub use recorder::Recorder;
pub use routine::{Phase, Routine, RoutineConfig, Sweep};
pub use session::{NeckMotion, Picture, Rest, Session, Turn};
pub use slip::{SlipConfig, SlipWatch};
pub use solve::{Determined, Solved, calibrate, solve};
pub use unknowns::{Priors, UNKNOWNS, Unknowns, at, name};
