//! Bodies of the robot as hulls, each at the end of a chain of joints from the chest.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use tactnet_catching_packets::{ARMS, Arm, JOINTS, RobotDescription, joint};

use super::gjk::distance;
use super::hull::Hull;
use super::sweep::{Interval, Step, placed, reaches, swept};

/// Number of bodies: trunk, head, two of the torso below the chest, platform, then upper arm, forearm and hand, left and
/// right.
pub const BODIES: usize = 11;
/// Number of bodies that belong to no arm.
const STILL: usize = 5;
/// Number of bodies per arm.
const OF_ARM: usize = 3;
/// Number of pairs that can collide: each body of an arm with trunk, head, torso and platform, and with each body of the
/// other arm.
pub const PAIRS: usize = ARMS * OF_ARM * STILL + OF_ARM * OF_ARM;

#[derive(Debug, Clone)]
struct Body {
    name: &'static str,
    hull: Hull,
    /// Chain from the chest frame outwards.
    chain: Vec<Step>,
    /// Maximum distance of the body's points from each joint's axis, in m; 0 for joints that do not move it.
    reaches: [f64; JOINTS],
}

impl Body {
    fn placed(&self, q: &[f64; JOINTS]) -> Hull {
        placed(&self.hull, &self.chain, q)
    }
}

/// Bodies of the robot in the chest frame. The sizes are assumed, because the thesis states none.
#[derive(Debug, Clone)]
pub struct Bodies {
    bodies: Vec<Body>,
    pairs: [[usize; 2]; PAIRS],
}

impl Bodies {
    /// Creates the bodies of a robot.
    pub fn new(robot: &RobotDescription) -> Self {
        let mut all = Self {
            bodies: Vec::with_capacity(BODIES),
            pairs: [[0; 2]; PAIRS],
        };
        all.add_torso_and_head(robot);
        for (side, arm) in robot.arms.iter().enumerate() {
            all.add_arm(side, arm);
        }
        let arm = |side: usize, part: usize| STILL + side * OF_ARM + part;
        let with_still =
            (0..ARMS * OF_ARM).flat_map(|body| (0..STILL).map(move |still| [still, STILL + body]));
        let of_both = (0..OF_ARM * OF_ARM).map(|i| [arm(0, i / OF_ARM), arm(1, i % OF_ARM)]);
        for (place, pair) in all.pairs.iter_mut().zip(with_still.chain(of_both)) {
            *place = pair;
        }
        all
    }

    /// Returns the names of a pair's bodies.
    pub fn names(&self, pair: usize) -> [&'static str; 2] {
        self.pairs[pair].map(|body| self.bodies[body].name)
    }

    /// Returns a pair's bodies at joint positions `q`, in the chest frame.
    pub fn placed(&self, pair: usize, q: &[f64; JOINTS]) -> [Hull; 2] {
        self.pairs[pair].map(|body| self.bodies[body].placed(q))
    }

    /// Returns the minimum distance of all pairs at joint positions `q`, in m.
    pub fn least(&self, q: &[f64; JOINTS]) -> f64 {
        let distances = (0..PAIRS).map(|pair| {
            let [a, b] = self.placed(pair, q);
            distance(&a, &b)
        });
        distances.fold(f64::INFINITY, f64::min)
    }

    /// Returns the trunk and the two torso bodies at joint positions `q`, in the chest frame.
    pub fn torso(&self, q: &[f64; JOINTS]) -> [Hull; 3] {
        [0, 2, 3].map(|body: usize| self.bodies[body].placed(q))
    }

    /// Returns head and platform at joint positions `q`, in the chest frame.
    pub fn head_and_platform(&self, q: &[f64; JOINTS]) -> [Hull; 2] {
        [1, 4].map(|body: usize| self.bodies[body].placed(q))
    }

    /// Returns upper arm, forearm and hand of an arm (0 left, 1 right) at joint positions `q`, in the chest frame.
    pub fn arm(&self, arm: usize, q: &[f64; JOINTS]) -> [Hull; OF_ARM] {
        std::array::from_fn(|part| self.bodies[STILL + arm * OF_ARM + part].placed(q))
    }

    /// Returns hulls that contain a pair's bodies for all joint positions within the intervals.
    pub fn swept(&self, pair: usize, intervals: &[Interval; JOINTS]) -> [Hull; 2] {
        self.pairs[pair].map(|body| {
            let body = &self.bodies[body];
            swept(&body.hull, &body.chain, intervals)
        })
    }

    /// Returns the maximum decrease of a pair's distance per radian of a joint, in m.
    pub fn reach(&self, pair: usize, joint: usize) -> f64 {
        self.pairs[pair]
            .iter()
            .map(|body| self.bodies[*body].reaches[joint])
            .sum()
    }

    fn add(&mut self, name: &'static str, points: &[[f64; 3]], radius: f64, chain: Vec<Step>) {
        let points: Vec<Vector3<f64>> = points.iter().copied().map(Vector3::from).collect();
        let hull = Hull::new(&points, radius);
        self.bodies.push(Body {
            reaches: reaches(&hull, &chain),
            name,
            hull,
            chain,
        });
    }

    fn add_torso_and_head(&mut self, robot: &RobotDescription) {
        let (torso, neck) = (&robot.torso, &robot.neck);
        let y = Vector3::y_axis();
        let z = Vector3::z_axis();
        // Rounded boxes. The arms' mounts protrude from the trunk on both sides, in front of their first joint.
        let trunk = corners([-0.1, 0.1], [-0.14, 0.14], [-0.12, 0.08]);
        self.add("trunk", &trunk, 0.06, Vec::new());
        let [pan, tilt] = [joint::NECK.start, joint::NECK.start + 1];
        let head = corners([-0.02, 0.1], [-0.12, 0.12], [0.06, 0.16]);
        let to_head = vec![along_z(neck.height), turn(pan, z, 1.0), turn(tilt, y, 1.0)];
        self.add("head", &head, 0.04, to_head);
        let [yaw, lower, upper] = [0, 1, 2].map(|i| joint::TORSO.start + i);
        // Downwards from the upright chest.
        let to_upper = [turn(lower, y, 1.0), turn(upper, y, 1.0)];
        let upper_torso = [[0.0, 0.0, -0.16], [0.0, 0.0, -torso.upper_length]];
        self.add("upper torso", &upper_torso, 0.1, to_upper.to_vec());
        let mut to_lower = to_upper.to_vec();
        to_lower.extend([along_z(-torso.upper_length), turn(upper, y, -1.0)]);
        let lower_torso = [[0.0; 3], [0.0, 0.0, -torso.lower_length]];
        self.add("lower torso", &lower_torso, 0.12, to_lower.clone());
        // Its upper side is half as high as the lowest pitch joint.
        let height = -torso.lower_pitch_height;
        let platform = corners([-0.25, 0.25], [-0.25, 0.25], [0.8 * height, 0.6 * height]);
        to_lower.extend([
            along_z(-torso.lower_length),
            turn(lower, y, -1.0),
            turn(yaw, z, -1.0),
        ]);
        self.add("platform", &platform, 0.06, to_lower);
    }

    fn add_arm(&mut self, side: usize, arm: &Arm) {
        let (y, z) = (Vector3::y_axis(), Vector3::z_axis());
        let names = [
            ["left upper arm", "left forearm", "left hand"],
            ["right upper arm", "right forearm", "right hand"],
        ][side];
        let q = joint::ARM[side].start;
        let base = Isometry3::from_parts(
            Translation3::from(Vector3::from(arm.position)),
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), arm.lean),
        );
        let mut chain = vec![
            Step::Fixed(base),
            along_z(arm.base_to_shoulder),
            turn(q, z, 1.0),
            turn(q + 1, y, -1.0),
            turn(q + 2, z, 1.0),
        ];
        let upper_arm = [[0.0; 3], [0.0, 0.0, arm.shoulder_to_elbow]];
        self.add(names[0], &upper_arm, 0.075, chain.clone());
        chain.extend([
            along_z(arm.shoulder_to_elbow),
            turn(q + 3, y, 1.0),
            turn(q + 4, z, 1.0),
        ]);
        let forearm = [[0.0; 3], [0.0, 0.0, arm.elbow_to_wrist]];
        self.add(names[1], &forearm, 0.065, chain.clone());
        chain.extend([
            along_z(arm.elbow_to_wrist),
            turn(q + 5, y, -1.0),
            turn(q + 6, z, 1.0),
        ]);
        // Palm and open fingers around the catch frame.
        let catch = arm.wrist_to_catch;
        let ring = 0.085;
        self.add(
            names[2],
            &[
                [0.0, 0.0, 0.03],
                [ring, 0.0, catch],
                [-ring, 0.0, catch],
                [0.0, ring, catch],
                [0.0, -ring, catch],
                [0.05, 0.05, catch + 0.05],
                [-0.05, 0.05, catch + 0.05],
                [0.05, -0.05, catch + 0.05],
                [-0.05, -0.05, catch + 0.05],
            ],
            0.03,
            chain,
        );
    }
}

fn turn(joint: usize, axis: Unit<Vector3<f64>>, sign: f64) -> Step {
    Step::Turn { joint, axis, sign }
}

fn along_z(length: f64) -> Step {
    Step::Fixed(Isometry3::from(Translation3::new(0.0, 0.0, length)))
}

fn corners(x: [f64; 2], y: [f64; 2], z: [f64; 2]) -> [[f64; 3]; 8] {
    std::array::from_fn(|i| [x[i & 1], y[i >> 1 & 1], z[i >> 2 & 1]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Robot;
    use proptest::prelude::*;

    proptest! {
        /// Seen from the room, the platform only slides sideways.
        #[test]
        fn the_platform_does_not_turn_with_the_torso(q in proptest::array::uniform4(-1.0..1.0f64)) {
            let robot = Robot::nominal();
            let bodies = Bodies::new(robot.description());
            let mut moved = [0.0; JOINTS];
            moved[..4].copy_from_slice(&q);
            let at = |q: &[f64; JOINTS]| {
                let [_, platform] = bodies.head_and_platform(q);
                let in_room = |point: &Vector3<f64>| robot.chest(q).transform_point(&(*point).into());
                platform.points().iter().map(in_room).collect::<Vec<_>>()
            };
            for (point, still) in at(&moved).iter().zip(at(&[0.0; JOINTS])) {
                let shift = point - still;
                prop_assert!((shift - Vector3::y() * q[0]).norm() < 1e-12, "{shift}");
                prop_assert!((0.1..0.4).contains(&point.z), "{point}");
            }
        }
    }
}
