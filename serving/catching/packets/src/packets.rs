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
//! | [`ArmPath`] | the coordinator, one for each arm | when a plan is accepted |
//! | [`HandCommand`] | the coordinator | with every path |

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

/// The motion of an arm, 360 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ArmPath {
    /// 0: 0 left, 1 right.
    pub arm: u64,
    /// 8: number of the ball that it is for.
    pub ball: u64,
    /// 16: when it begins.
    pub start_ns: u64,
    /// 24: its joints.
    pub ramps: [RampPacket; ARM_JOINTS],
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
