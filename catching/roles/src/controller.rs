//! Control loop at 1 kHz: turns paths into joint commands.

use tactnet_catching::control::Controller;
use tactnet_catching::safety::Bodies;
use tactnet_catching_packets::JOINTS;
use tactnet_catching_packets::packets::{
    ArmPath, BodyPath, ControllerCommand, ControllerMode, ControllerOrder, ControllerState, Gaze,
    JointCommand, JointState, SafetyState, ThrowPath,
};
use tactnet_channel::{Bus, Priority, Start, Ticker, now_ns};

use crate::channels::{
    ARM_PATH, BODY_PATH, CONTROLLER_COMMAND, CONTROLLER_STATE, HEAD_GAZE, JOINT_COMMAND,
    JOINT_STATE, SAFETY_STATE, THROW_PATH,
};
use crate::latest_value::{LatestValue, PATIENCE};
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Number of cycles between state packets while the state does not change.
const STATE_EVERY: u64 = 20;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let corrections = settings.corrections()?;
    let robot = corrections.robot();
    let begin = |q: &[f64; JOINTS]| {
        Controller::new(robot.clone(), *corrections.waiting(), &corrections.links(q))
    };
    let bodies = Bodies::new(robot.description());
    let paths = bus.get_port::<ArmPath>(ARM_PATH, Start::Now)?;
    let body_paths = bus.get_port::<BodyPath>(BODY_PATH, Start::Now)?;
    let throws = bus.get_port::<ThrowPath>(THROW_PATH, Start::Now)?;
    let gazes = bus.get_port::<Gaze>(HEAD_GAZE, Start::Now)?;
    let orders = bus.get_port::<ControllerCommand>(CONTROLLER_COMMAND, Start::Now)?;
    let joints = bus.get_port::<JointState>(JOINT_STATE, Start::Now)?;
    let mut word = LatestValue::<SafetyState>::open(bus, SAFETY_STATE)?;
    let commands = bus.put_port::<JointCommand>(JOINT_COMMAND, Priority::RealTime)?;
    let states = bus.put_port::<ControllerState>(CONTROLLER_STATE, Priority::High)?;
    ready();
    // The controller starts from the measured joint positions.
    let first = loop {
        if stopped() {
            return Ok(RoleReport::default());
        }
        if let Some(packet) = joints.get(PATIENCE)?
            && let Some(state) = packet
                .first()
                .filter(|state| state.q.iter().all(|q| q.is_finite()))
        {
            break *state;
        }
    };
    let mut controller = begin(&first.q);
    let (ahead_ns, patience_ns) = (
        (settings.drives * 1e9) as u64,
        (settings.safety_patience * 1e9) as u64,
    );
    let mut ticker = Ticker::aligned(1000.0, 0);
    let begun_ns = now_ns();
    let mut times = Times::at(1000);
    let (mut number, mut slowest_ns, mut last_mode) = (0, 0, None);
    let mut sample = first.number;
    while !stopped() {
        let beat_ns = ticker.next_ns();
        ticker.wait();
        let effect_ns = beat_ns + ahead_ns;
        while let Some(packet) = joints.try_get()? {
            let Some(state) = packet.first() else {
                continue;
            };
            // Restarted drives may be at other positions.
            if state.number < sample && state.q.iter().all(|q| q.is_finite()) {
                controller = begin(&state.q);
            }
            sample = state.number;
        }
        word.look()?;
        let silent = now_ns().saturating_sub(word.put_ns().max(begun_ns)) > patience_ns;
        let mut changed = false;
        while let Some(packet) = orders.try_get()? {
            for order in packet.iter() {
                match order.order() {
                    Some(ControllerOrder::Brake) => controller.brake(order.reason.as_str()),
                    // The robot moves only while the safety monitor is alive.
                    Some(ControllerOrder::GoBack) if !silent => controller.go_back(),
                    _ => {}
                }
            }
        }
        while let Some(packet) = paths.try_get()? {
            for path in packet.iter() {
                // The state packet reports a refusal.
                let _ = controller.arm_path(effect_ns, path);
                changed = true;
            }
        }
        while let Some(packet) = throws.try_get()? {
            for path in packet.iter() {
                let _ = controller.throw_path(effect_ns, path);
                changed = true;
            }
        }
        while let Some(packet) = body_paths.try_get()? {
            packet.iter().for_each(|path| {
                controller.body_path(path);
            });
        }
        while let Some(packet) = gazes.try_get()? {
            packet
                .iter()
                .for_each(|gaze| controller.gaze(effect_ns, gaze));
        }
        if silent {
            controller.brake("the monitor of self-collisions is silent");
        } else if let Some(word) = word
            .get()
            .filter(|word| settings.brakes && word.go == 0 && word.number + 50 > number)
            && matches!(
                controller.mode(),
                ControllerMode::Following | ControllerMode::GoingBack | ControllerMode::Throwing
            )
        {
            let [a, b] = bodies.names(word.pair as usize % tactnet_catching::safety::PAIRS);
            controller.brake(&format!("{a} and {b} would come too near"));
        }
        let (q, dq) = controller.tick(effect_ns);
        number += 1;
        let command = JointCommand {
            number,
            command_ns: beat_ns,
            q: *q,
            dq: *dq,
        };
        commands.put_copy(&[corrections.command(&command)])?;
        let taken = now_ns().saturating_sub(beat_ns);
        times.push(taken);
        slowest_ns = slowest_ns.max(taken);
        changed |= last_mode != Some(controller.mode());
        last_mode = Some(controller.mode());
        if changed || number % STATE_EVERY == 0 {
            let mut state = controller.state(beat_ns);
            state.loop_ns = std::mem::take(&mut slowest_ns);
            states.put_copy(&[state])?;
        }
    }
    Ok(RoleReport {
        lost: paths.lost() + throws.lost() + orders.lost(),
        ..times.report()
    })
}
