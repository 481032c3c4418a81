//! Plans and motions: what is asked of planners, what they answer, and what joints carry out.

use tactnet_packet::packets;

use crate::ARM_JOINTS;

packets! {
    /// A joint's motion: speeds up until `t1`, keeps its velocity until `t2`, slows down until `end`; thesis, equation 3.1.
    #[derive(PartialEq)]
    pub struct RampPacket {
        /// Position at the start, rad or m.
        #[recorded(1)]
        pub q0: f64,
        /// Velocity at the start.
        #[recorded(2)]
        pub w0: f64,
        /// Acceleration until `t1`; its negative from `t2`.
        #[recorded(3)]
        pub a: f64,
        /// End of the first part, seconds from the start.
        #[recorded(4)]
        pub t1: f64,
        /// Begin of the last part.
        #[recorded(5)]
        pub t2: f64,
        /// End; the joint stands from here.
        #[recorded(6)]
        pub end: f64,
    }

    /// The motion of an arm.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct ArmPath {
        /// 0 left, 1 right.
        #[recorded(1)]
        pub arm: u64,
        /// Number of the ball that it is for.
        #[recorded(2)]
        pub ball: u64,
        /// Exposure of the pictures that it follows from; 0: it follows from none.
        #[recorded(3)]
        pub exposure_ns: u64,
        /// Of which moment the head's pose is that it follows from.
        #[recorded(4)]
        pub head_ns: u64,
        /// When it begins.
        #[recorded(5)]
        pub start_ns: u64,
        /// Its joints.
        #[recorded(6)]
        pub ramps: [RampPacket; ARM_JOINTS],
    }

    /// The motion of platform and torso.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct BodyPath {
        /// When it begins.
        #[recorded(1)]
        pub start_ns: u64,
        /// The platform's.
        #[recorded(2)]
        pub platform: RampPacket,
        /// The torso's turn about the vertical.
        #[recorded(3)]
        pub turn: RampPacket,
    }

    /// A flight at one moment.
    #[derive(PartialEq)]
    pub struct FlightPacket {
        /// Of which moment.
        #[recorded(1)]
        pub t_ns: u64,
        /// Position, m.
        #[recorded(2)]
        pub p: [f64; 3],
        /// Velocity, m/s.
        #[recorded(3)]
        pub v: [f64; 3],
        /// Drag, 1/m.
        #[recorded(4)]
        pub k: f64,
        /// Lift, 1/s.
        #[recorded(5)]
        pub lift: [f64; 3],
    }

    /// A question to a planner.
    #[derive(PartialEq)]
    #[version(2)]
    pub struct PlanRequest {
        /// Counts calls; questions that follow from one prediction have the same.
        #[recorded(1)]
        pub call: u64,
        /// Exposure of the pictures that it follows from.
        #[recorded(2)]
        pub exposure_ns: u64,
        /// Of which moment the head's pose is that it follows from.
        #[recorded(3)]
        pub head_ns: u64,
        /// Number of the ball.
        #[recorded(4)]
        pub ball: u64,
        /// 0 left, 1 right.
        #[recorded(5)]
        pub arm: u64,
        /// When the motion would begin.
        #[recorded(6)]
        pub start_ns: u64,
        /// The ball then, in the frame of the chest at the catch.
        #[recorded(7)]
        pub flight: FlightPacket,
        /// Joint angles then, rad.
        #[recorded(8)]
        pub q0: [f64; ARM_JOINTS],
        /// Joint rates then, rad/s.
        #[recorded(9)]
        pub w0: [f64; ARM_JOINTS],
        /// No catch before, s after the begin.
        #[recorded(10)]
        pub earliest: f64,
        /// No catch after, s after the begin.
        #[recorded(11)]
        pub latest: f64,
        /// What is sought: 0 the gentlest motion, 1 the latest catch, 2 to be there early.
        #[recorded(12)]
        pub objective: u64,
        /// 1 if a plan is carried out, else 0.
        #[recorded(13)]
        pub has_last: u64,
        /// Its joint angles at the catch, rad.
        #[recorded(14)]
        pub last_q: [f64; ARM_JOINTS],
        /// Its catch, s after the begin.
        #[recorded(15)]
        pub last_t: f64,
        /// 1 if `other` says what the other arm does meanwhile; 0: it stands where it waits.
        #[recorded(16)]
        pub has_other: u64,
        /// When the other arm's motion begins.
        #[recorded(17)]
        pub other_start_ns: u64,
        /// The other arm's joints.
        #[recorded(18)]
        pub other: [RampPacket; ARM_JOINTS],
    }

    /// A planner's answer.
    #[derive(PartialEq)]
    #[version(2)]
    pub struct PlanResult {
        /// The question.
        #[recorded(1)]
        pub request: PlanRequest,
        /// A plan; 1 the question makes no sense, 2 out of reach, 3 no catch within limits, 4 time was up, 5 obstacles are in the way.
        #[recorded(2)]
        pub failure: u64,
        /// Joint angles at the catch, rad.
        #[recorded(3)]
        pub q: [f64; ARM_JOINTS],
        /// The catch, s after the begin.
        #[recorded(4)]
        pub t: f64,
        /// The objective's value.
        #[recorded(5)]
        pub cost: f64,
        /// Hand from ball, m; above 1e-5 it is a near miss.
        #[recorded(6)]
        pub position_error: f64,
        /// Hand's axis from the ball's flight, rad.
        #[recorded(7)]
        pub angle_error: f64,
        /// The motion.
        #[recorded(8)]
        pub ramps: [RampPacket; ARM_JOINTS],
        /// What it took, ns.
        #[recorded(9)]
        pub computing_ns: u64,
        /// Descents.
        #[recorded(10)]
        pub starts: u32,
        /// Quadratic programmes of all descents.
        #[recorded(11)]
        pub iterations: u32,
    }
}
