//! Keeps an arm away from obstacles on its whole way.
//!
//! ```text
//! cost = weight / samples  sum over samples, spheres  max(0, soft + r - d(p))^2
//! ```
//!
//! Here `d` is the distance of the map, positive in free space, at the centre `p` of a sphere of radius `r`. The thesis
//! adds the sum of distances that are positive inside obstacles and writes 'maximise'; that sum must be minimised, as
//! here. The ramps are sampled at equal fractions of their duration, so the gradient follows from
//! [`Passing`](super::passing::Passing), kinematics and map.
//!
//! A cost does not enforce a distance. [`Obstacles::clear_along`] checks the best motion on a fine walk along its
//! ramps: no sphere may come closer than `hard`, or than at the start if the arm starts closer. Otherwise the motion is
//! rejected.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARM_JOINTS;

use super::catch_motion::{CatchMotion, Point, UNKNOWNS};
use crate::flight::FlightPath;
use crate::map::{ARM_SPHERES, ArmSpheres, DistanceField};
use crate::ramp::Ramp;
use crate::robot::ArmKinematics;

/// Amount by which an arm that starts too close may come closer, in m: a tenth of a voxel.
pub(crate) const TOO_NEAR_ALREADY: f64 = 2e-3;
/// Step of the check along the ball's flight, in s, which is about 3 cm.
const FLIGHT_STEP: f64 = 5e-3;

tactnet_catching_packets::settings! {
    /// Distances that plans keep from obstacles.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct ObstacleConfig {
        /// Distance below which the motion has a cost, in m.
        pub soft: f64 = 0.1,
        /// Minimum distance of a plan, in m. It covers errors of the map: half a voxel, the camera's noise, the torso's
        /// elasticity.
        pub hard: f64 = 0.05,
        /// Weight of the squared hinge, in 1/m^2.
        pub weight: f64 = 300.0,
        /// Distance between the ball's centre and an obstacle at which the flight ends, in m.
        pub ball: f64 = 0.03,
        /// Number of samples for the cost along the motion, at least 1 (its end).
        pub samples: usize = 6,
        /// Number of samples for the final check along the motion, at least 1 (its end).
        pub checks: usize = 40,
    }
}

/// Motion of the chest in the map during an arm motion, by ramps of platform and torso's vertical joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChestWay {
    /// Sideways motion, in m.
    pub platform: Ramp,
    /// Rotation about the vertical axis, in rad.
    pub turn: Ramp,
    /// Time from the start of these ramps to the start of the arm's motion, in s.
    pub since: f64,
    /// Chest pose with platform and turn at zero, including the measured deviation from the pose by joint angles.
    pub chest: Isometry3<f64>,
}

impl ChestWay {
    /// Returns a chest at rest.
    pub fn standing(chest: Isometry3<f64>) -> Self {
        Self {
            platform: Ramp::standing(0.0),
            turn: Ramp::standing(0.0),
            since: 0.0,
            chest,
        }
    }

    /// Returns the chest pose in the map at a time, in s from the start of the arm's motion.
    pub fn at(&self, t: f64) -> Isometry3<f64> {
        self.moving(t).0
    }

    /// Returns the chest pose, the platform's position and velocity, and the angular velocity of the turn.
    fn moving(&self, t: f64) -> (Isometry3<f64>, [f64; 2], f64) {
        let t = t + self.since;
        let (platform, rate) = self.platform.at(t);
        let (turn, turn_rate) = self.turn.at(t);
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        let chest = Translation3::new(0.0, platform, 0.0) * (turned * self.chest);
        (chest, [platform, rate], turn_rate)
    }
}

/// Map and chest motion for one request.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// Map.
    pub field: &'a DistanceField,
    /// Motion of the chest in the map.
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
    pub fn cost(&self, motion: &CatchMotion, x: &Point) -> (f64, [f64; UNKNOWNS]) {
        let config = self.config;
        let (end, end_by) = motion.end(x);
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
            let joints = motion.passing(x, end, share);
            let chain = motion.arm.chain(&joints.map(|joint| joint.q));
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
                // The chest moves the sphere.
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

    /// Returns the time at which an obstacle stops the ball, in s, if it is before `latest`. Space outside of the map
    /// is free.
    pub fn ball_stops(&self, path: &FlightPath, latest: f64) -> Option<f64> {
        let Surroundings { field, chest } = self.surroundings;
        // The path is in the frame of the chest at its final rest.
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

    /// Returns true if the arm keeps its distance along the ramps and at their end.
    pub fn clear_along(&self, arm: &ArmKinematics, ramps: &[Ramp; ARM_JOINTS]) -> bool {
        let end = ramps.iter().map(|ramp| ramp.end).fold(0.0, f64::max);
        let at = |t: f64| {
            let chain = arm.chain(&ramps.map(|ramp| ramp.at(t).0));
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

    use super::*;
    use crate::map::VoxelGrid;
    use crate::plan::problem::Problem;
    use crate::plan::problem::tests::passing;
    use crate::plan::way::OwnBodies;
    use crate::plan::{CatchRequest, NoPlan, Objective, PlanConditions, PlanConfig, Planner};
    use crate::robot::Robot;

    /// Returns the chest pose of the waiting robot.
    fn chest() -> Isometry3<f64> {
        Isometry3::translation(0.0, 0.0, 1.2)
    }

    /// Returns a map with one box, given by two corners in m.
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

    fn among(field: &DistanceField) -> PlanConditions<'_> {
        PlanConditions {
            surroundings: Some(Surroundings {
                field,
                chest: ChestWay::standing(chest()),
            }),
            ..PlanConditions::default()
        }
    }

    fn request(robot: &Robot, objective: Objective) -> CatchRequest {
        CatchRequest {
            objective,
            ..passing(robot, [0.6, 0.45, 0.05])
        }
    }

    fn asked() -> (Robot, Planner, CatchRequest) {
        let robot = Robot::nominal();
        let planner = Planner::new(&robot, 0, PlanConfig::default());
        let request = request(&robot, Objective::Soft);
        (robot, planner, request)
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
            let robot = Robot::nominal();
            let mut request = request(&robot, objective);
            request.w0 = w;
            let own = OwnBodies::new(&robot, 0);
            let problem = Problem::new(&request, robot.arm(0), &own, 0.0);
            // A coarse map whose trilinear cells cause no kinks within the arm's range.
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
            let x: Point = std::array::from_fn(|i| if i < 7 { request.q0[i] + 0.5 * q[i] } else { t });
            // Exclude motions with extreme accelerations.
            prop_assume!((0..7).all(|i| problem.motion.acceleration(&x, i).a.abs() < 60.0));
            let (cost, gradient) = obstacles.cost(&problem.motion, &x);
            prop_assert!(cost > 0.0);
            for i in 0..UNKNOWNS {
                let moved = |h: f64| { let mut y = x; y[i] += h; obstacles.cost(&problem.motion, &y).0 };
                let h = 1e-5;
                let (more, less) = (moved(h), moved(-h));
                // The cost has kinks where another joint becomes the slowest or a part of a ramp starts at a sample.
                prop_assume!((more + less - 2.0 * cost).abs() < 1e-7);
                let slope = (more - less) / (2.0 * h);
                prop_assert!((slope - gradient[i]).abs() < 2e-3 * (1.0 + slope.abs()), "{objective:?} {i}: {slope} {}", gradient[i]);
            }
        }
    }

    #[test]
    fn a_plan_goes_round_a_box_that_stands_in_its_way() {
        let (robot, planner, request) = asked();
        let free = planner.plan(&request, &PlanConditions::default(), || false);
        let free = free.unwrap();
        // Next to the catch, at the arm's position in the unobstructed plan.
        let field = field([0.2, 0.55, 0.8], [0.7, 0.9, 1.12]);
        let without = least_on_the_way(&robot, &field, &free.ramps);
        assert!(without < 0.0, "{without}");
        let among = among(&field);
        let plan = planner.plan(&request, &among, || false).unwrap();
        let with = least_on_the_way(&robot, &field, &plan.ramps);
        let begin = least_on_the_way(&robot, &field, &robot.ready(0).map(Ramp::standing));
        let least = begin.min(PlanConfig::default().obstacles.hard) - 3e-3;
        assert!(with >= least, "{with} {least}");
        assert!(plan.violation.is_feasible());
    }

    #[test]
    fn a_ball_that_a_box_stops_is_not_planned_for() {
        let (_, planner, request) = asked();
        let field = field([0.9, -0.6, 0.3], [1.2, 1.25, 2.2]);
        let among = among(&field);
        let found = planner.plan(&request, &among, || false);
        assert_eq!(found.unwrap_err(), NoPlan::Obstructed);
        let missed = planner.plan(&request, &among.nearest_miss(), || false);
        assert_eq!(missed.unwrap_err(), NoPlan::Obstructed);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        /// For any box, plans and near misses keep the minimum distance.
        #[test]
        fn plans_keep_their_distance_or_there_is_none(
            x in 0.0..0.8f64, y in -0.2..1.0f64, z in 0.6..1.7f64, size in proptest::array::uniform3(0.08..0.5f64),
        ) {
            let (robot, planner, request) = asked();
            let field = field([x, y, z], [x + size[0], y + size[1], z + size[2]]);
            let among = among(&field);
            let begin = least_on_the_way(&robot, &field, &robot.ready(0).map(Ramp::standing));
            let bound = begin.min(PlanConfig::default().obstacles.hard);
            for plan in [
                planner.plan(&request, &among, || false),
                planner.plan(&request, &among.nearest_miss(), || false),
            ].into_iter().flatten() {
                let least = least_on_the_way(&robot, &field, &plan.ramps);
                // 2 mm are permitted, and between two checks slightly more is possible.
                prop_assert!(least > bound - 6e-3, "{least} {bound}");
            }
        }
    }

    #[test]
    fn an_empty_map_changes_no_plan() {
        let (robot, planner, _) = asked();
        let field = DistanceField::empty(VoxelGrid::default());
        let among = among(&field);
        for objective in [Objective::Soft, Objective::Latest, Objective::Cool] {
            let request = request(&robot, objective);
            let free = planner.plan(&request, &PlanConditions::default(), || false);
            assert_eq!(free, planner.plan(&request, &among, || false));
        }
    }
}
