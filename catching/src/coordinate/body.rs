//! Motion of platform and torso. It happens once, at the first valid prediction, and moves the arms' start positions
//! towards the ball.
//!
//! The thesis mentions a rule of thumb without details. Here, the platform moves sideways until the arm's best reach
//! point (0.55 m in front of the shoulder) aligns with the closest point of the ball's path, as far as it can and still
//! come to rest in time. The torso turns by the rest.

use nalgebra::{Isometry3, Vector3};
use tactnet_catching_packets::packets::BodyPath;
use tactnet_catching_packets::{JOINTS, joint};

use crate::flight::FlightPath;
use crate::plan::ChestWay;
use crate::ramp::{Ramp, Reach};
use crate::robot::Robot;

/// Distance of an arm's best reach point in front of its shoulder, in m.
const BEST_REACH: f64 = 0.55;
/// Time at rest before the ball arrives, in s.
const REST_BEFORE_CATCH: f64 = 0.15;
/// Minimum displacement that justifies a motion, in m.
const MIN_MOTION: f64 = 0.05;
/// Maximum turn of the torso, in rad.
const MAX_TURN: f64 = 0.5;

/// Motion of the platform and the torso's vertical joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyMotion {
    /// Start of the motion, in ns.
    pub start_ns: u64,
    /// Motion of the platform.
    pub platform: Ramp,
    /// Motion of the torso's vertical joint.
    pub turn: Ramp,
}

impl BodyMotion {
    /// Returns a body at rest.
    pub fn standing(q: &[f64; JOINTS]) -> Self {
        Self {
            start_ns: 0,
            platform: Ramp::standing(q[joint::PLATFORM]),
            turn: Ramp::standing(q[joint::TORSO.start]),
        }
    }

    /// Returns the motion of a packet.
    pub fn of(path: &BodyPath) -> Self {
        Self {
            start_ns: path.start_ns,
            platform: Ramp::of(&path.platform),
            turn: Ramp::of(&path.turn),
        }
    }

    /// Returns the motion as a packet.
    pub fn packet(&self) -> BodyPath {
        BodyPath {
            start_ns: self.start_ns,
            platform: self.platform.packet(),
            turn: self.turn.packet(),
        }
    }

    /// Returns the motion from rest at joint angles `q` towards a ball, for the arm whose best reach point is closer to
    /// its path. `path` is in the chest frame and starts at `start_ns`.
    pub fn towards(robot: &Robot, q: &[f64; JOINTS], path: &FlightPath, start_ns: u64) -> Self {
        let standing = Self::standing(q);
        // Closest approach over both arms and all times that leave room for a motion: distance, time, ball, reach
        // point.
        let mut nearest = (f64::INFINITY, 0.0, Vector3::zeros(), Vector3::zeros());
        for arm in 0..2 {
            let best = robot.arm(arm).shoulder() + Vector3::new(BEST_REACH, 0.0, 0.0);
            for i in 0..=150 {
                let t = 0.2 + 0.01 * f64::from(i);
                let ball = path.at(t).p;
                let distance = (ball - best).norm();
                if distance < nearest.0 {
                    nearest = (distance, t, ball, best);
                }
            }
        }
        let (_, t, ball, best) = nearest;
        let available = t - REST_BEFORE_CATCH;
        let aside = ball.y - best.y;
        if available < 0.15 || aside.abs() < MIN_MOTION {
            return standing;
        }
        let limits = robot.joints();
        let within = |index: usize, wanted: f64| {
            let joint = &limits[index];
            // Plan for half of that time, because larger accelerations shake chest and head.
            let reach = Reach::new(available * 0.5, 0.0, joint).high;
            (q[index] + wanted.clamp(-reach, reach)).clamp(joint.range[0], joint.range[1])
                - q[index]
        };
        // A turned chest has its sideways direction at an angle to the platform's axis.
        let turned = q[joint::TORSO.start];
        let roll = within(joint::PLATFORM, aside * turned.cos());
        let left = aside - roll * turned.cos();
        let turn = if left.abs() < MIN_MOTION {
            0.0
        } else {
            within(
                joint::TORSO.start,
                left.atan2(ball.x.max(0.3)).clamp(-MAX_TURN, MAX_TURN),
            )
        };
        let ramp = |index: usize, by: f64| {
            Ramp::between(q[index], 0.0, q[index] + by, available, limits[index].speed)
        };
        Self {
            start_ns,
            platform: ramp(joint::PLATFORM, roll),
            turn: ramp(joint::TORSO.start, turn),
        }
    }

    /// Returns a motion over a fraction of the distance in the same time.
    pub fn shortened(&self, robot: &Robot, share: f64) -> Self {
        let limits = robot.joints();
        let shorter = |ramp: &Ramp, index: usize| {
            let (there, _) = ramp.at(ramp.end);
            if ramp.end == 0.0 || there == ramp.q0 {
                return *ramp;
            }
            let there = ramp.q0 + share * (there - ramp.q0);
            Ramp::between(ramp.q0, 0.0, there, ramp.end, limits[index].speed)
        };
        Self {
            start_ns: self.start_ns,
            platform: shorter(&self.platform, joint::PLATFORM),
            turn: shorter(&self.turn, joint::TORSO.start),
        }
    }

    /// Returns the motion of the chest from `start_ns` on.
    ///
    /// - `joints`: torso joints that do not move
    /// - `deviation`: transform from the chest pose by joint angles to the measured one
    pub fn chest_way(
        &self,
        robot: &Robot,
        joints: &[f64; JOINTS],
        deviation: &Isometry3<f64>,
        start_ns: u64,
    ) -> ChestWay {
        let mut still = *joints;
        still[joint::PLATFORM] = 0.0;
        still[joint::TORSO.start] = 0.0;
        ChestWay {
            platform: self.platform,
            turn: self.turn,
            since: (start_ns as f64 - self.start_ns as f64) * 1e-9,
            chest: robot.chest(&still) * deviation,
        }
    }

    /// Returns the time at which the body comes to rest, in ns.
    pub fn end_ns(&self) -> u64 {
        self.start_ns + (self.platform.end.max(self.turn.end) * 1e9) as u64
    }

    /// Writes the positions and velocities at a time into those of all joints.
    pub fn write(&self, now_ns: u64, q: &mut [f64; JOINTS], dq: &mut [f64; JOINTS]) {
        let t = (now_ns as f64 - self.start_ns as f64) * 1e-9;
        (q[joint::PLATFORM], dq[joint::PLATFORM]) = self.platform.at(t);
        (q[joint::TORSO.start], dq[joint::TORSO.start]) = self.turn.at(t);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::flight::Flight;

    proptest! {
        #[test]
        fn the_body_keeps_its_limits_and_comes_closer(aside in -2.0..2.0f64, time in 0.4..1.0f64, turned in -1.0..1.0f64) {
            let robot = Robot::nominal();
            let mut q = [0.0; JOINTS];
            q[joint::TORSO.start] = turned;
            let ball = Flight::without_spin(Vector3::new(0.6, aside, 0.2), Vector3::new(-6.0, 0.0, -2.0), 0.03).after(-time);
            let path = FlightPath::new(ball);
            let motion = BodyMotion::towards(&robot, &q, &path, 0);
            for (ramp, index) in [(motion.platform, joint::PLATFORM), (motion.turn, joint::TORSO.start)] {
                let limits = robot.joints()[index];
                prop_assert!(ramp.a.abs() <= limits.acceleration * 1.0001 && ramp.top_speed() <= limits.speed * 1.0001);
                let [low, high] = ramp.extent();
                prop_assert!(limits.range[0] - 1e-9 <= low && high <= limits.range[1] + 1e-9);
                prop_assert!(ramp.end <= time);
            }
            let nearest = |motion: &BodyMotion| {
                let (mut there, mut rates) = (q, [0.0; JOINTS]);
                motion.write(motion.end_ns() + 1, &mut there, &mut rates);
                let moved = robot.chest(&there).inverse() * robot.chest(&q);
                let mut least = f64::INFINITY;
                for arm in 0..2 {
                    let best = robot.arm(arm).shoulder() + Vector3::new(BEST_REACH, 0.0, 0.0);
                    for i in 0..150 {
                        let ball = moved * nalgebra::Point3::from(path.at(0.01 * f64::from(i)).p);
                        least = least.min((ball.coords - best).norm());
                    }
                }
                least
            };
            prop_assert!(nearest(&motion) <= nearest(&BodyMotion::standing(&q)) + 0.1);
        }
    }
}
