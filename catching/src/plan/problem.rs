//! Nonlinear program of one catch: 8 unknowns, 5 equations, 31 inequalities (thesis, equation 3.2).
//!
//! Two constraints differ from the printed form without changing the set of catches. "The least time of each joint is
//! at most `t`" has an infinite slope at a pure braking motion; the equivalent interval of positions is smooth in `t`
//! ([`Reach`]). The two angles between the ball's velocity and the hand axis are replaced by `u_x = u_y = 0` of `u =
//! -R'v/|v|`, with `u_z > 0`.
//!
//! Two constraints are added. A joint that reverses its direction stays within its range at the turning point. At the
//! catch, the whole arm keeps its distance from trunk and torso ([`OwnBodies::clearance`]).

use tactnet_catching_packets::ARM_JOINTS;

use super::bodies::BODIES;
use super::catch_motion::{CatchMotion, OtherArm, Point, UNKNOWNS};
use super::no_plan::NoPlan;
use super::objective::Objective;
use super::obstacles::Obstacles;
use super::qp::Row;
use super::sqp::Solution;
use super::way::{OwnBodies, WayConfig};
use crate::flight::{Flight, FlightPath};
use crate::ramp::Reach;
use crate::robot::ArmKinematics;

/// Number of equations: hand at the ball (3), hand against its flight (2).
pub const EQUALITIES: usize = 5;
/// Number of inequalities: ranges (14), times (2), least times (7), bodies (8).
pub const INEQUALITIES: usize = 2 * ARM_JOINTS + 2 + ARM_JOINTS + BODIES;
/// Maximum number of rows of the linear form. A least time needs two rows, a reversing joint one more, the arm's
/// distance one, and the trust region two per unknown.
pub(crate) const ROWS: usize = EQUALITIES + INEQUALITIES + 2 * ARM_JOINTS + 1 + 2 * UNKNOWNS;
/// Distance beyond the required one above which the arm has no row, in m. It exceeds the effect of any step.
const FAR: f64 = 0.3;

/// Request of a catch, in the chest frame, which is assumed at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CatchRequest {
    /// Ball at the start of the motion.
    pub ball: Flight,
    /// Joint angles at the start, in rad.
    pub q0: [f64; ARM_JOINTS],
    /// Joint velocities at the start, in rad/s.
    pub w0: [f64; ARM_JOINTS],
    /// Earliest catch time, in s.
    pub earliest: f64,
    /// Latest catch time, in s; 1.8 in the thesis.
    pub latest: f64,
    /// Objective.
    pub objective: Objective,
    /// Motion of the other arm; `None` if it rests in its waiting pose.
    pub other: Option<OtherArm>,
}

/// Residuals of the catch constraints.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Violation {
    /// Distance between hand and ball, in m.
    pub position: f64,
    /// Angle between the hand axis and the ball's reversed velocity, in rad.
    pub angle: f64,
    /// Largest violation of an inequality in its unit (rad, m or s); 0 if all hold.
    pub limits: f64,
}

impl Violation {
    /// Returns true if the residuals are at most 0.01 mm, 1e-4 rad and, for limits, 1e-7.
    pub fn is_feasible(&self) -> bool {
        self.position <= 1e-5 && self.angle <= 1e-4 && self.limits <= 1e-7
    }
}

/// Request with all quantities that stay constant during its solution.
pub(crate) struct Problem<'a> {
    pub request: &'a CatchRequest,
    pub motion: CatchMotion<'a>,
    pub own: &'a OwnBodies,
    /// Minimum distance of the arm from trunk and torso at the catch, in m; 0 disables it.
    pub apart: f64,
    /// Obstacles, if there is a map.
    pub obstacles: Option<Obstacles<'a>>,
    /// Cost of close ways to the robot's own bodies, if it is active.
    pub way: Option<&'a WayConfig>,
    pub path: FlightPath,
    /// Earliest and latest catch time, in s.
    pub times: [f64; 2],
}

/// Values of a problem's functions at a point, with their derivatives.
pub(crate) struct Linearised {
    /// The equations, then the inequalities: `row . d` compared with `bound` for a step `d`.
    pub rows: [Row<UNKNOWNS>; ROWS],
    pub count: usize,
    /// Sum of the violations of equations and inequalities.
    pub lack: f64,
}

impl<'a> Problem<'a> {
    pub fn new(
        request: &'a CatchRequest,
        arm: &'a ArmKinematics,
        own: &'a OwnBodies,
        apart: f64,
    ) -> Self {
        let joints = arm.joints();
        // A joint cannot be at rest before it has braked.
        let braking = (0..ARM_JOINTS).map(|i| request.w0[i].abs() / joints[i].acceleration);
        let least = braking.fold(request.earliest.max(1e-3), f64::max);
        Self {
            request,
            motion: CatchMotion {
                arm,
                joints,
                q0: request.q0,
                w0: request.w0,
                earliest: least,
                arrives_early: request.objective == Objective::Cool,
                other: request.other,
            },
            own,
            apart,
            obstacles: None,
            way: None,
            path: FlightPath::new(request.ball),
            times: [least, request.latest],
        }
    }

    /// Ends the catch times when the ball hits an obstacle.
    ///
    /// # Errors
    /// Returns an error if that leaves no time for a catch.
    pub fn end_flight_at_obstacles(&mut self) -> Result<(), NoPlan> {
        let Some(obstacles) = &self.obstacles else {
            return Ok(());
        };
        if let Some(stops) = obstacles.ball_stops(&self.path, self.times[1]) {
            self.times[1] = stops;
        }
        if self.times[0] >= self.times[1] {
            return Err(NoPlan::Obstructed);
        }
        Ok(())
    }

    /// Returns true if an obstacle stops the ball before the latest catch time of the request.
    pub fn is_flight_obstructed(&self) -> bool {
        self.times[1] < self.request.latest
    }

    /// Returns the cost of a point and its gradient: the objective plus the costs of closeness to obstacles and to the
    /// robot itself.
    pub fn cost(&self, x: &Point) -> (f64, [f64; UNKNOWNS]) {
        let (mut cost, mut gradient) = self.request.objective.cost(&self.motion, x);
        let mut add = |(near, slope): (f64, [f64; UNKNOWNS])| {
            cost += near;
            gradient = std::array::from_fn(|i| gradient[i] + slope[i]);
        };
        if let Some(obstacles) = &self.obstacles {
            add(obstacles.cost(&self.motion, x));
        }
        if let Some(config) = self.way {
            add(self.own.cost(config, &self.motion, x));
        }
        (cost, gradient)
    }

    /// Returns true if the way to a point keeps its distance from obstacles; always true without a map.
    pub fn is_clear(&self, x: &Point) -> bool {
        self.obstacles
            .as_ref()
            .is_none_or(|obstacles| obstacles.clear_along(self.motion.arm, &self.motion.ramps(x)))
    }

    /// Returns the interval of joint `i` at time `t`: the intersection of its range and its reach. It is empty if the
    /// first value is greater.
    pub fn interval(&self, i: usize, t: f64) -> [f64; 2] {
        let joint = &self.motion.joints[i];
        let q0 = self.motion.q0[i];
        let reach = Reach::new(t, self.motion.w0[i], joint);
        [
            joint.range[0].max(q0 + reach.low),
            joint.range[1].min(q0 + reach.high),
        ]
    }

    /// Returns a point with its cost and its residuals.
    pub fn solution(&self, x: &Point, cost: f64) -> Solution {
        Solution {
            x: *x,
            cost,
            violation: self.violation(x),
        }
    }

    /// Returns the residuals of a point and its ramps.
    pub fn violation(&self, x: &Point) -> Violation {
        let q: [f64; ARM_JOINTS] = std::array::from_fn(|i| x[i]);
        let t = x[ARM_JOINTS];
        let ball = self.path.at(t);
        let pose = self.motion.arm.forward(&q);
        let u = pose.rotation.transpose() * (-ball.v / ball.v.norm());
        let mut limits = (self.times[0] - t).max(t - self.times[1]);
        for i in 0..ARM_JOINTS {
            let [low, high] = self.interval(i, t);
            limits = limits.max(low - x[i]).max(x[i] - high);
        }
        limits = limits.max(self.motion.beyond_ranges(x));
        for body in &self.own.simple {
            limits = limits.max(-body.distance(&pose.position).0);
        }
        // The most expensive check, needed only if all others hold.
        if limits <= 0.0 {
            limits = self.too_near(&q);
        }
        Violation {
            position: (pose.position - ball.p).norm(),
            angle: u.x.hypot(u.y).atan2(u.z),
            limits: limits.max(0.0),
        }
    }

    /// Returns the amount by which the arm is too close to trunk and torso, in m, or 0.
    pub fn too_near(&self, q: &[f64; ARM_JOINTS]) -> f64 {
        if self.apart > 0.0 {
            (self.apart - self.own.clearance(q)).max(0.0)
        } else {
            0.0
        }
    }

    /// Linearises all functions at `x` and adds the trust region of half width `trust`.
    pub fn linearise(&self, x: &Point, trust: f64) -> Linearised {
        let q: [f64; ARM_JOINTS] = std::array::from_fn(|i| x[i]);
        let t = x[ARM_JOINTS];
        let ball = self.path.at(t);
        let chain = self.motion.arm.chain(&q);
        let (pose, jacobian) = (chain.pose(), chain.jacobian());
        let mut rows = Linearised::new();

        let speed = ball.v.norm();
        let heading = ball.v / speed;
        let turn = (ball.acceleration() - heading * heading.dot(&ball.acceleration())) / speed;
        let back = pose.rotation.transpose();
        let u = back * -heading;
        let u_by_time = back * -turn;
        let apart = pose.position - ball.p;
        let spins = chain.axes.map(|axis| back * axis.cross(&heading));
        for k in 0..3 {
            rows.equation(apart[k], |i| jacobian[(k, i)], -ball.v[k]);
        }
        for k in 0..2 {
            rows.equation(u[k], |i| spins[i][k], u_by_time[k]);
        }

        self.limit_joints(x, &mut rows);
        for body in &self.own.simple {
            let (distance, gradient) = body.distance(&pose.position);
            rows.inequality(
                distance,
                |i| (0..3).map(|k| gradient[k] * jacobian[(k, i)]).sum(),
                0.0,
            );
        }
        if self.apart > 0.0 {
            let (distance, slope) = self.own.clearance_slope(&q, &pose, &jacobian);
            if distance < self.apart + FAR {
                rows.inequality(distance - self.apart, |i| slope[i], 0.0);
            }
        }
        for i in 0..UNKNOWNS {
            for sign in [1.0, -1.0] {
                let by = |k: usize| if k == i { sign } else { 0.0 };
                rows.push(trust, by, by(ARM_JOINTS));
            }
        }
        rows
    }

    /// Adds the limits of time, positions and least times of all joints.
    fn limit_joints(&self, x: &Point, rows: &mut Linearised) {
        let t = x[ARM_JOINTS];
        rows.inequality(t - self.times[0], |_| 0.0, 1.0);
        rows.inequality(self.times[1] - t, |_| 0.0, -1.0);
        for i in 0..ARM_JOINTS {
            let joint = &self.motion.joints[i];
            let (q0, w0) = (self.motion.q0[i], self.motion.w0[i]);
            let own = |sign: f64| move |k: usize| if k == i { sign } else { 0.0 };
            rows.inequality(x[i] - joint.range[0], own(1.0), 0.0);
            rows.inequality(joint.range[1] - x[i], own(-1.0), 0.0);
            let reach = Reach::new(t, w0, joint);
            rows.inequality(x[i] - q0 - reach.low, own(1.0), -reach.low_by_time);
            rows.inequality(q0 + reach.high - x[i], own(-1.0), reach.high_by_time);
            if self.request.objective != Objective::Cool {
                let shape = self.motion.acceleration(x, i);
                if w0 * shape.a < 0.0 && shape.a.is_finite() {
                    // The turning point is q0 - w0^2 / (2 a).
                    let turn = q0 - w0 * w0 / (2.0 * shape.a);
                    let slope = w0 * w0 / (2.0 * shape.a * shape.a);
                    let (slack, sign) = if w0 > 0.0 {
                        (joint.range[1] - turn, -1.0)
                    } else {
                        (turn - joint.range[0], 1.0)
                    };
                    rows.inequality(
                        slack,
                        own(sign * slope * shape.by_distance),
                        sign * slope * shape.by_time,
                    );
                }
            }
        }
    }

    /// Projects `x` onto the equations with up to three Gauss-Newton steps at fixed time.
    pub fn retract(&self, x: &Point) -> Point {
        let mut x = *x;
        let ball = self.path.at(x[ARM_JOINTS]);
        let heading = ball.v / ball.v.norm();
        for _ in 0..3 {
            let q: [f64; ARM_JOINTS] = std::array::from_fn(|i| x[i]);
            let chain = self.motion.arm.chain(&q);
            let (pose, jacobian) = (chain.pose(), chain.jacobian());
            let back = pose.rotation.transpose();
            let u = back * -heading;
            let apart = pose.position - ball.p;
            let h =
                nalgebra::SVector::<f64, EQUALITIES>::from([apart.x, apart.y, apart.z, u.x, u.y]);
            if h.norm() < 1e-9 {
                break;
            }
            let mut slopes = nalgebra::SMatrix::<f64, EQUALITIES, ARM_JOINTS>::zeros();
            for (i, axis) in chain.axes.iter().enumerate() {
                let spin = back * axis.cross(&heading);
                for k in 0..3 {
                    slopes[(k, i)] = jacobian[(k, i)];
                }
                slopes[(3, i)] = spin.x;
                slopes[(4, i)] = spin.y;
            }
            let Some(factor) = (slopes * slopes.transpose()).cholesky() else {
                break;
            };
            let step = slopes.transpose() * factor.solve(&h);
            for i in 0..ARM_JOINTS {
                x[i] -= step[i];
            }
        }
        x
    }
}

impl Linearised {
    fn new() -> Self {
        Self {
            rows: [Row {
                normal: [0.0; UNKNOWNS],
                bound: 0.0,
            }; ROWS],
            count: 0,
            lack: 0.0,
        }
    }

    fn push(&mut self, value: f64, by_joint: impl Fn(usize) -> f64, by_time: f64) {
        let normal = std::array::from_fn(|i| if i < ARM_JOINTS { by_joint(i) } else { by_time });
        self.rows[self.count] = Row {
            normal,
            bound: -value,
        };
        self.count += 1;
    }

    fn equation(&mut self, value: f64, by_joint: impl Fn(usize) -> f64, by_time: f64) {
        self.push(value, by_joint, by_time);
        self.lack += value.abs();
    }

    fn inequality(&mut self, value: f64, by_joint: impl Fn(usize) -> f64, by_time: f64) {
        self.push(value, by_joint, by_time);
        self.lack += (-value).max(0.0);
    }
}

#[cfg(test)]
pub(crate) mod tests;
