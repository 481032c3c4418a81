//! Packets of the catching stack: plain data, little endian, without padding.
//!
//! | packet | sender | rate |
//! |---|---|---|
//! | [`JointState`] | drives | 1 kHz |
//! | [`JointCommand`] | controller | 1 kHz |
//! | [`ImuSample`] | IMU in the head | 512 Hz |
//! | [`Circles`] | detectors, one per camera | 25 Hz |
//! | [`HeadPose`] | pose estimator | 512 Hz |
//! | [`BallPredictions`] | tracker | 25 Hz |
//! | [`PlanRequest`] | coordinator | with each prediction, one per candidate pair of arm and ball |
//! | [`PlanResult`] | planners | one per request |
//! | [`ArmPath`] | coordinator, one channel per arm | when a plan is accepted |
//! | [`BodyPath`] | coordinator | with the first prediction of a ball |
//! | [`Gaze`] | coordinator | with each prediction |
//! | [`HandCommand`] | coordinator; hand process to the hands | with each path and when the closing time changes |
//! | [`ControllerCommand`] | coordinator, process supervisor | when the robot must brake or return |
//! | [`ControllerState`] | controller | on change and at 50 Hz |
//! | [`SafetyState`] | self-collision monitor | 1 kHz, one per command |
//! | [`CatchStatus`] | coordinator | on change and at 10 Hz |
//! | [`CoordinatorStep`] | coordinator | at least 500 Hz |
//! | [`CatchOutcome`] | judge | after a throw and after the material was measured |
//! | [`HandState`] | hands | 50 Hz |
//! | [`FeltMaterial`] | sweep control of the free hand | when the posterior is high enough, or after three sweeps |
//! | [`ThrowPath`] | thrower | when a throw is planned |
//! | [`HandOpening`] | thrower; hand process to the hands | repeatedly during the last 0.1 s before a hand opens |
//! | [`ThrowStatus`] | thrower | on change and at 10 Hz |
//! | [`ThrownBack`] | judge | when a thrown ball has landed |
//! | [`MarkerFeatures`] | marker detector | 25 Hz |
//! | [`CalibrationState`] | calibration monitor | on change and at 2 Hz |

mod calibration;
mod control;
mod motions;
mod throws;

use bytemuck::Zeroable;
use tactnet_packet::{Described, Description, packets};

pub use calibration::{CalibrationHold, CalibrationState, MarkerFeature, MarkerFeatures};
pub use control::{
    CatchPhase, CatchStatus, ControllerCommand, ControllerMode, ControllerOrder, ControllerState,
    CoordinatorStep, SafetyState,
};
pub use motions::{
    ArmPath, BodyPath, FlightPacket, PlanFailure, PlanObjective, PlanRequest, PlanResult,
    RampPacket,
};
pub use throws::{HandOpening, ThrowPath, ThrowPhase, ThrowStatus, ThrownBack};

pub use tactnet_packet::Text;

use crate::JOINTS;

/// Maximum number of circles per picture.
pub const MAX_CIRCLES: usize = 32;
/// Maximum number of balls at a time.
pub const MAX_BALLS: usize = 2;

packets! {
    /// Measurements of all joints.
    #[derive(PartialEq)] #[version(1)]
    pub struct JointState {
        /// Sample number; a gap means lost samples.
        #[recorded(1)] pub number: u64,
        /// Time of the measurement, in ns.
        #[recorded(2)] pub sensor_ns: u64,
        /// Motor-side positions, in rad and m.
        #[recorded(3)] pub q: [f64; JOINTS],
        /// Velocities, in rad/s and m/s.
        #[recorded(4)] pub dq: [f64; JOINTS],
        /// Link-side torques and forces, in Nm and N.
        #[recorded(5)] pub tau: [f64; JOINTS],
    }

    /// Commanded positions and velocities of all joints.
    #[derive(PartialEq)] #[version(2)]
    pub struct JointCommand {
        /// Command number.
        #[recorded(1)] pub number: u64,
        /// Time of the command, in ns.
        #[recorded(2)] pub command_ns: u64,
        /// Positions, in rad and m.
        #[recorded(3)] pub q: [f64; JOINTS],
        /// Velocities, in rad/s and m/s.
        #[recorded(4)] pub dq: [f64; JOINTS],
        /// 1 to engage the brakes of the torso, otherwise 0.
        #[recorded(5)] pub torso_brakes: u64,
    }

    /// Sample of the head's inertial measurement unit (IMU), in the IMU frame.
    #[derive(PartialEq)] #[version(1)]
    pub struct ImuSample {
        /// Sample number.
        #[recorded(1)] pub number: u64,
        /// Time of the measurement, in ns.
        #[recorded(2)] pub sensor_ns: u64,
        /// Specific force (acceleration minus gravity), in m/s^2.
        #[recorded(3)] pub acceleration: [f64; 3],
        /// Angular velocity, in rad/s.
        #[recorded(4)] pub rate: [f64; 3],
    }

    /// Circle detected in a picture.
    #[derive(PartialEq)]
    pub struct Circle {
        /// Horizontal centre of the outline, in pixels from the left edge.
        #[recorded(1)] pub u: f64,
        /// Vertical centre of the outline, in pixels from the top edge.
        #[recorded(2)] pub v: f64,
        /// Mean radius, in pixels.
        #[recorded(3)] pub r: f64,
        /// Detector response, 0 to 1.
        #[recorded(4)] pub response: f64,
    }

    /// Circles detected in one picture.
    #[derive(PartialEq)] #[version(1)]
    pub struct Circles {
        /// Picture number, the same for both cameras.
        #[recorded(1)] pub frame: u64,
        /// Middle of the exposure, in ns.
        #[recorded(2)] pub exposure_ns: u64,
        /// Camera: 0 left, 1 right.
        #[recorded(3)] pub camera: u32,
        /// Number of valid entries in `circles`.
        pub count: u32,
        /// Circles, of which the first `count` are valid.
        #[recorded(5, count)] pub circles: [Circle; MAX_CIRCLES],
    }

    /// Estimated pose of the head.
    #[derive(PartialEq)] #[version(1)]
    pub struct HeadPose {
        /// Time of the estimate, in ns.
        #[recorded(1)] pub t_ns: u64,
        /// Position of the head frame in the inertial frame, in m.
        #[recorded(2)] pub position: [f64; 3],
        /// Rotation from the head frame to the inertial frame, as quaternion x, y, z, w.
        #[recorded(3)] pub quaternion: [f64; 4],
        /// Velocity in the inertial frame, in m/s.
        #[recorded(4)] pub velocity: [f64; 3],
        /// Accelerometer bias in the head frame, in m/s^2.
        #[recorded(5)] pub accelerometer_bias: [f64; 3],
        /// Gyroscope bias in the head frame, in rad/s.
        #[recorded(6)] pub gyroscope_bias: [f64; 3],
        /// Error covariance of position, velocity, rotation (all in the inertial frame) and both biases, row by row. At
        /// rest, tilt and accelerometer bias cannot be separated; their cross-covariance shows that together they move
        /// the head only little.
        #[recorded(7)] pub covariance: [[f64; 15]; 15],
    }

    /// Estimated state of a flying ball.
    #[derive(PartialEq)]
    pub struct BallPrediction {
        /// Ball number, constant while the ball is tracked.
        #[recorded(1)] pub ball: u64,
        /// Time of the state, in ns.
        #[recorded(2)] pub t_ns: u64,
        /// Position, in m.
        #[recorded(3)] pub p: [f64; 3],
        /// Velocity, in m/s.
        #[recorded(4)] pub v: [f64; 3],
        /// Drag coefficient `k` of `dv/dt = g - k |v| v + lift x v`, in 1/m.
        #[recorded(5)] pub k: f64,
        /// Lift vector of the spin (`lift x v` in `dv/dt`), in 1/s.
        #[recorded(6)] pub lift: [f64; 3],
        /// Covariance of p, v, k and lift, row by row, relative to the head. It excludes errors of the head pose that
        /// shift ball and head alike.
        #[recorded(7)] pub covariance: [[f64; 10]; 10],
        /// Probability that the ball exists.
        #[recorded(8)] pub existence: f32,
        /// Number of exposures in which both cameras detected the ball.
        #[recorded(9)] pub frames: u32,
    }

    /// Estimated states of all balls in flight.
    #[derive(PartialEq)] #[version(1)]
    pub struct BallPredictions {
        /// Exposure time of the latest pictures that the prediction uses, in ns.
        #[recorded(1)] pub exposure_ns: u64,
        /// Number of valid entries in `balls`.
        pub count: u64,
        /// Balls, sorted by number.
        #[recorded(3, count)] pub balls: [BallPrediction; MAX_BALLS],
    }

    /// Gaze target of the head.
    #[derive(PartialEq)] #[version(1)]
    pub struct Gaze {
        /// Number of valid entries in `flights`. The head turns to their mean position.
        pub count: u64,
        /// Flights in the inertial frame.
        #[recorded(2, count)] pub flights: [FlightPacket; MAX_BALLS],
    }

    /// Outcome of a throw.
    #[derive(PartialEq)] #[version(2)]
    pub struct CatchOutcome {
        /// Throw number.
        #[recorded(1)] pub throw: u64,
        /// Ball number.
        #[recorded(2)] pub ball: u64,
        /// Time of the release, in ns.
        #[recorded(3)] pub release_ns: u64,
        /// Time at which the ball crossed a hand's plane, in ns; 0 if it never did.
        #[recorded(4)] pub crossing_ns: u64,
        /// Distance from the hand axis at the crossing, in m.
        #[recorded(5)] pub across: f64,
        /// Time from the crossing to the hand's closing, in s.
        #[recorded(6)] pub along: f64,
        /// Angle between the hand axis and the ball's reversed velocity, in rad.
        #[recorded(7)] pub angle: f64,
        /// 1 if the ball was caught, otherwise 0.
        #[recorded(8)] pub caught: u32,
        /// Cause of a miss: 0 caught, 1 never near, 2 no command, 3 across, 4 angle, 5 too early, 6 too late.
        #[recorded(9)] pub cause: u32,
        /// Arms that were able to catch the ball: 0 none, 1 left, 2 right, 3 both.
        #[recorded(10)] pub arms: u32,
        /// Arm: 0 left, 1 right.
        #[recorded(11)] pub arm: u32,
        /// True material of the ball if it was measured after the catch, otherwise empty.
        #[recorded(12)] pub material: Text<56>,
        /// Predicted material; empty if not measured.
        #[recorded(13)] pub felt: Text<56>,
        /// Posterior probability of the predicted material, 0 to 1.
        #[recorded(14)] pub posterior: f64,
        /// Number of sweeps over the ball.
        #[recorded(15)] pub sweeps: u32,
        /// Reserved; always zero.
        pub reserved: u32,
    }

    /// Grip state of a hand.
    #[derive(PartialEq)] #[version(1)]
    pub struct HandState {
        /// Time, in ns.
        #[recorded(1)] pub t_ns: u64,
        /// Arm: 0 left, 1 right.
        #[recorded(2)] pub arm: u32,
        /// 1 if the hand holds an object, otherwise 0.
        #[recorded(3)] pub holds: u32,
        /// Number of successful catches of all hands so far.
        #[recorded(4)] pub grip: u64,
    }

    /// Predicted material of a caught ball.
    #[derive(PartialEq)] #[version(1)]
    pub struct FeltMaterial {
        /// Number of the grip, as counted in [`HandState`].
        #[recorded(1)] pub grip: u64,
        /// Most probable material; empty if no sweep was usable.
        #[recorded(2)] pub material: Text<56>,
        /// Posterior probability of the material, 0 to 1.
        #[recorded(3)] pub posterior: f64,
        /// Number of sweeps used.
        #[recorded(4)] pub sweeps: u32,
        /// Reserved; always zero.
        pub reserved: u32,
    }

    /// Closing command of a hand.
    #[derive(PartialEq)] #[version(1)]
    pub struct HandCommand {
        /// Arm: 0 left, 1 right.
        #[recorded(1)] pub arm: u64,
        /// Time at which the ball's centre reaches the catch frame, in ns. The hand closes such that it encloses the
        /// ball at this time.
        #[recorded(2)] pub catch_ns: u64,
    }
}

impl JointCommand {
    /// Returns a command without number and time.
    pub fn of(q: [f64; JOINTS], dq: [f64; JOINTS]) -> Self {
        Self {
            q,
            dq,
            ..Self::zeroed()
        }
    }

    /// Returns a command to rest, without number and time.
    pub fn still(q: [f64; JOINTS]) -> Self {
        Self::of(q, [0.0; JOINTS])
    }
}

impl Circles {
    /// Returns the valid circles.
    pub fn valid(&self) -> &[Circle] {
        &self.circles[..(self.count as usize).min(MAX_CIRCLES)]
    }
}

impl BallPredictions {
    /// Returns the valid balls.
    pub fn valid(&self) -> &[BallPrediction] {
        &self.balls[..(self.count as usize).min(MAX_BALLS)]
    }
}

/// Defines methods that return a field as a choice.
macro_rules! choices_of {
    ($($packet:ident.$field:ident: $choice:ident as $method:ident;)*) => { $(
        impl $packet {
            #[doc = concat!("Returns `", stringify!($field), "`, or `None` for an unknown number.")]
            pub fn $method(&self) -> Option<$choice> {
                $choice::of(u32::try_from(self.$field).ok()?)
            }
        }
    )* };
}

choices_of! {
    ControllerCommand.command: ControllerOrder as order;
    ControllerState.mode: ControllerMode as mode;
    CatchStatus.phase: CatchPhase as phase;
    PlanRequest.objective: PlanObjective as objective;
    PlanResult.failure: PlanFailure as failure;
    ThrowStatus.phase: ThrowPhase as phase;
    CalibrationState.hold: CalibrationHold as hold;
}

/// Lists a constant of types.
macro_rules! each {
    ($constant:ident of $($name:ident)*) => { &[$($name::$constant),*] };
}

/// Description of the packets for code generators of other languages.
pub const DESCRIPTION: Description = Description {
    project: "tactnet_catching",
    source: "catching/packets/src/packets.rs",
    constants: &[
        (
            "MAX_CIRCLES",
            "Maximum number of circles per picture.",
            MAX_CIRCLES,
        ),
        ("MAX_BALLS", "Maximum number of balls at a time.", MAX_BALLS),
    ],
    choices: each!(CHOICE of
        ControllerOrder ControllerMode CatchPhase ThrowPhase CalibrationHold PlanObjective
        PlanFailure),
    packets: each!(LAYOUT of
        JointState JointCommand ImuSample Circle Circles HeadPose BallPrediction BallPredictions
        RampPacket ArmPath BodyPath FlightPacket Gaze PlanRequest PlanResult ControllerCommand
        ControllerState SafetyState CatchStatus CoordinatorStep CatchOutcome HandState FeltMaterial
        HandCommand ThrowPath HandOpening ThrowStatus ThrownBack MarkerFeature MarkerFeatures
        CalibrationState),
};

#[cfg(test)]
mod tests;
