//! Trace of one throw, tick by tick, for drawings.

use std::sync::Arc;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tactnet_catching::Robot;
use tactnet_catching::map::DistanceField;
use tactnet_catching_packets::packets::{JointCommand, MAX_BALLS};
use tactnet_catching_packets::{ARMS, JOINTS, joint};
use tactnet_catching_world::{Grasp, Sensed, StandingBox, World};

/// State at a tick.
#[derive(Debug, Clone)]
pub struct TraceTick {
    /// Time since the throw, in s.
    pub t: f64,
    /// Positions of balls in the air, in m.
    pub balls: [Option<Vector3<f64>>; MAX_BALLS],
    /// Origins of the catch frames, in m.
    pub hands: [Vector3<f64>; ARMS],
    /// True shoulder, elbow, wrist and catch frame of each arm in the inertial frame, without calibration errors, in
    /// m.
    pub arms: [[Vector3<f64>; 4]; ARMS],
    /// Fingers of both hands and the balls among them.
    pub grasps: [Grasp; ARMS],
    /// Hip, knee and chest, in m.
    pub torso: [Vector3<f64>; 3],
    /// Head, in m.
    pub head: Vector3<f64>,
    /// True position of the chest in m, and rotation from its frame to the inertial frame.
    pub chest: (Vector3<f64>, Matrix3<f64>),
    /// Measured joint angles, in rad.
    pub angles: [f64; JOINTS],
    /// Commanded joint rates, in rad/s or m/s.
    pub commanded: [f64; JOINTS],
    /// Measured joint rates, in rad/s or m/s.
    pub measured: [f64; JOINTS],
}

/// An executed plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePlan {
    /// Start since the throw, in s.
    pub t: f64,
    /// Arm, 0 for left and 1 for right.
    pub arm: usize,
    /// Cost.
    pub cost: f64,
    /// Time of its catch since the throw, in s.
    pub catch: f64,
}

/// Trace of a throw.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// Ticks from the throw on.
    pub ticks: Vec<TraceTick>,
    /// Executed plans in temporal order.
    pub plans: Vec<TracePlan>,
    /// Map from before the throw in the inertial frame, if the robot looked around.
    pub field: Option<Arc<DistanceField>>,
    /// True obstacles.
    pub boxes: Vec<StandingBox>,
}

impl Trace {
    pub(crate) fn tick(
        &mut self,
        t: f64,
        robot: &Robot,
        world: &World,
        command: &JointCommand,
        sensed: &Sensed,
    ) {
        let (q, truth) = (&sensed.joints.q, world.truth());
        let (chest, torso) = (&truth.chest, &robot.description().torso);
        let hip = Vector3::new(
            0.0,
            q[joint::PLATFORM] + truth.slip,
            torso.lower_pitch_height,
        );
        let yaw = q[1] + truth.deflection[0];
        let lean = q[2] + truth.deflection[1];
        let lower = Vector3::new(lean.sin(), 0.0, lean.cos()) * torso.lower_length;
        let knee = hip + UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw) * lower;
        self.ticks.push(TraceTick {
            arms: std::array::from_fn(|arm| {
                let angles = std::array::from_fn(|i| q[joint::ARM[arm].start + i]);
                let points = robot.arm(arm).points(&angles);
                points.map(|point| chest.position + chest.rotation * point)
            }),
            grasps: std::array::from_fn(|arm| world.grasp(arm)),
            torso: [hip, knee, chest.position],
            head: truth.head.position,
            t,
            balls: truth.balls.map(|ball| ball.map(|ball| ball.state.position)),
            hands: truth.hands.map(|hand| hand.position),
            chest: (chest.position, chest.rotation),
            angles: *q,
            commanded: command.dq,
            measured: sensed.joints.dq,
        });
    }
}
