//! Perception of head and balls: from the sensors, or from the true state to measure the loss by perception.

use std::collections::VecDeque;

use bytemuck::Zeroable;
use nalgebra::{Isometry3, Quaternion, Rotation3, Translation3, UnitQuaternion};
use tactnet_catching::Robot;
use tactnet_catching::calibrate::Corrections;
use tactnet_catching::flight::DRAG;
use tactnet_catching::pose::{PoseConfig, PoseError, PoseEstimator};
use tactnet_catching::track::{BallTracker, CLUTTER_OF_PICTURES, TrackConfig};
use tactnet_catching_packets::packets::{
    BallPrediction, BallPredictions, Circles, HeadPose, JointState, MAX_BALLS,
};
use tactnet_catching_world::{FrameMotion, Sensed, Truth};

use crate::ablation::Ablation;
use crate::error::TrialError;
use crate::eyes::Eyes;
use crate::look_ahead::{TimedPrediction, between};
use crate::stepped_time::nanoseconds;
use crate::throw_config::ThrowConfig;

/// Variance of the kinematic head pose without the inertial unit, in m^2: a tenth of a millimetre.
const KINEMATIC_VARIANCE: f64 = 1e-8;

/// Sensors, pose estimator and tracker with their delays.
pub(crate) struct Perception {
    /// Robot model of the stack.
    robot: Robot,
    corrections: Corrections,
    source: Source,
    to_prediction_ns: u64,
    drag: bool,
    pose: PoseEstimator,
    tracker: BallTracker,
    /// Renderer and detector, if circles come from pictures.
    eyes: Option<Eyes>,
    /// Latest predictions.
    last: BallPredictions,
    exposures: VecDeque<Exposure>,
    joints: JointState,
    chest: Isometry3<f64>,
    pictures: u32,
    /// True head poses since the last inertial sample.
    heads: VecDeque<(u64, Isometry3<f64>)>,
    /// Transformations from the estimated to the true head pose, over time.
    alignments: Vec<(u64, Isometry3<f64>)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    /// Inertial unit and cameras.
    Sensors,
    /// Joints and cameras.
    Kinematics,
    /// True state of the world.
    Truth,
}

struct Exposure {
    due_ns: u64,
    /// Corrected timestamp of the cameras' clock; rendered pictures have exact timestamps.
    stamp_ns: u64,
    circles: [Circles; 2],
    truth: Truth,
    kinematic: HeadPose,
    pictures: u32,
}

/// Result of a pair of pictures.
pub(crate) struct Seen {
    pub predictions: BallPredictions,
    /// Current pose of the chest.
    pub chest: Isometry3<f64>,
    exposure_ns: u64,
    aligned: Isometry3<f64>,
}

impl Seen {
    /// Returns the predictions with the true head pose.
    pub fn said(&self) -> impl Iterator<Item = TimedPrediction> + '_ {
        self.predictions
            .valid()
            .iter()
            .map(|prediction| TimedPrediction {
                exposure_ns: self.exposure_ns,
                prediction: *prediction,
                aligned: self.aligned,
            })
    }
}

impl Perception {
    /// - `seed`: seed of the world, for pictures
    pub fn new(config: &ThrowConfig, seed: u64) -> Result<Self, TrialError> {
        let drag = !config.is_without(Ablation::Drag);
        let mut track = TrackConfig::default();
        if !drag {
            // A parabola without uncertainty.
            track.drag = [1e-9, 1e-9];
            track.drag_walk = 1e-9;
            (track.lift, track.lift_walk) = (1e-9, 1e-9);
        }
        if config.pixels {
            track.clutter = CLUTTER_OF_PICTURES;
        }
        let corrections = config.corrections();
        let robot = corrections.robot().clone();
        let description = robot.description();
        Ok(Self {
            source: match (config.perfect_perception, config.is_without(Ablation::Imu)) {
                (true, _) => Source::Truth,
                (false, true) => Source::Kinematics,
                (false, false) => Source::Sensors,
            },
            to_prediction_ns: nanoseconds(config.timing.to_prediction()),
            drag,
            pose: PoseEstimator::new(description, PoseConfig::default())?,
            tracker: BallTracker::new(description, track)?,
            eyes: match config.pixels {
                true => Some(Eyes::new(&config.robot, &config.world, seed)?),
                false => None,
            },
            last: BallPredictions::zeroed(),
            robot,
            corrections,
            exposures: VecDeque::new(),
            joints: JointState::zeroed(),
            chest: Isometry3::identity(),
            pictures: 0,
            heads: VecDeque::new(),
            alignments: Vec::new(),
        })
    }

    /// Takes the sensor values of a tick. `at_rest` is true while the robot waits.
    pub fn sense(
        &mut self,
        sensed: &Sensed,
        truth: &Truth,
        at_rest: bool,
    ) -> Result<(), TrialError> {
        self.joints = self.corrections.joints(&sensed.joints);
        if self.source == Source::Sensors {
            self.heads.push_back((truth.time_ns, isometry(&truth.head)));
        }
        let q = self.joints.q;
        let neck = self.robot.head(&q);
        let kinematic = self.robot.chest(&q) * neck;
        if let Some(sample) = &sensed.imu {
            let sample = &self.corrections.sample(sample);
            let head = self.pose.push(sample, at_rest.then_some(kinematic))?;
            if self.source == Source::Sensors {
                self.chest = as_isometry(&head) * neck.inverse();
                self.align(sample.sensor_ns)?;
            }
        }
        match self.source {
            Source::Sensors => {}
            Source::Kinematics => {
                self.chest = self.robot.chest(&q);
                let aligned = between(&kinematic, &isometry(&truth.head));
                self.alignments.push((truth.time_ns, aligned));
            }
            Source::Truth => self.chest = isometry(&truth.chest),
        }
        if let Some(circles) = &sensed.circles {
            self.pictures = if truth.balls.iter().any(Option::is_some) {
                self.pictures + 1
            } else {
                0
            };
            let circles = circles
                .each_ref()
                .map(|seen| self.corrections.circles(seen));
            let stamp_ns = match self.eyes {
                Some(_) => truth.time_ns,
                None => circles[0].exposure_ns,
            };
            self.exposures.push_back(Exposure {
                due_ns: truth.time_ns + self.to_prediction_ns,
                circles,
                stamp_ns,
                truth: *truth,
                kinematic: as_pose(&kinematic, stamp_ns),
                pictures: self.pictures,
            });
        }
        Ok(())
    }

    /// Compares estimated and true head poses up to a sample.
    fn align(&mut self, sampled_ns: u64) -> Result<(), TrialError> {
        while let Some((t_ns, head)) = self.heads.pop_front_if(|(t_ns, _)| *t_ns <= sampled_ns) {
            match self.pose.at(t_ns) {
                // From before the first sample.
                Err(PoseError::NotKept { .. }) => {}
                thought => self
                    .alignments
                    .push((t_ns, between(&as_isometry(&thought?), &head))),
            }
        }
        Ok(())
    }

    /// Returns the transformation from the estimated to the true head pose at a time.
    pub fn alignment(&self, t_ns: u64) -> Isometry3<f64> {
        self.alignments
            .iter()
            .min_by_key(|(known_ns, _)| known_ns.abs_diff(t_ns))
            .map_or_else(Isometry3::identity, |(_, aligned)| *aligned)
    }

    /// Returns the result of the next pair of pictures if it is due.
    pub fn predictions(&mut self, now_ns: u64) -> Result<Option<Seen>, TrialError> {
        let Some(exposure) = self
            .exposures
            .pop_front_if(|exposure| exposure.due_ns <= now_ns)
        else {
            return Ok(None);
        };
        let exposure_ns = exposure.truth.time_ns;
        let stamp_ns = exposure.stamp_ns;
        let head = match self.source {
            Source::Sensors => match self.pose.at(stamp_ns) {
                // Pictures from before the first inertial sample are unusable.
                Err(PoseError::NotKept { first_ns, .. }) if stamp_ns < first_ns => {
                    return Ok(None);
                }
                pose => pose?,
            },
            Source::Kinematics => exposure.kinematic,
            Source::Truth => as_pose(&isometry(&exposure.truth.head), exposure_ns),
        };
        let mut predictions = match self.source {
            Source::Truth => true_predictions(&exposure.truth, exposure.pictures),
            Source::Sensors | Source::Kinematics => {
                let [left, right] = match &mut self.eyes {
                    Some(eyes) => eyes.see(&exposure.truth, &head, &self.last),
                    None => exposure.circles,
                };
                self.tracker.push([&left, &right], &head)?
            }
        };
        self.last = predictions;
        if !self.drag {
            predictions
                .balls
                .iter_mut()
                .for_each(|ball| (ball.k, ball.lift) = (0.0, [0.0; 3]));
        }
        Ok(Some(Seen {
            predictions,
            chest: self.chest,
            exposure_ns,
            aligned: between(&as_isometry(&head), &isometry(&exposure.truth.head)),
        }))
    }
}

/// Returns a frame of the world as an isometry.
pub(crate) fn isometry(frame: &FrameMotion) -> Isometry3<f64> {
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(frame.rotation));
    Isometry3::from_parts(Translation3::from(frame.position), rotation)
}

fn as_isometry(pose: &HeadPose) -> Isometry3<f64> {
    let [x, y, z, w] = pose.quaternion;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(
        Translation3::new(pose.position[0], pose.position[1], pose.position[2]),
        rotation,
    )
}

/// Returns an exactly known pose of a head at rest, without covariance.
pub(crate) fn known_pose(frame: &Isometry3<f64>, t_ns: u64) -> HeadPose {
    let rotation = frame.rotation.coords;
    HeadPose {
        t_ns,
        position: frame.translation.vector.into(),
        quaternion: [rotation.x, rotation.y, rotation.z, rotation.w],
        ..HeadPose::zeroed()
    }
}

fn as_pose(frame: &Isometry3<f64>, t_ns: u64) -> HeadPose {
    let mut pose = known_pose(frame, t_ns);
    for i in 0..9 {
        pose.covariance[i][i] = KINEMATIC_VARIANCE;
    }
    pose
}

/// Returns the predictions of an ideal tracker at one time, after the given number of pictures.
fn true_predictions(truth: &Truth, frames: u32) -> BallPredictions {
    let mut predictions = BallPredictions::zeroed();
    predictions.exposure_ns = truth.time_ns;
    for ball in truth.balls.iter().flatten().take(MAX_BALLS) {
        predictions.balls[predictions.count as usize] = BallPrediction {
            ball: ball.number,
            t_ns: truth.time_ns,
            p: ball.state.position.into(),
            v: ball.state.velocity.into(),
            k: DRAG,
            lift: [0.0; 3],
            covariance: [[0.0; 10]; 10],
            existence: 1.0,
            frames,
        };
        predictions.count += 1;
    }
    predictions
}
