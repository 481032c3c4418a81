//! Would the robot touch itself if it braked now? (Thesis, section 3.5.3.)
//!
//! Bodies are convex hulls of points, grown by a radius. Where they may be while joints go through intervals is again such a hull, which
//! holds all of that: a whole braking motion is proved to be free, not samples of it. A table holds a lower bound of the distance of each
//! pair of bodies; every tick computes the least ones anew, and all others lose what they can have approached since, so that a tick takes
//! a bounded time.
//!
//! ```text
//! command ─> intervals of braking ─> bounds of all pairs ─> least ones anew: swept hulls, GJK ─> least bound ─> go or brake
//! ```

mod bodies;
mod gjk;
mod hull;
mod monitor;
mod sweep;

pub use bodies::{BODIES, Bodies, PAIRS};
pub use gjk::distance;
pub use hull::{Hull, MAX_POINTS};
pub use monitor::{Monitor, MonitorConfig, Ruling};
pub use sweep::{Interval, braking};

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tactnet_catching_packets::packets::JointCommand;
    use tactnet_catching_packets::{JOINTS, RobotDescription};

    /// Joint positions and half intervals, shares of ranges and rad.
    fn motion() -> impl Strategy<Value = (Vec<f64>, Vec<f64>, Vec<f64>)> {
        let of = |range: std::ops::Range<f64>| proptest::collection::vec(range, JOINTS);
        (of(0.0..1.0), of(0.0..0.5), of(-1.0..1.0))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// Wherever joints are in their intervals, bodies lie in their swept hulls, and are no nearer to each other than those.
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
                    // A sphere lies in another body if its centre is no farther out than the difference of the radii.
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

    /// Where a joint is `time` after a command, if its drive begins to brake `begun` after it.
    fn at(q: f64, dq: f64, deceleration: f64, begun: f64, time: f64) -> f64 {
        let slowing = (time - begun).clamp(0.0, dq.abs() / deceleration);
        q + dq * (time.min(begun) + slowing) - 0.5 * dq.signum() * deceleration * slowing * slowing
    }

    proptest! {
        /// Whenever drives begin to brake within the reaction, joints are in the intervals of the part of the time.
        #[test]
        fn parts_of_braking_hold_the_motion(
            q in -2.0..2.0f64, dq in -7.0..7.0f64, begun in 0.0..0.01f64, part in 0..8_usize, within in 0.0..1.0f64,
        ) {
            let joint = RobotDescription::nominal().joints()[7];
            let longest = 0.01 + dq.abs() / joint.acceleration;
            let time = [part, part + 1].map(|number| longest * number as f64 / 8.0);
            let interval = sweep::braking_between(q, dq, &joint, 0.01, time);
            let whole = braking(q, dq, &joint, 0.01);
            let moment = time[0] + within * (time[1] - time[0]);
            let place = at(q, dq, joint.acceleration, begun, moment);
            prop_assert!((interval.low - 1e-12..=interval.high + 1e-12).contains(&place));
            prop_assert!(whole.low <= interval.low + 1e-12 && interval.high <= whole.high + 1e-12);
        }
    }

    /// The least distance of all pairs while joints brake, looked at often, if drives begin to brake at once or at the end of the reaction.
    fn least(
        monitor: &Monitor,
        joints: &[tactnet_catching_packets::Joint; JOINTS],
        command: &JointCommand,
    ) -> f64 {
        let reaction = monitor.config().reaction;
        let longest = (0..JOINTS)
            .map(|i| reaction + command.dq[i].abs() / joints[i].acceleration)
            .fold(0.0, f64::max);
        let mut least = f64::INFINITY;
        for begun in [0.0, reaction] {
            for sample in 0..=20 {
                let time = longest * f64::from(sample) / 20.0;
                let q = std::array::from_fn(|i| {
                    at(
                        command.q[i],
                        command.dq[i],
                        joints[i].acceleration,
                        begun,
                        time,
                    )
                });
                for pair in 0..PAIRS {
                    let [a, b] = monitor.bodies().placed(pair, &q);
                    least = least.min(distance(&a, &b));
                }
            }
        }
        least
    }

    #[test]
    fn what_may_go_on_stays_apart_and_what_comes_near_is_braked() {
        let description = RobotDescription::nominal();
        let robot = crate::Robot::new(description.clone());
        let mut q = [0.0; JOINTS];
        for arm in 0..2 {
            q[tactnet_catching_packets::joint::ARM[arm].clone()].copy_from_slice(&robot.ready(arm));
        }
        let bodies = Bodies::new(&description);
        let mut monitor = Monitor::new(bodies, description.joints(), MonitorConfig::default(), &q);
        let command = |q: [f64; JOINTS], dq: [f64; JOINTS]| JointCommand {
            number: 0,
            command_ns: 0,
            q,
            dq,
        };
        assert!(monitor.judge(&command(q, [0.0; JOINTS])).go, "at rest");
        // The left arm's first joints carry it across the body, a tick of a millisecond each time.
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
                assert!(least(&monitor, &description.joints(), &now) >= ruling.bound - 1e-9);
                at[6] += 1e-3 * dq[6];
                at[7] += 1e-3 * dq[7];
            }
        }
        assert!(stopped, "an arm that goes on turning comes to the body");
    }
}
