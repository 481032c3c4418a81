//! Gaze of the head: at the balls, and at the hand after a catch.

use bytemuck::Zeroable;
use nalgebra::{Point3, Vector3};
use tactnet_catching_packets::packets::Gaze;
use tactnet_catching_packets::{ARMS, joint};

use super::{Coordinator, MeasuredPose, Step};
use crate::coordinate::attempt::CatchState;
use crate::flight::Flight;

/// Delay between a catch and the head's turn towards the hand, in ns.
const CAUGHT_NS: u64 = 20_000_000;
/// Period at which the gaze target at the hand is repeated, in ns. A gaze follows a falling ball, so it drifts off a
/// fixed point.
const LOOK_AGAIN_NS: u64 = 10_000_000;
/// Minimum distance of the gaze target ahead of the chest, in m.
const AHEAD: f64 = 0.5;

impl Coordinator {
    /// Sends the gaze target at the predicted balls, unless the head looks at a hand.
    pub(super) fn look_at_balls(&self, step: &mut Step) {
        let Some(armed) = &self.armed else {
            return;
        };
        if self.hand_to_look_at(step.now_ns).is_some() {
            return;
        }
        let mut gaze = Gaze::zeroed();
        for (t_ns, flight) in armed.attempt.looked_at.iter().flatten() {
            gaze.flights[gaze.count as usize] = flight.packet(*t_ns);
            gaze.count += 1;
        }
        step.outputs.gaze = Some(gaze);
    }

    /// Returns the arm that has just caught a ball if the head should look at it.
    fn hand_to_look_at(&self, now_ns: u64) -> Option<usize> {
        let attempt = &self.armed.as_ref()?.attempt;
        let looks = self.phases.looks_at_hand && attempt.state == CatchState::Closed;
        let over = |arm: &usize| {
            let target = attempt.target(*arm);
            target.is_some_and(|(_, catch_ns)| now_ns > catch_ns + CAUGHT_NS)
        };
        (0..ARMS).find(|arm| looks && over(arm))
    }

    /// Turns the head to the wrist of the arm that has just caught. The slip watch uses the marker on the wrist to
    /// check the calibration.
    pub(super) fn look_at_hand(&mut self, pose: MeasuredPose<'_>, step: &mut Step) {
        let Some(arm) = self.hand_to_look_at(step.now_ns) else {
            return;
        };
        let links = self.corrections.joints(pose.joints).q;
        let chest = pose.chest(&self.corrections);
        let robot = self.corrections.robot();
        let [_, _, wrist, _] = robot.arm(arm).points(&joint::of_arm(&links, arm));
        // The neck cannot look at points near the chest, so the target moves outwards along the same line.
        let neck = Vector3::new(0.0, 0.0, robot.description().neck.height);
        let farther = (AHEAD / wrist.x.max(0.05)).max(1.0);
        let place = chest * Point3::from(neck + (wrist - neck) * farther);
        self.look_at(&place.coords, step);
    }

    /// Turns the head to a fixed place. Must be called until it is turned.
    pub(super) fn look_at(&mut self, place: &Vector3<f64>, step: &mut Step) {
        if step.now_ns < self.looked_ns + LOOK_AGAIN_NS {
            return;
        }
        self.looked_ns = step.now_ns;
        let stands = Flight::without_spin(*place, Vector3::zeros(), 0.0);
        let mut gaze = Gaze::zeroed();
        (gaze.count, gaze.flights[0]) = (1, stands.packet(step.now_ns));
        step.outputs.gaze = Some(gaze);
    }
}
