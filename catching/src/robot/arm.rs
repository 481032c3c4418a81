//! Kinematics of an arm: frames, Jacobian, and closed-form inverse with a free elbow angle.

use nalgebra::{Isometry3, Matrix3, SMatrix, Translation3, UnitQuaternion, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, Arm, Joint};

use super::HandPose;

/// Frame of an arm's link in the chest frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkFrame {
    /// Origin on the axis of the joint that moves the link, in m.
    pub origin: Vector3<f64>,
    /// Rotation from the link frame to the chest frame.
    pub rotation: Matrix3<f64>,
    /// Axis of the joint that moves the link.
    pub axis: Vector3<f64>,
}

/// Kinematics of an arm with spherical shoulder and wrist and joint axes z, -y, z, y, z, -y, z.
#[derive(Debug, Clone)]
pub struct ArmKinematics {
    base: Isometry3<f64>,
    base_rotation: Matrix3<f64>,
    shoulder: Vector3<f64>,
    upper: f64,
    fore: f64,
    hand: f64,
    joints: [Joint; ARM_JOINTS],
}

impl ArmKinematics {
    pub(super) fn new(arm: &Arm) -> Self {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), arm.lean);
        let base = Isometry3::from_parts(Translation3::from(Vector3::from(arm.position)), rotation);
        Self {
            base,
            base_rotation: rotation.to_rotation_matrix().into_inner(),
            shoulder: base * nalgebra::Point3::new(0.0, 0.0, arm.base_to_shoulder)
                - nalgebra::Point3::origin(),
            upper: arm.shoulder_to_elbow,
            fore: arm.elbow_to_wrist,
            hand: arm.wrist_to_catch,
            joints: arm.joints,
        }
    }

    /// Returns the joint limits.
    pub fn joints(&self) -> &[Joint; ARM_JOINTS] {
        &self.joints
    }

    /// Returns the shoulder position in the chest frame, in m.
    pub fn shoulder(&self) -> Vector3<f64> {
        self.shoulder
    }

    /// Returns the distance from the shoulder to the farthest catch frame, in m.
    pub fn reach(&self) -> f64 {
        self.upper + self.fore + self.hand
    }

    /// Returns the mounting pose in the chest frame.
    pub fn base(&self) -> &Isometry3<f64> {
        &self.base
    }

    /// Returns the catch frame at joint angles `q`, in the chest frame.
    pub fn forward(&self, q: &[f64; ARM_JOINTS]) -> HandPose {
        self.chain(q).pose()
    }

    /// Returns the positions of shoulder, elbow, wrist and catch frame in the chest frame.
    pub fn points(&self, q: &[f64; ARM_JOINTS]) -> [Vector3<f64>; 4] {
        let chain = self.chain(q);
        [chain.shoulder, chain.elbow, chain.wrist, chain.catch]
    }

    /// Returns the catch frame and its geometric Jacobian `[6][7]`: linear velocity, then angular velocity, per joint
    /// velocity.
    pub fn jacobian(&self, q: &[f64; ARM_JOINTS]) -> (HandPose, SMatrix<f64, 6, ARM_JOINTS>) {
        let chain = self.chain(q);
        (chain.pose(), chain.jacobian())
    }

    /// Returns the link frames behind the joints, in the chest frame. The origin of the last one is the wrist.
    pub fn links(&self, q: &[f64; ARM_JOINTS]) -> [LinkFrame; ARM_JOINTS] {
        let mut rotation = self.base_rotation;
        let mut origin = self.shoulder;
        std::array::from_fn(|i| {
            match i {
                3 => origin += rotation.column(2) * self.upper,
                5 => origin += rotation.column(2) * self.fore,
                _ => {}
            }
            let axis = turn(&mut rotation, i, q[i]);
            LinkFrame {
                origin,
                rotation,
                axis,
            }
        })
    }

    /// Returns the joint axes and positions in the chest frame.
    pub(crate) fn chain(&self, q: &[f64; ARM_JOINTS]) -> Chain {
        let mut rotation = self.base_rotation;
        let mut axes = [Vector3::zeros(); ARM_JOINTS];
        let mut points = [Vector3::zeros(); 3];
        let mut point = self.shoulder;
        for i in 0..ARM_JOINTS {
            axes[i] = turn(&mut rotation, i, q[i]);
            let (joint, length) = match i {
                2 => (0, self.upper),
                4 => (1, self.fore),
                6 => (2, self.hand),
                _ => continue,
            };
            point += rotation.column(2) * length;
            points[joint] = point;
        }
        let [elbow, wrist, catch] = points;
        Chain {
            axes,
            shoulder: self.shoulder,
            elbow,
            wrist,
            catch,
            rotation,
        }
    }

    /// Calls `found` with each set of joint angles that puts the catch frame at `pose` (chest frame) and the elbow at
    /// `elbow_angle` on its circle about the line from shoulder to wrist. There are up to eight sets, with angles in
    /// (-pi, pi]. Joint ranges are not checked.
    ///
    /// A solution does not exist if the wrist is out of reach, or if the arm is stretched or folded to less than a
    /// milliradian, where the circle degenerates to a point.
    pub fn inverse(
        &self,
        pose: &HandPose,
        elbow_angle: f64,
        mut found: impl FnMut([f64; ARM_JOINTS]),
    ) {
        let Some(circle) = self.elbow_circle(pose) else {
            return;
        };
        circle.each(self, elbow_angle, &mut found);
    }

    /// Returns the circle of possible elbow positions for a pose, in the frame of the arm's base, or `None` if the pose
    /// is out of reach.
    pub fn elbow_circle(&self, pose: &HandPose) -> Option<ElbowCircle> {
        let rotation = self.base_rotation.transpose() * pose.rotation;
        let wrist = self.base_rotation.transpose() * (pose.position - self.shoulder)
            - rotation.column(2) * self.hand;
        let distance = wrist.norm();
        let cos = (distance * distance - self.upper * self.upper - self.fore * self.fore)
            / (2.0 * self.upper * self.fore);
        // Limit of one milliradian from stretched or folded.
        if cos.is_nan() || cos.abs() >= 1.0 - 5e-7 || distance < 1e-6 {
            return None;
        }
        let axis = wrist / distance;
        let along = (distance * distance + self.upper * self.upper - self.fore * self.fore)
            / (2.0 * distance);
        // Any direction perpendicular to the line.
        let first = axis.cross(&super::beside(&axis)).normalize();
        Some(ElbowCircle {
            rotation,
            wrist,
            centre: axis * along,
            first: first * (self.upper * self.upper - along * along).sqrt(),
            second: axis.cross(&first) * (self.upper * self.upper - along * along).sqrt(),
            bend: cos.acos(),
        })
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Chain {
    /// Joint axes.
    pub axes: [Vector3<f64>; ARM_JOINTS],
    pub shoulder: Vector3<f64>,
    pub elbow: Vector3<f64>,
    pub wrist: Vector3<f64>,
    /// Origin of the catch frame.
    pub catch: Vector3<f64>,
    /// Rotation from the catch frame to the chest frame.
    pub rotation: Matrix3<f64>,
}

impl Chain {
    /// Returns the catch frame.
    pub fn pose(&self) -> HandPose {
        HandPose {
            position: self.catch,
            rotation: self.rotation,
        }
    }

    /// Returns the Jacobian of the catch frame, like [`ArmKinematics::jacobian`].
    pub fn jacobian(&self) -> SMatrix<f64, 6, ARM_JOINTS> {
        let mut jacobian = SMatrix::<f64, 6, ARM_JOINTS>::zeros();
        for (i, axis) in self.axes.iter().enumerate() {
            let moved = axis.cross(&(self.catch - self.origin(i)));
            jacobian.fixed_view_mut::<3, 1>(0, i).copy_from(&moved);
            jacobian.fixed_view_mut::<3, 1>(3, i).copy_from(axis);
        }
        jacobian
    }

    /// Returns a point on a joint's axis.
    pub fn origin(&self, joint: usize) -> &Vector3<f64> {
        match joint {
            0..3 => &self.shoulder,
            3..5 => &self.elbow,
            _ => &self.wrist,
        }
    }
}

/// Circle of possible elbow positions for a fixed hand pose.
#[derive(Debug, Clone)]
pub struct ElbowCircle {
    rotation: Matrix3<f64>,
    wrist: Vector3<f64>,
    centre: Vector3<f64>,
    first: Vector3<f64>,
    second: Vector3<f64>,
    bend: f64,
}

impl ElbowCircle {
    /// Calls `found` with the up to eight sets of joint angles of one elbow angle, like [`ArmKinematics::inverse`].
    pub fn each(
        &self,
        arm: &ArmKinematics,
        elbow_angle: f64,
        found: &mut impl FnMut([f64; ARM_JOINTS]),
    ) {
        let (sin, cos) = elbow_angle.sin_cos();
        let elbow = self.centre + self.first * cos + self.second * sin;
        let z = elbow / arm.upper;
        let fore = (self.wrist - elbow) / arm.fore;
        let (bend_sin, bend_cos) = self.bend.sin_cos();
        let x = (fore - z * bend_cos) / bend_sin;
        for bend_sign in [1.0, -1.0] {
            // With the opposite bend, the upper arm is rotated by pi about its axis.
            let x = x * bend_sign;
            let y = z.cross(&x);
            let upper = Matrix3::from_columns(&[x, y, z]);
            let mut lower = upper;
            turn_plane(&mut lower, ABOUT_Y, bend_sin * bend_sign, bend_cos);
            let lower = lower.transpose() * self.rotation;
            for shoulder in zyz(&upper) {
                for wrist in zyz(&lower) {
                    found([
                        shoulder[0],
                        shoulder[1],
                        shoulder[2],
                        self.bend * bend_sign,
                        wrist[0],
                        wrist[1],
                        wrist[2],
                    ]);
                }
            }
        }
    }
}

/// Multiplies `rotation` by the rotation of joint `i` by `angle`. Returns the joint's axis.
fn turn(rotation: &mut Matrix3<f64>, i: usize, angle: f64) -> Vector3<f64> {
    let (axis, sign, plane) = match i {
        1 | 5 => (1, -1.0, ABOUT_Y),
        3 => (1, 1.0, ABOUT_Y),
        _ => (2, 1.0, ABOUT_Z),
    };
    let axis = rotation.column(axis) * sign;
    let (sin, cos) = angle.sin_cos();
    turn_plane(rotation, plane, sign * sin, cos);
    axis
}

/// Axes of the planes of rotations about y and z.
const ABOUT_Y: [usize; 2] = [2, 0];
pub(super) const ABOUT_Z: [usize; 2] = [0, 1];

/// Multiplies `rotation` by a rotation in the plane of two of its axes, the first towards the second.
pub(super) fn turn_plane(
    rotation: &mut Matrix3<f64>,
    [first, second]: [usize; 2],
    sin: f64,
    cos: f64,
) {
    let [a, b] = [first, second].map(|axis| rotation.column(axis).into_owned());
    rotation.set_column(first, &(a * cos + b * sin));
    rotation.set_column(second, &(b * cos - a * sin));
}

/// Returns both sets of angles whose rotations about z, -y and z give `r`. If the middle angle is 0 or pi, the first
/// one is 0.
fn zyz(r: &Matrix3<f64>) -> [[f64; 3]; 2] {
    let sin = r[(0, 2)].hypot(r[(1, 2)]);
    if sin < 1e-9 {
        let middle = if r[(2, 2)] > 0.0 {
            0.0
        } else {
            std::f64::consts::PI
        };
        let last = r[(1, 0)].atan2(r[(1, 1)]);
        return [[0.0, middle, last], [0.0, -middle, last]];
    }
    // A rotation by b about -y maps z to (-sin b cos a, -sin b sin a, cos b).
    let middle = sin.atan2(r[(2, 2)]);
    let first = (-r[(1, 2)]).atan2(-r[(0, 2)]);
    let last = (-r[(2, 1)]).atan2(r[(2, 0)]);
    let other = |angle: f64| {
        if angle > 0.0 {
            angle - std::f64::consts::PI
        } else {
            angle + std::f64::consts::PI
        }
    };
    [[first, middle, last], [other(first), -middle, other(last)]]
}
