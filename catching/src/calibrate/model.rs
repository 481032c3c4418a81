//! Predicted measurements for given unknowns, with analytic derivatives.

use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, ARMS};

use super::session::{NeckMotion, Picture, Rest, Turn};
use super::unknowns::{Unknowns, at};
use crate::pose::GRAVITY;
use crate::robot::Robot;
use crate::track::CAMERAS;

/// Maximum number of unknowns that one measurement depends on.
const MAX_COLUMNS: usize = 36;
/// Minimum distance of a visible marker in front of a camera, in m.
const MIN_DEPTH: f64 = 0.02;

/// Predicted measurement with its Jacobian with respect to the unknowns that it depends on.
#[derive(Debug, Clone)]
pub struct Block {
    /// Predicted values, of which the first `rows` are used.
    pub value: [f64; 3],
    /// Number of rows.
    pub rows: usize,
    /// Indices of the unknowns.
    pub columns: Vec<usize>,
    /// Jacobian, `[rows][columns]`.
    pub jacobian: [[f64; MAX_COLUMNS]; 3],
}

impl Block {
    fn new<const R: usize>(value: &SMatrix<f64, R, 1>) -> Self {
        let mut block = Self {
            value: [0.0; 3],
            rows: R,
            columns: Vec::with_capacity(MAX_COLUMNS),
            jacobian: [[0.0; MAX_COLUMNS]; 3],
        };
        block.value[..R].copy_from_slice(value.as_slice());
        block
    }

    /// Returns one row that depends on no unknown.
    pub(crate) fn constant(value: f64) -> Self {
        Self::new(&SMatrix::<f64, 1, 1>::new(value))
    }

    /// Appends the derivatives with respect to unknown `first` and those after it.
    fn by<const R: usize, const C: usize>(&mut self, first: usize, slope: &SMatrix<f64, R, C>) {
        for column in 0..C {
            for row in 0..R {
                self.jacobian[row][self.columns.len()] = slope[(row, column)];
            }
            self.columns.push(first + column);
        }
    }
}

/// Measurement model of a robot.
#[derive(Debug, Clone)]
pub struct Model {
    robot: Robot,
    /// Described camera positions in the head frame, in m.
    eyes: [Vector3<f64>; CAMERAS],
    /// Intersection of the neck axes in the chest frame, in m.
    neck: Vector3<f64>,
}

/// Projection of a point of an arm's last link into a camera, with intermediate results.
struct Way {
    /// Position relative to the neck, in the chest frame, in m.
    from_neck: Vector3<f64>,
    /// Derivative of the position with respect to link angles.
    by_joints: SMatrix<f64, 3, ARM_JOINTS>,
    /// Derivative with respect to the lengths shoulder to elbow and elbow to wrist.
    by_lengths: SMatrix<f64, 3, 2>,
    /// Rotation from the last link's frame to the chest frame.
    hand: Matrix3<f64>,
    /// Rotation from the head frame to the chest frame.
    head: Matrix3<f64>,
    /// Position relative to the camera, in the head frame, in m.
    from_camera: Vector3<f64>,
    /// Rotation from the camera frame to the head frame.
    camera: Matrix3<f64>,
    /// Position in the camera frame (forward, left, up), in m.
    seen: Vector3<f64>,
}

/// Returns the rotation from the head frame to the chest frame.
fn head_turn([pan, tilt]: [f64; 2]) -> Matrix3<f64> {
    let ((sp, cp), (st, ct)) = (pan.sin_cos(), tilt.sin_cos());
    Matrix3::new(cp * ct, -sp, cp * st, sp * ct, cp, sp * st, -st, 0.0, ct)
}

/// Rotates a vector from the chest frame to the head frame. Also returns its derivatives with respect to pan and tilt.
fn to_head(head: &Matrix3<f64>, v: &Vector3<f64>) -> (Vector3<f64>, SMatrix<f64, 3, 2>) {
    let there = head.tr_mul(v);
    let by_pan = -head.tr_mul(&Vector3::z().cross(v));
    let by_tilt = -Vector3::y().cross(&there);
    (there, SMatrix::from_columns(&[by_pan, by_tilt]))
}

impl Model {
    /// Creates the model of a robot as described.
    pub fn new(robot: &Robot) -> Self {
        let description = robot.description();
        let cameras = &description.cameras;
        let centre = Vector3::from(cameras.centre);
        Self {
            eyes: [0.5, -0.5].map(|side| centre + Vector3::new(0.0, side * cameras.baseline, 0.0)),
            neck: Vector3::new(0.0, 0.0, description.neck.height),
            robot: robot.clone(),
        }
    }

    /// Returns the robot as described.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Returns the projected marker in pixels, or `None` if it is not in front of the camera.
    pub fn feature(&self, x: &Unknowns, picture: &Picture, camera: usize) -> Option<Vector2<f64>> {
        let seen = self.marker(x, picture, camera);
        (seen.x > MIN_DEPTH).then(|| self.lens(x, camera, &seen).0)
    }

    /// Returns the marker in the frame of a camera (forward, left, up), in m.
    pub(crate) fn marker(&self, x: &Unknowns, picture: &Picture, camera: usize) -> Vector3<f64> {
        let marker = three(x, at::marker(picture.arm));
        self.way(x, picture, camera, &marker).seen
    }

    /// Returns the projected marker with its derivatives, or `None` if it is not in front of the camera.
    pub fn feature_with_slope(
        &self,
        x: &Unknowns,
        picture: &Picture,
        camera: usize,
    ) -> Option<Block> {
        let arm = picture.arm;
        let marker = three(x, at::marker(arm));
        let way = self.way(x, picture, camera, &marker);
        if way.seen.x <= MIN_DEPTH {
            return None;
        }
        let (pixel, by_seen, by_lens) = self.lens(x, camera, &way.seen);
        let mut block = Block::new(&pixel);
        let own = at::camera(camera);
        block.by(own, &by_lens);
        let turn = three(x, own + at::TURN);
        let by_turn = way.camera.tr_mul(&way.from_camera.cross_matrix()) * left_jacobian(&turn);
        block.by(own + at::TURN, &(by_seen * by_turn));
        let by_head = by_seen * way.camera.transpose();
        block.by(own + at::SHIFT, &-by_head);
        let by_chest = by_head * way.head.transpose();
        block.by(at::marker(arm), &(by_chest * way.hand));
        let by_joints = by_chest * way.by_joints;
        block.by(at::offsets(arm), &by_joints);
        let mut by_compliances = by_joints;
        for (mut column, load) in by_compliances.column_iter_mut().zip(picture.loads) {
            column *= load;
        }
        block.by(at::compliances(arm), &by_compliances);
        block.by(at::mount(arm), &by_chest);
        block.by(at::lengths(arm), &(by_chest * way.by_lengths));
        let (_, by_neck) = to_head(&way.head, &way.from_neck);
        let by_neck = by_head * by_neck;
        block.by(at::NECK, &by_neck);
        let neck = picture.neck.before(x[at::CAMERA_JOINTS]);
        block.by(at::CAMERA_JOINTS, &-(by_neck * Vector2::from(neck.dq)));
        Some(block)
    }

    /// Returns the accelerometer measurement at rest, in m/s^2, with derivatives.
    pub fn rest(&self, x: &Unknowns, rest: &Rest) -> Block {
        let neck = std::array::from_fn(|i| rest.neck[i] + x[at::NECK + i]);
        let up = Vector3::new(0.0, 0.0, GRAVITY);
        let (felt, by_neck) = to_head(&head_turn(neck), &up);
        self.inertial(x, at::ACCELEROMETER_BIAS, &felt, &by_neck)
    }

    /// Returns the gyroscope measurement while the head turns, in rad/s, with derivatives.
    pub fn turn(&self, x: &Unknowns, turn: &Turn) -> Block {
        let late = x[at::CAMERA_JOINTS] - x[at::CAMERA_IMU];
        let neck = turn.neck.before(late);
        let head = head_turn([0.0, neck.q[1] + x[at::NECK + 1]]);
        let (pan, by_tilt) = to_head(&head, &Vector3::new(0.0, 0.0, neck.dq[0]));
        let rate = pan + Vector3::y() * neck.dq[1];
        // The pan offset does not change a rotation about the vertical.
        let by_neck =
            SMatrix::<f64, 3, 2>::from_columns(&[Vector3::zeros(), by_tilt.column(1).into_owned()]);
        let mut block = self.inertial(x, at::GYROSCOPE_BIAS, &rate, &by_neck);
        let (by_pan_rate, _) = to_head(&head, &Vector3::z());
        let [pan_slope, tilt_slope] = neck.ddq;
        let by_late =
            by_neck.column(1) * -neck.dq[1] - by_pan_rate * pan_slope - Vector3::y() * tilt_slope;
        let by_late = exponential(&three(x, at::IMU_TURN)).tr_mul(&by_late);
        block.by(at::CAMERA_JOINTS, &by_late);
        block.by(at::CAMERA_IMU, &-by_late);
        block
    }

    fn inertial(
        &self,
        x: &Unknowns,
        bias_at: usize,
        felt: &Vector3<f64>,
        by_neck: &SMatrix<f64, 3, 2>,
    ) -> Block {
        let turn = three(x, at::IMU_TURN);
        let rotation = exponential(&turn);
        let mut block = Block::new(&(rotation.tr_mul(felt) + three(x, bias_at)));
        let by_turn = rotation.tr_mul(&felt.cross_matrix()) * left_jacobian(&turn);
        block.by(at::IMU_TURN, &by_turn);
        block.by(bias_at, &Matrix3::identity());
        block.by(at::NECK, &rotation.tr_mul(by_neck));
        block
    }

    /// Projects a point of the last link, at `offset` from the wrist, into a camera.
    fn way(&self, x: &Unknowns, picture: &Picture, camera: usize, offset: &Vector3<f64>) -> Way {
        let arm = picture.arm;
        let (offsets, compliances) = (at::offsets(arm), at::compliances(arm));
        let q: [f64; ARM_JOINTS] = std::array::from_fn(|i| {
            picture.q[i] + x[offsets + i] + x[compliances + i] * picture.loads[i]
        });
        let mut links = self.robot.arm(arm).links(&q);
        // Upper arm and forearm are parallel to the third and the fifth joint axis.
        let by_lengths = SMatrix::<f64, 3, 2>::from_columns(&[links[2].axis, links[4].axis]);
        let lengths = x.fixed_rows::<2>(at::lengths(arm)).into_owned();
        let (elbow, wrist) = (links[2].axis * lengths[0], by_lengths * lengths);
        for (i, link) in links.iter_mut().enumerate().skip(3) {
            link.origin += if i < 5 { elbow } else { wrist };
        }
        let last = &links[ARM_JOINTS - 1];
        let point = last.origin + last.rotation * offset;
        let by_joints = SMatrix::<f64, 3, ARM_JOINTS>::from_fn(|row, i| {
            links[i].axis.cross(&(point - links[i].origin))[row]
        });
        let from_neck = point + three(x, at::mount(arm)) - self.neck;
        let neck = picture.neck.before(x[at::CAMERA_JOINTS]);
        let head = head_turn(std::array::from_fn(|i| neck.q[i] + x[at::NECK + i]));
        let own = at::camera(camera);
        let eye = self.eyes[camera] + three(x, own + at::SHIFT);
        let from_camera = head.tr_mul(&from_neck) - eye;
        let camera = exponential(&three(x, own + at::TURN));
        Way {
            from_neck,
            by_joints,
            by_lengths,
            hand: last.rotation,
            head,
            seen: camera.tr_mul(&from_camera),
            from_camera,
            camera,
        }
    }

    /// Projects a point of the camera frame to a pixel. Also returns the derivatives with respect to the point, and to
    /// focal length, principal point and distortion.
    fn lens(
        &self,
        x: &Unknowns,
        camera: usize,
        seen: &Vector3<f64>,
    ) -> (Vector2<f64>, SMatrix<f64, 2, 3>, SMatrix<f64, 2, 5>) {
        let described = &self.robot.description().cameras;
        let own = at::camera(camera);
        let focal = described.focal + x[own];
        let middle = Vector2::new(
            f64::from(described.width) / 2.0 + x[own + at::CENTRE],
            f64::from(described.height) / 2.0 + x[own + at::CENTRE + 1],
        );
        let [k1, k2] = [x[own + at::DISTORTION], x[own + at::DISTORTION + 1]];
        let ray = Vector2::new(-seen.y, -seen.z) / seen.x;
        let by_point = SMatrix::<f64, 2, 3>::new(
            -ray.x / seen.x,
            -1.0 / seen.x,
            0.0,
            -ray.y / seen.x,
            0.0,
            -1.0 / seen.x,
        );
        let s = ray.norm_squared();
        let stretch = 1.0 + s * (k1 + s * k2);
        let slope = 2.0 * (k1 + 2.0 * s * k2);
        let by_ray =
            (SMatrix::<f64, 2, 2>::identity() * stretch + ray * ray.transpose() * slope) * focal;
        let mut by_lens = SMatrix::<f64, 2, 5>::zeros();
        by_lens.set_column(0, &(ray * stretch));
        by_lens[(0, 1)] = 1.0;
        by_lens[(1, 2)] = 1.0;
        by_lens.set_column(3, &(ray * (focal * s)));
        by_lens.set_column(4, &(ray * (focal * s * s)));
        (middle + ray * (focal * stretch), by_ray * by_point, by_lens)
    }
}

/// Returns the origin of an arm's catch frame in a camera frame (forward, left, up), in m, for measured joints and
/// loads.
pub fn seen_from_camera(
    model: &Model,
    x: &Unknowns,
    camera: usize,
    arm: usize,
    q: &[f64; ARM_JOINTS],
    loads: &[f64; ARM_JOINTS],
    neck: [f64; 2],
) -> Vector3<f64> {
    assert!(arm < ARMS && camera < CAMERAS, "two arms, two cameras");
    let still = Picture::without_features(arm, *q, *loads, NeckMotion::standing(neck));
    let ahead = model.robot.description().arms[arm].wrist_to_catch;
    let catch = Vector3::new(0.0, 0.0, ahead);
    model.way(x, &still, camera, &catch).seen
}

fn three(x: &Unknowns, first: usize) -> Vector3<f64> {
    x.fixed_rows::<3>(first).into_owned()
}

/// Returns the rotation matrix of a rotation vector.
pub(crate) fn exponential(w: &Vector3<f64>) -> Matrix3<f64> {
    nalgebra::Rotation3::new(*w).into_inner()
}

/// Returns the left Jacobian `J` of the rotation group: `exp(w + dw) = exp(J dw) exp(w)`.
fn left_jacobian(w: &Vector3<f64>) -> Matrix3<f64> {
    let angle = w.norm();
    let cross = w.cross_matrix();
    let (first, second) = if angle < 1e-4 {
        (0.5, 1.0 / 6.0)
    } else {
        let squared = angle * angle;
        let second = (angle - angle.sin()) / (squared * angle);
        ((1.0 - angle.cos()) / squared, second)
    };
    Matrix3::identity() + cross * first + cross * cross * second
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    use super::super::unknowns::{Priors, UNKNOWNS, name};

    fn model() -> Model {
        Model::new(&Robot::nominal())
    }

    /// Unknowns that deviate from the priors by `parts` standard deviations.
    fn moved(parts: &[f64]) -> Unknowns {
        let priors = Priors::default();
        let sigmas = priors.sigmas().unwrap();
        priors.guess() + sigmas.component_mul(&Unknowns::from_column_slice(parts))
    }

    fn check(x: &Unknowns, at: impl Fn(&Unknowns) -> Option<Block>) -> Result<(), TestCaseError> {
        let sigmas = Priors::default().sigmas().unwrap();
        let Some(block) = at(x) else { return Ok(()) };
        // Pixels diverge directly in front of the lens.
        prop_assume!(block.value.iter().all(|value| value.abs() < 1e4));
        for unknown in 0..UNKNOWNS {
            let h = 1e-4 * sigmas[unknown];
            let shifted = |step: f64| {
                let mut x = x.clone();
                x[unknown] += step;
                at(&x)
            };
            let (Some(after), Some(before)) = (shifted(h), shifted(-h)) else {
                return Ok(());
            };
            let column = block.columns.iter().position(|column| *column == unknown);
            for row in 0..block.rows {
                let slope = column.map_or(0.0, |column| block.jacobian[row][column]);
                let difference = (after.value[row] - before.value[row]) / (2.0 * h);
                // Pixels are about 1e3: rounding error 1e-13 / h, truncation error h^2; both scale with the slope.
                let [off, slope] = [slope - difference, slope].map(|x| x.abs() * sigmas[unknown]);
                prop_assert!(
                    off < 2e-6 * (1.0 + slope),
                    "{}: {off} {slope}",
                    name(unknown)
                );
            }
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn features_have_the_derivatives_of_differences(
            arm in 0..2usize,
            camera in 0..2usize,
            parts in proptest::collection::vec(-2.0..2.0f64, UNKNOWNS),
            around in proptest::array::uniform7(-0.4..0.4f64),
            loads in proptest::array::uniform7(-30.0..30.0f64),
            neck in proptest::array::uniform6(-0.5..0.5f64),
        ) {
            let model = model();
            let ready = model.robot().ready(arm);
            let neck = NeckMotion { q: [neck[0], neck[1]], dq: [neck[2], neck[3]], ddq: [neck[4], neck[5]] };
            let q = std::array::from_fn(|i| ready[i] + around[i]);
            let picture = Picture::without_features(arm, q, loads, neck);
            check(&moved(&parts), |x| model.feature_with_slope(x, &picture, camera))?;
            let x = moved(&parts);
            if let Some(block) = model.feature_with_slope(&x, &picture, camera) {
                let plain = model.feature(&x, &picture, camera).unwrap();
                prop_assert_eq!(plain.as_slice(), &block.value[..2]);
            }
        }

        #[test]
        fn inertial_samples_have_the_derivatives_of_differences(
            parts in proptest::collection::vec(-2.0..2.0f64, UNKNOWNS),
            neck in proptest::array::uniform6(-0.9..0.9f64),
        ) {
            let model = model();
            let rest = Rest { neck: [neck[0], neck[1]], acceleration: [0.0; 3], rate: [0.0; 3], samples: 1 };
            check(&moved(&parts), |x| Some(model.rest(x, &rest)))?;
            let turn = Turn {
                neck: NeckMotion { q: [neck[0], neck[1]], dq: [neck[2], neck[3]], ddq: [neck[4], neck[5]] },
                rate: [0.0; 3],
            };
            check(&moved(&parts), |x| Some(model.turn(x, &turn)))?;
        }
    }

    /// The catch frame agrees with the stack's forward kinematics.
    #[test]
    fn without_errors_a_hand_is_seen_where_kinematics_put_it() {
        let model = model();
        let robot = model.robot();
        let x = Unknowns::zeros(UNKNOWNS);
        let mut q = robot.waiting();
        (q[4], q[5]) = (0.2, 0.3);
        for arm in 0..ARMS {
            let own = robot.ready(arm);
            let hand = robot.arm(arm).forward(&own).position;
            let in_head = robot.head(&q).inverse() * nalgebra::Point3::from(hand);
            let seen = seen_from_camera(&model, &x, 0, arm, &own, &[5.0; 7], [q[4], q[5]]);
            let expected = in_head.coords - Vector3::new(0.08, 0.1, 0.1);
            assert!((seen - expected).norm() < 1e-12);
        }
    }
}
