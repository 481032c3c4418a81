//! From predictions to motion: which arm catches which ball, what the planner is asked, where every joint is to be (thesis, section 3.5.1).
//!
//! ```text
//! Armed ── a ball is valid ──> Tracking ── a plan is carried out ──> Reaching ── the hands' time has come ──> Closed
//! ```
//!
//! Plans are asked for with the moment at which they can begin, computing and travelling included, and with the state that the arm will
//! have then on its present path: position and velocity are continuous. A plan that cannot be improved is kept; the closing time follows
//! every prediction until the hand closes.

mod assign;
mod body;
mod coordinator;
mod neck;
mod room;

pub use assign::{Assignment, assign};
pub use body::BodyMotion;
pub use coordinator::{CatchState, Coordinator, CoordinatorConfig, PlanRequest, Planned};
pub use neck::{Looked, Neck};
pub use room::Room;
