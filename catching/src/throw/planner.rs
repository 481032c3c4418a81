//! Planner of throws: descents from many starts, and the best throw whose whole motion is collision-free.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::checks::{SettingError, from_to};
use tactnet_catching_packets::packets::{RampPacket, ThrowPath};
use tactnet_catching_packets::{ARMS, JOINTS, THROW_JOINTS};

use super::descent::{ThrowSolution, descend};
use super::landing::Landing;
use super::motion::ThrowMotion;
use super::problem::{Aim, Point, Problem, THROW_UNKNOWNS, TIME, ThrowViolation};
use super::starts::starts;
use super::swing::{Swing, ThrowJoints, throw_joint};
use crate::flight::DRAG;
use crate::plan::way::OwnBodies;
use crate::ramp::Ramp;
use crate::robot::Robot;
use crate::safety::Bodies;

tactnet_catching_packets::settings! {
    /// Settings of a throw planner.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct ThrowPlanConfig in "": NoThrow {
        /// Time for which joints keep their velocities before and after the release, in s.
        pub coast: f64 = 0.008 => from_to([0.0, 0.1], "0 to 0.1 s"),
        /// Maximum angle between the hand axis and the ball's velocity at the release, in rad. Above pi/2 the ball
        /// would hit the palm.
        pub palm: f64 = std::f64::consts::FRAC_PI_2 => from_to([0.0, std::f64::consts::PI], "0 to pi rad"),
        /// Maximum elevation angle of a throw to a target, in rad.
        pub rise: f64 = 0.75 => from_to([0.05, 1.5], "0.05 to 1.5 rad"),
        /// Minimum distance of the arm from trunk and torso at both ends of the swing and at the release, in m.
        pub clearance: f64 = 0.025 => from_to([0.0, f64::MAX], "0 m or more"),
        /// Minimum distance of all bodies during the whole motion, in m.
        pub margin: f64 = 0.015 => from_to([f64::NEG_INFINITY, f64::MAX], "a number, m"),
        /// Fraction of the maximum speeds used in the approach. Accelerations use its square.
        pub pace: f64 = 0.4 => from_to([0.05, 1.0], "0.05 to 1"),
        /// Number of configurations that are evaluated as starts.
        pub candidates: usize = 1000,
        /// Number of descents.
        pub starts: usize = 24,
        /// Maximum number of QP iterations per descent.
        pub iterations: usize = 100,
    }
}

impl ThrowPlanConfig {
    /// Returns the settings of live throws, whose approach is twice as fast.
    pub fn live() -> Self {
        Self {
            pace: 0.8,
            ..Self::default()
        }
    }
}

/// Request of a throw, in the inertial frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrowRequest {
    /// Arm whose hand holds the ball.
    pub arm: usize,
    /// Goal of the throw.
    pub aim: Aim,
    /// Unknowns of an earlier throw to a similar target. The result is the throw close to it if there is one, so that
    /// learned corrections stay valid.
    pub last: Option<[f64; THROW_UNKNOWNS]>,
}

impl ThrowRequest {
    /// Returns the request of a throw that depends on no earlier one.
    pub fn new(arm: usize, aim: Aim) -> Self {
        Self {
            arm,
            aim,
            last: None,
        }
    }
}

/// Plan of a throw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrowPlan {
    /// Arm: 0 left, 1 right.
    pub arm: usize,
    /// Angles of torso rotation and arm at the release, in rad.
    pub q: ThrowJoints,
    /// Joint velocities at the release, in rad/s.
    pub rates: ThrowJoints,
    /// Acceleration time, in s.
    pub time: f64,
    /// Position of the ball at the release, in m.
    pub p: Vector3<f64>,
    /// Velocity of the ball at the release, in m/s.
    pub v: Vector3<f64>,
    /// Predicted landing.
    pub landing: Landing,
    /// Value of the objective: the negative flight distance in m, or the effort.
    pub cost: f64,
    /// Residuals of the throw constraints.
    pub violation: ThrowViolation,
    /// Angles, fractions of the maximum speeds, and acceleration time, for [`ThrowRequest::last`].
    pub unknowns: [f64; THROW_UNKNOWNS],
    /// Motion of all joints.
    pub motion: ThrowMotion,
    /// Computational effort.
    pub effort: ThrowEffort,
}

/// Computational effort of one plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ThrowEffort {
    /// Number of descents.
    pub starts: usize,
    /// Number of quadratic programs solved in all descents.
    pub iterations: usize,
}

/// Reason why no throw can be planned.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoThrow {
    /// No hand holds a ball.
    #[error("no hand holds a ball: expected arm 0 or 1")]
    NoBall,
    /// A value is not finite.
    #[error("the request has values that are not finite")]
    NotFinite,
    /// A setting of the planner is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The target is out of reach.
    #[error("the target at {wanted:.2} m is out of reach within the joint limits")]
    OutOfReach {
        /// Distance of the target from the robot's axis, in m.
        wanted: f64,
    },
    /// Throws exist, but the robot would collide with itself.
    #[error("{a} and {b} would come closer than {margin} m in all {throws} throws that were found")]
    Obstructed {
        /// Name of the first body.
        a: &'static str,
        /// Name of the second body.
        b: &'static str,
        /// Minimum distance, in m.
        margin: f64,
        /// Number of throws found.
        throws: usize,
    },
}

/// Planner of throws.
#[derive(Debug, Clone)]
pub struct Thrower {
    robot: Robot,
    bodies: Bodies,
    own: [OwnBodies; ARMS],
    config: ThrowPlanConfig,
}

impl Thrower {
    /// Creates a planner.
    pub fn new(robot: &Robot, config: ThrowPlanConfig) -> Self {
        Self {
            bodies: Bodies::new(robot.description()),
            own: std::array::from_fn(|arm| OwnBodies::new(robot, arm)),
            robot: robot.clone(),
            config,
        }
    }

    /// Plans a throw from the waiting pose, in which all joints that do not throw stay. The result depends on the
    /// request only.
    ///
    /// # Errors
    /// Returns the planned throw, or the reason why none is possible.
    pub fn plan(&self, request: &ThrowRequest) -> Result<ThrowPlan, NoThrow> {
        let swing = self.swing(request)?;
        let problem = self.problem(&swing, request);
        let mut effort = ThrowEffort::default();
        if let Some(plan) = request
            .last
            .and_then(|last| self.best(&problem, request, &[last], &mut effort).ok())
        {
            return Ok(plan);
        }
        let starts = starts(&problem, self.config.candidates, self.config.starts);
        self.best(&problem, request, &starts, &mut effort)
    }

    /// Plans the requested throw and, starting from it, a second one that lands at an offset from the target, in m. The
    /// second throw stays close to the first, so corrections learned for one apply to the other.
    ///
    /// # Errors
    /// Same as [`Thrower::plan`].
    pub fn plan_beside(
        &self,
        request: &ThrowRequest,
        beside: &Vector3<f64>,
    ) -> Result<ThrowPlan, NoThrow> {
        let plan = self.plan(request)?;
        match request.aim {
            Aim::At { target } if *beside != Vector3::zeros() => self.plan(&ThrowRequest {
                aim: Aim::At {
                    target: target + beside,
                },
                last: Some(plan.unknowns),
                ..*request
            }),
            _ => Ok(plan),
        }
    }

    /// Descends from the starts and returns the best throw with a collision-free motion.
    fn best(
        &self,
        problem: &Problem,
        request: &ThrowRequest,
        starts: &[Point],
        effort: &mut ThrowEffort,
    ) -> Result<ThrowPlan, NoThrow> {
        let mut found: Vec<ThrowSolution> = Vec::new();
        for start in starts {
            let (best, iterations) = descend(problem, start, self.config.iterations);
            effort.starts += 1;
            effort.iterations += iterations;
            found.extend(best);
        }
        found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let mut touching = None;
        for throw in &found {
            let ends = [-1.0, 1.0].map(|sign| problem.end(&throw.x, sign));
            let (arm, time) = (problem.swing.number, throw.x[TIME]);
            match ThrowMotion::free(&self.robot, &self.bodies, &self.config, arm, ends, time) {
                Ok(motion) => return Ok(self.answer(problem, throw, motion, *effort)),
                Err(pair) => touching = touching.or(Some(pair)),
            }
        }
        Err(match touching {
            Some(pair) => {
                let [a, b] = self.bodies.names(pair);
                NoThrow::Obstructed {
                    a,
                    b,
                    margin: self.config.margin,
                    throws: found.len(),
                }
            }
            None => NoThrow::OutOfReach {
                wanted: match request.aim {
                    Aim::At { target } => target.xy().norm(),
                    Aim::Farthest { .. } => 0.0,
                },
            },
        })
    }

    /// Returns the start points of the descents as `(angles, fractions of speeds, time)`, for other planners.
    ///
    /// # Errors
    /// Same as [`Thrower::plan`].
    pub fn starts(&self, request: &ThrowRequest) -> Result<Vec<Vec<f64>>, NoThrow> {
        let swing = self.swing(request)?;
        let problem = self.problem(&swing, request);
        let starts = starts(&problem, self.config.candidates, self.config.starts);
        Ok(starts.into_iter().map(|x| x.to_vec()).collect())
    }

    fn problem<'a>(&'a self, swing: &'a Swing, request: &ThrowRequest) -> Problem<'a> {
        Problem {
            own: &self.own[swing.number],
            swing,
            config: &self.config,
            aim: request.aim,
        }
    }

    fn swing(&self, request: &ThrowRequest) -> Result<Swing, NoThrow> {
        self.config.check_settings()?;
        if request.arm >= ARMS {
            return Err(NoThrow::NoBall);
        }
        let aim = match request.aim {
            Aim::Farthest { heading, height } => [heading, height, 0.0],
            Aim::At { target } => target.into(),
        };
        if !aim.iter().all(|x| x.is_finite()) {
            return Err(NoThrow::NotFinite);
        }
        let waiting = self.robot.waiting();
        Ok(Swing::new(&self.robot, request.arm, &waiting))
    }

    fn answer(
        &self,
        problem: &Problem,
        throw: &ThrowSolution,
        motion: ThrowMotion,
        effort: ThrowEffort,
    ) -> ThrowPlan {
        let (q, rates) = (Problem::angles(&throw.x), problem.rates(&throw.x));
        let (p, v) = problem.swing.hand(&q, &rates);
        ThrowPlan {
            arm: problem.swing.number,
            q,
            rates,
            time: throw.x[TIME],
            landing: Landing::of(&p, &v, DRAG, problem.aim.height())
                .expect("every throw found has a landing"),
            p,
            v,
            cost: throw.cost,
            violation: throw.violation,
            unknowns: throw.x,
            motion,
            effort,
        }
    }
}

impl ThrowPlan {
    /// Returns the horizontal flight distance, in m.
    pub fn distance(&self) -> f64 {
        (self.landing.p - self.p).xy().norm()
    }

    /// Returns the landing if the fingers open `late` seconds late (early if negative) during the commanded motion.
    ///
    /// - `robot`: robot of the plan
    /// - `height`: height of the landing, in m
    pub fn released_late(&self, robot: &Robot, late: f64, height: f64) -> Option<Landing> {
        let t = self.motion.release() + late;
        let (q, rates) = self.motion.at(t);
        let swing = Swing::new(robot, self.arm, &q);
        let own = |all: &[f64; JOINTS]| -> ThrowJoints {
            std::array::from_fn(|i| all[throw_joint(self.arm, i)])
        };
        let (p, v) = swing.hand(&own(&q), &own(&rates));
        Landing::of(&p, &v, DRAG, height)
    }

    /// Returns the packet for controller and hand: the motion from `start_ns` on and the release time.
    ///
    /// - `grip`: number of the grip
    /// - `target`: target position of the ball, in m
    pub fn path(&self, start_ns: u64, grip: u64, target: [f64; 3]) -> ThrowPath {
        let after = |seconds: f64| start_ns + (seconds * 1e9).round() as u64;
        let packets = |ramps: &[Ramp; JOINTS]| -> [RampPacket; THROW_JOINTS] {
            std::array::from_fn(|i| ramps[throw_joint(self.arm, i)].packet())
        };
        ThrowPath {
            arm: self.arm as u64,
            grip,
            start_ns,
            swing_ns: after(self.motion.swing_begin()),
            open_ns: after(self.motion.release()),
            target,
            way: packets(&self.motion.way),
            swing: packets(&self.motion.swing),
        }
    }

    /// Returns the joint velocities at the release as fractions of the maximum speeds.
    pub fn shares_of_speed(&self, robot: &Robot) -> ThrowJoints {
        std::array::from_fn(|i| self.rates[i] / robot.joints()[throw_joint(self.arm, i)].speed)
    }
}

#[cfg(test)]
mod tests;
