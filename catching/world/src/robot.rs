//! The true robot: drives with dynamics, elastic links, slipping wheels.

use nalgebra::{Matrix3, Vector3};
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{ARMS, JOINTS, RobotDescription, joint};

use crate::GRAVITY;
use crate::config::WorldConfig;
use crate::drives::{Drives, TICK};
use crate::dynamics::Acceleration;
use crate::error::WorldError;
use crate::kinematics::{BODIES, CHEST, HAND, HEAD, Place, Tree, with_passive, without_passive};
use crate::planted::{JointErrors, Slip};
use crate::torso::{Prescribed, Torso, deflected};

/// Number of iterations for the initial sag of the arms; each reduces the error about a thousandfold.
const SETTLING: usize = 8;
/// Number of substeps per tick.
pub(crate) const SUBSTEPS: usize = 2;

/// Pose and motion of a frame in the inertial frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameMotion {
    /// Position of its origin, in m.
    pub position: Vector3<f64>,
    /// Rotation to the inertial frame. The third column of a catch frame is the hand's axis, which points away from
    /// the wrist.
    pub rotation: Matrix3<f64>,
    /// Velocity of its origin, in m/s.
    pub velocity: Vector3<f64>,
    /// Angular velocity in the inertial frame, in rad/s.
    pub rate: Vector3<f64>,
}

impl FrameMotion {
    /// Returns the frame between two others, interpolated linearly; `part` is 0 at the first and 1 at the second.
    pub(crate) fn between([from, to]: &[Self; 2], part: f64) -> Self {
        Self {
            position: from.position.lerp(&to.position, part),
            rotation: from.rotation * (1.0 - part) + to.rotation * part,
            velocity: from.velocity.lerp(&to.velocity, part),
            rate: from.rate.lerp(&to.rate, part),
        }
    }

    /// Returns a frame at rest.
    #[cfg(test)]
    pub(crate) fn still(position: Vector3<f64>, rotation: Matrix3<f64>) -> Self {
        Self {
            position,
            rotation,
            velocity: Vector3::zeros(),
            rate: Vector3::zeros(),
        }
    }
}

/// Measured quantities of an ideal inertial unit in the head frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Felt {
    /// Specific force, in m/s^2.
    pub(crate) specific_force: Vector3<f64>,
    /// Angular velocity, in rad/s.
    pub(crate) rate: Vector3<f64>,
}

/// Frames of interest at the end of a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frames {
    pub(crate) head: FrameMotion,
    pub(crate) chest: FrameMotion,
    pub(crate) hands: [FrameMotion; ARMS],
}

/// Joints with offsets and elasticity: `q_link = q + offset + sag`, `sag = compliance * load`. Arms sag
/// quasi-statically under their weight, with a delay of one tick.
#[derive(Debug, Clone, Default)]
struct Links {
    errors: JointErrors,
    /// Sag of each joint, in rad.
    sag: [f64; JOINTS],
}

impl Links {
    fn of(&self, q: &[f64; JOINTS]) -> [f64; JOINTS] {
        std::array::from_fn(|i| q[i] + self.errors.offsets[i] + self.sag[i])
    }

    /// Updates the sag of the arms for sensor values `q`.
    fn sag(&mut self, tree: &Tree, q: &[f64; JOINTS]) {
        if self.errors.compliances == [0.0; JOINTS] {
            return;
        }
        // The chest stays upright, so the springs of the torso do not matter.
        let places = tree.places(&with_passive(&self.of(q)));
        let weight = tree.inverse_dynamics(&places, &[0.0; BODIES], &[0.0; BODIES], GRAVITY);
        let carried = without_passive(&weight.torques);
        self.sag = std::array::from_fn(|i| -self.errors.compliances[i] * carried[i]);
    }
}

/// The robot without its hands.
#[derive(Debug, Clone)]
pub(crate) struct Robot {
    tree: Tree,
    pub(crate) drives: Drives,
    torso: Torso,
    slip: Slip,
    /// Deviations between links and sensors.
    links: Option<Links>,
    /// Position of the inertial unit in the head frame, in m.
    imu: Vector3<f64>,
    /// Torques and forces at the joints.
    pub(crate) torques: [f64; JOINTS],
    /// Measured quantities of the inertial unit in the middle of each substep of the last tick.
    pub(crate) felt: [Felt; SUBSTEPS],
    pub(crate) frames: Frames,
    /// Poses of all bodies at the end of the last tick.
    pub(crate) places: [Place; BODIES],
}

impl Robot {
    /// Creates a robot at rest at `start`.
    pub(crate) fn new(
        description: &RobotDescription,
        config: &WorldConfig,
        seed: u64,
        start: &[f64; JOINTS],
    ) -> Result<Self, WorldError> {
        let limits = description.joints();
        for (joint, (limit, q)) in limits.iter().zip(start).enumerate() {
            let [low, high] = limit.range;
            if !(low..=high).contains(q) {
                return Err(WorldError::Start {
                    joint,
                    found: *q,
                    low,
                    high,
                });
            }
        }
        let tree = Tree::new(
            &config.errors.lengths(description, seed),
            &config.errors.arm_mounts(seed),
        );
        let mut links = config.errors.joints(seed).map(|errors| Links {
            errors,
            sag: [0.0; JOINTS],
        });
        if let Some(links) = &mut links {
            for _ in 0..SETTLING {
                links.sag(&tree, start);
            }
        }
        let placed = links.as_ref().map_or(*start, |links| links.of(start));
        let torso = Torso::new(&tree, &config.torso, GRAVITY, &placed)?;
        let still = deflected(&placed, &torso.e);
        let places = tree.places(&still);
        let weight = tree.inverse_dynamics(&places, &[0.0; BODIES], &[0.0; BODIES], GRAVITY);
        let frames = frames(&tree, &places, &[0.0; BODIES]);
        let felt = Felt {
            specific_force: frames.head.rotation.transpose() * Vector3::z() * GRAVITY,
            rate: Vector3::zeros(),
        };
        Ok(Self {
            slip: config.errors.slip(seed, start[joint::PLATFORM]),
            links,
            drives: Drives::new(limits, &config.drives, *start),
            imu: description.imu.position.into(),
            torques: without_passive(&weight.torques),
            felt: [felt; SUBSTEPS],
            frames,
            places,
            tree,
            torso,
        })
    }

    pub(crate) fn advance(&mut self, command: &JointCommand) {
        self.drives.receive(command);
        if let Some(links) = &mut self.links {
            links.sag(&self.tree, &self.drives.q);
        }
        let braked = command.torso_brakes == 1;
        let h = TICK / SUBSTEPS as f64;
        for substep in 0..SUBSTEPS {
            let (q, dq) = (self.drives.q, self.drives.dq);
            let ddq = self.drives.advance(h);
            let middle = self.with_slip(Prescribed {
                q: std::array::from_fn(|i| q[i] + (dq[i] + ddq[i] * h / 4.0) * h / 2.0),
                dq: std::array::from_fn(|i| dq[i] + ddq[i] * h / 2.0),
                ddq,
            });
            let (inverse, places) = self.torso.advance(&self.tree, &middle, h, braked);
            self.felt[substep] = self.feel(&places[HEAD], &inverse.accelerations[HEAD]);
            self.torques = without_passive(&inverse.torques);
        }
        let end = self.with_slip(Prescribed {
            q: self.drives.q,
            dq: self.drives.dq,
            ddq: [0.0; JOINTS],
        });
        let places = self.tree.places(&deflected(&end.q, &self.torso.e));
        let rates = deflected(&end.dq, &self.torso.de);
        self.frames = frames(&self.tree, &places, &rates);
        self.places = places;
    }

    /// Rotates the link of a joint by `angle` rad without a change of its sensor.
    pub(crate) fn slip_joint(&mut self, joint: usize, angle: f64) {
        let links = self.links.get_or_insert_default();
        links.errors.offsets[joint] += angle;
    }

    /// Returns the deflections of the torso's links from their drives, in rad: yaw, lower pitch, upper pitch.
    pub(crate) fn deflection(&self) -> [f64; 3] {
        self.torso.e.into()
    }

    /// Returns the slip of the platform, in m.
    pub(crate) fn slip(&self) -> f64 {
        self.slip.at(self.drives.q[joint::PLATFORM])
    }

    /// Returns the frames of the arms' last links, whose origins are the wrists.
    pub(crate) fn wrists(&self) -> [FrameMotion; ARMS] {
        std::array::from_fn(|arm| {
            let hand = &self.frames.hands[arm];
            let back = hand.rotation.column(2) * -self.tree.wrist_to_catch(arm);
            FrameMotion {
                position: hand.position + back,
                velocity: hand.velocity + hand.rate.cross(&back),
                ..*hand
            }
        })
    }

    fn feel(&self, head: &Place, acceleration: &Acceleration) -> Felt {
        let arm = head.rotation * self.imu;
        let there = acceleration.specific_force
            + acceleration.angular.cross(&arm)
            + acceleration.rate.cross(&acceleration.rate.cross(&arm));
        Felt {
            specific_force: head.rotation.tr_mul(&there),
            rate: head.rotation.tr_mul(&acceleration.rate),
        }
    }

    fn with_slip(&self, mut motion: Prescribed) -> Prescribed {
        let (q, dq, ddq) = (&mut motion.q, &mut motion.dq, &mut motion.ddq);
        let platform = joint::PLATFORM;
        let slipped = self.slip.apply([q[platform], dq[platform], ddq[platform]]);
        if let Some(links) = &self.links {
            *q = links.of(q);
        }
        [q[platform], dq[platform], ddq[platform]] = slipped;
        motion
    }
}

fn frames(tree: &Tree, places: &[Place; BODIES], rates: &[f64; BODIES]) -> Frames {
    let velocities = tree.velocities(places, rates);
    let frame = |body: usize, position: Vector3<f64>| FrameMotion {
        position,
        rotation: places[body].rotation,
        velocity: velocities[body].linear
            + velocities[body]
                .angular
                .cross(&(position - places[body].position)),
        rate: velocities[body].angular,
    };
    Frames {
        head: frame(HEAD, places[HEAD].position),
        chest: frame(CHEST, places[CHEST].position),
        hands: std::array::from_fn(|arm| frame(HAND[arm], tree.catch_position(places, arm))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::ready;

    fn robot(config: &WorldConfig) -> Robot {
        Robot::new(&RobotDescription::nominal(), config, 1, &ready()).unwrap()
    }

    /// Returns joints and rates of a reach of 0.6 s with the left arm: 0.1 s acceleration, constant speed, 0.1 s
    /// deceleration.
    fn reach(t: f64) -> ([f64; JOINTS], [f64; JOINTS]) {
        let (mut q, mut dq) = (ready(), [0.0; JOINTS]);
        let sped_up = t.clamp(0.0, 0.1).powi(2) / 0.2;
        let run = (t - 0.1).clamp(0.0, 0.4);
        let slowed = (t - 0.5).clamp(0.0, 0.1);
        let way = sped_up + run + slowed - slowed * slowed / 0.2;
        let rate = (t / 0.1).min((0.6 - t) / 0.1).clamp(0.0, 1.0);
        // Close to the speed limits of the description.
        for (joint, speed) in [(6, 1.6), (7, -1.2), (8, 1.0), (9, -1.5), (11, 1.5)] {
            q[joint] += speed * way;
            dq[joint] = speed * rate;
        }
        (q, dq)
    }

    #[test]
    fn a_robot_without_commands_stands_still() {
        let mut robot = robot(&WorldConfig::default());
        let before = robot.frames;
        for _ in 0..1000 {
            robot.advance(&JointCommand::still(ready()));
        }
        let moved = (robot.frames.head.position - before.head.position).norm();
        // The equilibrium is accurate to 1e-14 rad; rounding excites small oscillations.
        assert!(moved < 1e-10, "{moved}");
        assert!((robot.felt[0].specific_force.norm() - GRAVITY).abs() < 1e-8);
        // The torso sags a little under the weight.
        assert!(robot.deflection()[1].abs() < 0.02);
    }

    /// Thesis, figure 3.12: the vertical joint of the torso deviates by 1.5 degrees during a catch.
    #[test]
    fn a_reaching_arm_shakes_the_torso_by_about_a_degree() {
        let mut robot = robot(&WorldConfig::default());
        let before = robot.frames;
        let rest = robot.deflection();
        let (mut yaw, mut head) = (0.0f64, 0.0f64);
        for tick in 0..1000 {
            let t = f64::from(tick) * TICK;
            let (q, dq) = reach(t);
            robot.advance(&JointCommand::of(q, dq));
            let now = robot.deflection();
            yaw = yaw.max((now[0] - rest[0]).abs());
            head = head.max((robot.frames.head.position - before.head.position).norm());
        }
        let yaw = yaw.to_degrees();
        assert!((0.5..3.0).contains(&yaw), "{yaw}");
        assert!((5e-4..0.05).contains(&head), "{head}");
    }

    /// Commands refer to sensor values, and the sensors follow them.
    #[test]
    fn links_stand_off_their_sensors_by_offset_and_sag() {
        let mut config = WorldConfig::default();
        let errors = &mut config.errors;
        (errors.arm_offset, errors.arm_compliance, errors.neck_offset) = (0.02, 1e-4, 0.01);
        let mut robot = robot(&config);
        let links = robot.links.clone().unwrap();
        let before = robot.frames;
        for _ in 0..200 {
            robot.advance(&JointCommand::still(ready()));
        }
        assert_eq!(robot.drives.q, ready());
        assert!((robot.frames.hands[0].position - before.hands[0].position).norm() < 1e-9);
        for own in joint::ARM {
            for i in own {
                // The joint sags under its load.
                let expected = -links.errors.compliances[i] * robot.torques[i];
                assert!((robot.links.as_ref().unwrap().sag[i] - expected).abs() < 1e-9);
            }
        }
        // The shoulders carry about 30 Nm.
        let most = links.sag.iter().map(|sag| sag.abs()).fold(0.0, f64::max);
        assert!((1e-3..2e-2).contains(&most), "{most}");
        let exact = self::robot(&WorldConfig::default()).frames;
        let aside = before.hands[0].position - exact.hands[0].position;
        assert!((0.002..0.1).contains(&aside.norm()), "{}", aside.norm());
    }

    #[test]
    fn a_rigid_torso_does_not_shake() {
        let mut config = WorldConfig::default();
        config.torso.stiffness = crate::Stiffness::Rigid;
        let mut robot = robot(&config);
        let before = robot.frames.head;
        for tick in 0..700 {
            let (q, dq) = reach(f64::from(tick) * TICK);
            robot.advance(&JointCommand::of(q, dq));
        }
        assert_eq!(robot.frames.head, before);
    }

    /// Integrating the measured quantities reproduces the motion of the head. The steps are the same half ticks, so
    /// only the second order of the rotation is lost.
    #[test]
    fn what_the_imu_feels_is_the_motion_of_the_head() {
        let mut robot = robot(&WorldConfig::default());
        let arm = robot.imu;
        let at = |head: &FrameMotion| {
            let arm = head.rotation * arm;
            (head.position + arm, head.velocity + head.rate.cross(&arm))
        };
        let (mut position, mut velocity) = at(&robot.frames.head);
        let mut rotation = nalgebra::Rotation3::from_matrix_unchecked(robot.frames.head.rotation);
        let h = TICK / SUBSTEPS as f64;
        for tick in 0..800 {
            let (mut q, mut dq) = reach(f64::from(tick) * TICK);
            // The head and the platform move, too.
            for (joint, size, rate) in [(0, 0.1, 4.0), (4, 0.3, 5.0)] {
                let angle = rate * f64::from(tick) * TICK;
                q[joint] += size * (1.0 - angle.cos());
                dq[joint] += size * rate * angle.sin();
            }
            robot.advance(&JointCommand::of(q, dq));
            for felt in robot.felt {
                let turn = |part: f64| nalgebra::Rotation3::new(felt.rate * (h * part));
                let middle = rotation * turn(0.5);
                let a = middle * felt.specific_force - Vector3::z() * GRAVITY;
                position += velocity * h + a * (h * h / 2.0);
                velocity += a * h;
                rotation *= turn(1.0);
            }
        }
        let (true_position, true_velocity) = at(&robot.frames.head);
        let off = [position - true_position, velocity - true_velocity].map(|off| off.norm());
        assert!(off[0] < 5e-4 && off[1] < 2e-3, "{off:?}");
        let turned = rotation.matrix().transpose() * robot.frames.head.rotation;
        assert!((turned - Matrix3::identity()).norm() < 2e-4);
    }
}
