//! Self-collision monitor: decides whether the robot could brake without touching itself (thesis, section 3.5.3).
//!
//! Bodies are convex hulls of points with a radius. The space that they cover while joints move through intervals is
//! bounded by such hulls, so the whole braking motion is proved to be free, not only samples of it. A table holds a
//! lower bound of each pair's distance. Each tick recomputes the smallest bounds and reduces all others by the maximum
//! possible approach since their computation. The computing time of a tick is therefore bounded.
//!
//! ```text
//! command ─> braking intervals ─> bounds of all pairs ─> smallest recomputed: swept hulls, GJK ─> smallest bound ─> go or brake
//! ```

mod bodies;
mod gjk;
mod hull;
mod monitor;
mod parts;
mod sweep;
mod watch;

pub use bodies::{BODIES, Bodies, PAIRS};
pub use gjk::distance;
pub(crate) use gjk::{Nearest, nearest};
pub use hull::{Hull, MAX_POINTS};
pub use monitor::{Monitor, MonitorConfig, Ruling};
pub use sweep::{Interval, braking};
pub use watch::SafetyWatch;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tactnet_catching_packets::joint::ARM;
    use tactnet_catching_packets::packets::JointCommand;
    use tactnet_catching_packets::{JOINTS, RobotDescription};

    use crate::Robot;
    use crate::ramp::Ramp;

    /// Returns joint positions as fractions of the ranges, half widths of intervals in rad or m, and positions within
    /// them.
    fn motion() -> impl Strategy<Value = (Vec<f64>, Vec<f64>, Vec<f64>)> {
        let of = |range: std::ops::Range<f64>| proptest::collection::vec(range, JOINTS);
        (of(0.0..1.0), of(0.0..0.5), of(-1.0..1.0))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// For all joint positions within their intervals, bodies lie in their swept hulls.
        #[test]
        fn swept_hulls_hold_their_bodies((places, halves, inside) in motion()) {
            let description = RobotDescription::nominal();
            let bodies = Bodies::new(&description);
            let joints = description.joints();
            let q: [f64; JOINTS] = std::array::from_fn(|i| {
                let [low, high] = joints[i].range;
                low + places[i] * (high - low)
            });
            let intervals: [Interval; JOINTS] = std::array::from_fn(|i| Interval {
                low: q[i] - halves[i] * (1.0 + inside[i]),
                high: q[i] + halves[i] * (1.0 - inside[i]),
            });
            for pair in 0..PAIRS {
                let [a, b] = bodies.placed(pair, &q);
                let [c, d] = bodies.swept(pair, &intervals);
                for (body, swept) in [(a, c), (b, d)] {
                    // A sphere lies in another body if its centre's distance is at most the difference of the radii.
                    let core = Hull::new(swept.points(), 0.0);
                    for point in body.points() {
                        let out = distance(&Hull::new(&[*point], 0.0), &core);
                        prop_assert!(out <= swept.radius - body.radius + 1e-9, "{:?}", bodies.names(pair));
                    }
                }
                prop_assert!(distance(&c, &d) <= distance(&a, &b) + 1e-9, "{:?}", bodies.names(pair));
            }
        }
    }

    proptest! {
        /// For any start of braking within the reaction time, all joints are within the intervals of one part of the
        /// motion, and the bound of parts holds.
        #[test]
        fn parts_of_braking_hold_the_motion(
            (places, _, speeds) in motion(), begun in 0.0..1.0f64, braked in 0.0..1.0f64, pair in 0..PAIRS, looks in 0..60_usize,
        ) {
            let description = RobotDescription::nominal();
            let (bodies, joints) = (Bodies::new(&description), description.joints());
            let command = JointCommand::of(
                std::array::from_fn(|i| joints[i].range[0] + places[i] * (joints[i].range[1] - joints[i].range[0])),
                std::array::from_fn(|i| 0.5 * speeds[i] * joints[i].speed),
            );
            let braking_of = sweep::Braking::new(&command, &joints, 0.005);
            let (begun, braked) = (begun * 0.005, braked * braking_of.longest());
            let q = braking_of.at(begun, braked);
            let near = |x: f64, by: f64| [x - by * x, x + by];
            for (i, interval) in braking_of.between(near(begun, 0.001), near(braked, 0.01)).iter().enumerate() {
                prop_assert!((interval.low - 1e-12..=interval.high + 1e-12).contains(&q[i]));
                let whole = braking(command.q[i], command.dq[i], &joints[i], 0.005);
                prop_assert!((whole.low - 1e-12..=whole.high + 1e-12).contains(&q[i]));
            }
            let [a, b] = bodies.placed(pair, &q);
            let mut left = looks;
            let bound = parts::least_in_parts(&bodies, pair, &braking_of, 0.01, &mut left);
            prop_assert!(bound <= distance(&a, &b) + 1e-9, "{bound} {:?}", bodies.names(pair));
            prop_assert!(left <= looks);
        }
    }

    /// Returns the minimum distance of all pairs during braking, sampled densely, for drives that brake at once or at
    /// the end of the reaction time.
    fn least(
        bodies: &Bodies,
        joints: &[tactnet_catching_packets::Joint; JOINTS],
        command: &JointCommand,
    ) -> f64 {
        let reaction = MonitorConfig::default().reaction;
        let braking = sweep::Braking::new(command, joints, reaction);
        let longest = reaction + braking.longest();
        let mut least = f64::INFINITY;
        for begun in [0.0, reaction] {
            for sample in 0..=20 {
                let time = longest * f64::from(sample) / 20.0;
                let q = braking.at(time.min(begun), (time - begun).max(0.0));
                least = least.min(bodies.least(&q));
            }
        }
        least
    }

    #[test]
    fn permitted_motions_stay_apart_and_close_ones_are_braked() {
        let description = RobotDescription::nominal();
        let robot = Robot::new(description.clone());
        let mut q = [0.0; JOINTS];
        for (arm, own) in ARM.into_iter().enumerate() {
            q[own].copy_from_slice(&robot.ready(arm));
        }
        let bodies = Bodies::new(&description);
        let config = MonitorConfig::default();
        let mut monitor = Monitor::new(bodies.clone(), description.joints(), config, &q);
        let command = JointCommand::of;
        assert!(monitor.judge(&command(q, [0.0; JOINTS])).go, "at rest");
        // The left arm's first joints move it across the body, one millisecond per step.
        let mut stopped = false;
        for direction in [-1.0, 1.0] {
            let (mut at, mut dq) = (q, [0.0; JOINTS]);
            (dq[6], dq[7]) = (direction * 1.7, 1.7);
            for _ in 0..2000 {
                let now = command(at, dq);
                let ruling = monitor.judge(&now);
                if !ruling.go {
                    stopped = true;
                    break;
                }
                assert!(least(&bodies, &description.joints(), &now) >= ruling.bound - 1e-9);
                at[6] += 1e-3 * dq[6];
                at[7] += 1e-3 * dq[7];
            }
        }
        assert!(stopped, "an arm that goes on turning comes to the body");
    }

    /// A robot that braked too late rests within the margin. It may leave slowly but must not come closer.
    #[test]
    fn a_robot_within_the_margin_may_leave() {
        let description = RobotDescription::nominal();
        let robot = Robot::new(description.clone());
        let q = robot.waiting();
        let bodies = Bodies::new(&description);
        let config = MonitorConfig::default();
        let mut monitor = Monitor::new(bodies, description.joints(), config, &q);
        let command = |q: [f64; JOINTS], speed: f64| {
            let mut dq = [0.0; JOINTS];
            (dq[6], dq[7]) = (speed, speed);
            JointCommand::of(q, dq)
        };
        let least =
            |monitor: &Monitor, q: [f64; JOINTS]| monitor.least_while_braking(&command(q, 0.0));
        let mut at = q;
        let mut step = |by: f64| {
            at[6] += by;
            at[7] += by;
            at
        };
        // Move to the margin, then on without the monitor until the distance is 75 % of the margin.
        let mut now = q;
        while monitor.judge(&command(now, 1.0)).go {
            now = step(1e-3);
        }
        while least(&monitor, now) > 0.75 * config.margin {
            now = step(1e-4);
        }
        assert!(!monitor.judge(&command(now, 0.5)).go, "fast");
        assert!(monitor.judge(&command(now, 0.0)).go, "it stands");
        // A further approach is stopped before contact.
        let place = now;
        while monitor.judge(&command(now, 0.05)).go {
            now = step(5e-5);
            assert!(least(&monitor, now) >= config.leaving);
        }
        // The way back is permitted all along, and afterwards the margin holds again.
        monitor.judge(&command(place, 0.0));
        let mut now = step(place[6] - now[6]);
        while least(&monitor, now) < 2.0 * config.margin {
            assert!(monitor.judge(&command(now, -0.05)).go);
            now = step(-5e-5);
        }
        let mut nearest = f64::INFINITY;
        while monitor.judge(&command(now, 0.05)).go {
            now = step(5e-5);
            nearest = nearest.min(least(&monitor, now));
        }
        let margin = config.margin..1.2 * config.margin;
        assert!(margin.contains(&nearest), "{nearest}");
    }

    /// Fast motion of both arms reduces all bounds so much per tick that four recomputed pairs do not suffice and a
    /// free robot is braked.
    #[test]
    fn fast_arms_with_room_are_not_braked() {
        use rand::{RngExt, SeedableRng};
        let description = RobotDescription::nominal();
        let robot = Robot::new(description.clone());
        let joints = description.joints();
        let waiting = robot.waiting();
        let brakes_with_room = |most_updates: usize| {
            let config = MonitorConfig {
                most_updates,
                ..MonitorConfig::default()
            };
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
            let mut brakes = 0;
            for _ in 0..60 {
                let ramps: [Ramp; JOINTS] = std::array::from_fn(|i| {
                    let of_arm = ARM.iter().any(|arm| arm.contains(&i));
                    let way: f64 = rng.random_range(-0.8..0.8);
                    let to = if of_arm { waiting[i] + way } else { waiting[i] };
                    let [low, high] = joints[i].range;
                    let to = to.clamp(low, high);
                    Ramp::between(waiting[i], 0.0, to, 0.6, joints[i].speed)
                });
                let bodies = Bodies::new(&description);
                let mut monitor = Monitor::new(bodies, joints, config, &waiting);
                for tick in 0..600_u64 {
                    let motion = ramps.map(|ramp| ramp.at(tick as f64 * 1e-3));
                    let command =
                        JointCommand::of(motion.map(|(q, _)| q), motion.map(|(_, dq)| dq));
                    if !monitor.judge(&command).go {
                        let room = monitor.least_while_braking(&command);
                        brakes += usize::from(room > 3.0 * config.margin);
                        break;
                    }
                }
            }
            brakes
        };
        assert_eq!(brakes_with_room(16), 0);
        assert!(brakes_with_room(4) > 0);
    }
}
