//! Conversion of a throw to a packet in absolute time.

use tactnet_catching_packets::packets::{RampPacket, ThrowPath};
use tactnet_catching_packets::{JOINTS, THROW_JOINTS};

use super::planner::{ThrowPlan, ThrowPlanConfig};
use super::swing::throw_joint;
use crate::ramp::Ramp;

impl ThrowPlanConfig {
    /// Returns the settings of live throws, whose approach is twice as fast.
    pub fn live() -> Self {
        Self {
            pace: 0.8,
            ..Self::default()
        }
    }
}

impl ThrowPlan {
    /// Returns the packet for controller and hand: the motion from `start_ns` on and the release time.
    ///
    /// - `grip`: number of the grip
    /// - `target`: target position of the ball, in m
    pub fn path(&self, start_ns: u64, grip: u64, target: [f64; 3]) -> ThrowPath {
        let after = |seconds: f64| start_ns + (seconds * 1e9).round() as u64;
        ThrowPath {
            arm: self.arm as u64,
            grip,
            start_ns,
            swing_ns: after(self.motion.swing_begin()),
            open_ns: after(self.motion.release()),
            target,
            way: self.of_throw(&self.motion.way),
            swing: self.of_throw(&self.motion.swing),
        }
    }

    fn of_throw(&self, ramps: &[Ramp; JOINTS]) -> [RampPacket; THROW_JOINTS] {
        std::array::from_fn(|i| ramps[throw_joint(self.arm, i)].packet())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use crate::flight::DRAG;
    use crate::ramp::Ramp;
    use crate::robot::Robot;
    use crate::throw::{Aim, Landing, Swing, ThrowPlanConfig, ThrowRequest, Thrower};

    #[test]
    fn a_throw_in_absolute_time_is_the_planned_one_and_comes_down_at_its_target() {
        let robot = Robot::nominal();
        let thrower = Thrower::new(&robot, ThrowPlanConfig::default());
        let target = Vector3::new(4.0, 0.2, 1.2);
        let request = ThrowRequest::new(0, Aim::At { target });
        let plan = thrower.plan(&request).unwrap();
        let start_ns = 7_000_000_123;
        let path = plan.path(start_ns, 3, target.into());
        assert_eq!((path.arm, path.grip, path.start_ns), (0, 3, start_ns));
        let release = (path.open_ns - path.start_ns) as f64 * 1e-9;
        assert!((release - plan.motion.release()).abs() < 1e-9);
        let since = (path.open_ns - path.swing_ns) as f64 * 1e-9;
        let swing = path.swing.map(|ramp| Ramp::of(&ramp).at(since));
        let (p, v) = Swing::new(&robot, 0, &robot.waiting())
            .hand(&swing.map(|(q, _)| q), &swing.map(|(_, w)| w));
        let landing = Landing::of(&p, &v, DRAG, target.z).unwrap();
        assert!((landing.p - target).norm() < 1e-3, "{}", landing.p);
        // The approach ends at the start of the swing.
        for (way, swing) in path.way.iter().zip(&path.swing) {
            assert!((Ramp::of(way).at(way.end).0 - swing.q0).abs() < 1e-9);
        }
    }
}
