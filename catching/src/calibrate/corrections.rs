//! Applies a calibration to measurements and commands. Behind these corrections, joint angles are link angles, and
//! cameras and IMU are mounted as described.

use nalgebra::{Matrix3, Vector2, Vector3};
use tactnet_catching_packets::packets::{Circle, Circles, ImuSample, JointCommand, JointState};
use tactnet_catching_packets::{ARM_JOINTS, Cameras, JOINTS, Joint, joint};

use super::gravity::loads;
use super::model::exponential;
use super::parameters::{Calibration, CameraCalibration};
use crate::robot::Robot;
use crate::track::CAMERAS;

/// Fixed-point iterations that undo the lens distortion. Each reduces the error about 100-fold.
const DISTORTION_STEPS: usize = 6;
/// Fixed-point iterations that find an arm's sag. Each reduces the error about 100-fold.
const SAG_STEPS: usize = 4;

/// Corrections of a calibration, or identity without one.
#[derive(Debug, Clone)]
pub struct Corrections {
    /// Robot with calibrated camera and arm geometry.
    robot: Robot,
    /// Waiting pose of the robot as described, in link angles.
    waiting: [f64; JOINTS],
    known: Option<Known>,
}

#[derive(Debug, Clone)]
struct Known {
    calibration: Calibration,
    optics: Cameras,
    /// Joint limits in sensor angles.
    joints: [Joint; JOINTS],
    turns: [Matrix3<f64>; CAMERAS],
    imu: Matrix3<f64>,
    camera_late: f64,
    imu_late: f64,
}

impl Corrections {
    /// Creates the corrections of a calibration, or the identity if there is none.
    pub fn new(robot: &Robot, calibration: Option<&Calibration>) -> Self {
        let Some(calibration) = calibration else {
            return Self {
                robot: robot.clone(),
                waiting: robot.waiting(),
                known: None,
            };
        };
        let clocks = &calibration.clocks;
        Self {
            robot: Robot::new(calibration.describe(robot.description())),
            waiting: robot.waiting(),
            known: Some(Known {
                optics: robot.description().cameras,
                joints: *robot.joints(),
                turns: std::array::from_fn(|camera| {
                    exponential(&calibration.cameras[camera].turn.into())
                }),
                imu: exponential(&calibration.imu.turn.into()),
                camera_late: clocks.camera_joints,
                imu_late: clocks.camera_joints - clocks.camera_imu,
                calibration: calibration.clone(),
            }),
        }
    }

    /// Returns the calibrated robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Returns the waiting pose in link angles, which is that of the robot as described.
    pub fn waiting(&self) -> &[f64; JOINTS] {
        &self.waiting
    }

    /// Converts measured joint states to link states.
    pub fn joints(&self, sensed: &JointState) -> JointState {
        let Some(known) = &self.known else {
            return *sensed;
        };
        let mut links = *sensed;
        for (arm, own) in joint::ARM.into_iter().enumerate() {
            let parameters = &known.calibration.arms[arm];
            for (i, place) in own.enumerate() {
                // Sensors measure the torque of the drives, which is opposite to the load.
                links.q[place] +=
                    parameters.offsets[i] - parameters.compliances[i] * sensed.tau[place];
            }
        }
        for (place, offset) in joint::NECK.zip(known.calibration.neck.offsets) {
            links.q[place] += offset;
        }
        links
    }

    /// Returns the sensor angles for link angles `q` under gravity, clamped to the joint ranges.
    pub fn sensors(&self, q: &[f64; JOINTS]) -> [f64; JOINTS] {
        let mut sensors = *q;
        let Some(known) = &self.known else {
            return sensors;
        };
        for (arm, own) in joint::ARM.into_iter().enumerate() {
            let parameters = &known.calibration.arms[arm];
            let links: [f64; ARM_JOINTS] = std::array::from_fn(|i| q[own.start + i]);
            let loads = loads(&self.robot, arm, &links);
            for (i, place) in own.enumerate() {
                sensors[place] -= parameters.offsets[i] + parameters.compliances[i] * loads[i];
            }
        }
        for (place, offset) in joint::NECK.zip(known.calibration.neck.offsets) {
            sensors[place] -= offset;
        }
        for (sensor, joint) in sensors.iter_mut().zip(&known.joints) {
            *sensor = sensor.clamp(joint.range[0], joint.range[1]);
        }
        sensors
    }

    /// Returns the link angles for sensor angles `q` under gravity; the inverse of [`Corrections::sensors`]. Unlike
    /// [`Corrections::joints`] it uses no measured torques, so commands convert back to themselves up to rounding.
    pub fn links(&self, q: &[f64; JOINTS]) -> [f64; JOINTS] {
        let mut links = *q;
        let Some(known) = &self.known else {
            return links;
        };
        for (place, offset) in joint::NECK.zip(known.calibration.neck.offsets) {
            links[place] += offset;
        }
        for (arm, own) in joint::ARM.into_iter().enumerate() {
            let parameters = &known.calibration.arms[arm];
            let unloaded: [f64; ARM_JOINTS] =
                std::array::from_fn(|i| q[own.start + i] + parameters.offsets[i]);
            let mut carried = unloaded;
            for _ in 0..SAG_STEPS {
                let loads = loads(&self.robot, arm, &carried);
                carried =
                    std::array::from_fn(|i| unloaded[i] + parameters.compliances[i] * loads[i]);
            }
            links[own].copy_from_slice(&carried);
        }
        links
    }

    /// Returns the drive command that moves the links as `command` specifies.
    pub fn command(&self, command: &JointCommand) -> JointCommand {
        JointCommand {
            q: self.sensors(&command.q),
            ..*command
        }
    }

    /// Returns the circles that ideal cameras, mounted as described, would have detected.
    pub fn circles(&self, seen: &Circles) -> Circles {
        let Some(known) = &self.known else {
            return *seen;
        };
        let mut rectified = *seen;
        rectified.exposure_ns = self.exposure(seen.exposure_ns);
        let camera = (seen.camera as usize).min(CAMERAS - 1);
        rectified.count = 0;
        for circle in seen.valid() {
            let [u, v, r] = known.rectify(camera, [circle.u, circle.v, circle.r]);
            // The ball almost touches the lens; the ideal camera has no such circle.
            if r <= f64::from(known.optics.width) {
                rectified.circles[rectified.count as usize] = Circle { u, v, r, ..*circle };
                rectified.count += 1;
            }
        }
        rectified
    }

    /// Converts the time stamp of a picture to the joint clock, in ns.
    pub fn exposure(&self, stamp_ns: u64) -> u64 {
        let known = self.known.as_ref();
        known.map_or(stamp_ns, |known| earlier(stamp_ns, known.camera_late))
    }

    /// Rotates an IMU sample into the head frame and converts its time stamp. The pose estimator estimates the biases
    /// itself.
    pub fn sample(&self, sample: &ImuSample) -> ImuSample {
        let Some(known) = &self.known else {
            return *sample;
        };
        let turned = |v: [f64; 3]| (known.imu * Vector3::from(v)).into();
        ImuSample {
            sensor_ns: earlier(sample.sensor_ns, known.imu_late),
            acceleration: turned(sample.acceleration),
            rate: turned(sample.rate),
            ..*sample
        }
    }
}

impl Known {
    fn rectify(&self, camera: usize, [u, v, r]: [f64; 3]) -> [f64; 3] {
        let own: &CameraCalibration = &self.calibration.cameras[camera];
        let focal = self.optics.focal + own.focal;
        let [width, height] = [self.optics.width, self.optics.height].map(f64::from);
        let middle = Vector2::new(width / 2.0, height / 2.0);
        let distorted = (Vector2::new(u, v) - middle - Vector2::from(own.centre)) / focal;
        let [k1, k2] = own.distortion;
        let mut ray = distorted;
        let mut stretch = 1.0;
        for _ in 0..DISTORTION_STEPS {
            let s = ray.norm_squared();
            stretch = 1.0 + s * (k1 + s * k2);
            ray = distorted / stretch;
        }
        let ahead = self.turns[camera] * Vector3::new(1.0, -ray.x, -ray.y);
        let seen = middle - Vector2::new(ahead.y, ahead.z) * (self.optics.focal / ahead.x);
        let radius = r * self.optics.focal / (focal * stretch * ahead.x);
        [seen.x, seen.y, radius]
    }
}

fn earlier(stamp_ns: u64, late: f64) -> u64 {
    stamp_ns.saturating_add_signed(-(late * 1e9).round() as i64)
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use proptest::prelude::*;

    use super::super::model::Model;
    use super::super::session::{NeckMotion, Picture};
    use super::super::unknowns::{Priors, UNKNOWNS, Unknowns};
    use super::*;

    fn calibration(parts: &[f64]) -> Calibration {
        let priors = Priors::default();
        let sigmas = priors.sigmas().unwrap();
        let parts = Unknowns::from_column_slice(parts);
        Calibration::of(&(priors.guess() + sigmas.component_mul(&parts)))
    }

    proptest! {
        /// The rectified feature of a marker equals the projection by an ideal camera of the corrected robot.
        #[test]
        fn rectified_features_are_those_of_described_cameras(
            camera in 0..2usize,
            arm in 0..2usize,
            parts in proptest::collection::vec(-1.0..1.0f64, UNKNOWNS),
            neck in proptest::array::uniform2(-0.3..0.3f64),
        ) {
            let robot = Robot::nominal();
            let mut calibration = calibration(&parts);
            calibration.clocks.camera_joints = 0.0;
            let corrections = Corrections::new(&robot, Some(&calibration));
            let mut sensed = JointState::zeroed();
            sensed.q = robot.waiting();
            // Look at the hand, so that it is in the picture.
            let gaze = robot.look_at(&robot.arm(arm).forward(&robot.ready(arm)).position);
            let neck: [f64; 2] = std::array::from_fn(|i| gaze[i] + neck[i]);
            sensed.q[joint::NECK].copy_from_slice(&neck);
            sensed.tau = std::array::from_fn(|i| i as f64 - 9.0);
            let own = joint::ARM[arm].start;
            let q = std::array::from_fn(|i| sensed.q[own + i]);
            let loads = std::array::from_fn(|i| -sensed.tau[own + i]);
            let picture = Picture::without_features(arm, q, loads, NeckMotion::standing(neck));
            let model = Model::new(&robot);
            let Some(pixel) = model.feature(&calibration.unknowns(), &picture, camera) else {
                return Ok(());
            };
            prop_assume!((0.0..1600.0).contains(&pixel.x) && (0.0..1250.0).contains(&pixel.y));
            let mut circles = Circles::zeroed();
            (circles.count, circles.camera) = (1, camera as u32);
            circles.circles[0] = Circle { u: pixel.x, v: pixel.y, r: 10.0, response: 0.9 };
            let rectified = corrections.circles(&circles).circles[0];
            // The same projection, computed with the description of the corrected robot alone.
            let links = corrections.joints(&sensed);
            let described = corrections.robot();
            let last = described
                .arm(arm)
                .links(&std::array::from_fn(|i| links.q[own + i]))[ARM_JOINTS - 1];
            let marker = last.origin + last.rotation * Vector3::from(calibration.arms[arm].marker);
            let in_head = described.head(&links.q).inverse() * nalgebra::Point3::from(marker);
            let eye = crate::track::Camera::pair(&described.description().cameras)[camera];
            let seen = in_head.coords - eye.offset;
            let expected = [
                800.0 - eye.focal * seen.y / seen.x,
                625.0 - eye.focal * seen.z / seen.x,
            ];
            // The distortion model folds far outside of the picture.
            prop_assume!((-100.0..1700.0).contains(&expected[0]) && (-100.0..1350.0).contains(&expected[1]));
            // Remaining error of the distortion's fixed-point iteration.
            prop_assert!((rectified.u - expected[0]).abs() < 1e-3, "{rectified:?} {expected:?}");
            prop_assert!((rectified.v - expected[1]).abs() < 1e-3, "{rectified:?} {expected:?}");
            prop_assert!((rectified.r / 10.0 - 1.0).abs() < 0.1);
        }

        /// Sensor angles of given link angles convert back to these link angles.
        #[test]
        fn commands_and_measurements_agree(parts in proptest::collection::vec(-2.0..2.0f64, UNKNOWNS)) {
            let robot = Robot::nominal();
            let corrections = Corrections::new(&robot, Some(&calibration(&parts)));
            // Away from the ends of the joint ranges.
            let mut links = robot.waiting();
            links[9] -= 0.2;
            links[16] -= 0.2;
            let mut sensed = JointState::zeroed();
            sensed.q = corrections.sensors(&links);
            for (arm, own) in joint::ARM.into_iter().enumerate() {
                let q = std::array::from_fn(|i| links[own.start + i]);
                for (place, load) in own.zip(loads(corrections.robot(), arm, &q)) {
                    sensed.tau[place] = -load;
                }
            }
            for (found, expected) in corrections.joints(&sensed).q.iter().zip(links) {
                prop_assert!((found - expected).abs() < 1e-12);
            }
        }

        /// A command that starts at the measured sensor angles reproduces them.
        #[test]
        fn links_are_where_the_sensors_commands_come_from(
            parts in proptest::collection::vec(-2.0..2.0f64, UNKNOWNS),
            aside in proptest::collection::vec(-0.05..0.05f64, JOINTS),
        ) {
            let robot = Robot::nominal();
            let corrections = Corrections::new(&robot, Some(&calibration(&parts)));
            let mut q = robot.waiting();
            // Away from the ends of the joint ranges.
            (q[9], q[16]) = (q[9] - 0.2, q[16] - 0.2);
            q.iter_mut().zip(&aside).for_each(|(q, aside)| *q += aside);
            let again = corrections.sensors(&corrections.links(&q));
            for (joint, (found, expected)) in again.iter().zip(q).enumerate() {
                // Remaining error of the sag: 0.02 rad, times 2e-4 rad/Nm and 70 Nm/rad in each step.
                prop_assert!((found - expected).abs() < 1e-7, "{joint}: {found} {expected}");
            }
        }
    }

    #[test]
    fn without_a_calibration_nothing_changes() {
        let corrections = Corrections::new(&Robot::nominal(), None);
        let mut sensed = JointState::zeroed();
        sensed.q = Robot::nominal().waiting();
        assert_eq!(corrections.joints(&sensed), sensed);
        assert_eq!(corrections.sensors(&sensed.q), sensed.q);
        assert_eq!(corrections.links(&sensed.q), sensed.q);
        assert_eq!(corrections.waiting(), &sensed.q);
        assert_eq!(corrections.exposure(7), 7);
        let mut sample = ImuSample::zeroed();
        sample.acceleration = [0.1, 0.2, 9.8];
        assert_eq!(corrections.sample(&sample), sample);
    }

    #[test]
    fn late_stamps_are_put_back() {
        let mut calibration = calibration(&[0.0; UNKNOWNS]);
        calibration.clocks = super::super::parameters::ClockCalibration {
            camera_joints: 0.005,
            camera_imu: 0.002,
        };
        let corrections = Corrections::new(&Robot::nominal(), Some(&calibration));
        let mut circles = Circles::zeroed();
        circles.exposure_ns = 1_005_000_000;
        assert_eq!(corrections.circles(&circles).exposure_ns, 1_000_000_000);
        let mut sample = ImuSample::zeroed();
        sample.sensor_ns = 1_003_000_000;
        assert_eq!(corrections.sample(&sample).sensor_ns, 1_000_000_000);
    }
}
