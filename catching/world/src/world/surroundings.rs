//! What stands about, and what markers and depth camera show of robot and room.

use nalgebra::{Matrix3, Vector3};
use tactnet_catching_packets::ARMS;

use super::World;
use crate::cameras::CAMERAS;
use crate::contact::{Contacts, is_clear_of};
use crate::depth::DepthPicture;
use crate::obstacles::StandingBox;
use crate::shape::PlacedCapsule;

/// Who puts a box somewhere keeps it so far from the robot, m.
pub(super) const PUT_APART: f64 = 0.1;

impl World {
    /// Puts boxes elsewhere, as far as their settings say so, away from the robot.
    pub fn rearrange(&mut self) {
        self.rearrangements += 1;
        let (capsules, places) = (&self.capsules, &self.robot.places);
        self.boxes = self
            .config
            .obstacles
            .place(self.seed, self.rearrangements, |standing| {
                is_clear_of(standing, capsules, places, PUT_APART)
            });
    }

    /// Returns the boxes where they stand.
    pub fn boxes(&self) -> &[StandingBox] {
        &self.boxes
    }

    /// Returns what the robot has touched so far; a part that is in a box touches it in every tick.
    pub fn contacts(&self) -> &Contacts {
        &self.contacts
    }

    /// Takes a depth picture now; each `number` has noise of its own.
    pub fn depth_picture(&self, number: u64) -> DepthPicture {
        let own: Vec<PlacedCapsule> = self
            .capsules
            .iter()
            .filter(|capsule| !capsule.is_head())
            .map(|capsule| capsule.placed(&self.robot.places))
            .collect();
        let head = &self.robot.frames.head;
        self.config
            .depth
            .take(self.seed, number, head, &self.boxes, &own)
    }

    /// Returns where detectors find the markers in the last pictures, pixels: of the left and the right wrist, in the left and the right
    /// picture. To be asked in the tick of the pictures, when [`Sensed::circles`](super::Sensed::circles) says that there are some.
    pub fn marker_features(&self) -> [[Option<[f64; 2]>; CAMERAS]; ARMS] {
        self.config.markers.find(
            &self.cameras,
            &self.robot.frames.head,
            &self.robot.wrists(),
            &self.markers,
            self.seed,
        )
    }

    /// Returns where the cameras are, inertial frame: middle of the lens, m, and from its directions (x along the optical axis).
    pub fn true_cameras(&self) -> [(Vector3<f64>, Matrix3<f64>); CAMERAS] {
        let head = &self.robot.frames.head;
        std::array::from_fn(|camera| {
            let (eye, turn) = self.cameras.mount(camera);
            (head.position + head.rotation * eye, head.rotation * turn)
        })
    }
}
