//! Requests to planners, their results, and the motions that joints execute.

use tactnet_packet::{choices, packets};

use crate::ARM_JOINTS;

packets! {
    /// Ramp motion of a joint: constant acceleration until `t1`, constant velocity until `t2`, deceleration until `end`
    /// (thesis, equation 3.1).
    #[derive(PartialEq)]
    pub struct RampPacket {
        /// Position at the start, in rad or m.
        #[recorded(1)] pub q0: f64,
        /// Velocity at the start, in rad/s or m/s.
        #[recorded(2)] pub w0: f64,
        /// Acceleration until `t1`, in rad/s^2 or m/s^2; its negative applies from `t2`.
        #[recorded(3)] pub a: f64,
        /// End of the acceleration, in s from the start.
        #[recorded(4)] pub t1: f64,
        /// Start of the deceleration, in s from the start.
        #[recorded(5)] pub t2: f64,
        /// End of the motion, in s from the start. The joint is at rest afterwards.
        #[recorded(6)] pub end: f64,
    }

    /// Motion of an arm.
    #[derive(PartialEq)] #[version(1)]
    pub struct ArmPath {
        /// Arm: 0 left, 1 right.
        #[recorded(1)] pub arm: u64,
        /// Number of the ball to catch.
        #[recorded(2)] pub ball: u64,
        /// Exposure time of the pictures that the plan uses, in ns; 0 if it uses none.
        #[recorded(3)] pub exposure_ns: u64,
        /// Time of the head pose that the plan uses, in ns.
        #[recorded(4)] pub head_ns: u64,
        /// Start of the motion, in ns.
        #[recorded(5)] pub start_ns: u64,
        /// Ramps of the arm's joints.
        #[recorded(6)] pub ramps: [RampPacket; ARM_JOINTS],
    }

    /// Motion of platform and torso.
    #[derive(PartialEq)] #[version(1)]
    pub struct BodyPath {
        /// Start of the motion, in ns.
        #[recorded(1)] pub start_ns: u64,
        /// Ramp of the platform.
        #[recorded(2)] pub platform: RampPacket,
        /// Ramp of the torso's vertical joint.
        #[recorded(3)] pub turn: RampPacket,
    }

    /// State of a flight at one time.
    #[derive(PartialEq)]
    pub struct FlightPacket {
        /// Time of the state, in ns.
        #[recorded(1)] pub t_ns: u64,
        /// Position, in m.
        #[recorded(2)] pub p: [f64; 3],
        /// Velocity, in m/s.
        #[recorded(3)] pub v: [f64; 3],
        /// Drag coefficient, in 1/m.
        #[recorded(4)] pub k: f64,
        /// Lift vector, in 1/s.
        #[recorded(5)] pub lift: [f64; 3],
    }

    /// Request to the planners of an arm.
    #[derive(PartialEq)] #[version(3)]
    pub struct PlanRequest {
        /// Call number. All requests of one prediction share it.
        #[recorded(1)] pub call: u64,
        /// Exposure time of the pictures that the request uses, in ns.
        #[recorded(2)] pub exposure_ns: u64,
        /// Time of the head pose that the request uses, in ns.
        #[recorded(3)] pub head_ns: u64,
        /// Ball number.
        #[recorded(4)] pub ball: u64,
        /// Arm: 0 left, 1 right.
        #[recorded(5)] pub arm: u64,
        /// Start of the planned motion, in ns.
        #[recorded(6)] pub start_ns: u64,
        /// Ball state at the start, in the chest frame at the catch time.
        #[recorded(7)] pub flight: FlightPacket,
        /// Joint angles at the start, in rad.
        #[recorded(8)] pub q0: [f64; ARM_JOINTS],
        /// Joint velocities at the start, in rad/s.
        #[recorded(9)] pub w0: [f64; ARM_JOINTS],
        /// Earliest catch time, in s after the start.
        #[recorded(10)] pub earliest: f64,
        /// Latest catch time, in s after the start.
        #[recorded(11)] pub latest: f64,
        /// A [`PlanObjective`].
        #[recorded(12)] pub objective: u64,
        /// 1 if a plan is being executed, otherwise 0.
        #[recorded(13)] pub has_last: u64,
        /// Joint angles of that plan at the catch, in rad.
        #[recorded(14)] pub last_q: [f64; ARM_JOINTS],
        /// Catch time of that plan, in s after the start.
        #[recorded(15)] pub last_t: f64,
        /// 1 if `other` holds the other arm's motion, 0 if that arm rests in its waiting pose.
        #[recorded(16)] pub has_other: u64,
        /// Start of the other arm's motion, in ns.
        #[recorded(17)] pub other_start_ns: u64,
        /// Ramps of the other arm's joints.
        #[recorded(18)] pub other: [RampPacket; ARM_JOINTS],
        /// Planner of the arm that answers, from 0. In a request to several planners it has no meaning.
        #[recorded(19)] pub planner: u32,
        /// Number of planners that share the search. With 0 or 1, `planner` alone does all of it.
        #[recorded(20)] pub planners: u32,
    }

    /// Result of a planner.
    #[derive(PartialEq)] #[version(4)]
    pub struct PlanResult {
        /// Request that it answers.
        #[recorded(1)] pub request: PlanRequest,
        /// A [`PlanFailure`].
        #[recorded(2)] pub failure: u64,
        /// Joint angles at the catch, in rad.
        #[recorded(3)] pub q: [f64; ARM_JOINTS],
        /// Catch time, in s after the start.
        #[recorded(4)] pub t: f64,
        /// Value of the objective.
        #[recorded(5)] pub cost: f64,
        /// Distance from hand to ball at the catch, in m. The plan is a near miss above 1e-5.
        #[recorded(6)] pub position_error: f64,
        /// Angle between the hand axis and the ball's reversed velocity, in rad.
        #[recorded(7)] pub angle_error: f64,
        /// Ramps of the arm's joints.
        #[recorded(8)] pub ramps: [RampPacket; ARM_JOINTS],
        /// Computing time, in ns.
        #[recorded(9)] pub computing_ns: u64,
        /// Number of descents.
        #[recorded(10)] pub starts: u32,
        /// Number of quadratic programs solved in all descents.
        #[recorded(11)] pub iterations: u32,
        /// 1 if the time limit ended the search, otherwise 0.
        #[recorded(12)] pub cut_short: u64,
    }
}

choices! {
    /// Objective of a plan.
    pub enum PlanObjective {
        /// Smoothest motion.
        Soft = 0,
        /// Latest catch.
        Latest = 1,
        /// Early arrival.
        Cool = 2,
    }

    /// Reason why a planner found no plan.
    pub enum PlanFailure {
        /// A plan was found.
        NotFailed = 0,
        /// The request is invalid.
        Request = 1,
        /// The ball stays out of reach.
        OutOfReach = 2,
        /// No catch keeps the limits.
        NoCatch = 3,
        /// The time limit expired.
        OutOfTime = 4,
        /// Obstacles block all catches.
        Obstructed = 5,
    }
}
