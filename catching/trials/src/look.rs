//! Mapping before a throw among obstacles. The robot looks around with raised arms, a box is moved, the robot looks
//! again, and lowers its arms.

use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Isometry3, Point3};
use tactnet_catching::Robot;
use tactnet_catching::coordinate::Room;
use tactnet_catching::map::{
    ArmSpheres, DepthCamera, DistanceField, Fusion, FusionConfig, Sphere, StillSpheres,
};
use tactnet_catching::plan::ObstacleConfig;
use tactnet_catching::ramp::Ramp;
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, joint};
use tactnet_catching_world::{DepthConfig, World};

use crate::error::TrialError;
use crate::stepped_time::ticks;
use crate::throw_config::{Mapping, ThrowConfig};

/// Pan and tilt of the head for each depth picture, in rad.
pub(crate) const VIEWS: [[f64; 2]; 4] = [[1.0, 0.55], [0.35, 0.55], [-0.35, 0.55], [-1.0, 0.55]];
/// Share of the maximum joint speed for large motions.
const PACE: f64 = 0.4;
/// Minimum duration of a motion, in s.
const LEAST: f64 = 0.3;
/// Standstill after each motion, in s.
const STAND: f64 = 0.15;

/// State of a robot after it has looked around.
pub(crate) struct Looked {
    /// Joint positions.
    pub joints: [f64; JOINTS],
    /// Distance field of the map.
    pub field: Option<Arc<DistanceField>>,
    /// Time from the last depth pictures to the map, in s.
    pub seconds: f64,
}

/// Motions of a robot from rest to rest.
pub(crate) struct Motions<'a> {
    pub robot: &'a Robot,
    pub world: &'a mut World,
    /// Last commanded joint positions.
    pub joints: [f64; JOINTS],
    /// Last measured joint positions.
    pub measured: [f64; JOINTS],
}

/// Returns the joint positions for looking around: the waiting pose with raised arms.
pub(crate) fn looking(robot: &Robot) -> [f64; JOINTS] {
    let mut joints = robot.waiting();
    for arm in 0..ARMS {
        joints[joint::ARM[arm].clone()].copy_from_slice(&robot.raised(arm));
    }
    joints
}

/// Returns a world with a robot in its waiting pose, after it has looked around if required. Without looking, the
/// joints start at `ready`.
pub(crate) fn begin(
    config: &ThrowConfig,
    seed: u64,
    ready: &[f64; JOINTS],
) -> Result<(World, Looked), TrialError> {
    let (robot, description) = (&config.robot, config.robot.description());
    if config.mapping == Mapping::Off {
        let looked = Looked {
            joints: *ready,
            field: None,
            seconds: 0.0,
        };
        return Ok((World::new(description, &config.world, seed, ready)?, looked));
    }
    let mut world = World::new(description, &config.world, seed, &looking(robot))?;
    let looked = look_about(robot, config.mapping, &config.world.depth, &mut world)?;
    Ok((world, looked))
}

/// Looks around, moves the boxes, looks again and lowers the arms. An arm whose path down is not clear stays up.
///
/// - `world`: world with the robot in the pose of [`looking`]
fn look_about(
    robot: &Robot,
    mapping: Mapping,
    depth: &DepthConfig,
    world: &mut World,
) -> Result<Looked, TrialError> {
    let mut fusion = match mapping {
        Mapping::Depth => Some(Fusion::new(fusion_config(depth))?),
        Mapping::Off | Mapping::Blind => None,
    };
    let mut motions = Motions::raised(robot, world);
    let mut seconds = 0.0;
    for look in 0..2 {
        if look > 0 {
            motions.world.rearrange();
        }
        if let Some(fusion) = &mut fusion {
            fusion.look_again();
        }
        seconds = 0.0;
        for (number, view) in VIEWS.iter().enumerate() {
            motions.turn_head(*view);
            if let Some(fusion) = &mut fusion {
                let picture = motions
                    .world
                    .depth_picture((look * VIEWS.len() + number) as u64);
                let begun = Instant::now();
                let measured = &motions.measured;
                let chest = robot.chest(measured);
                let head = chest * robot.head(measured);
                fusion.push(&picture, &head, &own_body(robot, measured, &chest))?;
                seconds += begun.elapsed().as_secs_f64();
            }
        }
    }
    motions.turn_head([0.0; 2]);
    let begun = Instant::now();
    let field = fusion.map(|fusion| Arc::new(fusion.field()));
    seconds += begun.elapsed().as_secs_f64();
    motions.lower_arms(field.as_ref());
    Ok(Looked {
        joints: motions.joints,
        field,
        seconds,
    })
}

/// Returns the settings of a map for a depth camera.
pub(crate) fn fusion_config(depth: &DepthConfig) -> FusionConfig {
    FusionConfig {
        camera: DepthCamera {
            position: depth.position,
            width: depth.width as usize,
            height: depth.height as usize,
            focal: depth.focal,
        },
        ..FusionConfig::default()
    }
}

/// Returns the spheres of both arms in the chest frame.
pub(crate) fn arm_spheres(robot: &Robot, joints: &[f64; JOINTS]) -> impl Iterator<Item = Sphere> {
    (0..ARMS).flat_map(move |arm| {
        let own = joint::ARM[arm].start;
        let q = std::array::from_fn(|i| joints[own + i]);
        ArmSpheres::new(robot, arm).placed(robot, arm, &q)
    })
}

/// Returns the robot's spheres in the inertial frame.
pub(crate) fn own_body(
    robot: &Robot,
    joints: &[f64; JOINTS],
    chest: &Isometry3<f64>,
) -> Vec<Sphere> {
    let still = StillSpheres::new(robot).spheres;
    still
        .into_iter()
        .chain(arm_spheres(robot, joints))
        .map(|sphere| Sphere {
            centre: (chest * Point3::from(sphere.centre)).coords,
            ..sphere
        })
        .collect()
}

impl<'a> Motions<'a> {
    /// Starts with the arms raised.
    ///
    /// - `world`: world with the robot in the pose of [`looking`]
    pub(crate) fn raised(robot: &'a Robot, world: &'a mut World) -> Self {
        let joints = looking(robot);
        Self {
            robot,
            world,
            joints,
            measured: joints,
        }
    }

    /// Follows a motion, and waits until the joints stand still.
    ///
    /// - `at`: joint positions and speeds at a time in s
    pub(crate) fn follow(
        &mut self,
        seconds: f64,
        at: impl Fn(f64) -> ([f64; JOINTS], [f64; JOINTS]),
    ) {
        for tick in 1..=ticks(seconds + STAND) {
            let (q, dq) = at(tick as f64 * 1e-3);
            let sensed = self.world.step(&JointCommand::of(q, dq), &[None; ARMS]);
            (self.joints, self.measured) = (q, sensed.joints.q);
        }
    }

    /// Moves the joints to the given positions, and waits until they stand still.
    fn go_to(&mut self, there: &[f64; JOINTS]) {
        let seconds = self.seconds_to(there);
        let ramps: [Ramp; JOINTS] = std::array::from_fn(|i| {
            let speed = self.robot.joints()[i].speed;
            Ramp::between(self.joints[i], 0.0, there[i], seconds, speed)
        });
        let at = |t: f64| {
            let at = ramps.map(|ramp| ramp.at(t));
            (at.map(|(q, _)| q), at.map(|(_, dq)| dq))
        };
        self.follow(seconds, at);
        // The ramps end there except for rounding errors.
        self.joints = *there;
    }

    fn seconds_to(&self, there: &[f64; JOINTS]) -> f64 {
        let joints = self.robot.joints().iter();
        let times = joints
            .zip(there.iter().zip(&self.joints))
            .map(|(joint, (there, here))| (there - here).abs() / (PACE * joint.speed));
        times.fold(LEAST, f64::max)
    }

    pub(crate) fn turn_head(&mut self, view: [f64; 2]) {
        let mut there = self.joints;
        there[joint::NECK].copy_from_slice(&view);
        self.go_to(&there);
    }

    fn lower_arms(&mut self, field: Option<&Arc<DistanceField>>) {
        let mut there = self.joints;
        let chest = self.robot.chest(&self.joints);
        let apart = ObstacleConfig::default().hard;
        let room = field.map(|field| Room::new(self.robot, field.clone(), apart));
        for arm in 0..ARMS {
            let own = joint::ARM[arm].clone();
            let down = self.robot.ready(arm);
            // All joints start and end together, so the path in joint space is straight at any speed.
            let way: [Ramp; ARM_JOINTS] = std::array::from_fn(|i| {
                Ramp::between(self.joints[own.start + i], 0.0, down[i], 1.0, f64::INFINITY)
            });
            let clear = |room: &Room| room.is_clear(self.robot, arm, &way, &chest);
            if room.as_ref().is_none_or(clear) {
                there[own].copy_from_slice(&down);
            }
        }
        self.go_to(&there);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use tactnet_catching_world::{BoxConfig, ObstaclesConfig, WorldConfig};

    use super::*;

    fn looked(config: &WorldConfig, seed: u64, mapping: Mapping) -> (World, Looked) {
        let robot = Robot::nominal();
        let mut world = World::new(robot.description(), config, seed, &looking(&robot)).unwrap();
        let looked = look_about(&robot, mapping, &config.depth, &mut world).unwrap();
        (world, looked)
    }

    fn table_and_box() -> WorldConfig {
        WorldConfig {
            obstacles: ObstaclesConfig::table_and_box(),
            ..WorldConfig::default()
        }
    }

    /// Compares the map with the true boxes at points that the last look could see from the front.
    #[test]
    fn the_map_shows_boxes_where_they_stand_and_not_where_they_stood() {
        let config = table_and_box();
        let robot = Robot::nominal();
        for seed in 1..4 {
            let before = World::new(robot.description(), &config, seed, &looking(&robot)).unwrap();
            let (world, looked) = looked(&config, seed, Mapping::Depth);
            let field = looked.field.unwrap();
            let [table, moved] = world.boxes() else {
                panic!("two boxes")
            };
            for standing in [table, moved] {
                let middle = Vector3::from(standing.middle);
                let found = field.distance(&middle);
                assert!(found < 0.01, "middle of a box: {found}");
                if standing == table {
                    continue;
                }
                // Above a box, distances are correct; next to it, occluded space counts as solid.
                for up in [0.05, 0.1, 0.2] {
                    let over = middle + Vector3::new(0.0, 0.0, 0.5 * standing.size[2] + up);
                    let distances = world.boxes().iter().map(|other| other.distance(&over));
                    let truth = distances.fold(f64::INFINITY, f64::min);
                    let found = field.distance(&over);
                    let good = (found - truth).abs() < 0.03 || truth < 0.02;
                    assert!(good, "{up} above: {found} {truth}");
                }
            }
            // The former place of the box, if it is neither at nor behind the new one.
            let old = Vector3::from(before.boxes()[1].middle);
            let apart = moved.distance(&old);
            if apart > 0.15 && moved.middle[0] > before.boxes()[1].middle[0] {
                let found = field.distance(&old);
                assert!(found > 0.02, "{found} {apart}");
            }
            assert_eq!(world.contacts().ticks, 0);
        }
    }

    #[test]
    fn the_robots_own_body_is_not_in_the_map() {
        let far = WorldConfig {
            obstacles: ObstaclesConfig {
                boxes: vec![BoxConfig::fixed([1.5, 0.0, 0.4], [0.2, 0.2, 0.8])],
            },
            ..WorldConfig::default()
        };
        let (_, again) = looked(&far, 1, Mapping::Depth);
        let (_, looked) = looked(&far, 1, Mapping::Depth);
        assert!(again.field == looked.field, "a look repeats to the bit");
        let robot = Robot::nominal();
        let field = looked.field.unwrap();
        for joints in [looking(&robot), robot.waiting()] {
            let chest = robot.chest(&joints);
            // The lower torso is out of view. Space behind the visible floor is below the map.
            let spheres = own_body(&robot, &joints, &chest);
            let least = spheres
                .iter()
                .map(|sphere| field.distance(&sphere.centre) - sphere.radius)
                .fold(f64::INFINITY, f64::min);
            assert!(least > 0.1, "{least}");
        }
        assert_eq!(looked.joints, robot.waiting());
    }

    #[test]
    fn an_arm_whose_way_down_is_not_clear_stays_up() {
        let robot = Robot::nominal();
        let hand = robot.chest(&robot.waiting())
            * Point3::from(robot.arm(0).forward(&robot.ready(0)).position);
        let under = WorldConfig {
            obstacles: ObstaclesConfig {
                boxes: vec![BoxConfig::fixed(
                    [hand.x, hand.y, 0.5 * hand.z],
                    [0.2, 0.2, hand.z],
                )],
            },
            ..WorldConfig::default()
        };
        let (world, seen) = looked(&under, 1, Mapping::Depth);
        assert_eq!(world.contacts().ticks, 0);
        assert_eq!(seen.joints[joint::ARM[0].clone()], robot.raised(0));
        assert_eq!(seen.joints[joint::ARM[1].clone()], robot.ready(1));
        // The robot that does not look touches the box.
        let (world, blind) = looked(&under, 1, Mapping::Blind);
        assert!(world.contacts().ticks > 0 && blind.field.is_none());
    }
}
