//! Perception of head and balls: from the sensors, or from the true state to measure the loss by perception.

use std::collections::VecDeque;

use bytemuck::Zeroable;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion};
use tactnet_catching::Robot;
use tactnet_catching::calibrate::Corrections;
use tactnet_catching::flight::DRAG;
use tactnet_catching::pose::{self, HeadEstimator, HeadInputs};
use tactnet_catching::track::{CLUTTER_OF_PICTURES, PairTracker, TrackConfig};
use tactnet_catching_packets::packets::{
    BallPrediction, BallPredictions, CatchPhase, Circles, HeadPose, JointState, MAX_BALLS,
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
    estimator: HeadEstimator,
    tracker: PairTracker,
    /// Renderer and detector, if circles come from pictures.
    eyes: Option<Eyes>,
    /// Latest predictions.
    last: BallPredictions,
    exposures: VecDeque<Exposure>,
    /// Latest joint state, as measured.
    joints: Option<JointState>,
    /// Latest head pose.
    head: Option<HeadPose>,
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
    /// Circles as detected, in camera coordinates.
    circles: [Circles; 2],
    truth: Truth,
    pictures: u32,
}

/// Result of a pair of pictures.
pub(crate) struct Seen {
    pub predictions: BallPredictions,
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
        Ok(Self {
            source: match (config.perfect_perception, config.is_without(Ablation::Imu)) {
                (true, _) => Source::Truth,
                (false, true) => Source::Kinematics,
                (false, false) => Source::Sensors,
            },
            to_prediction_ns: nanoseconds(config.timing.to_prediction()),
            drag,
            estimator: HeadEstimator::new(corrections.clone(), config.still)?,
            tracker: PairTracker::new(corrections.clone(), track)?,
            eyes: match config.pixels {
                true => Some(Eyes::new(&config.robot, &config.world, seed)?),
                false => None,
            },
            last: BallPredictions::zeroed(),
            robot,
            corrections,
            exposures: VecDeque::new(),
            joints: None,
            head: None,
            pictures: 0,
            heads: VecDeque::new(),
            alignments: Vec::new(),
        })
    }

    /// Takes the sensor values of a tick.
    ///
    /// - `phase`: phase of the coordinator
    pub fn sense(&mut self, sensed: &Sensed, truth: &Truth, phase: CatchPhase) {
        self.joints = Some(sensed.joints);
        let q = self.corrections.joints(&sensed.joints).q;
        let neck = self.robot.head(&q);
        let kinematic = self.robot.chest(&q) * neck;
        if let Some(sample) = &sensed.imu {
            let inputs = HeadInputs {
                sample,
                joints: Some(&sensed.joints),
                phase: Some(phase),
            };
            let head = self.estimator.step(truth.time_ns, &inputs);
            if let Some(head) = head.filter(|_| self.source == Source::Sensors) {
                self.take_pose(head);
            }
        }
        match self.source {
            Source::Sensors => {
                self.heads.push_back((truth.time_ns, isometry(&truth.head)));
                self.align();
            }
            Source::Kinematics => {
                self.take_pose(as_pose(&kinematic, sensed.joints.sensor_ns));
                let aligned = between(&kinematic, &isometry(&truth.head));
                self.alignments.push((truth.time_ns, aligned));
            }
            Source::Truth => {
                // With the measured neck angles, the coordinator finds the true pose of the chest.
                self.take_pose(as_pose(&(isometry(&truth.chest) * neck), truth.time_ns));
            }
        }
        if let Some(circles) = &sensed.circles {
            let flies = truth.balls.iter().any(Option::is_some);
            self.pictures = if flies { self.pictures + 1 } else { 0 };
            let stamp_ns = match self.eyes {
                Some(_) => truth.time_ns,
                None => self.corrections.exposure(circles[0].exposure_ns),
            };
            self.exposures.push_back(Exposure {
                due_ns: truth.time_ns + self.to_prediction_ns,
                circles: *circles,
                stamp_ns,
                truth: *truth,
                pictures: self.pictures,
            });
        }
    }

    /// Forgets the comparison of estimated and true head poses.
    pub fn forget(&mut self) {
        self.alignments.clear();
    }

    /// Returns the latest joint state, as measured.
    pub fn joints(&self) -> Option<&JointState> {
        self.joints.as_ref()
    }

    /// Returns the latest head pose.
    pub fn head(&self) -> Option<&HeadPose> {
        self.head.as_ref()
    }

    fn take_pose(&mut self, head: HeadPose) {
        self.tracker.pose(&head);
        self.head = Some(head);
    }

    /// Compares estimated and true head poses up to the latest estimate.
    fn align(&mut self) {
        let sampled_ns = self.head.map_or(0, |head| head.t_ns);
        while let Some((t_ns, head)) = self.heads.pop_front_if(|(t_ns, _)| *t_ns <= sampled_ns) {
            // Unknown before the first sample.
            if let Some(thought) = self.tracker.head(t_ns) {
                let aligned = between(&pose::isometry(&thought), &head);
                self.alignments.push((t_ns, aligned));
            }
        }
    }

    /// Returns the transformation from the estimated to the true head pose at a time.
    pub fn alignment(&self, t_ns: u64) -> Isometry3<f64> {
        self.alignments
            .iter()
            .min_by_key(|(known_ns, _)| known_ns.abs_diff(t_ns))
            .map_or_else(Isometry3::identity, |(_, aligned)| *aligned)
    }

    /// Returns the result of the next pair of pictures if it is due.
    pub fn predictions(&mut self, now_ns: u64) -> Option<Seen> {
        let exposure = self
            .exposures
            .pop_front_if(|exposure| exposure.due_ns <= now_ns)?;
        let truth = &exposure.truth;
        // Pictures from before the first inertial sample are unusable.
        let known = self.tracker.head(exposure.stamp_ns)?;
        let (head, predictions) = match self.source {
            Source::Truth => {
                let predictions = true_predictions(truth, exposure.pictures);
                (isometry(&truth.head), Some(predictions))
            }
            Source::Sensors | Source::Kinematics => {
                let pair = match &mut self.eyes {
                    Some(eyes) => Some(eyes.see(truth, Some((&self.last, &known)))),
                    None => {
                        let [left, right] = &exposure.circles;
                        self.tracker.pair(left);
                        self.tracker.pair(right)
                    }
                };
                let predictions = pair.and_then(|pair| self.tracker.predict(&pair));
                (pose::isometry(&known), predictions)
            }
        };
        let mut predictions = predictions?;
        self.last = predictions;
        if !self.drag {
            let balls = predictions.balls.iter_mut();
            balls.for_each(|ball| (ball.k, ball.lift) = (0.0, [0.0; 3]));
        }
        Some(Seen {
            predictions,
            exposure_ns: truth.time_ns,
            aligned: between(&head, &isometry(&truth.head)),
        })
    }
}

/// Returns a frame of the world as an isometry.
pub(crate) fn isometry(frame: &FrameMotion) -> Isometry3<f64> {
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(frame.rotation));
    Isometry3::from_parts(Translation3::from(frame.position), rotation)
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
            existence: 1.0,
            frames,
            ..BallPrediction::zeroed()
        };
        predictions.count += 1;
    }
    predictions
}
