//! Gaze control: the head turns towards the mean direction of the predicted balls, within the limits of the neck.

use nalgebra::Point3;
use tactnet_catching_packets::packets::MAX_BALLS;
use tactnet_catching_packets::{JOINTS, joint};

use crate::flight::Flight;
use crate::robot::Robot;

/// Balls to look at: time in ns and flight at that time, in the inertial frame.
pub type GazeTargets = [Option<(u64, Flight)>; MAX_BALLS];

/// Gaze control of pan and tilt.
#[derive(Debug, Clone)]
pub struct Neck {
    looked: GazeTargets,
    joints: [(f64, f64); 2],
    turned_ns: u64,
}

impl Neck {
    /// Creates a neck at rest in `q` without a target.
    pub fn standing(q: &[f64; JOINTS]) -> Self {
        Self {
            looked: [None; MAX_BALLS],
            joints: [(q[joint::NECK.start], 0.0), (q[joint::NECK.start + 1], 0.0)],
            turned_ns: 0,
        }
    }

    /// Replaces the targets.
    pub fn look_at(&mut self, now_ns: u64, balls: GazeTargets) {
        if self.looked == [None; MAX_BALLS] {
            self.turned_ns = now_ns;
        }
        self.looked = balls;
    }

    /// Writes angles and velocities into those of all joints.
    pub fn write(&self, q: &mut [f64; JOINTS], dq: &mut [f64; JOINTS]) {
        for (i, index) in joint::NECK.enumerate() {
            (q[index], dq[index]) = self.joints[i];
        }
    }

    /// Advances the motion to `now_ns`. Must be called at each tick of the controller.
    ///
    /// - `q`: positions of all joints, of which platform and torso are used
    pub fn turn(&mut self, now_ns: u64, robot: &Robot, q: &[f64; JOINTS]) {
        let stands = self.joints.iter().all(|(_, rate)| *rate == 0.0);
        if self.looked == [None; MAX_BALLS] && stands {
            return;
        }
        let dt = (now_ns.saturating_sub(self.turned_ns)) as f64 * 1e-9;
        self.turned_ns = now_ns;
        if dt <= 0.0 || dt > 0.1 {
            return;
        }
        let to_chest = robot.chest(q).inverse();
        // Look at the mean direction, so that all balls stay in the pictures.
        let (mut sum, mut count) = ([0.0; 2], 0.0);
        for (t_ns, flight) in self.looked.iter().flatten() {
            let ball = flight.after((now_ns as f64 - *t_ns as f64) * 1e-9);
            let seen = to_chest * Point3::from(ball.p);
            // Ignore balls to the side of the head or behind it.
            if seen.x > 0.3 {
                let angles = robot.look_at(&seen.coords);
                sum = [sum[0] + angles[0], sum[1] + angles[1]];
                count += 1.0;
            }
        }
        let wanted = if count > 0.0 {
            sum.map(|angle| angle / count)
        } else {
            self.joints.map(|(q, _)| q)
        };
        for (i, (angle, rate)) in self.joints.iter_mut().enumerate() {
            let limits = &robot.joints()[joint::NECK.start + i];
            let wanted = wanted[i].clamp(limits.range[0], limits.range[1]);
            // Maximum speed from which the joint can still brake.
            let away = wanted - *angle;
            let most = (2.0 * 0.5 * limits.acceleration * away.abs())
                .sqrt()
                .min(0.9 * limits.speed)
                .min(away.abs() / (3.0 * dt));
            let target = most.copysign(away);
            let change = (0.8 * limits.acceleration * dt).max(0.0);
            let next = *rate + (target - *rate).clamp(-change, change);
            *angle = (*angle + next * dt).clamp(limits.range[0], limits.range[1]);
            *rate = next;
        }
    }
}
