//! Channels of the catching stack, each with its packet and its priority.

use std::marker::PhantomData;

use tactnet_catching::coordinate::MAX_PLANNERS;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, BodyPath, CalibrationState, CatchOutcome, CatchStatus, Circles,
    ControllerCommand, ControllerState, CoordinatorStep, FeltMaterial, Gaze, HandCommand,
    HandOpening, HandState, HeadPose, ImuSample, JointCommand, JointState, MarkerFeatures,
    PlanRequest, PlanResult, SafetyState, ThrowPath, ThrowStatus, ThrownBack,
};
use tactnet_channel::{
    Bus, ChannelConfig, ChannelError, GetPort, Packet, Priority, PutPort, Start, Table,
};

use crate::latest_value::{LatestValue, NewPackets};

/// Number of bytes before the pixels of a picture: the size of a [`crate::PictureHead`].
pub const PICTURE_HEAD: usize = 64;

/// Pictures of the left camera.
pub const CAMERA_LEFT: &str = "camera/left";
/// Pictures of the right camera.
pub const CAMERA_RIGHT: &str = "camera/right";

/// Maximum number of planners of both arms.
const PLANNERS: usize = ARMS * MAX_PLANNERS as usize;

/// Channel with packets of one type.
#[derive(Debug)]
pub struct Channel<T> {
    /// Name.
    pub id: &'static str,
    priority: Priority,
    rate: Rate,
    packet: PhantomData<T>,
}

#[derive(Debug, Clone, Copy)]
enum Rate {
    /// Hundreds of packets per second. A reader that polls every 60 ms loses nothing.
    Fast,
    /// Few packets, of which this many are kept.
    Seldom(usize),
    /// Few packets, from or for all planners.
    Planners,
}

impl<T: Packet + Copy> Channel<T> {
    /// Opens the channel for sending.
    ///
    /// # Errors
    /// A missing or broken channel.
    pub fn put(&self, bus: &Bus) -> Result<PutPort<T>, ChannelError> {
        bus.put_port(self.id, self.priority)
    }

    /// Opens the channel for the packets from now on.
    ///
    /// # Errors
    /// A missing or broken channel.
    pub fn get(&self, bus: &Bus) -> Result<GetPort<T>, ChannelError> {
        bus.get_port(self.id, Start::Now)
    }

    pub(crate) fn latest(&self, bus: &Bus) -> Result<LatestValue<T>, ChannelError> {
        Ok(LatestValue::new(self.get(bus)?))
    }

    /// Also returns the last packet from before.
    pub(crate) fn latest_ever(&self, bus: &Bus) -> Result<LatestValue<T>, ChannelError> {
        let port = bus.get_port(self.id, Start::History(1))?;
        Ok(LatestValue::new(port))
    }

    pub(crate) fn new_packets(&self, bus: &Bus) -> Result<NewPackets<T>, ChannelError> {
        Ok(NewPackets::new(self.get(bus)?))
    }

    fn add(&self, table: Table) -> Table {
        let one = ChannelConfig::of::<T>(1);
        let config = match self.rate {
            Rate::Fast => ChannelConfig {
                depth: 64,
                // A process that was killed and its successor.
                put_ports: 2,
                ..one
            },
            Rate::Seldom(depth) => ChannelConfig {
                depth,
                put_ports: 3,
                history: 1,
                ..one
            },
            Rate::Planners => ChannelConfig {
                depth: 4 * PLANNERS,
                // Each planner, and the successor of one that was killed; for readers also the recorder and tools.
                put_ports: PLANNERS + 1,
                get_ports: PLANNERS + 4,
                history: 1,
                ..one
            },
        };
        table.with(self.id, config)
    }
}

/// Defines channels, and a function that adds them to a table.
macro_rules! channels {
    ($($name:ident: $packet:ty = $id:literal, $priority:ident, $rate:expr;)*) => {
        $(
            #[doc = concat!("Channel `", $id, "`.")]
            pub const $name: Channel<$packet> = Channel {
                id: $id,
                priority: Priority::$priority,
                rate: $rate,
                packet: PhantomData,
            };
        )*

        fn with_all(table: Table) -> Table {
            $(let table = $name.add(table);)*
            table
        }
    };
}

channels! {
    JOINT_STATE: JointState = "joint/state", RealTime, Rate::Fast;
    JOINT_COMMAND: JointCommand = "joint/command", RealTime, Rate::Fast;
    SAFETY_STATE: SafetyState = "safety/state", RealTime, Rate::Fast;
    IMU: ImuSample = "imu", High, Rate::Fast;
    HEAD_POSE: HeadPose = "head/pose", High, Rate::Fast;
    CIRCLES: Circles = "ball/circles", High, Rate::Seldom(8);
    PREDICTION: BallPredictions = "ball/prediction", High, Rate::Seldom(8);
    PLAN_REQUEST: PlanRequest = "plan/request", High, Rate::Planners;
    PLAN_RESULT: PlanResult = "plan/result", High, Rate::Planners;
    ARM_PATH: ArmPath = "arm/path", High, Rate::Seldom(8);
    BODY_PATH: BodyPath = "body/path", High, Rate::Seldom(8);
    HEAD_GAZE: Gaze = "head/gaze", High, Rate::Seldom(8);
    HAND_COMMAND: HandCommand = "hand/command", High, Rate::Seldom(16);
    HAND_TARGET: HandCommand = "hand/target", RealTime, Rate::Seldom(16);
    HAND_RELEASE: HandOpening = "hand/release", RealTime, Rate::Seldom(16);
    HAND_OPEN: HandOpening = "hand/open", RealTime, Rate::Seldom(16);
    HAND_STATE: HandState = "hand/state", Normal, Rate::Seldom(8);
    THROW_PATH: ThrowPath = "throw/path", High, Rate::Seldom(8);
    THROW_STATE: ThrowStatus = "throw/state", Normal, Rate::Seldom(16);
    THROW_OUTCOME: ThrownBack = "throw/outcome", Normal, Rate::Seldom(16);
    CATCH_FELT: FeltMaterial = "catch/felt", Normal, Rate::Seldom(8);
    CONTROLLER_COMMAND: ControllerCommand = "controller/command", High, Rate::Seldom(8);
    CONTROLLER_STATE: ControllerState = "controller/state", High, Rate::Seldom(16);
    COORDINATOR_STEP: CoordinatorStep = "coordinator/step", Normal, Rate::Fast;
    CATCH_STATE: CatchStatus = "catch/state", Normal, Rate::Seldom(16);
    CATCH_OUTCOME: CatchOutcome = "catch/outcome", Normal, Rate::Seldom(16);
    MARKER_FEATURES: MarkerFeatures = "marker/features", Normal, Rate::Seldom(8);
    CALIBRATION_STATE: CalibrationState = "calibration/state", Normal, Rate::Seldom(16);
}

/// Adds the channels of the stack to a table.
///
/// - `pixels`: number of pixels of a picture; `None` adds no picture channels, for circles that are computed
///   elsewhere
pub fn catching_channels(table: Table, pixels: Option<usize>) -> Table {
    let table = with_all(table);
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
