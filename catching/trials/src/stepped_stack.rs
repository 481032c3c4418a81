//! The catching stack in stepped time: the step functions of the live processes, joined by packets with the configured
//! delays.
//!
//! A packet of the coordinator takes one tick to the controller and the hands, a verdict of the safety monitor one to
//! the controller; a result reaches the coordinator in the last tick in which its path is still in time.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use bytemuck::Zeroable;
use tactnet_catching::Robot;
use tactnet_catching::calibrate::Corrections;
use tactnet_catching::control::{ControlConfig, ControlInputs, ControlLoop};
use tactnet_catching::coordinate::{
    Answering, Coordinator, CoordinatorInputs, CoordinatorOutputs, MAX_PLANNERS, PhaseConfig, Room,
    answer, request_for,
};
use tactnet_catching::hand::{HandInputs, HandRelay};
use tactnet_catching::map::DistanceField;
use tactnet_catching::plan::{ObstacleConfig, Planner, Surroundings};
use tactnet_catching::safety::SafetyWatch;
use tactnet_catching::throw_back::{ThrowBack, ThrowInputs, ThrowOutputs, ThrowTask};
use tactnet_catching_packets::packets::{
    CatchPhase, CatchStatus, ControllerMode, ControllerState, HandCommand, HandOpening, HandState,
    JointCommand, JointState, PlanFailure, PlanResult, SafetyState,
};
use tactnet_catching_packets::{ARMS, JOINTS};
use tactnet_catching_world::{Sensed, TICK_NS, Truth};

use crate::ablation::Ablation;
use crate::error::TrialError;
use crate::look_ahead::TimedPrediction;
use crate::perception::{Perception, Seen};
use crate::stepped_time::nanoseconds;
use crate::throw_config::ThrowConfig;

/// Time after a catch at which the robot prepares for the next ball, in s, as in the live settings.
const AFTER_CATCH: f64 = 0.4;
/// Standstill after which a robot is ready to catch, in s, because the torso oscillates.
const SETTLES: f64 = 3.0;
/// Timeout of the controller without verdicts of the safety monitor, in ns, as in the live settings.
const PATIENCE_NS: u64 = 50_000_000;

pub(crate) struct SteppedStack {
    pub perception: Perception,
    coordinator: Coordinator,
    control: ControlLoop,
    pub safety: SafetyWatch,
    hand: HandRelay,
    /// Present if the robot throws.
    pub thrower: Option<ThrowTask>,
    planners: [Planner; ARMS],
    field: Option<Arc<DistanceField>>,
    near_misses: bool,
    phases: PhaseConfig,
    /// Joint state before the first tick.
    begun: JointState,
    state: Option<ControllerState>,
    verdict: Option<SafetyState>,
    status: Option<CatchStatus>,
    holding: Option<HandState>,
    /// Packets of the last step, which controller and hands have not taken yet.
    sent: CoordinatorOutputs,
    throws: ThrowOutputs,
    /// Results on their way to the coordinator, with the time of their arrival.
    results: VecDeque<(u64, PlanResult)>,
    /// All predictions so far.
    pub said: Vec<TimedPrediction>,
    /// Plans whose paths the coordinator has sent, with the time.
    pub chosen: Vec<(u64, PlanResult)>,
    /// Number of requests without a collision-free plan.
    pub obstructed: u64,
    /// Computation time of the first plans, in s.
    pub first_plan: Option<f64>,
}

/// Packets for drives and hands, and the last verdict of the safety monitor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StackCommands {
    pub joints: JointCommand,
    pub hands: [Option<HandCommand>; ARMS],
    pub openings: [Option<HandOpening>; ARMS],
    pub verdict: SafetyState,
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
            next: config.next,
            looks_at_hand: config.calibration.is_some(),
        };
        let apart = ObstacleConfig::default().hard;
        let room = field.clone().map(|field| Room::new(&robot, field, apart));
        let mut control = ControlLoop::new(corrections.clone(), control(config));
        control.wait_in(ready);
        let planners = config.planners(&robot);
        let mut begun = JointState::zeroed();
        begun.q = corrections.sensors(&ready);
        let safety = SafetyWatch::new(corrections.clone());
        let mut coordinator = Coordinator::new(corrections, config.coordination(), phases);
        coordinator.wait_in(ready, room);
        Ok(Self {
            perception: Perception::new(config, seed)?,
            coordinator,
            control,
            safety,
            hand: HandRelay::default(),
            thrower: None,
            planners,
            field,
            near_misses: !config.is_without(Ablation::NearMiss),
            phases,
            begun,
            state: None,
            verdict: None,
            status: None,
            holding: None,
            sent: CoordinatorOutputs::default(),
            throws: ThrowOutputs::default(),
            results: VecDeque::new(),
            said: Vec::new(),
            chosen: Vec::new(),
            obstructed: 0,
            first_plan: None,
        })
    }

    /// Adds the thrower, before the first step.
    ///
    /// - `robot`: robot with its limits for throwing, which the controller and the safety monitor use as well
    pub fn throws_with(&mut self, config: &ThrowConfig, robot: &Robot, settings: ThrowBack) {
        let corrections = Corrections::new(robot, None);
        let existence = config.coordination().existence;
        self.control = ControlLoop::new(corrections.clone(), control(config));
        self.safety = SafetyWatch::new(corrections);
        self.thrower = Some(ThrowTask::new(robot, settings, existence));
    }

    /// Returns the number of failed plans for valid balls.
    pub fn no_plans(&self) -> u64 {
        self.coordinator.no_plans()
    }

    /// Returns true if the robot waits for a ball and its torso is at rest.
    pub fn waits_at_rest(&self, now_ns: u64) -> bool {
        let since_ns = self.status.map_or(0, |status| status.since_ns);
        let rested = now_ns >= since_ns + nanoseconds(SETTLES);
        rested && self.coordinator.phase() == CatchPhase::Armed
    }

    /// Returns the mode of the controller.
    pub fn mode(&self) -> Option<ControllerMode> {
        self.state.and_then(|state| state.mode())
    }

    /// Performs a tick of the whole stack.
    pub fn step(&mut self, now_ns: u64, observe: Option<&mut StepObserver<'_>>) -> StackCommands {
        let commands = self.control(now_ns);
        let seen = self.perception.predictions(now_ns);
        self.said.extend(seen.iter().flat_map(Seen::said));
        let next = || self.results.pop_front_if(|(due_ns, _)| *due_ns <= now_ns);
        let results = std::iter::from_fn(next).map(|(_, result)| result);
        let results: Vec<PlanResult> = results.collect();
        let inputs = CoordinatorInputs {
            joints: self.perception.joints(),
            head: self.perception.head(),
            controller: self.state.as_ref(),
            predictions: seen.as_ref().map(|seen| &seen.predictions),
            results: &results,
        };
        self.sent = self.coordinator.step(now_ns, &inputs);
        self.status = self.sent.status.or(self.status);
        if let Some(observe) = observe {
            observe(now_ns, &inputs, &self.sent);
        }
        for path in self.sent.paths.iter().flatten() {
            let is_of = |result: &&PlanResult| {
                (result.request.arm, result.request.ball) == (path.arm, path.ball)
                    && result.ramps == path.ramps
            };
            let result = results.iter().find(is_of);
            self.chosen.extend(result.map(|result| (now_ns, *result)));
        }
        if let Some(thrower) = &mut self.thrower {
            let paths: Vec<_> = self.sent.paths.iter().flatten().copied().collect();
            let inputs = ThrowInputs {
                hand: self.holding.as_ref(),
                status: self.status.as_ref(),
                controller: self.state.as_ref(),
                felt: None,
                predictions: match &seen {
                    Some(seen) => std::slice::from_ref(&seen.predictions),
                    None => &[],
                },
                paths: &paths,
            };
            self.throws = thrower.step(now_ns, &inputs);
        }
        self.plan(now_ns);
        commands
    }

    /// Hands the packets of coordinator and thrower to controller, safety monitor and hands.
    fn control(&mut self, now_ns: u64) -> StackCommands {
        let sent = &self.sent;
        let paths: Vec<_> = sent.paths.iter().flatten().copied().collect();
        let inputs = ControlInputs {
            joints: self.perception.joints().or(Some(&self.begun)),
            verdict: self.verdict.as_ref(),
            orders: sent.order.as_slice(),
            paths: &paths,
            throws: self.throws.path.as_slice(),
            bodies: sent.body.as_slice(),
            gazes: sent.gaze.as_slice(),
        };
        let control = self.control.step(now_ns, &inputs);
        let control = control.expect("joint states are finite");
        self.state = control.state.or(self.state);
        let verdict = self.safety.step(&control.command);
        self.safety.count(&control.command, &verdict);
        self.verdict = Some(verdict);
        let told: Vec<_> = sent.hands.iter().flatten().copied().collect();
        let inputs = HandInputs {
            commands: &told,
            releases: self.throws.release.as_slice(),
        };
        let hands = self.hand.step(now_ns, &inputs);
        StackCommands {
            joints: control.command,
            hands: hands.targets,
            openings: hands.openings,
            verdict,
        }
    }

    /// Answers the requests of the last step.
    fn plan(&mut self, now_ns: u64) {
        let begun = Instant::now();
        for request in self.sent.requests.iter().flatten() {
            let chest = self.coordinator.chest_way(request.start_ns);
            let known = self.field.as_deref().zip(chest);
            let answering = Answering {
                surroundings: known.map(|(field, chest)| Surroundings { field, chest }),
                near_misses: self.near_misses,
            };
            let planner = &self.planners[request.arm as usize];
            let latest_ns = request.start_ns.saturating_sub(self.phases.path_lead_ns());
            let due_ns = (latest_ns / TICK_NS * TICK_NS).max(now_ns + TICK_NS);
            let asked = (0..MAX_PLANNERS).filter_map(|number| request_for(number, request));
            for result in asked.filter_map(|of| answer(planner, &of, &answering, || false)) {
                let obstructed = result.failure() == Some(PlanFailure::Obstructed);
                self.obstructed += u64::from(obstructed);
                self.results.push_back((due_ns, result));
            }
            self.first_plan
                .get_or_insert_with(|| begun.elapsed().as_secs_f64());
        }
    }

    /// Takes the sensor values of a tick.
    pub fn sense(&mut self, sensed: &Sensed, truth: &Truth) {
        let phase = self.coordinator.phase();
        self.perception.sense(sensed, truth, phase);
    }

    /// Takes the state of the hands.
    pub fn hold(&mut self, holding: HandState) {
        self.holding = Some(holding);
    }

    /// Clears the recorded predictions and chosen paths.
    pub fn forget(&mut self) {
        self.said.clear();
        self.chosen.clear();
        self.perception.forget();
    }
}

fn control(config: &ThrowConfig) -> ControlConfig {
    ControlConfig {
        drives_ns: nanoseconds(config.timing.drives),
        patience_ns: PATIENCE_NS,
        // With an observer the monitor only reports, so that its false stops can be counted.
        brakes: !config.watch,
    }
}
