//! From predictions to motion: assignment of balls to arms, requests to the planner, and joint commands (thesis,
//! section 3.5.1).
//!
//! ```text
//! Armed ── valid ball ──> Tracking ── plan accepted ──> Reaching ── last closing time sent ──> Closed
//! ```
//!
//! A plan request contains the start time of the motion, which includes computing and transfer times, and the state of
//! the arm at that time on its current path. Position and velocity are therefore continuous. Without a better plan the
//! current one stays active. The closing time follows each prediction until the hand closes.

mod assign;
mod body;
mod config;
mod coordinator;
mod neck;
mod room;

pub use assign::{Assignment, assign};
pub use body::BodyMotion;
pub use config::CoordinatorConfig;
pub use coordinator::{CatchState, Coordinator, PlanRequest, Planned};
pub use neck::{GazeTargets, Neck};
pub use room::Room;
