//! One throw, tick by tick, to be drawn.

use std::sync::Arc;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tactnet_catching::Robot;
use tactnet_catching::map::DistanceField;
use tactnet_catching_packets::packets::{JointCommand, MAX_BALLS};
use tactnet_catching_packets::{ARMS, JOINTS, joint};
use tactnet_catching_world::{Sensed, StandingBox, Truth};

/// A tick.
#[derive(Debug, Clone)]
pub struct TraceTick {
    /// Since the throw, s.
    pub t: f64,
    /// Balls in the air.
    pub balls: [Option<Vector3<f64>>; MAX_BALLS],
    /// Middles of the catch frames.
    pub hands: [Vector3<f64>; ARMS],
    /// Shoulder, elbow, wrist and catch frame of each arm as it truly stands, inertial frame, m; without errors of calibration.
    pub arms: [[Vector3<f64>; 4]; ARMS],
    /// Hip, knee and chest, m.
    pub torso: [Vector3<f64>; 3],
    /// The head, m.
    pub head: Vector3<f64>,
    /// The chest's place, m, and from its frame to the inertial one, as they truly are.
    pub chest: (Vector3<f64>, Matrix3<f64>),
    /// Joint angles, measured, rad.
    pub angles: [f64; JOINTS],
    /// Joint rates, commanded.
    pub commanded: [f64; JOINTS],
    /// Joint rates, measured.
    pub measured: [f64; JOINTS],
}

/// A plan that was carried out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePlan {
    /// When it began, since the throw, s.
    pub t: f64,
    /// 0 left, 1 right.
    pub arm: usize,
    /// What it cost.
    pub cost: f64,
    /// The time of its catch, since the throw, s.
    pub catch: f64,
}

/// What happened in a throw.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// From the throw on.
    pub ticks: Vec<TraceTick>,
    /// In their order.
    pub plans: Vec<TracePlan>,
    /// What the robot has seen before the throw, inertial frame, if it looked about.
    pub field: Option<Arc<DistanceField>>,
    /// What truly stands about.
    pub boxes: Vec<StandingBox>,
}

impl Trace {
    pub(crate) fn tick(
        &mut self,
        t: f64,
        robot: &Robot,
        truth: &Truth,
        command: &JointCommand,
        sensed: &Sensed,
    ) {
        let q = &sensed.joints.q;
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
