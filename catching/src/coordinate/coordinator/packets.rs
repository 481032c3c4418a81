//! Packets that the coordinator takes and sends.

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, BodyPath, CatchStatus, ControllerCommand, ControllerState,
    CoordinatorStep, Gaze, HandCommand, HeadPose, JointState, PlanRequest, PlanResult,
};

use crate::coordinate::attempt::MAX_REQUESTS;

/// Inputs of one step. `Default` is a step without any packet.
#[derive(Debug, Clone, Copy, Default)]
pub struct CoordinatorInputs<'a> {
    /// Latest state of the joints, as measured.
    pub joints: Option<&'a JointState>,
    /// Latest head pose.
    pub head: Option<&'a HeadPose>,
    /// Latest state of the controller.
    pub controller: Option<&'a ControllerState>,
    /// Latest predictions, if any have arrived since the last step.
    pub predictions: Option<&'a BallPredictions>,
    /// Results of the planners since the last step.
    pub results: &'a [PlanResult],
}

impl CoordinatorInputs<'_> {
    /// Returns the stamps of the inputs, by which a recording finds them again.
    pub fn stamps(&self, now_ns: u64) -> CoordinatorStep {
        let of = |arm: u64| {
            let results = self.results.iter();
            results.filter(|result| result.request.arm == arm).count() as u64
        };
        CoordinatorStep {
            now_ns,
            joints_ns: self.joints.map_or(0, |joints| joints.sensor_ns),
            head_ns: self.head.map_or(0, |head| head.t_ns),
            controller_ns: self.controller.map_or(0, |state| state.t_ns),
            exposure_ns: self.predictions.map_or(0, |balls| balls.exposure_ns),
            results: [of(0), of(1)],
        }
    }
}

/// Packets that one step sends.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CoordinatorOutputs {
    /// Requests to the planners.
    pub requests: [Option<PlanRequest>; MAX_REQUESTS],
    /// Paths of the arms: left, right.
    pub paths: [Option<ArmPath>; ARMS],
    /// Path of platform and torso.
    pub body: Option<BodyPath>,
    /// Gaze target of the head.
    pub gaze: Option<Gaze>,
    /// Closing times of the hands: left, right.
    pub hands: [Option<HandCommand>; ARMS],
    /// Order to the controller.
    pub order: Option<ControllerCommand>,
    /// Phase, when it changes and ten times per second.
    pub status: Option<CatchStatus>,
}
