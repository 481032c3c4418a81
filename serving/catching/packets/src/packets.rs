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
//! | [`CatchOutcome`] | the judge | when a throw is over |

use bytemuck::{Pod, Zeroable};

use crate::{ARM_JOINTS, JOINTS};

/// Most circles of a picture.
pub const MAX_CIRCLES: usize = 32;
/// Most balls at once.
pub const MAX_BALLS: usize = 2;

/// What joints measure, 496 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct JointState {
    /// 0: number of the sample; a gap is a lost one.
    pub number: u64,
    /// 8: when it was measured.
    pub sensor_ns: u64,
    /// 16: positions at the motors, rad and m.
    pub q: [f64; JOINTS],
    /// 176: velocities, rad/s and m/s.
    pub dq: [f64; JOINTS],
    /// 336: torques and forces at the links, Nm and N.
    pub tau: [f64; JOINTS],
}

/// Where joints are to be, 336 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct JointCommand {
    /// 0: number of the command.
    pub number: u64,
    /// 8: when it was given.
    pub command_ns: u64,
    /// 16: positions, rad and m.
    pub q: [f64; JOINTS],
    /// 176: velocities, rad/s and m/s.
    pub dq: [f64; JOINTS],
}

/// A sample of the head's inertial unit, in its own frame, 64 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ImuSample {
    /// 0: number of the sample.
    pub number: u64,
    /// 8: when it was measured.
    pub sensor_ns: u64,
    /// 16: specific force (acceleration minus gravity), m/s^2.
    pub acceleration: [f64; 3],
    /// 40: rotation, rad/s.
    pub rate: [f64; 3],
}

/// A circle in a picture, 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Circle {
    /// 0: centre of the outline, pixels from the left.
    pub u: f64,
    /// 8: centre of the outline, pixels from the top.
    pub v: f64,
    /// 16: mean radius, pixels.
    pub r: f64,
    /// 24: the detector's answer, 0 to 1.
    pub response: f64,
}

/// The circles of one picture, 1048 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Circles {
    /// 0: number of the picture; both cameras count alike.
    pub frame: u64,
    /// 8: middle of the exposure.
    pub exposure_ns: u64,
    /// 16: 0 left, 1 right.
    pub camera: u32,
    /// 20: how many of `circles` are valid.
    pub count: u32,
    /// 24: the circles.
    pub circles: [Circle; MAX_CIRCLES],
}

impl Circles {
    /// Returns the valid ones.
    pub fn valid(&self) -> &[Circle] {
        &self.circles[..(self.count as usize).min(MAX_CIRCLES)]
    }
}

/// Where the head is, 784 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct HeadPose {
    /// 0: of which moment.
    pub t_ns: u64,
    /// 8: position of the head's frame, m.
    pub position: [f64; 3],
    /// 32: rotation from the head's frame to the inertial one: x, y, z, w.
    pub quaternion: [f64; 4],
    /// 64: velocity, m/s.
    pub velocity: [f64; 3],
    /// 88: bias of the accelerometer, m/s^2, in the head's frame.
    pub accelerometer_bias: [f64; 3],
    /// 112: bias of the gyroscope, rad/s, in the head's frame.
    pub gyroscope_bias: [f64; 3],
    /// 136: covariance of the errors of position, velocity, rotation (inertial frame) and both biases, row by row. Biases belong to it: at
    /// rest a tilt and a bias that feel alike cannot be told apart, and only together are they known to move the head little.
    pub covariance: [[f64; 15]; 15],
}

/// Where a ball is and how it flies, 904 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BallPrediction {
    /// 0: number of the ball; kept as long as it is tracked.
    pub ball: u64,
    /// 8: of which moment.
    pub t_ns: u64,
    /// 16: position, m.
    pub p: [f64; 3],
    /// 40: velocity, m/s.
    pub v: [f64; 3],
    /// 64: drag coefficient `k` of `dv/dt = g - k |v| v + lift x v`, 1/m.
    pub k: f64,
    /// 72: lift of the spin, `lift x v` in `dv/dt`, 1/s.
    pub lift: [f64; 3],
    /// 96: covariance of p, v, k, lift, row by row, as seen from the head: an error of the head's pose that moves ball and head alike does
    /// not count.
    pub covariance: [[f64; 10]; 10],
    /// 896: probability that there is such a ball.
    pub existence: f32,
    /// 900: pictures that it was seen in by both cameras.
    pub frames: u32,
}

/// The balls in the air.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BallPredictions {
    /// 0: exposure of the pictures that it follows from.
    pub exposure_ns: u64,
    /// 8: how many of `balls` are valid.
    pub count: u64,
    /// 16: the balls, by number.
    pub balls: [BallPrediction; MAX_BALLS],
}

impl BallPredictions {
    /// Returns the valid ones.
    pub fn valid(&self) -> &[BallPrediction] {
        &self.balls[..(self.count as usize).min(MAX_BALLS)]
    }
}

/// A joint's motion: speeds up until `t1`, keeps its velocity until `t2`, slows down until `end`; thesis, equation 3.1. 48 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct RampPacket {
    /// 0: position at the start, rad or m.
    pub q0: f64,
    /// 8: velocity at the start.
    pub w0: f64,
    /// 16: acceleration until `t1`; its negative from `t2`.
    pub a: f64,
    /// 24: end of the first part, seconds from the start.
    pub t1: f64,
    /// 32: begin of the last part.
    pub t2: f64,
    /// 40: end; the joint stands from here.
    pub end: f64,
}

/// The motion of an arm, 376 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ArmPath {
    /// 0: 0 left, 1 right.
    pub arm: u64,
    /// 8: number of the ball that it is for.
    pub ball: u64,
    /// 16: exposure of the pictures that it follows from; 0: it follows from none.
    pub exposure_ns: u64,
    /// 24: of which moment the head's pose is that it follows from.
    pub head_ns: u64,
    /// 32: when it begins.
    pub start_ns: u64,
    /// 40: its joints.
    pub ramps: [RampPacket; ARM_JOINTS],
}

/// The motion of platform and torso, 104 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BodyPath {
    /// 0: when it begins.
    pub start_ns: u64,
    /// 8: the platform's.
    pub platform: RampPacket,
    /// 56: the torso's turn about the vertical.
    pub turn: RampPacket,
}

/// A flight at one moment, 88 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct FlightPacket {
    /// 0: of which moment.
    pub t_ns: u64,
    /// 8: position, m.
    pub p: [f64; 3],
    /// 32: velocity, m/s.
    pub v: [f64; 3],
    /// 56: drag, 1/m.
    pub k: f64,
    /// 64: lift, 1/s.
    pub lift: [f64; 3],
}

/// What the head is to look at, 184 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Gaze {
    /// 0: how many of `flights` are valid; the head turns to their middle.
    pub count: u64,
    /// 8: inertial frame.
    pub flights: [FlightPacket; MAX_BALLS],
}

/// A question to a planner, 344 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct PlanRequest {
    /// 0: counts calls; questions that follow from one prediction have the same.
    pub call: u64,
    /// 8: exposure of the pictures that it follows from.
    pub exposure_ns: u64,
    /// 16: of which moment the head's pose is that it follows from.
    pub head_ns: u64,
    /// 24: number of the ball.
    pub ball: u64,
    /// 32: 0 left, 1 right.
    pub arm: u64,
    /// 40: when the motion would begin.
    pub start_ns: u64,
    /// 48: the ball then, in the frame of the chest at the catch.
    pub flight: FlightPacket,
    /// 136: joint angles then, rad.
    pub q0: [f64; ARM_JOINTS],
    /// 192: joint rates then, rad/s.
    pub w0: [f64; ARM_JOINTS],
    /// 248: no catch before, s after the begin.
    pub earliest: f64,
    /// 256: no catch after, s after the begin.
    pub latest: f64,
    /// 264: what is sought: 0 the gentlest motion, 1 the latest catch, 2 to be there early.
    pub objective: u64,
    /// 272: 1 if a plan is carried out, else 0.
    pub has_last: u64,
    /// 280: its joint angles at the catch, rad.
    pub last_q: [f64; ARM_JOINTS],
    /// 336: its catch, s after the begin.
    pub last_t: f64,
}

/// A planner's answer.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct PlanResult {
    /// The question.
    pub request: PlanRequest,
    /// 0: a plan; 1 the question makes no sense, 2 out of reach, 3 no catch within limits, 4 time was up.
    pub failure: u64,
    /// Joint angles at the catch, rad.
    pub q: [f64; ARM_JOINTS],
    /// The catch, s after the begin.
    pub t: f64,
    /// The objective's value.
    pub cost: f64,
    /// Hand from ball, m; above 1e-5 it is a near miss.
    pub position_error: f64,
    /// Hand's axis from the ball's flight, rad.
    pub angle_error: f64,
    /// The motion.
    pub ramps: [RampPacket; ARM_JOINTS],
    /// What it took, ns.
    pub computing_ns: u64,
    /// Descents.
    pub starts: u32,
    /// Quadratic programmes of all descents.
    pub iterations: u32,
}

/// What the controller is to do, 80 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ControllerCommand {
    /// 0: when it was given.
    pub command_ns: u64,
    /// 8: 1 brake, 2 go back to where the robot waits.
    pub command: u64,
    /// 16: why: text, filled up with zeros.
    pub reason: Reason,
}

/// Text of a packet, filled up with zeros.
pub type Reason = [u8; 64];

/// Returns a text as it travels, cut where it does not fit.
pub fn reason(text: &str) -> Reason {
    let mut bytes = [0; 64];
    let mut end = text.len().min(bytes.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
    bytes
}

/// Returns what [`reason`] was given.
pub fn reason_text(reason: &Reason) -> &str {
    let end = reason.iter().position(|byte| *byte == 0);
    str::from_utf8(&reason[..end.unwrap_or(reason.len())]).unwrap_or("?")
}

/// What the controller does.
#[repr(u64)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
}

impl ControllerMode {
    /// Returns the mode of a packet.
    pub fn of(number: u64) -> Option<Self> {
        [
            Self::Ready,
            Self::Following,
            Self::Braking,
            Self::Standing,
            Self::GoingBack,
            Self::Stuck,
        ]
        .into_iter()
        .find(|mode| *mode as u64 == number)
    }
}

/// What the controller does and carries out.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ControllerState {
    /// 0: when.
    pub t_ns: u64,
    /// 8: a [`ControllerMode`].
    pub mode: u64,
    /// 16: paths that were refused since it started.
    pub refused: u64,
    /// 24: beats since it started.
    pub beats: u64,
    /// 32: the longest time from a beat to its command since the last packet, ns.
    pub loop_ns: u64,
    /// 40: why it is in this mode.
    pub reason: Reason,
    /// 104: what the arms carry out: left, right. `start_ns` is 0 while they stand.
    pub paths: [ArmPath; 2],
}

/// The monitor's word on a command, 40 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SafetyState {
    /// 0: number of the command.
    pub number: u64,
    /// 8: when it was given.
    pub command_ns: u64,
    /// 16: least bound of a distance while the robot brakes, m.
    pub bound: f64,
    /// 24: what the judgement took, ns.
    pub computing_ns: u64,
    /// 32: the pair of bodies that has it.
    pub pair: u32,
    /// 36: 1 if the robot may go on, else 0.
    pub go: u32,
}

/// What the robot is about.
#[repr(u64)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
}

impl CatchPhase {
    /// Returns the phase of a packet.
    pub fn of(number: u64) -> Option<Self> {
        [
            Self::Starting,
            Self::Armed,
            Self::Tracking,
            Self::Reaching,
            Self::Closed,
            Self::GoingBack,
            Self::Braking,
            Self::Stuck,
        ]
        .into_iter()
        .find(|phase| *phase as u64 == number)
    }
}

/// What the robot is about, and why, 96 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct CatchStatus {
    /// 0: when.
    pub t_ns: u64,
    /// 8: a [`CatchPhase`].
    pub phase: u64,
    /// 16: since when.
    pub since_ns: u64,
    /// 24: plans that found nothing, so far.
    pub no_plans: u64,
    /// 32: why.
    pub reason: Reason,
}

/// What became of a throw, 72 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct CatchOutcome {
    /// 0: number of the throw.
    pub throw: u64,
    /// 8: number of the ball.
    pub ball: u64,
    /// 16: when the ball was let go.
    pub release_ns: u64,
    /// 24: when it crossed a hand's plane; 0: never.
    pub crossing_ns: u64,
    /// 32: from the hand's axis, m.
    pub across: f64,
    /// 40: from the crossing to the hand's closing, s.
    pub along: f64,
    /// 48: between the hand's axis and the ball's reversed velocity, rad.
    pub angle: f64,
    /// 56: 1 if it was caught, else 0.
    pub caught: u32,
    /// 60: why not: 0 caught, 1 never came near, 2 no command, 3 across, 4 angle, 5 too early, 6 too late.
    pub cause: u32,
    /// 64: arms that can catch it: 1 left, 2 right, 3 both, 0 none.
    pub arms: u32,
    /// 68: 0 left, 1 right.
    pub arm: u32,
}

/// When a hand closes, 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct HandCommand {
    /// 0: 0 left, 1 right.
    pub arm: u64,
    /// 8: when the ball's centre is to be at the catch frame; the hand closes so that it encloses the ball then.
    pub catch_ns: u64,
}

#[cfg(feature = "channel")]
macro_rules! packets {
    ($($packet:ident)*) => { $(
        impl tactnet_channel::Packet for $packet {
            const NAME: &'static str = stringify!($packet);
            const VERSION: u32 = 1;
        }
    )* };
}
#[cfg(feature = "channel")]
packets!(
    JointState JointCommand ImuSample Circles HeadPose BallPredictions PlanRequest PlanResult ArmPath BodyPath Gaze HandCommand
    ControllerCommand ControllerState SafetyState CatchStatus CatchOutcome
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_as_documented() {
        assert_eq!(size_of::<ArmPath>(), 376);
        assert_eq!(size_of::<BodyPath>(), 104);
        assert_eq!(size_of::<Gaze>(), 184);
        assert_eq!(size_of::<PlanRequest>(), 344);
        assert_eq!(size_of::<ControllerCommand>(), 80);
        assert_eq!(size_of::<SafetyState>(), 40);
        assert_eq!(size_of::<CatchStatus>(), 96);
        assert_eq!(size_of::<CatchOutcome>(), 72);
        assert_eq!(size_of::<JointState>(), 496);
    }

    #[test]
    fn reasons_are_cut_between_letters() {
        assert_eq!(reason_text(&reason("a plan")), "a plan");
        let long = "\u{e4}".repeat(40);
        assert_eq!(reason_text(&reason(&long)), "\u{e4}".repeat(32));
        let shifted = format!("x{long}");
        assert_eq!(
            reason_text(&reason(&shifted)),
            format!("x{}", "\u{e4}".repeat(31))
        );
        assert_eq!(reason_text(&[0xff; 64]), "?");
    }

    #[test]
    fn every_mode_and_phase_has_its_number() {
        for number in 0..10 {
            assert!(ControllerMode::of(number).is_none_or(|mode| mode as u64 == number));
            assert!(CatchPhase::of(number).is_none_or(|phase| phase as u64 == number));
        }
        assert_eq!(ControllerMode::of(6), Some(ControllerMode::Stuck));
        assert_eq!(CatchPhase::of(8), Some(CatchPhase::Stuck));
    }
}
