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
    let robot = corrections.robot();
    let commands = bus.get_port::<JointCommand>(JOINT_COMMAND, Start::Now)?;
    let states = bus.put_port::<SafetyState>(SAFETY_STATE, Priority::RealTime)?;
    let bodies = Bodies::new(robot.description());
    let mut monitor: Option<Monitor> = None;
    let mut times = Times::at(1000);
    let (mut brakes, mut brakes_in_vain, mut went) = (0, 0, true);
    ready();
    while !stopped() {
        let Some(packet) = commands.get(PATIENCE)? else {
            continue;
        };
        let Some(command) = packet.first() else {
            continue;
        };
        let begun = now_ns();
        let finite = command
            .q
            .iter()
            .chain(&command.dq)
            .all(|number| number.is_finite());
        let state = |go: bool, bound: f64, pair: usize| SafetyState {
            number: command.number,
            command_ns: command.command_ns,
            bound,
            computing_ns: now_ns() - begun,
            pair: pair as u32,
            go: u32::from(go),
        };
        let said = if finite {
            let command = &links(&corrections, command);
            // A monitor that starts during a motion takes the current joint states as its starting point.
            let monitor = monitor.get_or_insert_with(|| {
                Monitor::new(
                    bodies.clone(),
                    *robot.joints(),
                    MonitorConfig::default(),
                    &command.q,
                )
            });
            let ruling = monitor.judge(command);
            state(ruling.go, ruling.bound, ruling.pair)
        } else {
            state(false, 0.0, 0)
        };
        states.put_copy(&[said])?;
        times.push(said.computing_ns);
        // Statistics follow after the verdict is published.
        let moves = command.dq.iter().any(|dq| dq.abs() > MOVES);
        if went && said.go == 0 && moves && finite {
            brakes += 1;
            if let Some(monitor) = &monitor {
                let least = monitor.least_while_braking(&links(&corrections, command));
                brakes_in_vain += u64::from(least >= monitor.config().margin);
            }
        }
        went = said.go == 1;
    }
    Ok(RoleReport {
        lost: commands.lost(),
        brakes,
        brakes_in_vain,
        ..times.report()
    })
}

/// Returns the command with joint angles converted to link angles.
fn links(corrections: &Corrections, command: &JointCommand) -> JointCommand {
    JointCommand {
        q: corrections.links(&command.q),
        ..*command
    }
}
