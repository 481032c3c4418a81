//! Nonlinear program of one throw.
//!
//! The unknowns are the joint angles `q` at the release, the joint velocities at that time as fractions `u` of the
//! maximum speeds, and the time `T` in which all joints accelerate uniformly from rest: `a_i = w_i u_i / T`. A joint
//! keeps its velocity for [`coast`](ThrowPlanConfig::coast) before and after the release, which allows for timing
//! errors of the fingers, and decelerates symmetrically. Its motion is a [`Ramp`](crate::ramp::Ramp) from `q - w u (T /
//! 2 + coast)` to `q + w u (T / 2 + coast)`, so the start of the swing is part of the solution.
//!
//! The thesis (section 3.5.4) only states that the equations of the catch are replaced; it does not print the program.

use nalgebra::Vector3;
use tactnet_catching_packets::THROW_JOINTS;

use super::landing::Landing;
use super::planner::ThrowPlanConfig;
use super::swing::{HandMotion, Swing, ThrowJoints};
use crate::flight::DRAG;
use crate::plan::qp::Row;
use crate::plan::way::OwnBodies;

/// Number of unknowns: angles, fractions of speeds, time.
pub const THROW_UNKNOWNS: usize = 2 * THROW_JOINTS + 1;
/// Index of the acceleration time among the unknowns.
pub(crate) const TIME: usize = 2 * THROW_JOINTS;
/// Maximum number of rows of the linear form: two equations, accelerations and ranges (48), speeds (16), time (2),
/// palm, elevation, clearances (3), trust region.
pub(crate) const ROWS: usize =
    2 + 6 * THROW_JOINTS + 2 * THROW_JOINTS + 2 + 2 + 3 + 2 * THROW_UNKNOWNS;
/// Distance beyond the required one above which the arm has no row, in m.
const FAR: f64 = 0.3;
/// Minimum and maximum acceleration time, in s.
const TIMES: [f64; 2] = [0.05, 0.8];

pub(crate) type Point = [f64; THROW_UNKNOWNS];

/// Goal of a throw, in the inertial frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim {
    /// Farthest throw in a direction.
    Farthest {
        /// Direction about the vertical from straight ahead, in rad.
        heading: f64,
        /// Height at which the flight ends, in m.
        height: f64,
    },
    /// Throw to a target with minimum effort.
    At {
        /// Target position, in m.
        target: Vector3<f64>,
    },
}

impl Aim {
    /// Returns the height at which the flight ends, in m.
    pub fn height(&self) -> f64 {
        match self {
            Self::Farthest { height, .. } => *height,
            Self::At { target } => target.z,
        }
    }

    /// Returns the horizontal direction from a position.
    pub(crate) fn heading(&self, from: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Farthest { heading, .. } => Vector3::new(heading.cos(), heading.sin(), 0.0),
            Self::At { target } => {
                let way = Vector3::new(target.x - from.x, target.y - from.y, 0.0);
                way / way.norm().max(1e-9)
            }
        }
    }

    pub(crate) fn equalities(&self) -> usize {
        match self {
            Self::Farthest { .. } => 1,
            Self::At { .. } => 2,
        }
    }
}

/// Residuals of the throw constraints.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ThrowViolation {
    /// Largest violation of an equation: lateral velocity in m/s, or distance from the target in m.
    pub aim: f64,
    /// Largest violation of an inequality in rad, m or as a fraction; 0 if all hold.
    pub limits: f64,
}

impl ThrowViolation {
    /// Returns true if the residuals are at most 0.1 mm and, for limits, 1e-6.
    pub fn is_feasible(&self) -> bool {
        self.aim <= 1e-4 && self.limits <= 1e-6
    }
}

/// Request with all quantities that stay constant during its solution.
pub(crate) struct Problem<'a> {
    pub swing: &'a Swing,
    pub own: &'a OwnBodies,
    pub config: &'a ThrowPlanConfig,
    pub aim: Aim,
}

/// Values of the functions at a point, with derivatives.
pub(crate) struct Linearised {
    pub cost: f64,
    pub slope: Point,
    pub rows: [Row<THROW_UNKNOWNS>; ROWS],
    pub count: usize,
    /// Number of rows without those of the trust region.
    pub own: usize,
    /// Sum of the violations of equations and inequalities.
    pub lack: f64,
    pub violation: ThrowViolation,
}

impl Problem<'_> {
    pub fn angles(x: &Point) -> ThrowJoints {
        std::array::from_fn(|i| x[i])
    }

    pub fn rates(&self, x: &Point) -> ThrowJoints {
        std::array::from_fn(|i| x[THROW_JOINTS + i] * self.swing.joints[i].speed)
    }

    /// Returns the start (-1.0) or the end (1.0) of the swing.
    pub fn end(&self, x: &Point, sign: f64) -> ThrowJoints {
        let rates = self.rates(x);
        std::array::from_fn(|i| x[i] + sign * rates[i] * (x[TIME] / 2.0 + self.config.coast))
    }

    /// Linearises all functions at `x` and adds the trust region of half width `trust`. Returns `None` if the ball does
    /// not fall through the height.
    pub fn linearise(&self, x: &Point, trust: f64) -> Option<Linearised> {
        let (q, rates) = (Self::angles(x), self.rates(x));
        let hand = self.swing.motion(&q, &rates);
        let landing = Landing::of(&hand.p, &hand.v, DRAG, self.aim.height())?;
        let mut rows = Linearised::empty();
        let (cost, slope) = match self.aim {
            Aim::Farthest { .. } => self.farthest(&hand, &landing, &mut rows),
            Aim::At { target } => {
                self.at(&target, &hand, &landing, &mut rows);
                self.effort(x)
            }
        };
        self.limit_joints(x, &mut rows);
        self.limit_hand(&hand, &mut rows);
        self.keep_clear(x, &mut rows);
        rows.own = rows.count;
        for i in 0..THROW_UNKNOWNS {
            for sign in [1.0, -1.0] {
                rows.push(trust, |k| if k == i { sign } else { 0.0 });
            }
        }
        Some(Linearised {
            cost,
            slope,
            ..rows
        })
    }

    /// Adds the equation of zero lateral velocity and returns the negative flight distance, in m.
    fn farthest(
        &self,
        hand: &HandMotion,
        landing: &Landing,
        rows: &mut Linearised,
    ) -> (f64, Point) {
        let heading = self.aim.heading(&hand.p);
        let aside = Vector3::z().cross(&heading);
        rows.equation(hand.v.dot(&aside), |i| {
            self.of_hand(hand, &Vector3::zeros(), &aside, i)
        });
        let by_p = landing.by_p.transpose() * heading - heading;
        let by_v = landing.by_v.transpose() * heading;
        let slope = std::array::from_fn(|i| -self.of_hand(hand, &by_p, &by_v, i));
        (-(landing.p - hand.p).dot(&heading), slope)
    }

    /// Adds the equations of landing at the target.
    fn at(
        &self,
        target: &Vector3<f64>,
        hand: &HandMotion,
        landing: &Landing,
        rows: &mut Linearised,
    ) {
        for axis in 0..2 {
            let by_p: Vector3<f64> = landing.by_p.row(axis).transpose();
            let by_v: Vector3<f64> = landing.by_v.row(axis).transpose();
            rows.equation(landing.p[axis] - target[axis], |i| {
                self.of_hand(hand, &by_p, &by_v, i)
            });
        }
    }

    /// Returns the mean square of the relative velocities and accelerations.
    fn effort(&self, x: &Point) -> (f64, Point) {
        let mut slope = [0.0; THROW_UNKNOWNS];
        let mut cost = 0.0;
        let of = 1.0 / THROW_JOINTS as f64;
        for (i, joint) in self.swing.joints.iter().enumerate() {
            let u = x[THROW_JOINTS + i];
            let slow = joint.speed / (joint.acceleration * x[TIME]);
            cost += of * u * u * (1.0 + slow * slow);
            slope[THROW_JOINTS + i] = 2.0 * of * u * (1.0 + slow * slow);
            slope[TIME] -= 2.0 * of * u * u * slow * slow / x[TIME];
        }
        (cost, slope)
    }

    /// Returns the derivative with respect to unknown `i` of a function of the hand's position and velocity.
    fn of_hand(
        &self,
        hand: &HandMotion,
        by_p: &Vector3<f64>,
        by_v: &Vector3<f64>,
        i: usize,
    ) -> f64 {
        if i < THROW_JOINTS {
            by_p.dot(&hand.p_by_q.column(i)) + by_v.dot(&hand.v_by_q.column(i))
        } else if i < TIME {
            let joint = i - THROW_JOINTS;
            by_v.dot(&hand.p_by_q.column(joint)) * self.swing.joints[joint].speed
        } else {
            0.0
        }
    }

    fn limit_joints(&self, x: &Point, rows: &mut Linearised) {
        let time = x[TIME];
        for (i, joint) in self.swing.joints.iter().enumerate() {
            let (q, u) = (x[i], x[THROW_JOINTS + i]);
            let way = time / 2.0 + self.config.coast;
            for sign in [1.0, -1.0] {
                rows.inequality(1.0 - sign * u, |k| {
                    if k == THROW_JOINTS + i { -sign } else { 0.0 }
                });
                // Acceleration limit: a T / w - |u|.
                let quick = joint.acceleration / joint.speed;
                rows.inequality(quick * time - sign * u, |k| match k {
                    TIME => quick,
                    _ if k == THROW_JOINTS + i => -sign,
                    _ => 0.0,
                });
                let end = q + sign * joint.speed * u * way;
                let by = |k: usize| match k {
                    TIME => sign * joint.speed * u / 2.0,
                    _ if k == i => 1.0,
                    _ if k == THROW_JOINTS + i => sign * joint.speed * way,
                    _ => 0.0,
                };
                rows.inequality(end - joint.range[0], by);
                rows.inequality(joint.range[1] - end, |k| -by(k));
            }
        }
        rows.inequality(time - TIMES[0], |k| f64::from(k == TIME));
        rows.inequality(TIMES[1] - time, |k| -f64::from(k == TIME));
    }

    /// Limits the angle between velocity and hand axis, and the elevation.
    fn limit_hand(&self, hand: &HandMotion, rows: &mut Linearised) {
        let speed = hand.v.norm().max(1e-3);
        let along = hand.v / speed;
        let cos = hand.axis.dot(&along);
        let by_v = (hand.axis - along * cos) / speed;
        rows.inequality(cos - self.config.palm.cos(), |i| {
            let turned = if i < THROW_JOINTS {
                along.dot(&hand.axis_by_q.column(i))
            } else {
                0.0
            };
            turned + self.of_hand(hand, &Vector3::zeros(), &by_v, i)
        });
        if let Aim::At { target } = self.aim {
            let steepest = self.config.rise.tan();
            let heading = self.aim.heading(&hand.p);
            let by_v = heading * steepest - Vector3::z();
            let far = (target - hand.p).xy().norm().max(1e-9);
            let aside = hand.v - heading * hand.v.dot(&heading);
            let by_p = Vector3::new(aside.x, aside.y, 0.0) * (-steepest / far);
            rows.inequality(by_v.dot(&hand.v), |i| self.of_hand(hand, &by_p, &by_v, i));
        }
    }

    /// Keeps the arm away from trunk and torso at both ends of the swing and at the release.
    fn keep_clear(&self, x: &Point, rows: &mut Linearised) {
        let apart = self.config.clearance;
        if apart <= 0.0 {
            return;
        }
        let rates = self.rates(x);
        let way = x[TIME] / 2.0 + self.config.coast;
        for sign in [-1.0, 0.0, 1.0] {
            let q = self.end(x, sign);
            let arm = std::array::from_fn(|i| q[i + 1]);
            let (pose, jacobian) = self.swing.arm.jacobian(&arm);
            let (distance, slope) = self.own.clearance_slope(&arm, &pose, &jacobian);
            if distance >= apart + FAR {
                continue;
            }
            rows.inequality(distance - apart, |k| match k {
                0 | THROW_JOINTS => 0.0,
                TIME => (1..THROW_JOINTS)
                    .map(|i| slope[i - 1] * sign * rates[i] / 2.0)
                    .sum(),
                _ if k < THROW_JOINTS => slope[k - 1],
                _ => {
                    let i = k - THROW_JOINTS;
                    slope[i - 1] * sign * self.swing.joints[i].speed * way
                }
            });
        }
    }
}

impl Linearised {
    /// Returns the values of no function yet.
    fn empty() -> Self {
        Self {
            cost: 0.0,
            slope: [0.0; THROW_UNKNOWNS],
            rows: [Row {
                normal: [0.0; THROW_UNKNOWNS],
                bound: 0.0,
            }; ROWS],
            count: 0,
            own: 0,
            lack: 0.0,
            violation: ThrowViolation::default(),
        }
    }

    fn push(&mut self, value: f64, slope: impl Fn(usize) -> f64) {
        self.rows[self.count] = Row {
            normal: std::array::from_fn(slope),
            bound: -value,
        };
        self.count += 1;
    }

    /// Adds an equation `value = 0`.
    fn equation(&mut self, value: f64, slope: impl Fn(usize) -> f64) {
        self.lack += value.abs();
        self.violation.aim = self.violation.aim.max(value.abs());
        self.push(value, slope);
    }

    /// Adds an inequality `value >= 0`.
    fn inequality(&mut self, value: f64, slope: impl Fn(usize) -> f64) {
        self.lack += (-value).max(0.0);
        self.violation.limits = self.violation.limits.max(-value);
        self.push(value, slope);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Robot;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]

        #[test]
        fn slopes_are_differences(
            shares in proptest::array::uniform8(0.1..0.9f64), u in proptest::array::uniform8(-1.0..1.0f64), time in 0.1..0.7f64, far in proptest::bool::ANY, arm in 0..2usize,
        ) {
            let robot = Robot::nominal();
            let swing = Swing::new(&robot, arm, &robot.waiting());
            let (own, config) = (OwnBodies::new(&robot, arm), ThrowPlanConfig::default());
            let aim = if far {
                Aim::Farthest { heading: 0.2, height: 0.2 }
            } else {
                Aim::At { target: Vector3::new(3.0, 0.4, 0.2) }
            };
            let problem = Problem { swing: &swing, own: &own, config: &config, aim };
            let mut x = [0.0; THROW_UNKNOWNS];
            for (i, joint) in swing.joints.iter().enumerate() {
                let [low, high] = joint.range;
                x[i] = low + shares[i] * (high - low);
                x[THROW_JOINTS + i] = u[i];
            }
            x[TIME] = time;
            let Some(here) = problem.linearise(&x, 0.3) else { return Ok(()) };
            let h = 1e-6;
            for i in 0..THROW_UNKNOWNS {
                let moved = |by: f64| {
                    let mut x = x;
                    x[i] += by;
                    problem.linearise(&x, 0.3)
                };
                let (Some(more), Some(less)) = (moved(h), moved(-h)) else { return Ok(()) };
                prop_assume!(more.own == here.own && less.own == here.own);
                prop_assert!(((more.cost - less.cost) / (2.0 * h) - here.slope[i]).abs() < 1e-5 * (1.0 + here.slope[i].abs()));
                for row in 0..here.own {
                    // Values are negative bounds. The distance has a kink where the closest pair of bodies changes.
                    let [a, b, c] = [&less, &here, &more].map(|at| -at.rows[row].bound);
                    prop_assume!((a + c - 2.0 * b).abs() < 1e-8);
                    let slope = (c - a) / (2.0 * h);
                    prop_assert!((slope - here.rows[row].normal[i]).abs() < 1e-4 * (1.0 + slope.abs()), "row {row}, unknown {i}: {slope} {}", here.rows[row].normal[i]);
                }
            }
        }
    }
}
