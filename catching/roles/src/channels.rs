//! Channels of the catching stack.

use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, BodyPath, CalibrationState, CatchOutcome, CatchStatus, Circles,
    ControllerCommand, ControllerState, CoordinatorStep, FeltMaterial, Gaze, HandCommand,
    HandOpening, HandState, HeadPose, ImuSample, JointCommand, JointState, MarkerFeatures,
    PlanRequest, PlanResult, SafetyState, ThrowPath, ThrowStatus, ThrownBack,
};
use tactnet_channel::{ChannelConfig, Packet, Table};

/// Number of bytes before the pixels of a picture: the size of a [`crate::PictureHead`].
pub const PICTURE_HEAD: usize = 64;

pub(crate) const CAMERA_LEFT: &str = "camera/left";
pub(crate) const CAMERA_RIGHT: &str = "camera/right";
pub(crate) const CIRCLES: &str = "ball/circles";
pub(crate) const PREDICTION: &str = "ball/prediction";
pub(crate) const IMU: &str = "imu";
pub(crate) const JOINT_STATE: &str = "joint/state";
pub(crate) const JOINT_COMMAND: &str = "joint/command";
pub(crate) const HEAD_POSE: &str = "head/pose";
pub(crate) const HEAD_GAZE: &str = "head/gaze";
pub(crate) const PLAN_REQUEST: &str = "plan/request";
pub(crate) const PLAN_RESULT: &str = "plan/result";
pub(crate) const ARM_PATH: &str = "arm/path";
pub(crate) const BODY_PATH: &str = "body/path";
pub(crate) const HAND_COMMAND: &str = "hand/command";
pub(crate) const HAND_TARGET: &str = "hand/target";
pub(crate) const HAND_RELEASE: &str = "hand/release";
pub(crate) const HAND_OPEN: &str = "hand/open";
pub(crate) const THROW_PATH: &str = "throw/path";
pub(crate) const THROW_STATE: &str = "throw/state";
pub(crate) const THROW_OUTCOME: &str = "throw/outcome";
pub(crate) const CONTROLLER_COMMAND: &str = "controller/command";
pub(crate) const CONTROLLER_STATE: &str = "controller/state";
pub(crate) const SAFETY_STATE: &str = "safety/state";
pub(crate) const HAND_STATE: &str = "hand/state";
pub(crate) const CATCH_FELT: &str = "catch/felt";
pub(crate) const COORDINATOR_STEP: &str = "coordinator/step";
pub(crate) const CATCH_STATE: &str = "catch/state";
pub(crate) const CATCH_OUTCOME: &str = "catch/outcome";
pub(crate) const MARKER_FEATURES: &str = "marker/features";
pub(crate) const CALIBRATION_STATE: &str = "calibration/state";

/// Adds the channels of the stack to a table.
///
/// - `pixels`: number of pixels of a picture; `None` adds no picture channels, for circles that are computed
///   elsewhere
pub fn catching_channels(table: Table, pixels: Option<usize>) -> Table {
    let table = table
        .with(JOINT_STATE, fast::<JointState>())
        .with(JOINT_COMMAND, fast::<JointCommand>())
        .with(SAFETY_STATE, fast::<SafetyState>())
        .with(IMU, fast::<ImuSample>())
        .with(HEAD_POSE, fast::<HeadPose>())
        .with(CIRCLES, seldom::<Circles>(8))
        .with(PREDICTION, seldom::<BallPredictions>(8))
        .with(PLAN_REQUEST, seldom::<PlanRequest>(8))
        .with(PLAN_RESULT, seldom::<PlanResult>(8))
        .with(ARM_PATH, seldom::<ArmPath>(8))
        .with(BODY_PATH, seldom::<BodyPath>(8))
        .with(HEAD_GAZE, seldom::<Gaze>(8))
        .with(HAND_COMMAND, seldom::<HandCommand>(16))
        .with(HAND_TARGET, seldom::<HandCommand>(16))
        .with(HAND_RELEASE, seldom::<HandOpening>(16))
        .with(HAND_OPEN, seldom::<HandOpening>(16))
        .with(THROW_PATH, seldom::<ThrowPath>(8))
        .with(THROW_STATE, seldom::<ThrowStatus>(16))
        .with(THROW_OUTCOME, seldom::<ThrownBack>(16))
        .with(HAND_STATE, seldom::<HandState>(8))
        .with(CATCH_FELT, seldom::<FeltMaterial>(8))
        .with(CONTROLLER_COMMAND, seldom::<ControllerCommand>(8))
        .with(CONTROLLER_STATE, seldom::<ControllerState>(16))
        .with(COORDINATOR_STEP, fast::<CoordinatorStep>())
        .with(CATCH_STATE, seldom::<CatchStatus>(16))
        .with(CATCH_OUTCOME, seldom::<CatchOutcome>(16))
        .with(MARKER_FEATURES, seldom::<MarkerFeatures>(8))
        .with(CALIBRATION_STATE, seldom::<CalibrationState>(16));
    let Some(pixels) = pixels else {
        return table;
    };
    let picture = ChannelConfig {
        depth: 2,
        put_ports: 2,
        get_ports: 4,
        ..ChannelConfig::of::<u8>(PICTURE_HEAD + pixels)
    };
    table
        .with(CAMERA_LEFT, picture.clone())
        .with(CAMERA_RIGHT, picture)
}

/// Returns the configuration of a channel with hundreds of packets per second. A reader that polls every 60 ms loses
/// nothing.
fn fast<T: Packet>() -> ChannelConfig {
    ChannelConfig {
        depth: 64,
        // A process that was killed and its successor.
        put_ports: 2,
        ..ChannelConfig::of::<T>(1)
    }
}

fn seldom<T: Packet>(depth: usize) -> ChannelConfig {
    ChannelConfig {
        depth,
        put_ports: 3,
        history: 1,
        ..ChannelConfig::of::<T>(1)
    }
}
