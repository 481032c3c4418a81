//! Planner of one arm: grid search, descents, and the best feasible catch within the time limit.

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARM_JOINTS;

use super::candidates::Candidates;
use super::catch_motion::Point;
use super::nearest::approach;
use super::no_plan::{NoPlan, RequestError};
use super::obstacles::{ObstacleConfig, Obstacles, Surroundings};
use super::problem::{CatchRequest, Problem, Violation};
use super::seeds::{Grid, Seeds, Share};
use super::sqp::{Descent, Solution, descend};
use super::way::{OwnBodies, WayConfig};
use crate::flight::FlightPath;
use crate::map::ArmSpheres;
use crate::ramp::Ramp;
use crate::robot::{ArmKinematics, Robot};

tactnet_catching_packets::settings! {
    /// Settings of a planner.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct PlanConfig {
        /// Grid of a first plan.
        pub first: Grid = Grid { times: 24, hands: 16, elbows: 16 },
        /// Grid of a replan.
        pub again: Grid = Grid { times: 8, hands: 8, elbows: 8 },
        /// Number of descents from grid candidates in a first plan.
        pub starts: usize = 16,
        /// Number of descents from grid candidates in a replan.
        pub starts_again: usize = 3,
        /// Maximum number of QP iterations per descent.
        pub iterations: usize = 40,
        /// Minimum distance of the arm from trunk and torso at the catch, in m. With 0, only the hand keeps its
        /// distance.
        pub clearance: f64 = 0.025,
        /// Distances from obstacles; ignored without a map.
        pub obstacles: ObstacleConfig = ObstacleConfig::default(),
        /// Distances from the robot's own bodies on the way.
        pub way: WayConfig = WayConfig::default(),
    }
}

/// Plan of a catch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CatchPlan {
    /// Joint angles at the catch, in rad.
    pub q: [f64; ARM_JOINTS],
    /// Catch time, in s after the start of the motion.
    pub t: f64,
    /// Motion of each joint. It ends at `t`, or earlier with [`Objective::Cool`](super::Objective::Cool).
    pub ramps: [Ramp; ARM_JOINTS],
    /// Value of the objective.
    pub cost: f64,
    /// Residuals of the catch constraints at the solution.
    pub violation: Violation,
    /// Computational effort.
    pub effort: Effort,
}

impl CatchPlan {
    fn of(problem: &Problem, solution: &Solution, effort: Effort) -> Self {
        Self {
            q: std::array::from_fn(|i| solution.x[i]),
            t: solution.x[ARM_JOINTS],
            ramps: problem.motion.ramps(&solution.x),
            cost: solution.cost,
            violation: solution.violation,
            effort,
        }
    }
}

/// Computational effort of one plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Effort {
    /// Number of descents.
    pub starts: usize,
    /// Number of quadratic programs solved in all descents.
    pub iterations: usize,
}

impl Effort {
    fn add(&mut self, descent: &Descent) {
        self.starts += 1;
        self.iterations += descent.iterations;
    }
}

/// Joint angles and time of a catch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CatchPoint {
    /// Joint angles, in rad.
    pub q: [f64; ARM_JOINTS],
    /// Time after the start of the motion, in s.
    pub t: f64,
}

impl CatchPoint {
    fn is_finite(&self) -> bool {
        self.t.is_finite() && self.q.iter().all(|q| q.is_finite())
    }
}

/// Goal of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PlanGoal {
    /// Exact catch.
    #[default]
    Catch,
    /// Motion that comes closest to a catch, for requests without an exact one. [`CatchPlan::violation`] states the
    /// miss, which is at most 15 cm and 0.6 rad. It is never larger than that of the plan being executed.
    NearestMiss,
}

/// Conditions of a plan beyond its request.
#[derive(Debug, Clone, Copy, Default)]
pub struct PlanConditions<'a> {
    /// Map and chest motion; `None` without obstacles.
    pub surroundings: Option<Surroundings<'a>>,
    /// Catch of the plan that is being executed, with its time after the start of the new motion.
    pub last: Option<CatchPoint>,
    /// Goal of the plan.
    pub goal: PlanGoal,
    /// Part of the search, for planners that share it.
    pub share: Share,
}

impl PlanConditions<'_> {
    /// Returns the same conditions with the goal [`PlanGoal::NearestMiss`].
    pub fn nearest_miss(&self) -> Self {
        Self {
            goal: PlanGoal::NearestMiss,
            ..*self
        }
    }
}

/// Planner of catches with one arm.
#[derive(Debug, Clone)]
pub struct Planner {
    arm: ArmKinematics,
    spheres: ArmSpheres,
    own: OwnBodies,
    config: PlanConfig,
}

impl Planner {
    /// Creates the planner of an arm: 0 left, 1 right.
    pub fn new(robot: &Robot, arm: usize, config: PlanConfig) -> Self {
        Self {
            arm: robot.arm(arm).clone(),
            spheres: ArmSpheres::new(robot, arm),
            own: OwnBodies::new(robot, arm),
            config,
        }
    }

    /// Returns the best catch found before `out_of_time` returns true, or the nearest miss ([`PlanGoal`]). Does not
    /// allocate.
    ///
    /// # Errors
    /// Returns the reason if planning fails. A plan that is being executed stays valid.
    pub fn plan(
        &self,
        request: &CatchRequest,
        conditions: &PlanConditions<'_>,
        mut out_of_time: impl FnMut() -> bool,
    ) -> Result<CatchPlan, NoPlan> {
        self.check(request)?;
        let request = &self.within_limits(request);
        let mut problem = self.problem(request, conditions.surroundings);
        if problem.times[0] > problem.times[1] {
            return Err(NoPlan::NoCatch);
        }
        problem.end_flight_at_obstacles()?;
        match conditions.goal {
            PlanGoal::Catch => self.search_catch(problem, conditions, &mut out_of_time),
            PlanGoal::NearestMiss => {
                self.search_nearest_miss(&problem, conditions.last, &mut out_of_time)
            }
        }
    }

    fn search_catch<'a>(
        &'a self,
        mut problem: Problem<'a>,
        conditions: &PlanConditions<'_>,
        out_of_time: &mut impl FnMut() -> bool,
    ) -> Result<CatchPlan, NoPlan> {
        let (last, share) = (conditions.last, conditions.share);
        let mut candidates = Candidates::new();
        let mut effort = Effort::default();
        if let Some(last) = last.filter(CatchPoint::is_finite) {
            let x: Point = std::array::from_fn(|i| match self.arm.joints().get(i) {
                Some(joint) => last.q[i].clamp(joint.range[0], joint.range[1]),
                None => last.t.clamp(problem.times[0], problem.times[1]),
            });
            let descent = descend(&problem, &x, self.config.iterations, &mut *out_of_time);
            effort.add(&descent);
            candidates.offer(descent.best);
        }
        let (grid, starts) = match candidates.cheapest() {
            Some(_) => (self.config.again, self.config.starts_again),
            None => (self.config.first, self.config.starts),
        };
        let seeds = Seeds::search(&problem, grid, share, &mut *out_of_time);
        for seed in seeds.best().iter().filter(|seed| seed.lack == 0.0) {
            let solution = problem.solution(&seed.x, seed.cost);
            if solution.violation.is_feasible() && problem.is_clear(&solution.x) {
                candidates.offer(Some(solution));
            }
        }
        for seed in seeds.best().iter().take(starts.div_ceil(share.of)) {
            if out_of_time() {
                break;
            }
            let descent = descend(&problem, &seed.x, self.config.iterations, &mut *out_of_time);
            effort.add(&descent);
            candidates.offer(descent.best);
        }
        let solution = self.choose(&mut problem, &candidates, &mut effort, &mut *out_of_time);
        match solution {
            Some(solution) => Ok(CatchPlan::of(&problem, &solution, effort)),
            None => Err(no_catch(&problem, &seeds, out_of_time)),
        }
    }

    fn search_nearest_miss(
        &self,
        problem: &Problem<'_>,
        last: Option<CatchPoint>,
        out_of_time: &mut impl FnMut() -> bool,
    ) -> Result<CatchPlan, NoPlan> {
        let mut effort = Effort::default();
        let mut candidates = Candidates::new();
        let mut approach_from = |x: &Point, out_of_time: &mut dyn FnMut() -> bool| {
            effort.starts += 1;
            candidates.offer(approach(problem, x, out_of_time));
        };
        if let Some(last) = last {
            let x: Point = std::array::from_fn(|i| last.q.get(i).copied().unwrap_or(last.t));
            approach_from(&x, out_of_time);
        }
        let whole = Share::default();
        let seeds = Seeds::search(problem, self.config.again, whole, &mut *out_of_time);
        for seed in seeds.best().iter().take(self.config.starts_again) {
            approach_from(&seed.x, out_of_time);
        }
        let mut clear = candidates
            .distinct()
            .filter(|solution| self.is_way_clear(problem, &solution.x));
        clear
            .next()
            .map(|solution| CatchPlan::of(problem, solution, effort))
            .ok_or(if problem.is_flight_obstructed() {
                NoPlan::Obstructed
            } else {
                NoPlan::NoCatch
            })
    }

    /// Returns the cheapest candidate if its way keeps clear of the robot's own bodies, which is almost always the
    /// case. Otherwise returns the cheapest candidate with a clear way, including descents from the cheapest candidates
    /// with a cost for close ways.
    fn choose<'a>(
        &'a self,
        problem: &mut Problem<'a>,
        candidates: &Candidates,
        effort: &mut Effort,
        out_of_time: &mut impl FnMut() -> bool,
    ) -> Option<Solution> {
        let cheapest = candidates.cheapest()?;
        if self.is_way_clear(problem, &cheapest.x) {
            return Some(cheapest);
        }
        let mut others = candidates.distinct().skip(1);
        let mut best = others
            .find(|found| self.is_way_clear(problem, &found.x))
            .copied();
        for candidate in candidates.distinct().take(self.config.way.starts) {
            if out_of_time() {
                break;
            }
            problem.way = Some(&self.config.way);
            let most = self.config.way.iterations;
            let descent = descend(problem, &candidate.x, most, &mut *out_of_time);
            problem.way = None;
            effort.add(&descent);
            let Some(found) = descent.best else { continue };
            let found = Solution {
                cost: problem.cost(&found.x).0,
                ..found
            };
            if best.is_none_or(|best| found.cost < best.cost)
                && self.is_way_clear(problem, &found.x)
            {
                best = Some(found);
            }
        }
        best
    }

    fn is_way_clear(&self, problem: &Problem, x: &Point) -> bool {
        let way = &self.config.way;
        self.own
            .is_clear(way, &problem.motion, &problem.motion.ramps(x))
    }

    /// Returns the best catch on a grid, without descents and time limit, as a reference for planners.
    ///
    /// - `path`: path of the ball if it differs from the flight of the request
    ///
    /// # Errors
    /// Same as [`Planner::plan`].
    pub fn best_on_grid(
        &self,
        request: &CatchRequest,
        path: Option<&FlightPath>,
        grid: Grid,
    ) -> Result<CatchPlan, NoPlan> {
        self.check(request)?;
        let request = &self.within_limits(request);
        let mut problem = self.problem(request, None);
        if let Some(path) = path {
            problem.path = path.clone();
        }
        if problem.times[0] > problem.times[1] {
            return Err(NoPlan::NoCatch);
        }
        let seeds = Seeds::search(&problem, grid, Share::default(), || false);
        match seeds.best().first().filter(|seed| seed.lack == 0.0) {
            Some(seed) => Ok(CatchPlan::of(
                &problem,
                &problem.solution(&seed.x, seed.cost),
                Effort::default(),
            )),
            None if seeds.within_reach => Err(NoPlan::NoCatch),
            None => Err(NoPlan::OutOfReach),
        }
    }

    fn problem<'a>(
        &'a self,
        request: &'a CatchRequest,
        surroundings: Option<Surroundings<'a>>,
    ) -> Problem<'a> {
        let apart = self.config.clearance;
        Problem {
            obstacles: surroundings.map(|surroundings| Obstacles {
                surroundings,
                spheres: &self.spheres,
                config: &self.config.obstacles,
            }),
            ..Problem::new(request, &self.arm, &self.own, apart)
        }
    }

    /// Returns the start points of a first plan, sorted by quality.
    ///
    /// # Errors
    /// Returns an error if the request is invalid.
    pub fn starts(&self, request: &CatchRequest) -> Result<Vec<CatchPoint>, RequestError> {
        self.check(request)?;
        let request = &self.within_limits(request);
        let problem = self.problem(request, None);
        let seeds = Seeds::search(&problem, self.config.first, Share::default(), || false);
        let starts = seeds.best().iter().take(self.config.starts);
        Ok(starts
            .map(|seed| CatchPoint {
                q: std::array::from_fn(|i| seed.x[i]),
                t: seed.x[ARM_JOINTS],
            })
            .collect())
    }

    /// Clamps joint positions and velocities that exceed their limits by rounding.
    fn within_limits(&self, request: &CatchRequest) -> CatchRequest {
        let mut request = *request;
        for (joint, limits) in self.arm.joints().iter().enumerate() {
            request.q0[joint] = request.q0[joint].clamp(limits.range[0], limits.range[1]);
            request.w0[joint] = request.w0[joint].clamp(-limits.speed, limits.speed);
        }
        request
    }

    fn check(&self, request: &CatchRequest) -> Result<(), RequestError> {
        let CatchRequest { ball, q0, w0, .. } = request;
        let (earliest, latest) = (request.earliest, request.latest);
        let numbers = ball.p.iter().chain(&ball.v).chain(&ball.lift);
        let numbers = numbers.chain([&ball.k]).chain(q0).chain(w0);
        let other_is_finite = request.other.is_none_or(|other| other.is_finite());
        if !other_is_finite || !numbers.chain([&earliest, &latest]).all(|x| x.is_finite()) {
            return Err(RequestError::NotFinite);
        }
        if ball.v.norm() < 0.1 || ball.v.norm() > 100.0 || !(0.0..=1.0).contains(&ball.k) {
            return Err(RequestError::Ball);
        }
        if !(0.0 <= earliest && earliest < latest && latest <= 2.0) {
            return Err(RequestError::Times { earliest, latest });
        }
        for (joint, limits) in self.arm.joints().iter().enumerate() {
            // Rounding of an interrupted ramp.
            let slack = 1e-6;
            let found = q0[joint];
            if found < limits.range[0] - slack || found > limits.range[1] + slack {
                return Err(RequestError::Range { joint, found });
            }
            let found = w0[joint];
            if found.abs() > limits.speed + slack {
                return Err(RequestError::Speed { joint, found });
            }
        }
        Ok(())
    }
}

/// Returns the reason why no candidate was accepted.
fn no_catch(
    problem: &Problem<'_>,
    seeds: &Seeds,
    out_of_time: &mut impl FnMut() -> bool,
) -> NoPlan {
    if problem.is_flight_obstructed() {
        NoPlan::Obstructed
    } else if !seeds.within_reach {
        NoPlan::OutOfReach
    } else if out_of_time() {
        NoPlan::OutOfTime
    } else if problem.obstacles.is_some() && seeds.feasible > 0 {
        NoPlan::Obstructed
    } else {
        NoPlan::NoCatch
    }
}

#[cfg(test)]
mod tests;
