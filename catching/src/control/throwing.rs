//! Execution of a throw: approach to the swing, rest, swing.

use bytemuck::Zeroable;
use tactnet_catching_packets::packets::{ArmPath, RampPacket, ThrowPath};
use tactnet_catching_packets::{ARMS, JOINTS, THROW_JOINTS};

use super::controller::{
    MAX_AHEAD_NS, POSITION_TOLERANCE, PathError, SPEED_TOLERANCE, is_whole, keeps,
};
use crate::ramp::Ramp;
use crate::robot::Robot;
use crate::throw::throw_joint;

/// Maximum time from the start of the approach to the swing, in ns. A longer time indicates a wrong clock.
const MAX_REST_NS: u64 = 20_000_000_000;

/// Validated throw.
#[derive(Debug, Clone, Copy)]
pub(super) struct Throwing {
    path: ThrowPath,
    arm: usize,
    end_ns: u64,
}

impl Throwing {
    /// Validates a throw that starts at rest in `q`.
    ///
    /// - `since_ns`: earliest start, in ns
    pub fn new(
        path: &ThrowPath,
        robot: &Robot,
        q: &[f64; JOINTS],
        since_ns: u64,
    ) -> Result<Self, PathError> {
        let arm = usize::try_from(path.arm).ok().filter(|arm| *arm < ARMS);
        let arm = arm.ok_or(PathError::Arm)?;
        let [way, swing] = [path.way, path.swing].map(|ramps| ramps.map(|ramp| Ramp::of(&ramp)));
        let finite = path.target.iter().all(|x| x.is_finite());
        if !(finite && way.iter().chain(&swing).all(is_whole)) {
            return Err(PathError::NotFinite);
        }
        if path.start_ns < since_ns || path.start_ns > since_ns + MAX_AHEAD_NS {
            let late_us = (since_ns as i64 - path.start_ns as i64) / 1000;
            return Err(PathError::Time { late_us });
        }
        let latest = |ramps: &[Ramp; THROW_JOINTS], from_ns: u64| {
            let end = ramps.iter().fold(0.0, |most: f64, ramp| most.max(ramp.end));
            from_ns.saturating_add((end * 1e9).ceil() as u64)
        };
        let end_ns = latest(&swing, path.swing_ns);
        let in_order = path.swing_ns >= latest(&way, path.start_ns)
            && path.swing_ns - path.start_ns <= MAX_REST_NS
            && (path.swing_ns..end_ns).contains(&path.open_ns);
        if !in_order {
            return Err(PathError::Order);
        }
        for i in 0..THROW_JOINTS {
            let joint = throw_joint(arm, i);
            let begins = [q[joint], way[i].at(way[i].end).0];
            for (ramp, begin) in [way[i], swing[i]].iter().zip(begins) {
                if (ramp.q0 - begin).abs() > POSITION_TOLERANCE || ramp.w0.abs() > SPEED_TOLERANCE {
                    return Err(PathError::Jump { joint: i });
                }
                if !keeps(ramp, &robot.joints()[joint]) {
                    return Err(PathError::Limits { joint: i });
                }
            }
        }
        Ok(Self {
            path: *path,
            arm,
            end_ns,
        })
    }

    /// Writes the commands of the throwing joints. Returns false after the end of the throw.
    pub fn write(&self, now_ns: u64, q: &mut [f64; JOINTS], dq: &mut [f64; JOINTS]) -> bool {
        let (from_ns, ramps) = self.leg(now_ns);
        let t = (now_ns as f64 - from_ns as f64) * 1e-9;
        for (i, ramp) in ramps.iter().enumerate() {
            let joint = throw_joint(self.arm, i);
            (q[joint], dq[joint]) = Ramp::of(ramp).at(t);
        }
        now_ns < self.end_ns
    }

    /// Returns true during the swing, in which the brakes of the torso are engaged (thesis, section 3.5.4).
    pub fn brakes_torso(&self, now_ns: u64) -> bool {
        now_ns >= self.path.swing_ns
    }

    /// Returns the current motion of the throwing arm as a packet.
    pub fn arm_path(&self, now_ns: u64) -> ArmPath {
        let (start_ns, ramps) = self.leg(now_ns);
        ArmPath {
            arm: self.arm as u64,
            start_ns,
            ramps: std::array::from_fn(|i| ramps[i + 1]),
            ..ArmPath::zeroed()
        }
    }

    fn leg(&self, now_ns: u64) -> (u64, &[RampPacket; THROW_JOINTS]) {
        if now_ns < self.path.swing_ns {
            (self.path.start_ns, &self.path.way)
        } else {
            (self.path.swing_ns, &self.path.swing)
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use tactnet_catching_packets::packets::ControllerMode;

    use super::*;
    use crate::control::Controller;
    use crate::flight::DRAG;
    use crate::throw::{Aim, Landing, Swing, ThrowJoints, ThrowPlanConfig, ThrowRequest, Thrower};

    const TICK_NS: u64 = 1_000_000;
    const ARM: usize = 1;

    /// Returns a throw to 4 m that starts after 20 ms.
    fn throw(robot: &Robot) -> ThrowPath {
        let target = Vector3::new(4.0, 0.0, 1.2);
        let request = ThrowRequest::new(ARM, Aim::At { target });
        let plan = Thrower::new(robot, ThrowPlanConfig::live()).plan(&request);
        plan.unwrap().path(20 * TICK_NS, 1, target.into())
    }

    fn ready(robot: &Robot) -> Controller {
        let waiting = robot.waiting();
        let mut controller = Controller::new(robot.clone(), waiting, &waiting);
        controller.tick(TICK_NS);
        controller
    }

    fn of_throw(all: &[f64; JOINTS]) -> ThrowJoints {
        std::array::from_fn(|i| all[throw_joint(ARM, i)])
    }

    #[test]
    fn a_throw_is_carried_out_in_absolute_time_within_limits_and_the_robot_goes_back() {
        let robot = Robot::nominal();
        let mut controller = ready(&robot);
        let path = throw(&robot);
        controller.throw_path(TICK_NS, &path).unwrap();
        let (mut now, mut last) = (TICK_NS, (robot.waiting(), [0.0; JOINTS]));
        let mut released = None;
        while controller.mode() == ControllerMode::Throwing {
            now += TICK_NS;
            let (q, dq) = controller.tick(now);
            for (i, limits) in robot.joints().iter().enumerate() {
                assert!(dq[i].abs() <= limits.speed * 1.001, "joint {i}");
                let (change, most) = ((dq[i] - last.1[i]).abs(), 1.1e-3 * limits.acceleration);
                assert!(change <= most, "joint {i}: {change}");
                let moved = q[i] - last.0[i] - 0.5e-3 * (dq[i] + last.1[i]);
                assert!(moved.abs() < 1e-3 * most, "joint {i}: {moved}");
            }
            last = (*q, *dq);
            if now.abs_diff(path.open_ns) < TICK_NS && released.is_none() {
                released = Some((now, last));
            }
            let state = controller.state(now);
            assert_eq!(state.paths[0].start_ns, 0, "the other arm stands");
        }
        // Extrapolate from the tick before the release to the release.
        let (at_ns, (q, dq)) = released.unwrap();
        let late = (path.open_ns - at_ns) as f64 * 1e-9;
        let (p, v) = Swing::new(&robot, ARM, &robot.waiting()).hand(&of_throw(&q), &of_throw(&dq));
        let landing = Landing::of(&(p + v * late), &v, DRAG, path.target[2]).unwrap();
        // The hand turns by 5 mrad per millisecond.
        let beside = (landing.p - Vector3::from(path.target)).norm();
        assert!(beside < 0.03, "{beside}");
        assert_eq!(controller.mode(), ControllerMode::Standing);
        assert_eq!(controller.state(now).reason.as_str(), "the throw is over");
        controller.go_back();
        while controller.mode() == ControllerMode::GoingBack {
            now += TICK_NS;
            controller.tick(now);
        }
        assert_eq!(controller.mode(), ControllerMode::Ready);
    }

    #[test]
    fn a_throw_that_is_braked_stands_and_goes_back() {
        let robot = Robot::nominal();
        let path = throw(&robot);
        // During the approach, and in the middle of the swing.
        for at_ns in [path.start_ns + 400 * TICK_NS, path.open_ns] {
            let mut controller = ready(&robot);
            controller.throw_path(TICK_NS, &path).unwrap();
            let mut now = TICK_NS;
            while now < at_ns {
                now += TICK_NS;
                controller.tick(now);
            }
            controller.go_back();
            assert_eq!(controller.mode(), ControllerMode::Throwing, "not yet");
            controller.brake("asked");
            let mut ticks = 0;
            while controller.mode() != ControllerMode::Ready {
                now += TICK_NS;
                controller.tick(now);
                controller.go_back();
                ticks += 1;
                assert!(ticks < 30_000, "{:?}", controller.mode());
            }
            assert!(controller.throw_path(now, &path).is_err(), "it is over");
        }
    }

    #[test]
    fn throws_that_cannot_be_carried_out_are_refused_with_a_reason() {
        let robot = Robot::nominal();
        let good = throw(&robot);
        let mut controller = ready(&robot);
        let mut refused = |spoil: &dyn Fn(&mut ThrowPath), expected: PathError| {
            let mut path = good;
            spoil(&mut path);
            assert_eq!(controller.throw_path(TICK_NS, &path), Err(expected));
        };
        refused(&|path| path.arm = 2, PathError::Arm);
        refused(&|path| path.swing[3].a = f64::NAN, PathError::NotFinite);
        refused(&|path| path.target[1] = f64::INFINITY, PathError::NotFinite);
        refused(&|path| path.start_ns = 0, PathError::Time { late_us: 1000 });
        refused(&|path| path.swing_ns = path.start_ns, PathError::Order);
        refused(&|path| path.swing_ns = u64::MAX, PathError::Order);
        refused(&|path| path.open_ns = path.swing_ns - 1, PathError::Order);
        refused(&|path| path.way[2].q0 += 0.01, PathError::Jump { joint: 2 });
        let joint = 0;
        refused(&|path| path.swing[0].q0 += 0.01, PathError::Jump { joint });
        refused(&|path| path.swing[0].a *= 1e3, PathError::Limits { joint });
        assert_eq!(controller.mode(), ControllerMode::Ready);
        controller.throw_path(TICK_NS, &good).unwrap();
        let again = controller.throw_path(TICK_NS, &good);
        assert_eq!(again, Err(PathError::NotReady));
        let mut arm = controller.state(TICK_NS).paths[0];
        arm.start_ns = 40 * TICK_NS;
        let meanwhile = controller.arm_path(TICK_NS, &arm);
        assert_eq!(meanwhile, Err(PathError::NotFollowing));
        assert_eq!(controller.state(0).refused, 12);
    }
}
