//! Obstacles, and their appearance to markers and depth camera.

use nalgebra::{Matrix3, Vector3};
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::Circle;

use super::World;
use crate::cameras::CAMERAS;
use crate::contact::{Contacts, is_clear_of};
use crate::obstacles::StandingBox;
use crate::robot::FrameMotion;
use crate::shape::PlacedCapsule;

/// Minimum distance between a rearranged box and the robot, in m.
pub(super) const PUT_APART: f64 = 0.1;

impl World {
    /// Moves the boxes to new random places according to their settings, away from the robot.
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

    /// Returns the boxes at their current places.
    pub fn boxes(&self) -> &[StandingBox] {
        &self.boxes
    }

    /// Returns the contacts so far. A part inside a box counts in every tick.
    pub fn contacts(&self) -> &Contacts {
        &self.contacts
    }

    /// Renders a depth picture now: the depth along the optical axis in m, row by row from the top left; 0 is invalid.
    /// `number` selects its noise.
    pub fn depth_picture(&self, number: u64) -> Vec<f32> {
        let own = self.capsules.iter().filter(|capsule| !capsule.is_head());
        let own: Vec<PlacedCapsule> = own.map(|one| one.placed(&self.robot.places)).collect();
        let head = &self.robot.frames.head;
        self.config
            .depth
            .take(self.seed, number, head, &self.boxes, &own)
    }

    /// Returns the detected markers in the latest pictures, in pixels: left and right wrist, each in the left and the
    /// right picture. Call this in the tick in which [`Sensed::circles`](super::Sensed::circles) is present.
    pub fn marker_features(&self) -> [[Option<[f64; 2]>; CAMERAS]; ARMS] {
        self.config.markers.find(
            &self.cameras,
            &self.robot.frames.head,
            &self.true_markers(),
            self.seed,
        )
    }

    /// Returns the frames of the arms' last links, moved to the markers.
    pub(super) fn true_markers(&self) -> [FrameMotion; ARMS] {
        self.config
            .markers
            .frames(&self.robot.wrists(), &self.markers)
    }

    /// Returns the true projection of an arm's marker in a camera: its centre and the radius of its outline, or `None`
    /// if the centre is outside the picture.
    pub fn true_feature(&self, camera: usize, arm: usize) -> Option<Circle> {
        let (head, point) = (&self.robot.frames.head, self.true_markers()[arm].position);
        let radius = self.config.markers.radius;
        let [u, v] = self.cameras.project(camera, head, &point)?;
        let outline = self.cameras.outline(camera, head, &point, radius)?;
        Some(Circle { u, v, ..outline })
    }

    /// Returns the poses of the cameras in the inertial frame: position of the lens in m, and rotation from the
    /// camera frame (x along the optical axis).
    pub fn true_cameras(&self) -> [(Vector3<f64>, Matrix3<f64>); CAMERAS] {
        let head = &self.robot.frames.head;
        std::array::from_fn(|camera| {
            let (eye, turn) = self.cameras.mount(camera);
            (head.position + head.rotation * eye, head.rotation * turn)
        })
    }
}
