//! Planning of a catch with one arm: position, time and configuration (thesis, sections 3.5 and 3.5.2, equation 3.2).
//!
//! The unknowns are the seven joint angles `q` at the catch and its time `t`. Each joint moves by a
//! [`Ramp`](crate::ramp::Ramp) from its current state to rest at `q`, so the unknowns determine the whole motion. Five
//! equations put the hand at the ball and against its flight direction. Inequalities keep the joints within ranges,
//! speeds and accelerations, and the hand away from the body. The [`Planner`] computes
//!
//! 1. candidates on a grid of the remaining freedom: time, elbow angle, hand angle, times up to eight closed-form
//!    branches;
//! 2. the minimum near the best candidates by sequential quadratic programming ([`qp`] inside).
//!
//! With [`Surroundings`], the motion keeps its distance from obstacles, by a term of the objective and a final check.
//!
//! The motion keeps its distance from the robot's own bodies and from the other arm's motion. If the cheapest plan does
//! not, the planner searches for another one with a further term of the objective ([`WayConfig`]).

pub(crate) mod bfgs;
mod bodies;
mod candidates;
mod catch_motion;
mod clearance;
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
pub(crate) mod way;
mod whole_body;

pub use bodies::{BODIES, Body};
pub use catch_motion::{OtherArm, UNKNOWNS};
pub use no_plan::{NoPlan, RequestError};
pub use objective::Objective;
pub(crate) use obstacles::TOO_NEAR_ALREADY;
pub use obstacles::{ChestWay, ObstacleConfig, Surroundings};
pub use planner::{CatchPlan, CatchPoint, Effort, PlanConditions, PlanConfig, PlanGoal, Planner};
pub use problem::{CatchRequest, EQUALITIES, INEQUALITIES, Violation};
pub use seeds::{Grid, Share};
pub use way::WayConfig;
pub use whole_body::{BodyWay, NoWay, WholeBody};
