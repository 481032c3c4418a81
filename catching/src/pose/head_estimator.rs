//! Head poses of a robot that waits, catches and waits again.

use tactnet_catching_packets::packets::{CatchPhase, HeadPose, ImuSample, JointState};

use super::{PoseConfig, PoseError, PoseEstimator};
use crate::calibrate::Corrections;

/// Waiting time after which the oscillation of the torso springs is negligible, in s.
pub const TORSO_RESTS: f64 = 1.5;
/// Joint speed below which a joint counts as standing still, in rad/s and m/s.
const STILL_RATE: f64 = 0.02;

/// Inputs of one step.
#[derive(Debug, Clone, Copy)]
pub struct HeadInputs<'a> {
    /// Next inertial sample, as measured.
    pub sample: &'a ImuSample,
    /// Latest joint state, as measured.
    pub joints: Option<&'a JointState>,
    /// Latest phase of the coordinator; `None` before the first.
    pub phase: Option<CatchPhase>,
}

/// Estimator of head poses that uses kinematics only while the robot waits at rest.
#[derive(Debug, Clone)]
pub struct HeadEstimator {
    corrections: Corrections,
    estimator: PoseEstimator,
    still_ns: u64,
    stands_since: Option<u64>,
    was_still: bool,
}

impl HeadEstimator {
    /// Creates an estimator without a pose.
    ///
    /// - `still`: time at rest after which the oscillation of the torso springs is negligible, in s
    ///
    /// # Errors
    /// Returns an error if a setting is not greater than 0.
    pub fn new(corrections: Corrections, still: f64) -> Result<Self, PoseError> {
        let description = corrections.robot().description();
        Ok(Self {
            estimator: PoseEstimator::new(description, PoseConfig::default())?,
            corrections,
            still_ns: (still * 1e9) as u64,
            stands_since: None,
            was_still: false,
        })
    }

    /// Returns the pose at the time of an inertial sample, or `None` before the first pose and for a rejected sample.
    pub fn step(&mut self, now_ns: u64, inputs: &HeadInputs<'_>) -> Option<HeadPose> {
        let is_still = |joints: &JointState| joints.dq.iter().all(|rate| rate.abs() < STILL_RATE);
        let stands = inputs.joints.is_some_and(is_still);
        self.stands_since = self
            .stands_since
            .filter(|_| stands)
            .or(stands.then_some(now_ns));
        let waits = matches!(
            inputs.phase,
            None | Some(CatchPhase::Armed | CatchPhase::Starting)
        );
        let rested = |since: u64| now_ns.saturating_sub(since) >= self.still_ns;
        let still = waits && self.stands_since.is_some_and(rested);
        if still && !self.was_still {
            // After a motion, the kinematic pose is more accurate than the integrated one.
            self.estimator.restart();
        }
        self.was_still = still;
        let kinematic = inputs.joints.filter(|_| still).map(|joints| {
            let (robot, links) = (self.corrections.robot(), self.corrections.joints(joints).q);
            robot.chest(&links) * robot.head(&links)
        });
        let sample = self.corrections.sample(inputs.sample);
        self.estimator.push(&sample, kinematic).ok()
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::robot::Robot;

    /// Samples of a head at rest, every 2 ms.
    fn poses(
        ticks: std::ops::Range<u64>,
        estimator: &mut HeadEstimator,
        joints: &JointState,
        phase: CatchPhase,
    ) -> Vec<Option<HeadPose>> {
        ticks
            .map(|tick| {
                let sample = ImuSample {
                    number: tick,
                    sensor_ns: tick * 2_000_000,
                    acceleration: [0.0, 0.0, 9.81],
                    ..ImuSample::zeroed()
                };
                let inputs = HeadInputs {
                    sample: &sample,
                    joints: Some(joints),
                    phase: Some(phase),
                };
                estimator.step(tick * 2_000_000, &inputs)
            })
            .collect()
    }

    #[test]
    fn kinematics_count_only_while_the_robot_waits_at_rest() {
        let robot = Robot::nominal();
        let corrections = Corrections::new(&robot, None);
        let mut estimator = HeadEstimator::new(corrections, 0.1).unwrap();
        let mut joints = JointState::zeroed();
        let found = poses(0..60, &mut estimator, &joints, CatchPhase::Armed);
        // The first pose comes after 100 ms at rest.
        assert_eq!(found.iter().position(Option::is_some), Some(50));
        // A turned platform is not seen during a catch, nor in the first 100 ms after it.
        joints.q[0] = 0.3;
        let before = found[59].unwrap().position[1];
        let during = poses(60..100, &mut estimator, &joints, CatchPhase::Reaching);
        assert!((during[39].unwrap().position[1] - before).abs() < 0.01);
        joints.dq[0] = 0.1;
        let moves = poses(100..101, &mut estimator, &joints, CatchPhase::Armed);
        assert!((moves[0].unwrap().position[1] - before).abs() < 0.01);
        joints.dq[0] = 0.0;
        let after = poses(101..152, &mut estimator, &joints, CatchPhase::Armed);
        assert!((after[49].unwrap().position[1] - before).abs() < 0.01);
        assert!((after[50].unwrap().position[1] - before - 0.3).abs() < 0.01);
    }
}
