//! Keeping an arm away from what stands about, on the whole of its way.
//!
//! ```text
//! cost = weight / samples  sum over samples, spheres  max(0, soft + r - d(p))^2
//! ```
//!
//! with `d` the map's distance, positive in free space, at the middle `p` of a sphere of radius `r`. The thesis adds the sum of distances
//! that are positive inside obstacles and writes 'maximise'; that must be minimised, and so is this. The ramps are sampled at even shares of
//! their time, so the gradient by joint angles and by time is that of [`Passing`], kinematics and map.
//!
//! A cost does not forbid. Where a motion ends as the best one, [`Obstacles::clear_along`] has the last word: on a fine walk along the ramps no
//! sphere may come nearer than `hard`, or, if the arm begins nearer, nearer than where it begins. Otherwise there is no plan.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARM_JOINTS;

use super::passing::Passing;
use super::problem::{Point, Problem, UNKNOWNS, end_of_motion};
use crate::flight::FlightPath;
use crate::map::{ARM_SPHERES, ArmSpheres, DistanceField};
use crate::ramp::Ramp;

/// An arm that begins too near may come so much nearer, m: a tenth of a voxel.
pub(crate) const TOO_NEAR_ALREADY: f64 = 2e-3;
/// Step of the look along the ball's flight, s: 3 cm.
const FLIGHT_STEP: f64 = 5e-3;

/// How far from obstacles plans stay.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObstacleConfig {
    /// Nearer than this costs something, m.
    pub soft: f64,
    /// Nearer than this there is no plan, m. It holds what the map does not know: half a voxel, the camera's noise, a torso that gives way.
    pub hard: f64,
    /// Of the squared hinge, 1/m^2.
    pub weight: f64,
    /// A ball's flight ends where its middle comes so near to an obstacle, m.
    pub ball: f64,
    /// Shares of the motion at which the cost is computed; at least 1, its end.
    pub samples: usize,
    /// Shares of the motion at which a plan is checked in the end; at least 1, its end.
    pub checks: usize,
}

impl Default for ObstacleConfig {
    fn default() -> Self {
        Self {
            soft: 0.1,
            hard: 0.05,
            weight: 300.0,
            ball: 0.03,
            samples: 6,
            checks: 40,
        }
    }
}

/// How the chest moves in the map while an arm moves: platform and torso's vertical axis by ramps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChestWay {
    /// Sideways, m.
    pub platform: Ramp,
    /// About the vertical axis, rad.
    pub turn: Ramp,
    /// From the begin of those to the begin of the arm's motion, s.
    pub since: f64,
    /// The chest with platform and turn at zero, with what it is measured to differ by from where joints put it.
    pub chest: Isometry3<f64>,
}

impl ChestWay {
    /// Returns a chest that stands.
    pub fn standing(chest: Isometry3<f64>) -> Self {
        Self {
            platform: Ramp::standing(0.0),
            turn: Ramp::standing(0.0),
            since: 0.0,
            chest,
        }
    }

    /// Returns the chest in the map at a time, s from the begin of the arm's motion.
    pub fn at(&self, t: f64) -> Isometry3<f64> {
        self.moving(t).0
    }

    /// Returns the chest, the platform's place and rate, and the turn's rate.
    fn moving(&self, t: f64) -> (Isometry3<f64>, [f64; 2], f64) {
        let t = t + self.since;
        let (platform, rate) = self.platform.at(t);
        let (turn, turn_rate) = self.turn.at(t);
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        let chest = Translation3::new(0.0, platform, 0.0) * (turned * self.chest);
        (chest, [platform, rate], turn_rate)
    }
}

/// What stands about, for one request.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// The map.
    pub field: &'a DistanceField,
    /// Where the chest is in it.
    pub chest: ChestWay,
}

/// Obstacles of a problem.
#[derive(Clone, Copy)]
pub(crate) struct Obstacles<'a> {
    pub surroundings: Surroundings<'a>,
    pub spheres: &'a ArmSpheres,
    pub config: &'a ObstacleConfig,
}

impl Obstacles<'_> {
    /// Returns the cost of the way to a point, and its gradient.
    pub fn cost(&self, problem: &Problem, x: &Point) -> (f64, [f64; UNKNOWNS]) {
        let config = self.config;
        let (end, end_by) = end_of_motion(problem, x);
        let mut cost = 0.0;
        let mut gradient = [0.0; UNKNOWNS];
        if !end.is_finite() || end <= 0.0 {
            return (f64::INFINITY, gradient);
        }
        let samples = config.samples.max(1);
        let weight = config.weight / samples as f64;
        let mut by_end = 0.0;
        for sample in 1..=samples {
            let share = sample as f64 / samples as f64;
            let joints: [Passing; ARM_JOINTS] = std::array::from_fn(|i| {
                let (q0, w0) = (problem.request.q0[i], problem.request.w0[i]);
                Passing::new(q0, w0, x[i] - q0, end, problem.joints[i].speed, share)
            });
            let chain = problem.arm.chain(&joints.map(|joint| joint.q));
            let (chest, [platform, rate], turn_rate) = self.surroundings.chest.moving(share * end);
            for sphere in 0..ARM_SPHERES {
                let centre = self.spheres.centre(sphere, &chain);
                let in_map = chest * Point3::from(centre);
                let bound = config.soft + self.spheres.radius(sphere);
                let (distance, slope) = self.surroundings.field.gradient(&in_map.coords);
                let lack = bound - distance;
                if lack <= 0.0 {
                    continue;
                }
                cost += weight * lack * lack;
                let pull = -2.0 * weight * lack;
                let in_chest = chest.rotation.inverse() * slope;
                let by_joint = self.spheres.slopes(sphere, &chain, &centre, &in_chest);
                for i in 0..ARM_JOINTS {
                    gradient[i] += pull * by_joint[i] * joints[i].by_distance;
                    by_end += pull * by_joint[i] * joints[i].by_end;
                }
                // The chest carries the sphere along.
                let lever = in_map.coords - Vector3::new(0.0, platform, 0.0);
                let carried =
                    Vector3::new(0.0, rate, 0.0) + Vector3::new(0.0, 0.0, turn_rate).cross(&lever);
                by_end += pull * share * slope.dot(&carried);
            }
        }
        for i in 0..UNKNOWNS {
            gradient[i] += by_end * end_by[i];
        }
        (cost, gradient)
    }

    /// Returns when the ball's flight ends at an obstacle, s, if that is before `latest`. What is outside the map is free.
    pub fn ball_stops(&self, path: &FlightPath, latest: f64) -> Option<f64> {
        let Surroundings { field, chest } = self.surroundings;
        // The path is in the frame of the chest that stands.
        let chest = chest.at(chest.platform.end.max(chest.turn.end));
        let mut t = 0.0;
        while t <= latest {
            let ball = (chest * Point3::from(path.at(t).p)).coords;
            if field.grid().cell_at(&ball).is_some() && field.distance(&ball) < self.config.ball {
                return Some(t);
            }
            t += FLIGHT_STEP;
        }
        None
    }

    /// Returns true if the arm keeps its distance on ramps that take `end` seconds, and after them.
    pub fn clear_along(&self, problem: &Problem, ramps: &[Ramp; ARM_JOINTS]) -> bool {
        let end = ramps.iter().map(|ramp| ramp.end).fold(0.0, f64::max);
        let at = |t: f64| {
            let chain = problem.arm.chain(&ramps.map(|ramp| ramp.at(t).0));
            let Surroundings { field, chest } = &self.surroundings;
            self.spheres.distance(&chain, &chest.at(t), field)
        };
        let begin = at(0.0);
        let bound = self.config.hard.min(begin - TOO_NEAR_ALREADY);
        let checks = self.config.checks.max(1);
        (1..=checks).all(|i| at(end * i as f64 / checks as f64) >= bound)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactnet_catching_packets::RobotDescription;

    use super::*;
    use crate::flight::Flight;
    use crate::map::VoxelGrid;
    use crate::plan::bodies::Body;
    use crate::plan::clearance::Clearance;
    use crate::plan::{CatchRequest, NoPlan, Objective, PlanConfig, Planner};
    use crate::robot::Robot;

    /// Where the chest is when the robot waits.
    fn chest() -> Isometry3<f64> {
        Isometry3::translation(0.0, 0.0, 1.2)
    }

    /// A map with one box, given by two corners, m.
    fn field(least: [f64; 3], greatest: [f64; 3]) -> DistanceField {
        let grid = VoxelGrid {
            corner: [-0.8, -1.3, 0.0],
            voxel: 0.04,
            cells: [64, 64, 60],
        };
        let solid: Vec<bool> = (0..grid.count())
            .map(|n| {
                let p = grid.middle([n % 64, n / 64 % 64, n / 4096]);
                (0..3).all(|i| (least[i]..greatest[i]).contains(&p[i]))
            })
            .collect();
        DistanceField::new(grid, &solid)
    }

    fn request(robot: &Robot, objective: Objective) -> CatchRequest {
        CatchRequest {
            ball: Flight {
                p: Vector3::new(0.6, 0.45, 0.05),
                v: Vector3::new(-5.5, 0.0, -2.0),
                k: 0.03,
                lift: Vector3::zeros(),
            }
            .after(-0.8),
            q0: robot.ready(0),
            w0: [0.0; 7],
            earliest: 0.0,
            latest: 1.8,
            objective,
            other: None,
        }
    }

    fn least_on_the_way(robot: &Robot, field: &DistanceField, ramps: &[Ramp; 7]) -> f64 {
        let spheres = ArmSpheres::new(robot, 0);
        (0..=200)
            .flat_map(|i| {
                let q = ramps.map(|ramp| ramp.at(ramp.end * f64::from(i) / 200.0).0);
                spheres.placed(robot, 0, &q)
            })
            .map(|sphere| {
                field.distance(&(chest() * Point3::from(sphere.centre)).coords) - sphere.radius
            })
            .fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(150))]

        #[test]
        fn the_costs_gradient_is_a_difference(
            q in proptest::array::uniform7(-1.0..1.0f64), w in proptest::array::uniform7(-0.5..0.5f64), t in 0.5..1.2f64, roll in -0.3..0.3f64,
            turn in -0.4..0.4f64, objective in prop_oneof![Just(Objective::Soft), Just(Objective::Latest), Just(Objective::Cool)],
        ) {
            let robot = Robot::new(RobotDescription::nominal());
            let mut request = request(&robot, objective);
            request.w0 = w;
            let (bodies, clearance) = (Body::around_chest(0), Clearance::new(&robot, 0));
            let mut problem = Problem::new(&request, robot.arm(0), &bodies, &clearance, 0.0);
            // A distance without the edges of trilinear cells: the map is so coarse that an arm stays within few.
            let grid = VoxelGrid { corner: [-20.0, -20.0, -20.0], voxel: 20.0, cells: [2, 2, 3] };
            let field = DistanceField::new(grid, &[true, false, false, false, false, false, false, true, false, false, false, false]);
            let spheres = ArmSpheres::new(&robot, 0);
            let config = ObstacleConfig { soft: 30.0, weight: 1e-3, ..ObstacleConfig::default() };
            let way = ChestWay {
                platform: Ramp::between(0.0, 0.0, roll, 0.45, 2.0),
                turn: Ramp::between(0.1, 0.0, turn, 0.4, 3.0),
                since: 0.05,
                chest: chest(),
            };
            let obstacles = Obstacles { surroundings: Surroundings { field: &field, chest: way }, spheres: &spheres, config: &config };
            problem.obstacles = Some(obstacles);
            let x: Point = std::array::from_fn(|i| if i < 7 { request.q0[i] + 0.5 * q[i] } else { t });
            // Not where a joint would have to be faster than it may be.
            prop_assume!((0..7).all(|i| crate::ramp::Acceleration::new(x[i] - request.q0[i], t, w[i], problem.joints[i].speed).a.abs() < 60.0));
            let (cost, gradient) = obstacles.cost(&problem, &x);
            prop_assert!(cost > 0.0);
            for i in 0..UNKNOWNS {
                let moved = |h: f64| { let mut y = x; y[i] += h; obstacles.cost(&problem, &y).0 };
                let h = 1e-5;
                let (more, less) = (moved(h), moved(-h));
                // Edges: another joint is the slowest, a part of a ramp begins at a sample.
                prop_assume!((more + less - 2.0 * cost).abs() < 1e-7);
                let slope = (more - less) / (2.0 * h);
                prop_assert!((slope - gradient[i]).abs() < 2e-3 * (1.0 + slope.abs()), "{objective:?} {i}: {slope} {}", gradient[i]);
            }
        }
    }

    #[test]
    fn a_plan_goes_round_a_box_that_stands_in_its_way() {
        let robot = Robot::new(RobotDescription::nominal());
        let planner = Planner::new(&robot, 0, PlanConfig::default());
        let request = request(&robot, Objective::Soft);
        let free = planner.plan(&request, None, || false).unwrap();
        // Beside the catch, where the arm of the free plan is.
        let field = field([0.2, 0.55, 0.8], [0.7, 0.9, 1.12]);
        let without = least_on_the_way(&robot, &field, &free.ramps);
        assert!(without < 0.0, "{without}");
        let among = Surroundings {
            field: &field,
            chest: ChestWay::standing(chest()),
        };
        let plan = planner
            .plan_among(&request, &among, None, || false)
            .unwrap();
        let with = least_on_the_way(&robot, &field, &plan.ramps);
        println!("nearest {without:.3} m without the map, {with:.3} m with it");
        let begin = least_on_the_way(&robot, &field, &robot.ready(0).map(Ramp::standing));
        assert!(
            with >= begin.min(PlanConfig::default().obstacles.hard) - 3e-3,
            "{with} {begin}"
        );
        assert!(plan.violation.is_feasible());
    }

    #[test]
    fn a_ball_that_a_box_stops_is_not_planned_for() {
        let robot = Robot::new(RobotDescription::nominal());
        let planner = Planner::new(&robot, 0, PlanConfig::default());
        let request = request(&robot, Objective::Soft);
        let field = field([0.9, -0.6, 0.3], [1.2, 1.25, 2.2]);
        let among = Surroundings {
            field: &field,
            chest: ChestWay::standing(chest()),
        };
        let found = planner.plan_among(&request, &among, None, || false);
        assert_eq!(found.unwrap_err(), NoPlan::Obstructed);
        let missed = planner.nearest_miss_among(&request, &among, None, || false);
        assert_eq!(missed.unwrap_err(), NoPlan::Obstructed);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        /// Wherever a box stands: no plan and no near miss comes nearer to it than it may.
        #[test]
        fn plans_keep_their_distance_or_there_is_none(
            x in 0.0..0.8f64, y in -0.2..1.0f64, z in 0.6..1.7f64, size in proptest::array::uniform3(0.08..0.5f64),
        ) {
            let robot = Robot::new(RobotDescription::nominal());
            let planner = Planner::new(&robot, 0, PlanConfig::default());
            let request = request(&robot, Objective::Soft);
            let field = field([x, y, z], [x + size[0], y + size[1], z + size[2]]);
            let among = Surroundings { field: &field, chest: ChestWay::standing(chest()) };
            let begin = least_on_the_way(&robot, &field, &robot.ready(0).map(Ramp::standing));
            let bound = begin.min(PlanConfig::default().obstacles.hard);
            for plan in [
                planner.plan_among(&request, &among, None, || false),
                planner.nearest_miss_among(&request, &among, None, || false),
            ].into_iter().flatten() {
                let least = least_on_the_way(&robot, &field, &plan.ramps);
                // 2 mm are granted, and between two checks some more are possible.
                prop_assert!(least > bound - 6e-3, "{least} {bound}");
            }
        }
    }

    #[test]
    fn an_empty_map_changes_no_plan() {
        let robot = Robot::new(RobotDescription::nominal());
        let planner = Planner::new(&robot, 0, PlanConfig::default());
        let field = DistanceField::empty(VoxelGrid::default());
        let among = Surroundings {
            field: &field,
            chest: ChestWay::standing(chest()),
        };
        for objective in [Objective::Soft, Objective::Latest, Objective::Cool] {
            let request = request(&robot, objective);
            assert_eq!(
                planner.plan(&request, None, || false),
                planner.plan_among(&request, &among, None, || false)
            );
        }
    }
}
