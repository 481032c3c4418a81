//! Coordinator process: the step function of the stack on its channels.

use std::time::Duration;

use tactnet_catching::coordinate::{Coordinator, CoordinatorInputs, CoordinatorOutputs};
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, BodyPath, CatchStatus, ControllerCommand, ControllerState,
    CoordinatorStep, Gaze, HandCommand, HeadPose, JointState, PlanRequest, PlanResult,
};
use tactnet_channel::{Bus, GetPort, Packet, Priority, PutPort, Start, SyncGroup, Wait, now_ns};

use crate::channels::{
    ARM_PATH, BODY_PATH, CATCH_STATE, CONTROLLER_COMMAND, CONTROLLER_STATE, COORDINATOR_STEP,
    HAND_COMMAND, HEAD_GAZE, HEAD_POSE, JOINT_STATE, PLAN_REQUEST, PLAN_RESULT, PREDICTION,
};
use crate::latest_value::{LatestValue, drain};
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Maximum sleep, which bounds the reaction time to closing times and phase changes.
const BEAT: Wait = Wait::Block {
    timeout: Duration::from_millis(2),
};
/// Maximum number of waiting results that are taken without allocation.
const RESULTS: usize = 16;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let mut coordinator = settings.new_coordinator()?;
    let mut ports = CoordinatorPorts::open(bus)?;
    let mut group = ports.group(bus)?;
    let mut times = Times::at(25);
    ready();
    while !stopped() {
        group.wait(BEAT)?;
        let begun = now_ns();
        if ports.step(&mut coordinator, begun)? {
            times.push(now_ns() - begun);
        }
    }
    Ok(RoleReport {
        lost: ports.predictions.lost() + ports.results.lost() + ports.controller.lost(),
        ..times.report()
    })
}

/// Channels of the coordinator.
pub struct CoordinatorPorts {
    joints: LatestValue<JointState>,
    head: LatestValue<HeadPose>,
    controller: GetPort<ControllerState>,
    state: Option<ControllerState>,
    predictions: GetPort<BallPredictions>,
    results: GetPort<PlanResult>,
    arrived: Vec<PlanResult>,
    steps: PutPort<CoordinatorStep>,
    requests: PutPort<PlanRequest>,
    paths: PutPort<ArmPath>,
    body: PutPort<BodyPath>,
    gaze: PutPort<Gaze>,
    hands: PutPort<HandCommand>,
    orders: PutPort<ControllerCommand>,
    status: PutPort<CatchStatus>,
}

impl CoordinatorPorts {
    /// Opens all channels.
    ///
    /// # Errors
    /// Missing or broken channels.
    pub fn open(bus: &Bus) -> Result<Self, RoleError> {
        Ok(Self {
            joints: LatestValue::open(bus, JOINT_STATE)?,
            head: LatestValue::open(bus, HEAD_POSE)?,
            controller: bus.get_port(CONTROLLER_STATE, Start::Now)?,
            state: None,
            predictions: bus.get_port(PREDICTION, Start::Now)?,
            results: bus.get_port(PLAN_RESULT, Start::Now)?,
            arrived: Vec::with_capacity(RESULTS),
            steps: bus.put_port(COORDINATOR_STEP, Priority::Normal)?,
            requests: bus.put_port(PLAN_REQUEST, Priority::High)?,
            paths: bus.put_port(ARM_PATH, Priority::High)?,
            body: bus.put_port(BODY_PATH, Priority::High)?,
            gaze: bus.put_port(HEAD_GAZE, Priority::High)?,
            hands: bus.put_port(HAND_COMMAND, Priority::High)?,
            orders: bus.put_port(CONTROLLER_COMMAND, Priority::High)?,
            status: bus.put_port(CATCH_STATE, Priority::Normal)?,
        })
    }

    fn group(&self, bus: &Bus) -> Result<SyncGroup, RoleError> {
        Ok(bus.sync_group(&[&self.predictions, &self.results, &self.controller])?)
    }

    /// Takes all waiting packets, performs a step, and sends its packets. Returns true if there were predictions.
    ///
    /// # Errors
    /// Broken channels.
    pub fn step(&mut self, coordinator: &mut Coordinator, now_ns: u64) -> Result<bool, RoleError> {
        self.joints.look()?;
        self.head.look()?;
        drain(&self.controller, |state| self.state = Some(*state))?;
        let mut predictions = None;
        drain(&self.predictions, |packet| predictions = Some(*packet))?;
        self.arrived.clear();
        drain(&self.results, |result| self.arrived.push(*result))?;
        let inputs = CoordinatorInputs {
            joints: self.joints.get(),
            head: self.head.get(),
            controller: self.state.as_ref(),
            predictions: predictions.as_ref(),
            results: &self.arrived,
        };
        self.steps.put_copy(&[inputs.stamps(now_ns)])?;
        let outputs = coordinator.step(now_ns, &inputs);
        self.put(&outputs)?;
        Ok(predictions.is_some())
    }

    fn put(&self, outputs: &CoordinatorOutputs) -> Result<(), RoleError> {
        send(&self.requests, outputs.requests)?;
        send(&self.paths, outputs.paths)?;
        send(&self.body, [outputs.body])?;
        send(&self.gaze, [outputs.gaze])?;
        send(&self.hands, outputs.hands)?;
        send(&self.orders, [outputs.order])?;
        send(&self.status, [outputs.status])
    }
}

fn send<T: Packet + Copy, const MOST: usize>(
    port: &PutPort<T>,
    packets: [Option<T>; MOST],
) -> Result<(), RoleError> {
    for packet in packets.into_iter().flatten() {
        port.put_copy(&[packet])?;
    }
    Ok(())
}
