//! Geometry of the robot: forward kinematics of hands and head, Jacobians, and closed-form inverse kinematics.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, Joint, RobotDescription, joint};

mod arm;

pub(crate) use arm::Chain;
use arm::{ABOUT_Z, turn_plane};
pub use arm::{ArmKinematics, ElbowCircle, LinkFrame};

/// Position of a raised hand relative to the shoulder, in m.
const RAISED: Vector3<f64> = Vector3::new(0.4, 0.0, 0.6);
/// Minimum distance of the raised arm's joints from the ends of their ranges, as a fraction of the range.
const RAISED_MARGIN: f64 = 0.015;
/// Number of steps at which the way down is evaluated.
const RAISED_STEPS: u32 = 6;

/// Pose of a catch frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandPose {
    /// Centre of the hand's opening, in m.
    pub position: Vector3<f64>,
    /// Rotation from the catch frame to the frame of `position`. Its third column is the hand axis, which points away
    /// from the wrist.
    pub rotation: Matrix3<f64>,
}

/// Geometry and limits of the robot.
#[derive(Debug, Clone)]
pub struct Robot {
    description: RobotDescription,
    joints: [Joint; JOINTS],
    arms: [ArmKinematics; ARMS],
}

impl Robot {
    /// Returns the robot of the simulation.
    pub fn nominal() -> Self {
        Self::new(RobotDescription::nominal())
    }

    /// Creates a robot from a validated description.
    pub fn new(description: RobotDescription) -> Self {
        Self {
            joints: description.joints(),
            arms: std::array::from_fn(|i| ArmKinematics::new(&description.arms[i])),
            description,
        }
    }

    /// Returns the description.
    pub fn description(&self) -> &RobotDescription {
        &self.description
    }

    /// Returns the limits of all joints.
    pub fn joints(&self) -> &[Joint; JOINTS] {
        &self.joints
    }

    /// Returns the kinematics of an arm in the chest frame: 0 left, 1 right.
    pub fn arm(&self, arm: usize) -> &ArmKinematics {
        &self.arms[arm]
    }

    /// Returns the joints of the waiting pose: platform, torso and neck at zero, arms as in [`Robot::ready`].
    pub fn waiting(&self) -> [f64; JOINTS] {
        let mut q = [0.0; JOINTS];
        for arm in 0..ARMS {
            q[joint::ARM[arm].clone()].copy_from_slice(&self.ready(arm));
        }
        q
    }

    /// Returns the joint angles of an arm in the waiting pose. The hand is half a metre in front of the shoulder,
    /// slightly below it and open towards the thrower. Of all such configurations, this one is farthest from the ends
    /// of the joint ranges.
    pub fn ready(&self, arm: usize) -> [f64; ARM_JOINTS] {
        self.held(
            arm,
            Vector3::new(0.5, 0.0, -0.25),
            &Vector3::new(1.0, 0.0, 0.3).normalize(),
            |margin, _| margin,
        )
    }

    /// Returns the joint angles of a raised arm, used while the head looks at the space in front of the robot. The hand
    /// is above and in front of the shoulder and open inwards. Of all such configurations, the straight way to
    /// [`Robot::ready`] swings outwards least.
    pub fn raised(&self, arm: usize) -> [f64; ARM_JOINTS] {
        let ready = self.ready(arm);
        let kinematics = &self.arms[arm];
        let outwards = kinematics.shoulder().y.signum();
        let axis = Vector3::new(0.3, -outwards, 0.5).normalize();
        self.held(arm, RAISED, &axis, |margin, q| {
            if margin < RAISED_MARGIN {
                return f64::NEG_INFINITY;
            }
            let points = (0..=RAISED_STEPS).flat_map(|step| {
                let share = f64::from(step) / f64::from(RAISED_STEPS);
                kinematics.points(&std::array::from_fn(|i| q[i] + share * (ready[i] - q[i])))
            });
            -points
                .map(|point| point.y * outwards)
                .fold(f64::NEG_INFINITY, f64::max)
        })
    }

    /// Returns the joint angles with the hand at `from_shoulder` and its axis along `axis` that maximise `measure`. Its
    /// arguments are the minimum distance to an end of a range, as a fraction of the range, and the angles.
    fn held(
        &self,
        arm: usize,
        from_shoulder: Vector3<f64>,
        axis: &Vector3<f64>,
        measure: impl Fn(f64, &[f64; ARM_JOINTS]) -> f64,
    ) -> [f64; ARM_JOINTS] {
        let arm = &self.arms[arm];
        let mut best = (f64::NEG_INFINITY, [0.0; ARM_JOINTS]);
        let steps = 36;
        for hand in 0..steps {
            let pose = HandPose {
                position: arm.shoulder() + from_shoulder,
                rotation: rotation_towards(axis, f64::from(hand) * TAU / f64::from(steps)),
            };
            for elbow in 0..steps {
                arm.inverse(&pose, f64::from(elbow) * TAU / f64::from(steps), |q| {
                    let margin = arm.joints().iter().zip(&q).map(|(joint, q)| {
                        let [low, high] = joint.range;
                        (q - low).min(high - q) / (high - low)
                    });
                    let worth = measure(margin.fold(f64::INFINITY, f64::min), &q);
                    if worth > best.0 {
                        best = (worth, q);
                    }
                });
            }
        }
        best.1
    }

    /// Returns the chest pose in the inertial frame from joint positions alone, without elasticity and slip.
    pub fn chest(&self, q: &[f64; JOINTS]) -> Isometry3<f64> {
        let torso = &self.description.torso;
        let [yaw, lower, upper] = [q[1], q[2], q[3]];
        let forward = torso.lower_length * lower.sin() + torso.upper_length * (lower + upper).sin();
        let up = torso.lower_pitch_height
            + torso.lower_length * lower.cos()
            + torso.upper_length * (lower + upper).cos();
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        let position =
            Vector3::new(0.0, q[joint::PLATFORM], 0.0) + rotation * Vector3::new(forward, 0.0, up);
        Isometry3::from_parts(Translation3::from(position), rotation)
    }

    /// Returns the head pose in the chest frame.
    pub fn head(&self, q: &[f64; JOINTS]) -> Isometry3<f64> {
        let [pan, tilt] = [q[joint::NECK.start], q[joint::NECK.start + 1]];
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pan)
            * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt);
        Isometry3::from_parts(
            Translation3::new(0.0, 0.0, self.description.neck.height),
            rotation,
        )
    }

    /// Returns pan and tilt that point the head at `point` (chest frame), without limits.
    pub fn look_at(&self, point: &Vector3<f64>) -> [f64; 2] {
        let d = point - Vector3::new(0.0, 0.0, self.description.neck.height);
        [d.y.atan2(d.x), (-d.z).atan2(d.x.hypot(d.y))]
    }
}

/// Returns a unit vector that is not nearly parallel to `axis`.
fn beside(axis: &Vector3<f64>) -> Vector3<f64> {
    if axis.z.abs() < 0.9 {
        Vector3::z()
    } else {
        Vector3::x()
    }
}

/// Returns a rotation whose z axis is the unit vector `axis`, rotated by `angle` about it.
pub fn rotation_towards(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let x = beside(axis).cross(axis).normalize();
    let mut rotation = Matrix3::from_columns(&[x, axis.cross(&x), *axis]);
    let (sin, cos) = angle.sin_cos();
    turn_plane(&mut rotation, ABOUT_Z, sin, cos);
    rotation
}

#[cfg(test)]
mod tests;
