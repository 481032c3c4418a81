//! Braking of drives that receive no commands.

use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{JOINTS, Joint};

/// Number of ticks without a command after which the drives brake.
const PATIENCE: u64 = 20;
/// Duration of a tick, in s.
const TICK: f64 = 1e-3;

/// Latest command, until its timeout.
pub(crate) struct DriveWatch {
    joints: [Joint; JOINTS],
    command: JointCommand,
    age: u64,
    /// Number of brakings while a joint moved.
    pub braked: u64,
}

impl DriveWatch {
    /// Holds the joints at `q` until the first command.
    pub fn new(joints: [Joint; JOINTS], q: &[f64; JOINTS]) -> Self {
        Self {
            joints,
            command: JointCommand::still(*q),
            age: 0,
            braked: 0,
        }
    }

    /// Returns the command that the drives follow in a tick.
    ///
    /// - `newest`: latest command since the previous tick
    pub fn tick(&mut self, newest: Option<&JointCommand>) -> &JointCommand {
        match newest {
            Some(command) => {
                self.command = *command;
                self.age = 0;
                return &self.command;
            }
            None => self.age += 1,
        }
        if self.age == PATIENCE && self.command.dq.iter().any(|dq| dq.abs() > 1e-3) {
            self.braked += 1;
        }
        for (i, joint) in self.joints.iter().enumerate() {
            let (q, dq) = (&mut self.command.q[i], &mut self.command.dq[i]);
            let before = *dq;
            if self.age >= PATIENCE {
                // A velocity that is not finite becomes 0.
                *dq = if dq.is_finite() {
                    dq.signum() * (dq.abs() - joint.acceleration * TICK).max(0.0)
                } else {
                    0.0
                };
            }
            *q = (*q + 0.5 * (before + *dq) * TICK).clamp(joint.range[0], joint.range[1]);
        }
        &self.command
    }
}

#[cfg(test)]
mod tests {
    use tactnet_catching::Robot;

    use super::*;

    #[test]
    fn drives_go_on_for_a_moment_and_then_stand() {
        let robot = Robot::nominal();
        let joints = *robot.joints();
        let mut watch = DriveWatch::new(joints, &[0.0; JOINTS]);
        let mut command = *watch.tick(None);
        command.q = joints.map(|joint| 0.5 * (joint.range[0] + joint.range[1]));
        command.dq = joints.map(|joint| 0.5 * joint.speed);
        let mut last = *watch.tick(Some(&command));
        for tick in 1..400 {
            let next = *watch.tick(None);
            for (i, joint) in joints.iter().enumerate() {
                assert!((next.dq[i] - last.dq[i]).abs() <= joint.acceleration * 1.001e-3);
                assert!((next.q[i] - last.q[i]).abs() <= joint.speed * 1e-3);
                if tick < 19 {
                    assert_eq!(next.dq[i], command.dq[i]);
                }
            }
            last = next;
        }
        assert_eq!(last.dq, [0.0; JOINTS]);
        assert_eq!(watch.braked, 1);
    }
}
