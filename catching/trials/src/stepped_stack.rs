//! The catching stack in stepped time: perception, coordinator, planners and controller, joined by packets with the
//! configured delays.
//!
//! Coordinator and planners are the step functions of the live processes. A packet of the coordinator takes one tick
//! to the controller; a result reaches the coordinator in the last tick in which its path is still in time.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use tactnet_catching::control::Controller;
use tactnet_catching::coordinate::{
    Answering, Coordinator, CoordinatorInputs, CoordinatorOutputs, PhaseConfig, Room, answer,
};
use tactnet_catching::map::DistanceField;
use tactnet_catching::plan::{ObstacleConfig, Planner, Surroundings};
use tactnet_catching_packets::packets::{
    ControllerOrder, ControllerState, HandCommand, JointCommand, PlanFailure, PlanResult,
};
use tactnet_catching_packets::{ARMS, JOINTS};
use tactnet_catching_world::{Sensed, TICK_NS, Truth};

use crate::ablation::Ablation;
use crate::error::TrialError;
use crate::look_ahead::TimedPrediction;
use crate::perception::{Perception, Seen};
use crate::stepped_time::nanoseconds;
use crate::throw_config::ThrowConfig;

/// Time after a catch at which the robot returns to its waiting pose, in s, as in the live settings.
const AFTER_CATCH: f64 = 0.4;
/// Number of ticks between state packets of the controller while its state does not change.
const STATE_EVERY: u64 = 20;

/// Stack of a robot that waits for a throw.
pub(crate) struct SteppedStack {
    pub perception: Perception,
    coordinator: Coordinator,
    pub controller: Controller,
    planners: [Planner; ARMS],
    field: Option<Arc<DistanceField>>,
    near_misses: bool,
    phases: PhaseConfig,
    state: Option<ControllerState>,
    /// Packets of the last step, which the controller has not taken yet.
    sent: CoordinatorOutputs,
    /// Results on their way to the coordinator, with the time of their arrival.
    results: VecDeque<(u64, PlanResult)>,
    hands: [Option<HandCommand>; ARMS],
    /// All predictions so far.
    pub said: Vec<TimedPrediction>,
    /// Plans whose paths the coordinator has sent, with the time.
    pub chosen: Vec<(u64, PlanResult)>,
    /// Number of requests without a collision-free plan.
    pub obstructed: u64,
    /// Computation time of the first plans, in s.
    pub first_plan: Option<f64>,
}

/// Observer of the coordinator: time in ns, inputs and outputs of each step.
pub type StepObserver<'a> = dyn FnMut(u64, &CoordinatorInputs<'_>, &CoordinatorOutputs) + 'a;

impl SteppedStack {
    /// Creates the stack of a robot at rest.
    ///
    /// - `ready`: joint angles of its waiting pose
    /// - `field`: map of obstacles, if there is one
    /// - `seed`: seed of the world, for pictures
    pub fn new(
        config: &ThrowConfig,
        ready: [f64; JOINTS],
        field: Option<Arc<DistanceField>>,
        seed: u64,
    ) -> Result<Self, TrialError> {
        let corrections = config.corrections();
        let robot = corrections.robot().clone();
        let phases = PhaseConfig {
            drives: config.timing.drives,
            after_catch: AFTER_CATCH,
            looks_at_hand: config.calibration.is_some(),
        };
        let apart = ObstacleConfig::default().hard;
        let room = field.clone().map(|field| Room::new(&robot, field, apart));
        let planners = config.planners(&robot);
        let mut coordinator = Coordinator::new(corrections, config.coordination(), phases);
        coordinator.wait_in(ready, room);
        Ok(Self {
            perception: Perception::new(config, seed)?,
            coordinator,
            controller: Controller::new(robot, ready, &ready),
            planners,
            field,
            near_misses: !config.is_without(Ablation::NearMiss),
            phases,
            state: None,
            sent: CoordinatorOutputs::default(),
            results: VecDeque::new(),
            hands: [None; ARMS],
            said: Vec::new(),
            chosen: Vec::new(),
            obstructed: 0,
            first_plan: None,
        })
    }

    /// Returns the number of failed plans for valid balls.
    pub fn no_plans(&self) -> u64 {
        self.coordinator.no_plans()
    }

    /// Returns the closing commands of the hands.
    pub fn hands(&self) -> &[Option<HandCommand>; ARMS] {
        &self.hands
    }

    /// Returns true if an arm was sent towards a ball.
    pub fn reached_for(&self, ball: u64) -> bool {
        let mut chosen = self.chosen.iter();
        chosen.any(|(_, plan)| plan.request.ball == ball)
    }

    /// Performs a tick of the whole stack and returns the joint command, in link angles.
    pub fn step(&mut self, now_ns: u64, observe: Option<&mut StepObserver<'_>>) -> JointCommand {
        let command = self.control(now_ns);
        let seen = self.perception.predictions(now_ns);
        self.said.extend(seen.iter().flat_map(Seen::said));
        let mut results = Vec::new();
        while let Some((_, result)) = self.results.pop_front_if(|(due_ns, _)| *due_ns <= now_ns) {
            results.push(result);
        }
        let inputs = CoordinatorInputs {
            joints: self.perception.joints(),
            head: self.perception.head(),
            controller: self.state.as_ref(),
            predictions: seen.as_ref().map(|seen| &seen.predictions),
            results: &results,
        };
        self.sent = self.coordinator.step(now_ns, &inputs);
        if let Some(observe) = observe {
            observe(now_ns, &inputs, &self.sent);
        }
        for path in self.sent.paths.iter().flatten() {
            let is_of = |result: &&PlanResult| {
                (result.request.arm, result.request.ball) == (path.arm, path.ball)
            };
            let result = results.iter().find(is_of);
            self.chosen.extend(result.map(|result| (now_ns, *result)));
        }
        self.plan(now_ns);
        command
    }

    /// Hands the packets of the coordinator to the controller and returns its command.
    fn control(&mut self, now_ns: u64) -> JointCommand {
        let effect_ns = now_ns + nanoseconds(self.phases.drives);
        let (sent, controller) = (&self.sent, &mut self.controller);
        let mode = controller.mode();
        match sent.order.and_then(|order| order.order()) {
            Some(ControllerOrder::GoBack) => controller.go_back(),
            Some(ControllerOrder::Brake) => controller.brake("ordered to brake"),
            None => {}
        }
        for path in sent.paths.iter().flatten() {
            // The state packet reports a refusal.
            let _ = controller.arm_path(effect_ns, path);
        }
        if let Some(path) = &sent.body {
            controller.body_path(path);
        }
        if let Some(gaze) = &sent.gaze {
            controller.gaze(effect_ns, gaze);
        }
        for (hand, told) in self.hands.iter_mut().zip(sent.hands) {
            *hand = told.or(*hand);
        }
        let (q, dq) = controller.tick(effect_ns);
        let command = JointCommand {
            number: now_ns / TICK_NS,
            command_ns: now_ns,
            q: *q,
            dq: *dq,
        };
        let came = sent.paths != [None; ARMS] || mode != controller.mode();
        if came || self.state.is_none() || command.number.is_multiple_of(STATE_EVERY) {
            self.state = Some(controller.state(now_ns));
        }
        command
    }

    /// Answers the requests of the last step.
    fn plan(&mut self, now_ns: u64) {
        let begun = Instant::now();
        for request in self.sent.requests.iter().flatten() {
            let chest = self.coordinator.chest_way(request.start_ns);
            let answering = Answering {
                surroundings: self
                    .field
                    .as_deref()
                    .zip(chest)
                    .map(|(field, chest)| Surroundings { field, chest }),
                near_misses: self.near_misses,
            };
            let planner = &self.planners[request.arm as usize];
            let Some(result) = answer(planner, request, &answering, || false) else {
                continue;
            };
            let obstructed = result.failure() == Some(PlanFailure::Obstructed);
            self.obstructed += u64::from(obstructed);
            let latest_ns = request.start_ns.saturating_sub(self.phases.path_lead_ns());
            let due_ns = (latest_ns / TICK_NS * TICK_NS).max(now_ns + TICK_NS);
            self.results.push_back((due_ns, result));
            self.first_plan
                .get_or_insert_with(|| begun.elapsed().as_secs_f64());
        }
    }

    /// Takes the sensor values of a tick.
    pub fn sense(&mut self, sensed: &Sensed, truth: &Truth) {
        let phase = self.coordinator.phase();
        self.perception.sense(sensed, truth, phase);
    }
}
