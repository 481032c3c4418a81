//! Throwing a ball back (thesis, section 3.5.4): arm and torso rotation swing the hand, and the fingers open in time.
//!
//! The unknowns are the joint angles at the release, the joint velocities at that time, and the time in which the
//! joints accelerate from rest. They determine the start and the end of the swing: each joint accelerates uniformly,
//! keeps its velocity around the release, and decelerates symmetrically within its range. The [`Thrower`] computes the
//! farthest flight in a direction, or the smoothest throw to a target, by sequential quadratic programming from many
//! starts. Flights have the drag of [`flight`](crate::flight). A [`ThrowMotion`] leads from the waiting pose to the
//! swing and through it.
//!
//! ```text
//! release q, u, T ─> hand p, v ─> flight with drag ─> landing position      q -+ w u (T / 2 + coast) ─> ends of the swing
//! ```

mod descent;
mod landing;
mod motion;
mod planner;
mod problem;
mod starts;
mod swing;

pub use tactnet_catching_packets::THROW_JOINTS;

pub use landing::Landing;
pub use motion::ThrowMotion;
pub use planner::{NoThrow, ThrowEffort, ThrowPlan, ThrowPlanConfig, ThrowRequest, Thrower};
pub use problem::{Aim, THROW_UNKNOWNS, ThrowViolation};
pub use swing::{Swing, ThrowJoints, throw_joint};
