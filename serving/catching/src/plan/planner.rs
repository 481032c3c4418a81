//! The planner of one arm: grid, descents, the best feasible catch when time is up.

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARM_JOINTS;

use super::bodies::{BODIES, Body};
use super::clearance::Clearance;
use super::nearest::approach;
use super::no_plan::{NoPlan, RequestError};
use super::obstacles::{ObstacleConfig, Obstacles, Surroundings};
use super::problem::{CatchRequest, Point, Problem, Violation};
use super::seeds::{Grid, Seeds};
use super::sqp::{Found, descend};
use crate::flight::FlightPath;
use crate::map::ArmSpheres;
use crate::ramp::Ramp;
use crate::robot::{ArmKinematics, Robot};

/// Settings of a planner.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlanConfig {
    /// Grid of a first plan.
    pub first: Grid,
    /// Grid beside the last plan.
    pub again: Grid,
    /// Descents from the best candidates of a first plan.
    pub starts: usize,
    /// Descents from candidates beside the one from the last plan.
    pub starts_again: usize,
    /// Quadratic programmes of a descent, at most.
    pub iterations: usize,
    /// At a catch the whole arm is at least so far from trunk and torso, m; 0: only the hand is kept away.
    pub clearance: f64,
    /// How far plans stay from what a map shows; of no account without one.
    pub obstacles: ObstacleConfig,
}

impl Default for PlanConfig {
    fn default() -> Self {
        Self {
            first: Grid::first(),
            again: Grid::again(),
            starts: 16,
            starts_again: 3,
            iterations: 40,
            clearance: 0.025,
            obstacles: ObstacleConfig::default(),
        }
    }
}

/// A catch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CatchPlan {
    /// Joint angles at the catch, rad.
    pub q: [f64; ARM_JOINTS],
    /// When the ball is in the hand, s after the motion begins.
    pub t: f64,
    /// The motion of every joint. It ends at `t`, or before ([`Objective::Cool`](super::Objective::Cool)).
    pub ramps: [Ramp; ARM_JOINTS],
    /// The objective's value.
    pub cost: f64,
    /// How exactly it is a catch.
    pub violation: Violation,
    /// What it took.
    pub effort: Effort,
}

impl CatchPlan {
    fn of(problem: &Problem, found: &Found, effort: Effort) -> Self {
        Self {
            q: std::array::from_fn(|i| found.x[i]),
            t: found.x[ARM_JOINTS],
            ramps: problem.ramps(&found.x),
            cost: found.cost,
            violation: found.violation,
            effort,
        }
    }
}

/// What a plan took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Effort {
    /// Feasible candidates on the grid.
    pub candidates: usize,
    /// Descents.
    pub starts: usize,
    /// Quadratic programmes of all descents.
    pub iterations: usize,
    /// True if time was up before all descents had ended.
    pub cut_short: bool,
}

/// Plans catches with one arm.
#[derive(Debug, Clone)]
pub struct Planner {
    arm: ArmKinematics,
    bodies: [Body; BODIES],
    clearance: Clearance,
    spheres: ArmSpheres,
    config: PlanConfig,
}

impl Planner {
    /// Prepares the planner of an arm: 0 left, 1 right.
    pub fn new(robot: &Robot, arm: usize, config: PlanConfig) -> Self {
        Self {
            arm: robot.arm(arm).clone(),
            bodies: Body::around_chest(arm),
            clearance: Clearance::new(robot, arm),
            spheres: ArmSpheres::new(robot, arm),
            config,
        }
    }

    /// Returns the best catch that is found before `out_of_time` says so. `last` is the plan that is carried out, with its time counted
    /// from the new beginning. Does not allocate.
    ///
    /// # Errors
    /// Says why there is no plan; the plan that is carried out remains what it is.
    pub fn plan(
        &self,
        request: &CatchRequest,
        last: Option<(&[f64; ARM_JOINTS], f64)>,
        out_of_time: impl FnMut() -> bool,
    ) -> Result<CatchPlan, NoPlan> {
        self.search(request, None, last, out_of_time)
    }

    /// Returns the best catch that keeps its distance from what stands about, as [`Planner::plan`] does without a map. Does not allocate.
    ///
    /// # Errors
    /// As [`Planner::plan`], and where obstacles are in the way.
    pub fn plan_among(
        &self,
        request: &CatchRequest,
        surroundings: &Surroundings<'_>,
        last: Option<(&[f64; ARM_JOINTS], f64)>,
        out_of_time: impl FnMut() -> bool,
    ) -> Result<CatchPlan, NoPlan> {
        self.search(request, Some(surroundings), last, out_of_time)
    }

    fn search(
        &self,
        request: &CatchRequest,
        surroundings: Option<&Surroundings<'_>>,
        last: Option<(&[f64; ARM_JOINTS], f64)>,
        mut out_of_time: impl FnMut() -> bool,
    ) -> Result<CatchPlan, NoPlan> {
        self.check(request)?;
        let request = &self.within_limits(request);
        let mut problem = self.problem(request, surroundings);
        if problem.times[0] > problem.times[1] {
            return Err(NoPlan::NoCatch);
        }
        problem.end_flight_at_obstacles()?;
        let mut best: Option<Found> = None;
        let mut effort = Effort::default();
        let better = |best: &mut Option<Found>, found: Option<Found>| {
            if let Some(found) = found
                && best.is_none_or(|best| found.cost < best.cost)
            {
                *best = Some(found);
            }
        };
        if let Some((q, t)) = last
            && t.is_finite()
            && q.iter().all(|q| q.is_finite())
        {
            let x: Point = std::array::from_fn(|i| match self.arm.joints().get(i) {
                Some(joint) => q[i].clamp(joint.range[0], joint.range[1]),
                None => t.clamp(problem.times[0], problem.times[1]),
            });
            let descent = descend(&problem, &x, self.config.iterations, &mut out_of_time);
            effort.starts += 1;
            effort.iterations += descent.iterations;
            better(&mut best, descent.best);
        }
        let (grid, starts) = match best {
            Some(_) => (self.config.again, self.config.starts_again),
            None => (self.config.first, self.config.starts),
        };
        let seeds = Seeds::search(&problem, grid, &mut out_of_time);
        effort.candidates = seeds.feasible;
        for seed in seeds.best().iter().filter(|seed| seed.lack == 0.0) {
            better(
                &mut best,
                Some(Found {
                    x: seed.x,
                    cost: seed.cost,
                    violation: problem.violation(&seed.x),
                })
                .filter(|found| found.violation.is_feasible() && problem.is_clear(&found.x)),
            );
        }
        for seed in seeds.best().iter().take(starts) {
            if out_of_time() {
                effort.cut_short = true;
                break;
            }
            let descent = descend(&problem, &seed.x, self.config.iterations, &mut out_of_time);
            effort.starts += 1;
            effort.iterations += descent.iterations;
            better(&mut best, descent.best);
        }
        let Some(found) = best else {
            return Err(if problem.times[1] < request.latest {
                // The ball does not come that far.
                NoPlan::Obstructed
            } else if !seeds.within_reach {
                NoPlan::OutOfReach
            } else if out_of_time() {
                NoPlan::OutOfTime
            } else if surroundings.is_some() && seeds.feasible > 0 {
                NoPlan::Obstructed
            } else {
                NoPlan::NoCatch
            });
        };
        Ok(CatchPlan::of(&problem, &found, effort))
    }

    /// Returns the motion that comes nearest to a catch where [`Planner::plan`] finds no exact one; what it misses by is in
    /// [`CatchPlan::violation`]. From `last` it is never farther off than `last` itself. Does not allocate.
    ///
    /// # Errors
    /// Where even that is a wide miss: 15 cm or 0.6 rad.
    pub fn nearest_miss(
        &self,
        request: &CatchRequest,
        last: Option<(&[f64; ARM_JOINTS], f64)>,
        out_of_time: impl FnMut() -> bool,
    ) -> Result<CatchPlan, NoPlan> {
        self.search_near(request, None, last, out_of_time)
    }

    /// The same among what stands about.
    ///
    /// # Errors
    /// As [`Planner::nearest_miss`].
    pub fn nearest_miss_among(
        &self,
        request: &CatchRequest,
        surroundings: &Surroundings<'_>,
        last: Option<(&[f64; ARM_JOINTS], f64)>,
        out_of_time: impl FnMut() -> bool,
    ) -> Result<CatchPlan, NoPlan> {
        self.search_near(request, Some(surroundings), last, out_of_time)
    }

    fn search_near(
        &self,
        request: &CatchRequest,
        surroundings: Option<&Surroundings<'_>>,
        last: Option<(&[f64; ARM_JOINTS], f64)>,
        mut out_of_time: impl FnMut() -> bool,
    ) -> Result<CatchPlan, NoPlan> {
        self.check(request)?;
        let request = &self.within_limits(request);
        let mut problem = self.problem(request, surroundings);
        if problem.times[0] > problem.times[1] {
            return Err(NoPlan::NoCatch);
        }
        problem.end_flight_at_obstacles()?;
        let mut effort = Effort::default();
        let mut best: Option<Found> = None;
        let mut approach_from = |x: &Point, out_of_time: &mut dyn FnMut() -> bool| {
            effort.starts += 1;
            if let Some(found) = approach(&problem, x, out_of_time)
                && best.is_none_or(|best| found.cost < best.cost)
            {
                best = Some(found);
            }
        };
        if let Some((q, t)) = last {
            let x: Point = std::array::from_fn(|i| q.get(i).copied().unwrap_or(t));
            approach_from(&x, &mut out_of_time);
        }
        let seeds = Seeds::search(&problem, self.config.again, &mut out_of_time);
        for seed in seeds.best().iter().take(self.config.starts_again) {
            approach_from(&seed.x, &mut out_of_time);
        }
        best.map(|found| CatchPlan::of(&problem, &found, effort))
            .ok_or(if problem.times[1] < request.latest {
                NoPlan::Obstructed
            } else {
                NoPlan::NoCatch
            })
    }

    /// Returns the best catch on a grid, without descents and without a limit of time: what a planner is compared with.
    ///
    /// # Errors
    /// As [`Planner::plan`].
    pub fn best_on_grid(&self, request: &CatchRequest, grid: Grid) -> Result<CatchPlan, NoPlan> {
        self.check(request)?;
        let request = &self.within_limits(request);
        self.search_grid(&self.problem(request, None), grid)
    }

    /// The same for a ball that flies along a given path, whatever model that follows.
    ///
    /// # Errors
    /// As [`Planner::plan`].
    pub fn best_on_path(
        &self,
        request: &CatchRequest,
        path: &FlightPath,
        grid: Grid,
    ) -> Result<CatchPlan, NoPlan> {
        self.check(request)?;
        let request = &self.within_limits(request);
        let problem = Problem {
            path: path.clone(),
            ..self.problem(request, None)
        };
        self.search_grid(&problem, grid)
    }

    fn problem<'a>(
        &'a self,
        request: &'a CatchRequest,
        surroundings: Option<&Surroundings<'a>>,
    ) -> Problem<'a> {
        let apart = self.config.clearance;
        Problem {
            obstacles: surroundings.map(|surroundings| Obstacles {
                surroundings: *surroundings,
                spheres: &self.spheres,
                config: &self.config.obstacles,
            }),
            ..Problem::new(request, &self.arm, &self.bodies, &self.clearance, apart)
        }
    }

    fn search_grid(&self, problem: &Problem, grid: Grid) -> Result<CatchPlan, NoPlan> {
        if problem.times[0] > problem.times[1] {
            return Err(NoPlan::NoCatch);
        }
        let seeds = Seeds::search(problem, grid, || false);
        let effort = Effort {
            candidates: seeds.feasible,
            ..Effort::default()
        };
        match seeds.best().first().filter(|seed| seed.lack == 0.0) {
            Some(seed) => {
                let found = Found {
                    x: seed.x,
                    cost: seed.cost,
                    violation: problem.violation(&seed.x),
                };
                Ok(CatchPlan::of(problem, &found, effort))
            }
            None if seeds.within_reach => Err(NoPlan::NoCatch),
            None => Err(NoPlan::OutOfReach),
        }
    }

    /// Returns the starts of a first plan, the best first: joint angles and time of the catch.
    ///
    /// # Errors
    /// Says what is wrong with the request.
    pub fn starts(
        &self,
        request: &CatchRequest,
    ) -> Result<Vec<([f64; ARM_JOINTS], f64)>, RequestError> {
        self.check(request)?;
        let request = &self.within_limits(request);
        let problem = self.problem(request, None);
        let seeds = Seeds::search(&problem, self.config.first, || false);
        let starts = seeds.best().iter().take(self.config.starts);
        Ok(starts
            .map(|seed| (std::array::from_fn(|i| seed.x[i]), seed.x[ARM_JOINTS]))
            .collect())
    }

    /// Takes away what rounding puts a joint outside its range, or beyond its speed.
    fn within_limits(&self, request: &CatchRequest) -> CatchRequest {
        let mut request = *request;
        for (joint, limits) in self.arm.joints().iter().enumerate() {
            request.q0[joint] = request.q0[joint].clamp(limits.range[0], limits.range[1]);
            request.w0[joint] = request.w0[joint].clamp(-limits.speed, limits.speed);
        }
        request
    }

    fn check(&self, request: &CatchRequest) -> Result<(), RequestError> {
        let CatchRequest {
            ball,
            q0,
            w0,
            earliest,
            latest,
            ..
        } = request;
        let numbers = ball
            .p
            .iter()
            .chain(&ball.v)
            .chain([&ball.k])
            .chain(&ball.lift)
            .chain(q0)
            .chain(w0);
        if !numbers.chain([earliest, latest]).all(|x| x.is_finite()) {
            return Err(RequestError::NotFinite);
        }
        if ball.v.norm() < 0.1 || ball.v.norm() > 100.0 || !(0.0..=1.0).contains(&ball.k) {
            return Err(RequestError::Ball);
        }
        if !(0.0 <= *earliest && earliest < latest && *latest <= 2.0) {
            return Err(RequestError::Times {
                earliest: *earliest,
                latest: *latest,
            });
        }
        for (joint, limits) in self.arm.joints().iter().enumerate() {
            // Rounding of a ramp that is interrupted.
            let slack = 1e-6;
            if q0[joint] < limits.range[0] - slack || q0[joint] > limits.range[1] + slack {
                return Err(RequestError::Range {
                    joint,
                    found: q0[joint],
                });
            }
            if w0[joint].abs() > limits.speed + slack {
                return Err(RequestError::Speed {
                    joint,
                    found: w0[joint],
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;
    use tactnet_catching_packets::RobotDescription;

    use super::*;
    use crate::flight::Flight;
    use crate::plan::Objective;

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            8 => -3.0..3.0f64,
            1 => -1e6..1e6f64,
            1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(0.0), Just(-0.0), Just(1e300), Just(1e-300)],
        ]
    }

    fn objective() -> impl Strategy<Value = Objective> {
        prop_oneof![
            Just(Objective::Soft),
            Just(Objective::Latest),
            Just(Objective::Cool)
        ]
    }

    /// From a throw at the chest's front to numbers that make no sense.
    fn request() -> impl Strategy<Value = CatchRequest> {
        let sensible = (
            proptest::array::uniform3(-1.0..1.0f64),
            0.3..1.0f64,
            proptest::array::uniform3(-1.0..1.0f64),
        )
            .prop_map(|(aim, time, speed)| {
                let target = Vector3::new(0.6 + 0.4 * aim[0], 1.2 * aim[1], 0.6 * aim[2]);
                let v = Vector3::new(-5.5 + speed[0], speed[1], -2.0 + 2.0 * speed[2]);
                Flight {
                    p: target,
                    v,
                    k: 0.03,
                    lift: Vector3::zeros(),
                }
                .after(-time)
            });
        let hostile = (
            proptest::array::uniform3(number()),
            proptest::array::uniform3(number()),
            number(),
        )
            .prop_map(|(p, v, k)| Flight {
                p: p.into(),
                v: v.into(),
                k,
                lift: Vector3::zeros(),
            });
        (
            prop_oneof![9 => sensible, 1 => hostile],
            proptest::array::uniform7(-1.0..1.0f64),
            proptest::array::uniform7(-1.0..1.0f64),
            prop_oneof![9 => Just([0.0, 1.8]), 1 => proptest::array::uniform2(number())],
            objective(),
            prop_oneof![4 => Just(0.0), 1 => number()],
        )
            .prop_map(|(ball, share, speed, [earliest, latest], objective, odd)| {
                let joints = RobotDescription::nominal().arms[0].joints;
                let mut q0: [f64; 7] = std::array::from_fn(|i| share[i] * joints[i].range[1]);
                q0[2] += odd;
                CatchRequest {
                    ball,
                    q0,
                    w0: std::array::from_fn(|i| speed[i] * joints[i].speed),
                    earliest,
                    latest,
                    objective,
                }
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        /// Whatever is asked for: an error, or a path that is within ranges, speeds and accelerations at every moment and ends at the ball.
        #[test]
        fn no_path_leaves_the_limits(request in request(), last in proptest::option::of((proptest::array::uniform7(number()), number()))) {
            let robot = Robot::new(RobotDescription::nominal());
            let config = PlanConfig { first: Grid { times: 8, hands: 6, elbows: 6 }, starts: 2, ..PlanConfig::default() };
            let planner = Planner::new(&robot, 0, config);
            let last = last.as_ref().map(|(q, t)| (q, *t));
            let ball_at = |t: f64| request.ball.after(t);
            if let Ok(plan) = planner.plan(&request, last, || false) {
                keeps_limits(&plan, &request, &robot)?;
                let [apart, aslant] = misses(&plan, &ball_at(plan.t), &robot);
                prop_assert!(apart < 2e-5 && aslant < 2e-4);
            }
            // A near miss keeps all limits as well, and says by how much it misses.
            if let Ok(plan) = planner.nearest_miss(&request, last, || false) {
                keeps_limits(&plan, &request, &robot)?;
                let [apart, aslant] = misses(&plan, &ball_at(plan.t), &robot);
                prop_assert!((apart - plan.violation.position).abs() < 1e-5, "{apart} {:?}", plan.violation);
                prop_assert!((aslant - plan.violation.angle).abs() < 1e-4 + 1e-3 * aslant, "{aslant} {:?}", plan.violation);
                prop_assert!(apart <= 0.15);
            }
        }

        /// An arm on its way hears that the ball comes elsewhere: what it does about it is never worse than carrying on.
        #[test]
        fn a_near_miss_is_no_farther_off_than_carrying_on(aside in -0.5..0.5f64, rise in -0.3..0.3f64, heard in 0.1..0.45f64) {
            let robot = Robot::new(RobotDescription::nominal());
            let planner = Planner::new(&robot, 0, PlanConfig::default());
            let ball = Flight { p: Vector3::new(0.6, 0.4, 0.1), v: Vector3::new(-5.5, 0.0, -2.0), k: 0.03, lift: Vector3::zeros() }.after(-0.6);
            let first = CatchRequest { ball, q0: robot.ready(0), w0: [0.0; 7], earliest: 0.0, latest: 1.8, objective: Objective::Soft };
            let plan = planner.plan(&first, None, || false).unwrap();
            let mut elsewhere = ball.after(heard);
            elsewhere.v += Vector3::new(0.0, aside, rise);
            let on_the_way = plan.ramps.map(|ramp| ramp.at(heard));
            let request = CatchRequest { ball: elsewhere, q0: on_the_way.map(|(q, _)| q), w0: on_the_way.map(|(_, w)| w), ..first };
            let carried_on = misses_at(&plan.q, &elsewhere.after(plan.t - heard), &robot);
            let weigh = |[apart, aslant]: [f64; 2]| (apart / 0.005).powi(2) + (aslant.sin() / 0.15).powi(2);
            if let Ok(better) = planner.nearest_miss(&request, Some((&plan.q, plan.t - heard)), || false) {
                prop_assert!(weigh(misses(&better, &elsewhere.after(better.t), &robot)) <= weigh(carried_on) * (1.0 + 1e-6) + 1e-6);
            } else {
                prop_assert!(carried_on[0] > 0.1 || carried_on[1] > 0.5, "{carried_on:?}");
            }
        }
    }

    fn keeps_limits(
        plan: &CatchPlan,
        request: &CatchRequest,
        robot: &Robot,
    ) -> Result<(), TestCaseError> {
        prop_assert!(plan.t >= request.earliest && plan.t <= request.latest);
        for (ramp, joint) in plan.ramps.iter().zip(robot.arm(0).joints()) {
            prop_assert!(
                ramp.a.abs() <= joint.acceleration * (1.0 + 1e-6) + 1e-6,
                "{} {}",
                ramp.a,
                joint.acceleration
            );
            prop_assert!(ramp.end <= plan.t + 1e-12);
            for i in 0..=200 {
                let (q, w) = ramp.at(ramp.end * f64::from(i) / 200.0);
                prop_assert!(joint.range[0] - 1e-6 <= q && q <= joint.range[1] + 1e-6);
                prop_assert!(w.abs() <= joint.speed * (1.0 + 1e-9));
            }
        }
        Ok(())
    }

    /// Returns how far the hand is from the ball where the path ends, m and rad.
    fn misses(plan: &CatchPlan, ball: &Flight, robot: &Robot) -> [f64; 2] {
        let q = std::array::from_fn(|i| plan.ramps[i].at(plan.t).0);
        misses_at(&q, ball, robot)
    }

    fn misses_at(q: &[f64; 7], ball: &Flight, robot: &Robot) -> [f64; 2] {
        let pose = robot.arm(0).forward(q);
        let axis: Vector3<f64> = pose.rotation.column(2).into_owned();
        let against = -ball.v / ball.v.norm();
        [
            (pose.position - ball.p).norm(),
            axis.cross(&against).norm().atan2(axis.dot(&against)),
        ]
    }

    #[test]
    fn reasons_are_told_apart() {
        let robot = Robot::new(RobotDescription::nominal());
        let planner = Planner::new(&robot, 0, PlanConfig::default());
        let caught = CatchRequest {
            ball: Flight {
                p: Vector3::new(0.6, 0.4, 0.1),
                v: Vector3::new(-5.5, 0.0, -2.0),
                k: 0.03,
                lift: Vector3::zeros(),
            }
            .after(-0.8),
            q0: robot.ready(0),
            w0: [0.0; 7],
            earliest: 0.0,
            latest: 1.8,
            objective: Objective::Soft,
        };
        let plan = planner.plan(&caught, None, || false).unwrap();
        assert!((0.5..0.95).contains(&plan.t), "{}", plan.t);
        let away = CatchRequest {
            ball: Flight {
                v: Vector3::new(6.0, 0.0, 2.0),
                ..caught.ball
            },
            ..caught
        };
        assert_eq!(
            planner.plan(&away, None, || false).unwrap_err(),
            NoPlan::OutOfReach
        );
        let soon = CatchRequest {
            ball: caught.ball.after(0.78),
            q0: std::array::from_fn(|i| {
                if i == 0 {
                    caught.q0[0] + 1.5
                } else {
                    caught.q0[i]
                }
            }),
            ..caught
        };
        assert_eq!(
            planner.plan(&soon, None, || false).unwrap_err(),
            NoPlan::NoCatch
        );
        assert_eq!(
            planner.plan(&caught, None, || true).unwrap_err(),
            NoPlan::OutOfTime
        );
        let numbers = CatchRequest {
            w0: [f64::NAN; 7],
            ..caught
        };
        let error = planner.plan(&numbers, None, || false).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the request has numbers that are not finite"
        );
        // A plan that is repeated does not get worse, and needs less.
        let again = planner
            .plan(&caught, Some((&plan.q, plan.t)), || false)
            .unwrap();
        assert!(again.cost <= plan.cost + 1e-9);
        assert!(again.effort.iterations <= plan.effort.iterations);
    }
}
