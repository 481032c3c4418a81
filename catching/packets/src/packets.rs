//! Packets of the catching stack: plain data, little endian, without padding.
//!
//! | packet | who puts it | when |
//! |---|---|---|
//! | [`JointState`] | the drives | 1 kHz |
//! | [`JointCommand`] | the controller | 1 kHz |
//! | [`ImuSample`] | the head's inertial unit | 512 Hz |
//! | [`Circles`] | a detector, one for each camera | 25 Hz |
//! | [`HeadPose`] | the pose estimator | 512 Hz |
//! | [`BallPredictions`] | the tracker | 25 Hz |
//! | [`PlanRequest`] | the coordinator | with predictions, one for each arm and ball in question |
//! | [`PlanResult`] | a planner | when it has answered |
//! | [`ArmPath`] | the coordinator, one for each arm | when a plan is accepted |
//! | [`BodyPath`] | the coordinator | with the first prediction of a ball |
//! | [`Gaze`] | the coordinator | with every prediction |
//! | [`HandCommand`] | the coordinator, and the hands' process for the hands | with every path, and when the closing time changes |
//! | [`ControllerCommand`] | the coordinator, whoever watches the processes | when the robot is to brake or to go back |
//! | [`ControllerState`] | the controller | when it changes, and 50 times a second |
//! | [`SafetyState`] | the monitor of self-collisions | 1 kHz, for every command |
//! | [`CatchStatus`] | the coordinator | when it changes, and 10 times a second |
//! | [`CatchOutcome`] | the judge | when a throw is over, and the ball has been felt |
//! | [`HandState`] | the hands | 50 Hz |
//! | [`FeltMaterial`] | who lets the free hand sweep | when it is sure, or after three sweeps |
//! | [`ThrowPath`] | the thrower | when a throw back is planned |
//! | [`HandOpening`] | the thrower, and the hands' process for the hands | again and again in the last tenth of a second before a hand opens |
//! | [`ThrowStatus`] | the thrower | when it changes, and 10 times a second |
//! | [`ThrownBack`] | the judge | when a ball that was thrown back has come down |
//! | [`MarkerFeatures`] | a detector | 25 Hz |
//! | [`CalibrationState`] | who watches the calibration | when it changes, and twice a second |

mod calibration;
mod motions;
mod throws;

use tactnet_packet::{Described, Description, choices, packets};

pub use calibration::{CalibrationHold, CalibrationState, MarkerFeature, MarkerFeatures};
pub use motions::{ArmPath, BodyPath, FlightPacket, PlanRequest, PlanResult, RampPacket};
pub use throws::{HandOpening, ThrowPath, ThrowPhase, ThrowStatus, ThrownBack};

pub use tactnet_packet::Text;

use crate::JOINTS;

/// Most circles of a picture.
pub const MAX_CIRCLES: usize = 32;
/// Most balls at once.
pub const MAX_BALLS: usize = 2;

packets! {
    /// What joints measure.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct JointState {
        /// Number of the sample; a gap is a lost one.
        #[recorded(1)]
        pub number: u64,
        /// When it was measured.
        #[recorded(2)]
        pub sensor_ns: u64,
        /// Positions at the motors, rad and m.
        #[recorded(3)]
        pub q: [f64; JOINTS],
        /// Velocities, rad/s and m/s.
        #[recorded(4)]
        pub dq: [f64; JOINTS],
        /// Torques and forces at the links, Nm and N.
        #[recorded(5)]
        pub tau: [f64; JOINTS],
    }

    /// Where joints are to be.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct JointCommand {
        /// Number of the command.
        #[recorded(1)]
        pub number: u64,
        /// When it was given.
        #[recorded(2)]
        pub command_ns: u64,
        /// Positions, rad and m.
        #[recorded(3)]
        pub q: [f64; JOINTS],
        /// Velocities, rad/s and m/s.
        #[recorded(4)]
        pub dq: [f64; JOINTS],
    }

    /// A sample of the head's inertial unit, in its own frame.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ImuSample {
        /// Number of the sample.
        #[recorded(1)]
        pub number: u64,
        /// When it was measured.
        #[recorded(2)]
        pub sensor_ns: u64,
        /// Specific force (acceleration minus gravity), m/s^2.
        #[recorded(3)]
        pub acceleration: [f64; 3],
        /// Rotation, rad/s.
        #[recorded(4)]
        pub rate: [f64; 3],
    }

    /// A circle in a picture.
    #[derive(PartialEq)]
    pub struct Circle {
        /// Centre of the outline, pixels from the left.
        #[recorded(1)]
        pub u: f64,
        /// Centre of the outline, pixels from the top.
        #[recorded(2)]
        pub v: f64,
        /// Mean radius, pixels.
        #[recorded(3)]
        pub r: f64,
        /// The detector's answer, 0 to 1.
        #[recorded(4)]
        pub response: f64,
    }

    /// The circles of one picture.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct Circles {
        /// Number of the picture; both cameras count alike.
        #[recorded(1)]
        pub frame: u64,
        /// Middle of the exposure.
        #[recorded(2)]
        pub exposure_ns: u64,
        /// 0 left, 1 right.
        #[recorded(3)]
        pub camera: u32,
        /// How many of `circles` are valid.
        pub count: u32,
        /// The circles.
        #[recorded(5, count)]
        pub circles: [Circle; MAX_CIRCLES],
    }

    /// Where the head is.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct HeadPose {
        /// Of which moment.
        #[recorded(1)]
        pub t_ns: u64,
        /// Position of the head's frame, m.
        #[recorded(2)]
        pub position: [f64; 3],
        /// Rotation from the head's frame to the inertial one: x, y, z, w.
        #[recorded(3)]
        pub quaternion: [f64; 4],
        /// Velocity, m/s.
        #[recorded(4)]
        pub velocity: [f64; 3],
        /// Bias of the accelerometer, m/s^2, in the head's frame.
        #[recorded(5)]
        pub accelerometer_bias: [f64; 3],
        /// Bias of the gyroscope, rad/s, in the head's frame.
        #[recorded(6)]
        pub gyroscope_bias: [f64; 3],
        /// Covariance of the errors of position, velocity, rotation (inertial frame) and both biases, row by row. Biases belong to it: at
        /// rest a tilt and a bias that feel alike cannot be told apart, and only together are they known to move the head little.
        #[recorded(7)]
        pub covariance: [[f64; 15]; 15],
    }

    /// Where a ball is and how it flies.
    #[derive(PartialEq)]
    pub struct BallPrediction {
        /// Number of the ball; kept as long as it is tracked.
        #[recorded(1)]
        pub ball: u64,
        /// Of which moment.
        #[recorded(2)]
        pub t_ns: u64,
        /// Position, m.
        #[recorded(3)]
        pub p: [f64; 3],
        /// Velocity, m/s.
        #[recorded(4)]
        pub v: [f64; 3],
        /// Drag coefficient `k` of `dv/dt = g - k |v| v + lift x v`, 1/m.
        #[recorded(5)]
        pub k: f64,
        /// Lift of the spin, `lift x v` in `dv/dt`, 1/s.
        #[recorded(6)]
        pub lift: [f64; 3],
        /// Covariance of p, v, k, lift, row by row, as seen from the head: an error of the head's pose that moves ball and head alike does
        /// not count.
        #[recorded(7)]
        pub covariance: [[f64; 10]; 10],
        /// Probability that there is such a ball.
        #[recorded(8)]
        pub existence: f32,
        /// Pictures that it was seen in by both cameras.
        #[recorded(9)]
        pub frames: u32,
    }

    /// The balls in the air.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct BallPredictions {
        /// Exposure of the pictures that it follows from.
        #[recorded(1)]
        pub exposure_ns: u64,
        /// How many of `balls` are valid.
        pub count: u64,
        /// The balls, by number.
        #[recorded(3, count)]
        pub balls: [BallPrediction; MAX_BALLS],
    }

    /// What the head is to look at.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct Gaze {
        /// How many of `flights` are valid; the head turns to their middle.
        pub count: u64,
        /// Inertial frame.
        #[recorded(2, count)]
        pub flights: [FlightPacket; MAX_BALLS],
    }

    /// What the controller is to do.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ControllerCommand {
        /// When it was given.
        #[recorded(1)]
        pub command_ns: u64,
        /// 1 brake, 2 go back to where the robot waits.
        #[recorded(2)]
        pub command: u64,
        /// Why: text, filled up with zeros.
        #[recorded(3)]
        pub reason: Text<64>,
    }

    /// What the controller does and carries out.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ControllerState {
        /// When.
        #[recorded(1)]
        pub t_ns: u64,
        /// A [`ControllerMode`].
        #[recorded(2)]
        pub mode: u64,
        /// Paths that were refused since it started.
        #[recorded(3)]
        pub refused: u64,
        /// Beats since it started.
        #[recorded(4)]
        pub beats: u64,
        /// The longest time from a beat to its command since the last packet, ns.
        #[recorded(5)]
        pub loop_ns: u64,
        /// Why it is in this mode.
        #[recorded(6)]
        pub reason: Text<64>,
        /// What the arms carry out: left, right. `start_ns` is 0 while they stand.
        #[recorded(7)]
        pub paths: [ArmPath; 2],
    }

    /// The monitor's word on a command.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct SafetyState {
        /// Number of the command.
        #[recorded(1)]
        pub number: u64,
        /// When it was given.
        #[recorded(2)]
        pub command_ns: u64,
        /// Least bound of a distance while the robot brakes, m.
        #[recorded(3)]
        pub bound: f64,
        /// What the judgement took, ns.
        #[recorded(4)]
        pub computing_ns: u64,
        /// The pair of bodies that has it.
        #[recorded(5)]
        pub pair: u32,
        /// 1 if the robot may go on, else 0.
        #[recorded(6)]
        pub go: u32,
    }

    /// What the robot is about, and why.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct CatchStatus {
        /// When.
        #[recorded(1)]
        pub t_ns: u64,
        /// A [`CatchPhase`].
        #[recorded(2)]
        pub phase: u64,
        /// Since when.
        #[recorded(3)]
        pub since_ns: u64,
        /// Plans that found nothing, so far.
        #[recorded(4)]
        pub no_plans: u64,
        /// Why.
        #[recorded(5)]
        pub reason: Text<64>,
    }

    /// What became of a throw.
    #[derive(PartialEq)]
    #[version(2)]
    pub struct CatchOutcome {
        /// Number of the throw.
        #[recorded(1)]
        pub throw: u64,
        /// Number of the ball.
        #[recorded(2)]
        pub ball: u64,
        /// When the ball was let go.
        #[recorded(3)]
        pub release_ns: u64,
        /// When it crossed a hand's plane; 0: never.
        #[recorded(4)]
        pub crossing_ns: u64,
        /// From the hand's axis, m.
        #[recorded(5)]
        pub across: f64,
        /// From the crossing to the hand's closing, s.
        #[recorded(6)]
        pub along: f64,
        /// Between the hand's axis and the ball's reversed velocity, rad.
        #[recorded(7)]
        pub angle: f64,
        /// 1 if it was caught, else 0.
        #[recorded(8)]
        pub caught: u32,
        /// Why not: 0 caught, 1 never came near, 2 no command, 3 across, 4 angle, 5 too early, 6 too late.
        #[recorded(9)]
        pub cause: u32,
        /// Arms that can catch it: 1 left, 2 right, 3 both, 0 none.
        #[recorded(10)]
        pub arms: u32,
        /// 0 left, 1 right.
        #[recorded(11)]
        pub arm: u32,
        /// What the ball is made of, where it is felt after the catch; else empty.
        #[recorded(12)]
        pub material: Text<56>,
        /// What it was felt to be made of; empty where it was not felt.
        #[recorded(13)]
        pub felt: Text<56>,
        /// How sure that is, 0 to 1.
        #[recorded(14)]
        pub posterior: f64,
        /// Sweeps over it.
        #[recorded(15)]
        pub sweeps: u32,
        /// Zero.
        pub reserved: u32,
    }

    /// What a hand feels.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct HandState {
        /// When.
        #[recorded(1)]
        pub t_ns: u64,
        /// 0 left, 1 right.
        #[recorded(2)]
        pub arm: u32,
        /// 1 if it holds something, else 0.
        #[recorded(3)]
        pub holds: u32,
        /// How often a hand has caught something so far.
        #[recorded(4)]
        pub grip: u64,
    }

    /// What a caught ball was felt to be made of.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct FeltMaterial {
        /// Which grip it is about, as [`HandState`] counts.
        #[recorded(1)]
        pub grip: u64,
        /// Its most probable material; empty where no sweep could be used.
        #[recorded(2)]
        pub material: Text<56>,
        /// How sure that is, 0 to 1.
        #[recorded(3)]
        pub posterior: f64,
        /// Sweeps that it follows from.
        #[recorded(4)]
        pub sweeps: u32,
        /// Zero.
        pub reserved: u32,
    }

    /// When a hand closes.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct HandCommand {
        /// 0 left, 1 right.
        #[recorded(1)]
        pub arm: u64,
        /// When the ball's centre is to be at the catch frame; the hand closes so that it encloses the ball then.
        #[recorded(2)]
        pub catch_ns: u64,
    }
}

choices! {
    /// What the controller does.
    pub enum ControllerMode {
        /// Stands where the robot waits, and follows paths.
        Ready = 1,
        /// Follows paths.
        Following = 2,
        /// Brakes.
        Braking = 3,
        /// Stands anywhere, and follows nothing.
        Standing = 4,
        /// Goes back to where the robot waits.
        GoingBack = 5,
        /// Stands, and knows no way back.
        Stuck = 6,
        /// Throws.
        Throwing = 7,
    }

    /// What the robot is about.
    pub enum CatchPhase {
        /// Not all parts have been heard of yet.
        Starting = 1,
        /// Waits for a ball.
        Armed = 2,
        /// A ball is valid, no catch is planned.
        Tracking = 3,
        /// An arm is on its way.
        Reaching = 4,
        /// The hands have been told for the last time.
        Closed = 5,
        /// Goes back to where it waits.
        GoingBack = 6,
        /// Brakes, or stands after it.
        Braking = 7,
        /// Knows no way back.
        Stuck = 8,
        /// Throws a ball back.
        Throwing = 9,
    }
}

impl ControllerState {
    /// Returns what the controller does; `None` for a number that is no mode.
    pub fn mode(&self) -> Option<ControllerMode> {
        ControllerMode::of(u32::try_from(self.mode).ok()?)
    }
}

impl CatchStatus {
    /// Returns what the robot is about; `None` for a number that is no phase.
    pub fn phase(&self) -> Option<CatchPhase> {
        CatchPhase::of(u32::try_from(self.phase).ok()?)
    }
}

impl Circles {
    /// Returns the valid ones.
    pub fn valid(&self) -> &[Circle] {
        &self.circles[..(self.count as usize).min(MAX_CIRCLES)]
    }
}

impl BallPredictions {
    /// Returns the valid ones.
    pub fn valid(&self) -> &[BallPrediction] {
        &self.balls[..(self.count as usize).min(MAX_BALLS)]
    }
}

/// The packets for other languages.
pub const DESCRIPTION: Description = Description {
    project: "tactnet_catching",
    source: "catching/packets/src/packets.rs",
    constants: &[
        ("MAX_CIRCLES", "Most circles of a picture.", MAX_CIRCLES),
        ("MAX_BALLS", "Most balls at once.", MAX_BALLS),
    ],
    choices: &[
        ControllerMode::CHOICE,
        CatchPhase::CHOICE,
        ThrowPhase::CHOICE,
        CalibrationHold::CHOICE,
    ],
    packets: &[
        JointState::LAYOUT,
        JointCommand::LAYOUT,
        ImuSample::LAYOUT,
        Circle::LAYOUT,
        Circles::LAYOUT,
        HeadPose::LAYOUT,
        BallPrediction::LAYOUT,
        BallPredictions::LAYOUT,
        RampPacket::LAYOUT,
        ArmPath::LAYOUT,
        BodyPath::LAYOUT,
        FlightPacket::LAYOUT,
        Gaze::LAYOUT,
        PlanRequest::LAYOUT,
        PlanResult::LAYOUT,
        ControllerCommand::LAYOUT,
        ControllerState::LAYOUT,
        SafetyState::LAYOUT,
        CatchStatus::LAYOUT,
        CatchOutcome::LAYOUT,
        HandState::LAYOUT,
        FeltMaterial::LAYOUT,
        HandCommand::LAYOUT,
        ThrowPath::LAYOUT,
        HandOpening::LAYOUT,
        ThrowStatus::LAYOUT,
        ThrownBack::LAYOUT,
        MarkerFeature::LAYOUT,
        MarkerFeatures::LAYOUT,
        CalibrationState::LAYOUT,
    ],
};

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_packet::FieldType;

    use super::*;

    #[test]
    fn sizes_are_as_documented() {
        assert_eq!(size_of::<ArmPath>(), 376);
        assert_eq!(size_of::<BodyPath>(), 104);
        assert_eq!(size_of::<Gaze>(), 184);
        assert_eq!(size_of::<PlanRequest>(), 696);
        assert_eq!(size_of::<ControllerCommand>(), 80);
        assert_eq!(size_of::<SafetyState>(), 40);
        assert_eq!(size_of::<CatchStatus>(), 96);
        assert_eq!(size_of::<CatchOutcome>(), 200);
        assert_eq!(size_of::<JointState>(), 496);
    }

    #[test]
    fn modes_and_phases_that_are_none_are_refused() {
        let state = |mode| ControllerState {
            mode,
            ..ControllerState::zeroed()
        };
        assert_eq!(state(6).mode(), Some(ControllerMode::Stuck));
        assert_eq!((state(0).mode(), state(1 << 32 | 1).mode()), (None, None));
        let status = CatchStatus {
            phase: 8,
            ..CatchStatus::zeroed()
        };
        assert_eq!(status.phase(), Some(CatchPhase::Stuck));
    }

    /// A number that stands for two fields would lose one of them in recordings; parts come before what they are parts of.
    #[test]
    fn the_description_is_in_order() {
        let mut before: Vec<&str> = Vec::new();
        for layout in DESCRIPTION.packets {
            let mut numbers: Vec<u32> = layout.recorded().iter().map(|of| of.0).collect();
            numbers.dedup();
            assert_eq!(numbers.len(), layout.recorded().len(), "{}", layout.name);
            for field in layout.fields {
                let mut kind = field.kind;
                while let FieldType::Array(of, _) = kind {
                    kind = *of;
                }
                if let FieldType::Packet(part) = kind {
                    assert!(before.contains(&part.name), "{}", part.name);
                }
            }
            before.push(layout.name);
        }
    }
}
