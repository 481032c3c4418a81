//! From predictions to paths: phases, assignment of balls to arms, requests to the planner, closing times (thesis,
//! section 3.5.1). The [`Coordinator`] is one step function from packets to packets; [`answer`] is that of a planner.
//!
//! ```text
//! Armed ── valid ball ──> Tracking ── plan accepted ──> Reaching ── last closing time sent ──> Closed
//! ```
//!
//! A plan request contains the start time of the motion, which includes computing and transfer times, and the state of
//! the arm at that time on its current path. Position and velocity are therefore continuous. Without a better plan the
//! current one stays active. The closing time follows each prediction until the hand closes.

mod answer;
mod assign;
mod attempt;
mod body;
mod config;
mod coordinator;
mod neck;
mod room;

pub use answer::{Answering, answer, request_for};
pub use assign::{Assignment, assign};
pub use body::BodyMotion;
pub use config::{CoordinatorConfig, MAX_PLANNERS, NextPose, PhaseConfig};
pub use coordinator::{Coordinator, CoordinatorInputs, CoordinatorOutputs};
pub use neck::{GazeTargets, Neck};
pub use room::Room;
