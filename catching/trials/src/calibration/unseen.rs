//! Held-out poses: distances between the estimated and the true hands.

use nalgebra::Vector3;
use serde::Serialize;
use tactnet_catching::calibrate::{Candidate, Model, Unknowns, seen_from_camera};
use tactnet_catching_packets::packets::{JointCommand, JointState};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, joint};
use tactnet_catching_world::{World, WorldConfig};

use crate::error::TrialError;

/// A robot at rest: its sensor values, and the true positions of its hands in the frames of its cameras.
#[derive(Debug, Clone)]
pub(crate) struct Standing {
    arm: usize,
    joints: JointState,
    /// Origin of the arm's catch frame in the left and the right camera's frame (ahead, left, up), in m.
    seen: [Vector3<f64>; 2],
}

/// Statistics of the distances between estimated and true hands in the frames of the cameras.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distances {
    /// Mean over poses and cameras, in mm.
    pub mean_mm: f64,
    /// Maximum, in mm.
    pub worst_mm: f64,
}

impl Standing {
    /// Moves the robot of the world to a pose.
    ///
    /// # Errors
    /// Invalid settings of the world.
    pub(crate) fn new(
        model: &Model,
        world: &WorldConfig,
        seed: u64,
        pose: &Candidate,
    ) -> Result<Self, TrialError> {
        let robot = model.robot();
        let mut q = robot.waiting();
        q[joint::ARM[pose.arm].clone()].copy_from_slice(&pose.q);
        q[joint::NECK].copy_from_slice(&pose.gaze);
        let mut world = World::new(robot.description(), world, seed, &q)?;
        let command = JointCommand::still(q);
        let joints = world.step(&command, &[None; ARMS]).joints;
        let hand = world.truth().hands[pose.arm].position;
        let seen = world
            .true_cameras()
            .map(|(eye, turn)| turn.tr_mul(&(hand - eye)));
        let arm = pose.arm;
        Ok(Self { arm, joints, seen })
    }

    fn distances(&self, model: &Model, x: &Unknowns) -> [f64; 2] {
        let own = joint::ARM[self.arm].start;
        let q: [f64; ARM_JOINTS] = std::array::from_fn(|i| self.joints.q[own + i]);
        let loads = std::array::from_fn(|i| -self.joints.tau[own + i]);
        let neck = std::array::from_fn(|i| self.joints.q[joint::NECK.start + i]);
        std::array::from_fn(|camera| {
            let thought = seen_from_camera(model, x, camera, self.arm, &q, &loads, neck);
            1e3 * (thought - self.seen[camera]).norm()
        })
    }
}

impl Distances {
    /// Computes the statistics of distances in mm.
    pub(crate) fn of(all: &[f64]) -> Self {
        Self {
            mean_mm: all.iter().sum::<f64>() / all.len().max(1) as f64,
            worst_mm: all.iter().copied().fold(0.0, f64::max),
        }
    }
}

/// Returns the distances in the poses with the given unknowns in mm, two cameras per pose.
pub(crate) fn distances(poses: &[Standing], model: &Model, x: &Unknowns) -> Vec<f64> {
    poses
        .iter()
        .flat_map(|pose| pose.distances(model, x))
        .collect()
}
