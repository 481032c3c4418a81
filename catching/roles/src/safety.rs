//! Safety process: monitors the controller's commands for self-collisions.

use tactnet_catching::calibrate::Corrections;
use tactnet_catching::safety::{Bodies, Monitor, MonitorConfig};
use tactnet_catching_packets::packets::{JointCommand, SafetyState};
use tactnet_channel::{Bus, Priority, Start, now_ns};

use crate::channels::{JOINT_COMMAND, SAFETY_STATE};
use crate::latest_value::PATIENCE;
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Joint speed below which a joint counts as standing still, in rad/s and m/s.
const MOVES: f64 = 1e-3;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let corrections = settings.corrections()?;
    let commands = bus.get_port::<JointCommand>(JOINT_COMMAND, Start::Now)?;
    let states = bus.put_port::<SafetyState>(SAFETY_STATE, Priority::RealTime)?;
    let mut watch = SafetyWatch {
        bodies: Bodies::new(corrections.robot().description()),
        corrections,
        monitor: None,
        brakes: 0,
        brakes_in_vain: 0,
        went: true,
    };
    let mut times = Times::at(1000);
    ready();
    while !stopped() {
        let Some(packet) = commands.get(PATIENCE)? else {
            continue;
        };
        let Some(command) = packet.first() else {
            continue;
        };
        let verdict = watch.judge(command);
        states.put_copy(&[verdict])?;
        times.push(verdict.computing_ns);
        // Statistics follow after the verdict is published.
        watch.count(command, &verdict);
    }
    Ok(RoleReport {
        lost: commands.lost(),
        brakes: watch.brakes,
        brakes_in_vain: watch.brakes_in_vain,
        ..times.report()
    })
}

/// Monitor of the commands with its statistics.
struct SafetyWatch {
    corrections: Corrections,
    bodies: Bodies,
    /// Present from the first command on.
    monitor: Option<Monitor>,
    brakes: u64,
    brakes_in_vain: u64,
    /// True if the last command was safe.
    went: bool,
}

impl SafetyWatch {
    /// Returns the verdict on a command; a command with numbers that are not finite is unsafe.
    fn judge(&mut self, command: &JointCommand) -> SafetyState {
        let begun = now_ns();
        let (go, bound, pair) = if is_finite(command) {
            let command = &links(&self.corrections, command);
            // A monitor that starts during a motion takes the current joint states as its starting point.
            let monitor = self.monitor.get_or_insert_with(|| {
                Monitor::new(
                    self.bodies.clone(),
                    *self.corrections.robot().joints(),
                    MonitorConfig::default(),
                    &command.q,
                )
            });
            let ruling = monitor.judge(command);
            (ruling.go, ruling.bound, ruling.pair)
        } else {
            (false, 0.0, 0)
        };
        SafetyState {
            number: command.number,
            command_ns: command.command_ns,
            bound,
            computing_ns: now_ns() - begun,
            pair: pair as u32,
            go: u32::from(go),
        }
    }

    /// Counts transitions to unsafe commands while the robot moves.
    fn count(&mut self, command: &JointCommand, verdict: &SafetyState) {
        let moves = command.dq.iter().any(|dq| dq.abs() > MOVES);
        if self.went && verdict.go == 0 && moves && is_finite(command) {
            self.brakes += 1;
            if let Some(monitor) = &self.monitor {
                let least = monitor.least_while_braking(&links(&self.corrections, command));
                self.brakes_in_vain += u64::from(least >= monitor.config().margin);
            }
        }
        self.went = verdict.go == 1;
    }
}

fn is_finite(command: &JointCommand) -> bool {
    let mut numbers = command.q.iter().chain(&command.dq);
    numbers.all(|number| number.is_finite())
}

/// Returns the command with joint angles converted to link angles.
fn links(corrections: &Corrections, command: &JointCommand) -> JointCommand {
    JointCommand {
        q: corrections.links(&command.q),
        ..*command
    }
}
