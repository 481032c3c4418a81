//! Self-calibration (thesis, section 3.4.2): arms carry a marker each before the head's cameras, and one nonlinear least-squares problem
//! finds what the robot's description does not say.
//!
//! ```text
//! q_link = q_measured + offset + compliance * load                                  arms; neck: offset alone
//! pixel  = project(camera, T_camera^-1 T_neck(t - late)^-1 (mount + T_arm(q_link) marker))
//! rest   = M^-1 T_neck^-1 (0, 0, g) + bias        turn = M^-1 rate_neck(t - late) + bias
//! ```
//!
//! | module | what |
//! |---|---|
//! | `session` | what was recorded: pictures, rests, turns |
//! | `unknowns` | the 79 unknowns, their names and priors |
//! | `model` | residuals and their analytic derivatives |
//! | `problem` | all residuals of a session, Huber loss, normal equations |
//! | `solve` | Levenberg-Marquardt, covariance, the worst-determined direction |
//! | `routine`, `recorder` | how the robot moves in a session, and what is kept of it |
//! | `choose` | configurations by greedy D-optimal choice |
//! | `parameters` | the result |
//! | `kept` | the result as a TOML file, with how sure it is and of which robot |
//! | `identity` | what robots and calibrations are known by |
//! | `corrections` | what the result does to measurements and commands |
//! | `slip`, `marker_watch` | whether the result still holds |
//! | `joint_history` | what joints did around a picture |
//!
//! Gauge: an offset of the tilt joint is the same as turning cameras and inertial unit about the tilt axis, an offset of an arm's last joint
//! the same as a marker turned about it. Priors decide; neither changes where hands are seen. Cameras whose baseline is unknown do not see how large
//! an arm of unknown lengths is: the scale comes from the priors of the four lengths, which a marker cannot better.

mod choose;
mod corrections;
mod error;
mod gravity;
mod identity;
mod joint_history;
mod kept;
mod marker_watch;
mod model;
mod parameters;
mod problem;
mod recorder;
mod routine;
mod session;
mod slip;
mod solve;
mod unknowns;

pub use choose::{Candidate, Chosen, choose, draw_candidate, gain};
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
pub use slip::{Slip, SlipConfig, SlipWatch};
pub use solve::{Determined, Solved, calibrate, solve};
pub use unknowns::{Priors, UNKNOWNS, Unknowns, at, name};
