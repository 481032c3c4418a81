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

    /// The least distance of all pairs while joints brake, looked at often.
    fn least(monitor: &Monitor, command: &JointCommand) -> f64 {
        let intervals = monitor.intervals(command);
        let mut least = f64::INFINITY;
        for sample in 0..=20 {
            // All joints from where they are to where they stop, each at its own pace.
            let q = std::array::from_fn(|i| {
                let Interval { low, high } = intervals[i];
                let share = f64::from(sample) / 20.0;
                if command.dq[i] < 0.0 {
                    high + share * (low - high)
                } else {
                    low + share * (high - low)
                }
            });
            for pair in 0..PAIRS {
                let [a, b] = monitor.bodies().placed(pair, &q);
                least = least.min(distance(&a, &b));
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
                assert!(least(&monitor, &now) >= ruling.bound - 1e-9);
                at[6] += 1e-3 * dq[6];
                at[7] += 1e-3 * dq[7];
            }
        }
        assert!(stopped, "an arm that goes on turning comes to the body");
    }
}
