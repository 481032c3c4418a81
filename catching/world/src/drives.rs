//! Drives of the joints: stiff servos with delay and limits.
//!
//! `ddq = a_c + w^2 (q_c - q) + 2 w (dq_c - dq)`, critically damped and constant over a substep. `a_c` is the change
//! of the commanded velocity since the last tick. The acceleration is clipped so that the limits of acceleration,
//! speed and range hold: a joint always can stop before the end of its range.

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{JOINTS, Joint};

use crate::error::{WorldError, from_to};

/// Factor by which accelerations may exceed the description, so that a motion at the limit can be tracked.
pub const ACCELERATION_HEADROOM: f64 = 1.05;
/// Time between two commands, in s.
pub(crate) const TICK: f64 = 1e-3;

tactnet_catching_packets::settings! {
    /// Settings of the drives.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct DrivesConfig in "drives.": WorldError {
        /// Delay from a command to its effect, in s; rounded to ms.
        pub latency: f64 = 0.003 => from_to([0.0, 1.0], "seconds, 0 to 1"),
        /// Natural frequency of the servo, in Hz.
        pub bandwidth: f64 = 60.0 => from_to([f64::MIN_POSITIVE, 200.0], "more than 0 and at most 200 Hz, which substeps resolve"),
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Drives {
    limits: [Joint; JOINTS],
    /// Natural frequency, in rad/s.
    bandwidth: f64,
    /// Ring of delayed commands, oldest at `next`. `None` stands for a missing or invalid command.
    waiting: Vec<Option<JointCommand>>,
    next: usize,
    target: JointCommand,
    /// Commanded acceleration, in rad/s^2.
    feed: [f64; JOINTS],
    /// Time since the target took effect, in s.
    since: f64,
    /// Number of commands with values that are not finite.
    pub(crate) ignored: u64,
    /// Positions, in rad or m.
    pub(crate) q: [f64; JOINTS],
    /// Velocities, in rad/s or m/s.
    pub(crate) dq: [f64; JOINTS],
}

impl Drives {
    /// Creates drives at rest at `start`, which must be within all ranges.
    pub(crate) fn new(
        limits: [Joint; JOINTS],
        config: &DrivesConfig,
        start: [f64; JOINTS],
    ) -> Self {
        Self {
            limits,
            bandwidth: config.bandwidth * std::f64::consts::TAU,
            waiting: vec![None; (config.latency / TICK).round() as usize],
            next: 0,
            target: JointCommand::still(start),
            feed: [0.0; JOINTS],
            since: 0.0,
            ignored: 0,
            q: start,
            dq: [0.0; JOINTS],
        }
    }

    /// Takes the command of the next millisecond. A command with a value that is not finite is ignored and counted.
    pub(crate) fn receive(&mut self, command: &JointCommand) {
        let usable = command.q.iter().chain(&command.dq).all(|x| x.is_finite());
        let mut target = usable.then(|| JointCommand {
            q: std::array::from_fn(|i| {
                command.q[i].clamp(self.limits[i].range[0], self.limits[i].range[1])
            }),
            dq: std::array::from_fn(|i| {
                command.dq[i].clamp(-self.limits[i].speed, self.limits[i].speed)
            }),
            ..*command
        });
        self.ignored += u64::from(!usable);
        if !self.waiting.is_empty() {
            std::mem::swap(&mut target, &mut self.waiting[self.next]);
            self.next = (self.next + 1) % self.waiting.len();
        }
        if let Some(target) = target {
            // After a tick without a command, the joint holds its position.
            let steady = self.since < 1.5 * TICK;
            self.feed = std::array::from_fn(|i| {
                if steady {
                    (target.dq[i] - self.target.dq[i]) / TICK
                } else {
                    0.0
                }
            });
            self.target = target;
            self.since = 0.0;
        }
    }

    /// Advances by `h` seconds and returns the accelerations, which are constant over the step.
    pub(crate) fn advance(&mut self, h: f64) -> [f64; JOINTS] {
        // A command gives the position and velocity for now. Without a further one, the joint stops after a tick.
        let ahead = self.since.min(TICK);
        let going = f64::from(self.since < TICK - 0.5 * h);
        self.since += h;
        std::array::from_fn(|i| {
            let rate = (self.target.dq[i] + self.feed[i] * ahead) * going;
            let place = self.target.q[i] + (self.target.dq[i] + self.feed[i] * ahead / 2.0) * ahead;
            let wanted = self.feed[i] * going
                + self.bandwidth * self.bandwidth * (place - self.q[i])
                + 2.0 * self.bandwidth * (rate - self.dq[i]);
            let a = allowed(&self.limits[i], self.q[i], self.dq[i], wanted, h);
            self.q[i] += (self.dq[i] + 0.5 * a * h) * h;
            self.dq[i] += a * h;
            a
        })
    }
}

/// Returns the acceleration closest to `wanted` that respects all limits now and later.
fn allowed(joint: &Joint, q: f64, dq: f64, wanted: f64, h: f64) -> f64 {
    let most = joint.acceleration * ACCELERATION_HEADROOM;
    let next = dq + wanted.clamp(-most, most) * h;
    let next = next
        .max(-fastest(q - joint.range[0], -dq, most, h))
        .min(fastest(joint.range[1] - q, dq, most, h));
    let next = next.clamp(-joint.speed, joint.speed);
    ((next - dq) / h).clamp(-most, most)
}

/// Returns the maximum speed towards the end of a range, after a step of length `h`, from which a joint can still
/// stop.
///
/// From `(v + w) h / 2 + w^2 / (2 a) <= room`, minus the overshoot `a h^2 / 8` of a joint that stops within a step.
fn fastest(room: f64, speed: f64, most: f64, h: f64) -> f64 {
    let room = room - most * h * h / 8.0 - speed * h / 2.0;
    if room <= 0.0 {
        return 2.0 * room / h;
    }
    let half = most * h / 2.0;
    (half * half + 2.0 * most * room).sqrt() - half
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tactnet_catching_packets::RobotDescription;

    const H: f64 = 5e-4;

    fn any_number() -> impl Strategy<Value = f64> {
        prop_oneof![
            6 => -4.0..4.0f64,
            1 => proptest::num::f64::ANY,
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn limits_are_kept_whatever_is_commanded(
            commands in proptest::collection::vec((any_number(), any_number(), 1..200usize), 1..20),
        ) {
            let limits = RobotDescription::nominal().joints();
            let mut drives = Drives::new(limits, &DrivesConfig::default(), [0.0; JOINTS]);
            for (q, dq, ticks) in commands {
                for _ in 0..ticks {
                    drives.receive(&JointCommand::of([q; JOINTS], [dq; JOINTS]));
                    for _ in 0..2 {
                        let a = drives.advance(H);
                        for (i, joint) in limits.iter().enumerate() {
                            let most = joint.acceleration * ACCELERATION_HEADROOM;
                            // Rounding errors.
                            prop_assert!(a[i].abs() <= most * (1.0 + 1e-12));
                            prop_assert!(drives.dq[i].abs() <= joint.speed * (1.0 + 1e-12));
                            prop_assert!(drives.q[i] >= joint.range[0] - 1e-12, "{i} {}", drives.q[i]);
                            prop_assert!(drives.q[i] <= joint.range[1] + 1e-12, "{i} {}", drives.q[i]);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_command_takes_effect_after_the_latency() {
        let limits = RobotDescription::nominal().joints();
        let mut drives = Drives::new(limits, &DrivesConfig::default(), [0.0; JOINTS]);
        let moved: Vec<bool> = (0..6)
            .map(|_| {
                drives.receive(&JointCommand::still([0.1; JOINTS]));
                drives.advance(TICK);
                drives.q[0] > 0.0
            })
            .collect();
        assert_eq!(moved, [false, false, false, true, true, true]);
    }

    #[test]
    fn a_ramp_at_the_limits_is_followed_to_half_a_milliradian() {
        let limits = RobotDescription::nominal().joints();
        let config = DrivesConfig {
            latency: 0.0,
            ..DrivesConfig::default()
        };
        let mut drives = Drives::new(limits, &config, [0.0; JOINTS]);
        for tick in 0..600 {
            let t = f64::from(tick) * TICK;
            let ramp = |joint: &Joint, t: f64| {
                let up = joint.speed / joint.acceleration;
                let end = up + 0.3;
                let sped = t.min(up).powi(2) * joint.acceleration / 2.0;
                let run = (t - up).clamp(0.0, end - 2.0 * up) * joint.speed;
                let slowed = (t - end + up).clamp(0.0, up);
                let q = sped + run + slowed * (joint.speed - slowed * joint.acceleration / 2.0);
                let dq = (t * joint.acceleration)
                    .min((end - t) * joint.acceleration)
                    .clamp(0.0, joint.speed);
                (q, dq)
            };
            // Arms only; the other joints take longer to reach their speed.
            let arm = 6..20;
            let mut now = JointCommand::still([0.0; JOINTS]);
            for i in arm.clone() {
                (now.q[i], now.dq[i]) = ramp(&limits[i], t);
            }
            drives.receive(&now);
            drives.advance(H);
            drives.advance(H);
            for i in arm {
                let off = drives.q[i] - ramp(&limits[i], t + TICK).0;
                // Accelerations are known a tick late, and the headroom of 5 % makes up for it.
                assert!(off.abs() < 5e-4, "{i} at {t}: {off}");
            }
        }
    }

    #[test]
    fn what_is_no_number_is_counted_and_changes_nothing() {
        let limits = RobotDescription::nominal().joints();
        let mut drives = Drives::new(limits, &DrivesConfig::default(), [0.0; JOINTS]);
        for bad in [f64::NAN, f64::INFINITY] {
            let mut q = [0.5; JOINTS];
            q[7] = bad;
            drives.receive(&JointCommand::still(q));
            drives.advance(TICK);
        }
        for _ in 0..10 {
            drives.receive(&JointCommand::still([0.0; JOINTS]));
            drives.advance(TICK);
        }
        assert_eq!(drives.ignored, 2);
        assert_eq!(drives.q, [0.0; JOINTS]);
    }
}
