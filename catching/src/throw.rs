//! Throwing a ball back (thesis, section 3.5.4): arm and platform's turn swing the hand, the fingers open in time.
//!
//! Unknown are the joint angles at the release, the speeds with which joints turn then, and the time in which they get so fast from rest.
//! Where the swing begins and ends follows: every joint speeds up evenly, keeps its speed around the release, and slows down as it sped up,
//! within its range. The [`Thrower`] seeks the farthest flight in a direction, or the gentlest throw that comes down at a place, by
//! sequential quadratic programming from many starts; flights have the drag of [`flight`](crate::flight). A [`ThrowMotion`] leads from
//! wherever the robot stands to the swing and through it.
//!
//! ```text
//! release q, u, T ─> hand p, v ─> flight with drag ─> where it comes down      q -+ w u (T / 2 + coast) ─> ends of the swing
//! ```

mod beside;
mod descent;
mod landing;
mod motion;
mod path;
mod planner;
mod problem;
mod starts;
mod swing;
mod way;

pub use tactnet_catching_packets::THROW_JOINTS;

pub use landing::Landing;
pub use motion::ThrowMotion;
pub use planner::{NoThrow, ThrowEffort, ThrowPlan, ThrowPlanConfig, ThrowRequest, Thrower};
pub use problem::{Aim, THROW_UNKNOWNS, ThrowViolation};
pub use swing::{Swing, ThrowJoints, throw_joint};
pub use way::Way;
