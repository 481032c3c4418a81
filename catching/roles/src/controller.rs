//! Control loop at 1 kHz: turns paths into joint commands.

use tactnet_catching::calibrate::Corrections;
use tactnet_catching::control::Controller;
use tactnet_catching::safety::{Bodies, PAIRS};
use tactnet_catching_packets::JOINTS;
use tactnet_catching_packets::packets::{
    ArmPath, BodyPath, ControllerCommand, ControllerMode, ControllerOrder, ControllerState, Gaze,
    JointCommand, JointState, SafetyState, ThrowPath,
};
use tactnet_channel::{Bus, GetPort, Priority, PutPort, Start, Ticker, now_ns};

use crate::channels::{
    ARM_PATH, BODY_PATH, CONTROLLER_COMMAND, CONTROLLER_STATE, HEAD_GAZE, JOINT_COMMAND,
    JOINT_STATE, SAFETY_STATE, THROW_PATH,
};
use crate::latest_value::{LatestValue, PATIENCE, drain};
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
    let mut ports = Ports::open(bus)?;
    ready();
    let Some(first) = ports.first_joints(stopped)? else {
        return Ok(RoleReport::default());
    };
    let ahead_ns = (settings.drives * 1e9) as u64;
    let mut ticker = Ticker::aligned(1000.0, 0);
    let mut task = ControllerTask {
        bodies: Bodies::new(corrections.robot().description()),
        controller: begin(&corrections, &first.q),
        sample: first.number,
        corrections: &corrections,
        settings,
        begun_ns: now_ns(),
        number: 0,
    };
    let mut times = Times::at(1000);
    let (mut slowest_ns, mut last_mode) = (0, None);
    while !stopped() {
        let beat_ns = ticker.next_ns();
        ticker.wait();
        let mut changed = task.take_packets(&mut ports, beat_ns + ahead_ns)?;
        let command = task.command(beat_ns, beat_ns + ahead_ns);
        ports.commands.put_copy(&[command])?;
        let taken = now_ns().saturating_sub(beat_ns);
        times.push(taken);
        slowest_ns = slowest_ns.max(taken);
        changed |= last_mode != Some(task.controller.mode());
        last_mode = Some(task.controller.mode());
        if changed || task.number.is_multiple_of(STATE_EVERY) {
            let mut state = task.controller.state(beat_ns);
            state.loop_ns = std::mem::take(&mut slowest_ns);
            ports.states.put_copy(&[state])?;
        }
    }
    Ok(RoleReport {
        lost: ports.paths.lost() + ports.throws.lost() + ports.orders.lost(),
        ..times.report()
    })
}

struct Ports {
    paths: GetPort<ArmPath>,
    body_paths: GetPort<BodyPath>,
    throws: GetPort<ThrowPath>,
    gazes: GetPort<Gaze>,
    orders: GetPort<ControllerCommand>,
    joints: GetPort<JointState>,
    verdict: LatestValue<SafetyState>,
    commands: PutPort<JointCommand>,
    states: PutPort<ControllerState>,
}

impl Ports {
    fn open(bus: &Bus) -> Result<Self, RoleError> {
        Ok(Self {
            paths: bus.get_port(ARM_PATH, Start::Now)?,
            body_paths: bus.get_port(BODY_PATH, Start::Now)?,
            throws: bus.get_port(THROW_PATH, Start::Now)?,
            gazes: bus.get_port(HEAD_GAZE, Start::Now)?,
            orders: bus.get_port(CONTROLLER_COMMAND, Start::Now)?,
            joints: bus.get_port(JOINT_STATE, Start::Now)?,
            verdict: LatestValue::open(bus, SAFETY_STATE)?,
            commands: bus.put_port(JOINT_COMMAND, Priority::RealTime)?,
            states: bus.put_port(CONTROLLER_STATE, Priority::High)?,
        })
    }

    /// Waits for the measured joint positions; returns `None` if stopped before.
    fn first_joints(&self, stopped: &dyn Fn() -> bool) -> Result<Option<JointState>, RoleError> {
        while !stopped() {
            if let Some(packet) = self.joints.get(PATIENCE)?
                && let Some(state) = packet.first().filter(|state| is_finite(state))
            {
                return Ok(Some(*state));
            }
        }
        Ok(None)
    }
}

struct ControllerTask<'a> {
    corrections: &'a Corrections,
    settings: &'a RoleSettings,
    bodies: Bodies,
    controller: Controller,
    begun_ns: u64,
    /// Number of the last joint state.
    sample: u64,
    /// Number of commands.
    number: u64,
}

impl ControllerTask<'_> {
    /// Takes all waiting packets. Returns true if there were paths of arms or throws.
    fn take_packets(&mut self, ports: &mut Ports, effect_ns: u64) -> Result<bool, RoleError> {
        self.take_joints(ports)?;
        ports.verdict.look()?;
        let silent = self.is_monitor_silent(&ports.verdict);
        let controller = &mut self.controller;
        drain(&ports.orders, |order| match order.order() {
            Some(ControllerOrder::Brake) => controller.brake(order.reason.as_str()),
            // The robot moves only while the safety monitor is alive.
            Some(ControllerOrder::GoBack) if !silent => controller.go_back(),
            _ => {}
        })?;
        let mut came = false;
        drain(&ports.paths, |path| {
            // The state packet reports a refusal.
            let _ = controller.arm_path(effect_ns, path);
            came = true;
        })?;
        drain(&ports.throws, |path| {
            let _ = controller.throw_path(effect_ns, path);
            came = true;
        })?;
        drain(&ports.body_paths, |path| {
            controller.body_path(path);
        })?;
        drain(&ports.gazes, |gaze| controller.gaze(effect_ns, gaze))?;
        self.obey_monitor(silent, ports.verdict.get());
        Ok(came)
    }

    /// Restarts the controller if restarted drives may be at other positions.
    fn take_joints(&mut self, ports: &Ports) -> Result<(), RoleError> {
        while let Some(packet) = ports.joints.try_get()? {
            let Some(state) = packet.first() else {
                continue;
            };
            if state.number < self.sample && is_finite(state) {
                self.controller = begin(self.corrections, &state.q);
            }
            self.sample = state.number;
        }
        Ok(())
    }

    fn is_monitor_silent(&self, verdict: &LatestValue<SafetyState>) -> bool {
        let patience_ns = (self.settings.safety_patience * 1e9) as u64;
        now_ns().saturating_sub(verdict.put_ns().max(self.begun_ns)) > patience_ns
    }

    /// Brakes if the safety monitor is silent or demands it.
    fn obey_monitor(&mut self, silent: bool, verdict: Option<&SafetyState>) {
        let controller = &mut self.controller;
        if silent {
            controller.brake("the monitor of self-collisions is silent");
        } else if let Some(verdict) = verdict.filter(|verdict| {
            self.settings.brakes && verdict.go == 0 && verdict.number + 50 > self.number
        }) && matches!(
            controller.mode(),
            ControllerMode::Following | ControllerMode::GoingBack | ControllerMode::Throwing
        ) {
            let [a, b] = self.bodies.names(verdict.pair as usize % PAIRS);
            controller.brake(&format!("{a} and {b} would come too near"));
        }
    }

    /// Returns the next command to the joints.
    fn command(&mut self, beat_ns: u64, effect_ns: u64) -> JointCommand {
        let (q, dq) = self.controller.tick(effect_ns);
        self.number += 1;
        self.corrections.command(&JointCommand {
            number: self.number,
            command_ns: beat_ns,
            q: *q,
            dq: *dq,
        })
    }
}

/// Returns a controller that starts from measured joint positions.
fn begin(corrections: &Corrections, q: &[f64; JOINTS]) -> Controller {
    let robot = corrections.robot().clone();
    Controller::new(robot, *corrections.waiting(), &corrections.links(q))
}

fn is_finite(state: &JointState) -> bool {
    state.q.iter().all(|q| q.is_finite())
}
