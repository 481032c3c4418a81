//! The monitor as a step function: a verdict on each joint command, and statistics of its stops.

use bytemuck::Zeroable;
use tactnet_catching_packets::packets::{JointCommand, SafetyState};

use super::bodies::{Bodies, PAIRS};
use super::monitor::{Monitor, MonitorConfig};
use crate::calibrate::Corrections;

/// Joint speed below which a joint counts as standing still, in rad/s and m/s.
const MOVES: f64 = 1e-3;

/// Monitor of the controller's commands.
#[derive(Debug, Clone)]
pub struct SafetyWatch {
    corrections: Corrections,
    bodies: Bodies,
    /// Present from the first command on.
    monitor: Option<Box<Monitor>>,
    /// Number of stops while the robot moved.
    pub brakes: u64,
    /// Number of those stops after which the bodies would not have touched.
    pub brakes_in_vain: u64,
    /// True if the last command was safe.
    went: bool,
}

impl SafetyWatch {
    /// Creates a monitor that starts with the first command, even during a motion.
    pub fn new(corrections: Corrections) -> Self {
        Self {
            bodies: Bodies::new(corrections.robot().description()),
            corrections,
            monitor: None,
            brakes: 0,
            brakes_in_vain: 0,
            went: true,
        }
    }

    /// Returns the verdict on a command, with a computing time of 0. A command with numbers that are not finite is
    /// unsafe.
    pub fn step(&mut self, command: &JointCommand) -> SafetyState {
        let mut verdict = SafetyState::zeroed();
        (verdict.number, verdict.command_ns) = (command.number, command.command_ns);
        if is_finite(command) {
            let command = &self.links(command);
            let robot = self.corrections.robot();
            let monitor = self.monitor.get_or_insert_with(|| {
                let (bodies, config) = (self.bodies.clone(), MonitorConfig::default());
                Box::new(Monitor::new(bodies, *robot.joints(), config, &command.q))
            });
            let ruling = monitor.judge(command);
            verdict.bound = ruling.bound;
            verdict.pair = ruling.pair as u32;
            verdict.go = u32::from(ruling.go);
        }
        verdict
    }

    /// Counts stops of a moving robot. This takes milliseconds, so call it after the verdict is published.
    pub fn count(&mut self, command: &JointCommand, verdict: &SafetyState) {
        let moves = command.dq.iter().any(|dq| dq.abs() > MOVES);
        if self.went && verdict.go == 0 && moves && is_finite(command) {
            self.brakes += 1;
            let in_vain = self.least_while_braking(command) >= MonitorConfig::default().margin;
            self.brakes_in_vain += u64::from(in_vain);
        }
        self.went = verdict.go == 1;
    }

    /// Returns the minimum distance of all bodies from a command until the robot has braked, in m. Takes milliseconds.
    pub fn least_while_braking(&self, command: &JointCommand) -> f64 {
        let monitor = self.monitor.as_ref();
        monitor.map_or(0.0, |monitor| {
            monitor.least_while_braking(&self.links(command))
        })
    }

    /// Returns the minimum distance of all bodies at the commanded positions, in m.
    pub fn least(&self, command: &JointCommand) -> f64 {
        self.bodies.least(&self.corrections.links(&command.q))
    }

    /// Returns the names of the bodies of a verdict.
    pub fn bodies(&self, verdict: &SafetyState) -> [&'static str; 2] {
        self.bodies.names(verdict.pair as usize % PAIRS)
    }

    /// Returns the command with joint angles converted to link angles.
    fn links(&self, command: &JointCommand) -> JointCommand {
        JointCommand {
            q: self.corrections.links(&command.q),
            ..*command
        }
    }
}

fn is_finite(command: &JointCommand) -> bool {
    let mut numbers = command.q.iter().chain(&command.dq);
    numbers.all(|number| number.is_finite())
}

#[cfg(test)]
mod tests {
    use tactnet_catching_packets::{JOINTS, joint};

    use super::*;
    use crate::robot::Robot;

    /// The left arm's first joints move it across the body.
    #[test]
    fn a_motion_that_would_touch_is_stopped_and_counted_once_and_rest_is_safe() {
        let robot = Robot::nominal();
        let own = joint::ARM[0].start;
        let stops = [-1.7, 1.7].map(|speed| {
            let mut watch = SafetyWatch::new(Corrections::new(&robot, None));
            let mut command = JointCommand::still(robot.waiting());
            (command.number, command.command_ns) = (7, 3);
            let rest = watch.step(&command);
            watch.count(&command, &rest);
            assert_eq!((rest.go, rest.number, rest.command_ns), (1, 7, 3));
            (command.dq[own], command.dq[own + 1]) = (speed, 1.7);
            let mut stopped = 0;
            for _ in 0..2000 {
                let verdict = watch.step(&command);
                watch.count(&command, &verdict);
                stopped += 1 - verdict.go;
                if stopped == 3 {
                    break;
                }
                command.q[own] += 1e-3 * speed;
                command.q[own + 1] += 1e-3 * 1.7;
            }
            (stopped, watch.brakes)
        });
        assert!(stops.contains(&(3, 1)), "{stops:?}");
    }

    #[test]
    fn a_command_that_is_not_finite_is_unsafe_and_no_stop() {
        let robot = Robot::nominal();
        let mut watch = SafetyWatch::new(Corrections::new(&robot, None));
        let command = JointCommand::of([f64::NAN; JOINTS], [1.0; JOINTS]);
        let verdict = watch.step(&command);
        watch.count(&command, &verdict);
        assert_eq!((verdict.go, watch.brakes), (0, 0));
    }
}
