//! Replay of the coordinator's decisions.

use std::collections::VecDeque;

use tactnet_catching::coordinate::{Coordinator, CoordinatorInputs, CoordinatorOutputs};
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, BodyPath, CatchStatus, ControllerCommand, ControllerOrder,
    ControllerState, CoordinatorStep, Gaze, HandCommand, HeadPose, JointState, PlanRequest,
    PlanResult,
};
use tactnet_channel::Packet;
use tactnet_recording::PlainPacket;

use super::replay::Compared;

/// Number of remembered packets of each input, far more than arrive between two steps.
const REMEMBERED: usize = 64;

/// A coordinator that repeats the recorded steps.
pub(super) struct Decisions {
    coordinator: Coordinator,
    joints: Recent<JointState>,
    heads: Recent<HeadPose>,
    states: Recent<ControllerState>,
    predictions: Recent<BallPredictions>,
    results: [VecDeque<PlanResult>; ARMS],
    /// Outputs of the last step: replayed, if its inputs were recorded, and recorded.
    replayed: Option<CoordinatorOutputs>,
    recorded: CoordinatorOutputs,
    compared: Compared,
}

impl Decisions {
    /// - `coordinator`: coordinator before its first step
    pub fn new(coordinator: Coordinator) -> Self {
        Self {
            coordinator,
            joints: Recent::new(|packet| packet.sensor_ns),
            heads: Recent::new(|packet| packet.t_ns),
            states: Recent::new(|packet| packet.t_ns),
            predictions: Recent::new(|packet| packet.exposure_ns),
            results: Default::default(),
            replayed: None,
            recorded: CoordinatorOutputs::default(),
            compared: Compared::default(),
        }
    }

    /// Takes the next packet of the recording.
    pub fn take(&mut self, channel: &str, packet: &PlainPacket) {
        self.joints.take(packet);
        self.heads.take(packet);
        self.states.take(packet);
        self.predictions.take(packet);
        if let Some(result) = packet.get::<PlanResult>()
            && let Some(results) = self.results.get_mut(result.request.arm as usize)
        {
            results.push_back(result);
        }
        if let Some(step) = packet.get::<CoordinatorStep>() {
            self.compare();
            self.repeat(&step);
        }
        self.take_output(channel, packet);
    }

    fn take_output(&mut self, channel: &str, packet: &PlainPacket) {
        let outputs = &mut self.recorded;
        if let Some(request) = packet.get::<PlanRequest>() {
            let place = outputs.requests.iter_mut().find(|place| place.is_none());
            place.into_iter().for_each(|place| *place = Some(request));
        } else if let Some(path) = packet.get::<ArmPath>() {
            put(&mut outputs.paths, path.arm, path);
        } else if let Some(hand) = packet
            .get::<HandCommand>()
            .filter(|_| channel == "hand/command")
        {
            put(&mut outputs.hands, hand.arm, hand);
        } else if let Some(order) = packet
            .get::<ControllerCommand>()
            .filter(|order| order.order() == Some(ControllerOrder::GoBack))
        {
            outputs.order = Some(order);
        }
        outputs.body = packet.get::<BodyPath>().or(outputs.body);
        outputs.gaze = packet.get::<Gaze>().or(outputs.gaze);
        outputs.status = packet.get::<CatchStatus>().or(outputs.status);
    }

    /// Performs a recorded step if its inputs were recorded.
    fn repeat(&mut self, step: &CoordinatorStep) {
        let mut results = Vec::new();
        for (queue, count) in self.results.iter_mut().zip(step.results) {
            results.extend(queue.drain(..queue.len().min(count as usize)));
        }
        let inputs = CoordinatorInputs {
            joints: self.joints.at(step.joints_ns),
            head: self.heads.at(step.head_ns),
            controller: self.states.at(step.controller_ns),
            predictions: self.predictions.at(step.exposure_ns),
            results: &results,
        };
        if inputs.stamps(step.now_ns) != *step {
            self.compared.alone += 1;
            return;
        }
        self.replayed = Some(self.coordinator.step(step.now_ns, &inputs));
    }

    /// Compares the outputs of the last step. Steps without any are not counted.
    fn compare(&mut self) {
        let recorded = std::mem::take(&mut self.recorded);
        let Some(replayed) = self.replayed.take() else {
            return;
        };
        if replayed != CoordinatorOutputs::default() || recorded != replayed {
            self.compared.answers += 1;
            self.compared.same += usize::from(recorded == replayed);
        }
    }

    /// Returns the comparison of all steps.
    pub fn end(mut self) -> Compared {
        self.compare();
        self.compared
    }
}

fn put<T>(places: &mut [Option<T>; ARMS], arm: u64, packet: T) {
    if let Some(place) = places.get_mut(arm as usize) {
        *place = Some(packet);
    }
}

/// Latest packets of one type.
struct Recent<T> {
    packets: VecDeque<T>,
    stamp: fn(&T) -> u64,
}

impl<T: Packet> Recent<T> {
    fn new(stamp: fn(&T) -> u64) -> Self {
        Self {
            packets: VecDeque::with_capacity(REMEMBERED),
            stamp,
        }
    }

    fn take(&mut self, packet: &PlainPacket) {
        let Some(packet) = packet.get() else {
            return;
        };
        if self.packets.len() == REMEMBERED {
            self.packets.pop_front();
        }
        self.packets.push_back(packet);
    }

    fn at(&self, stamp: u64) -> Option<&T> {
        let mut latest_first = self.packets.iter().rev();
        latest_first.find(|packet| stamp > 0 && (self.stamp)(packet) == stamp)
    }
}
