//! Planning a catch with one arm: where, when and in which configuration (thesis, sections 3.5 and 3.5.2, equation 3.2).
//!
//! Unknown are the seven joint angles `q` at the catch and its time `t`. Since every joint moves by a [`Ramp`](crate::ramp::Ramp) from
//! where it is to a standstill at `q`, that is everything. Five equations hold the hand at the ball and against its flight; inequalities
//! hold joints in their ranges, speeds and accelerations and the hand away from the body. The [`Planner`] seeks
//!
//! 1. candidates on a grid of what the equations leave free: time, elbow angle, hand angle, times up to eight closed-form branches;
//! 2. the minimum near the best of them by sequential quadratic programming ([`qp`] inside).
//!
//! With a map of what stands about ([`Planner::plan_among`]) the way there is kept away from it, by a term of the objective and a last check.
//!
//! The whole way there keeps away from the robot's own bodies and from the other arm on its way; where the cheapest plan's does not, another is
//! sought, with a term of the objective ([`WayConfig`]).

pub(crate) mod bfgs;
mod bodies;
mod candidates;
pub(crate) mod clearance;
mod nearest;
mod no_plan;
mod objective;
mod obstacles;
mod passing;
mod planner;
mod problem;
pub mod qp;
mod seeds;
mod sqp;
mod way;

pub use bodies::{BODIES, Body};
pub use no_plan::{NoPlan, RequestError};
pub use objective::Objective;
pub(crate) use obstacles::TOO_NEAR_ALREADY;
pub use obstacles::{ChestWay, ObstacleConfig, Surroundings};
pub use planner::{CatchPlan, Effort, PlanConfig, Planner};
pub use problem::{CatchRequest, EQUALITIES, INEQUALITIES, UNKNOWNS, Violation};
pub use seeds::Grid;
pub use way::{OtherArm, WayConfig};
