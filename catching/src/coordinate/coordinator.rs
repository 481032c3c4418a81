//! The coordinator: phases of catching, and every decision between predictions and paths, as a step function.

mod gaze;
mod packets;
mod plan_requests;

use bytemuck::Zeroable;
use nalgebra::{Isometry3, Vector3};
use tactnet_catching_packets::packets::{
    BallPredictions, CatchPhase, CatchStatus, ControllerCommand, ControllerMode, ControllerOrder,
    ControllerState, Gaze, HandCommand, HeadPose, JointState, PlanResult, Text,
};
use tactnet_catching_packets::{ARMS, JOINTS};

use super::attempt::{CatchAttempt, CatchState, MAX_REQUESTS};
use super::config::{CoordinatorConfig, NextPose, PhaseConfig};
use super::room::Room;
use crate::calibrate::Corrections;
use crate::plan::ChestWay;
use crate::pose::isometry;
use crate::ramp::Ramp;
pub use packets::{CoordinatorInputs, CoordinatorOutputs};
use plan_requests::PendingPlans;

/// Time after sending a path until the controller's state takes it into account, in ns.
const TAKEN_NS: u64 = 5_000_000;
/// Timeout after which a silent controller or estimator counts as lost, in ns.
const SILENT_NS: u64 = 200_000_000;
/// Time without detections after which a ball counts as gone, in ns.
const GONE_NS: u64 = 500_000_000;
/// Period at which the order to return to the waiting pose is repeated, in ns.
const AGAIN_NS: u64 = 100_000_000;
/// Time for which the head looks at the hand, in s.
const LOOKING: f64 = 0.6;
/// Period at which an unchanged phase is published, in ns.
const TELL_NS: u64 = 100_000_000;

#[derive(Clone, Copy)]
struct MeasuredPose<'a> {
    joints: &'a JointState,
    head: &'a HeadPose,
}

impl<'a> MeasuredPose<'a> {
    fn of(inputs: &CoordinatorInputs<'a>) -> Option<Self> {
        Some(Self {
            joints: inputs.joints?,
            head: inputs.head?,
        })
    }

    /// Returns the pose of the chest in the inertial frame.
    fn chest(&self, corrections: &Corrections) -> Isometry3<f64> {
        let links = corrections.joints(self.joints).q;
        isometry(self.head) * corrections.robot().head(&links).inverse()
    }
}

/// Time of a step, in ns, and the packets that it sends.
struct Step {
    now_ns: u64,
    outputs: CoordinatorOutputs,
}

/// State while the robot may catch.
#[derive(Debug, Clone)]
struct Armed {
    attempt: CatchAttempt,
    pending: Option<PendingPlans>,
    /// Results of the pending requests.
    answers: Vec<PlanResult>,
    /// Latest predictions of the current throw.
    predictions: Option<BallPredictions>,
    /// Starts of the last paths sent.
    sent: [u64; ARMS],
    hands: [Option<HandCommand>; ARMS],
    /// Time of the last valid prediction, in ns.
    seen_ns: u64,
    /// Place where the first ball was seen first, in m.
    came_from: Option<Vector3<f64>>,
}

impl Armed {
    fn new(attempt: CatchAttempt, now_ns: u64) -> Self {
        Self {
            attempt,
            pending: None,
            answers: Vec::with_capacity(MAX_REQUESTS),
            predictions: None,
            sent: [0; ARMS],
            hands: [None; ARMS],
            seen_ns: now_ns,
            came_from: None,
        }
    }
}

/// Coordinator of one robot. Its only inputs are packets and the time, so it runs the same live, simulated and
/// replayed.
#[derive(Debug, Clone)]
pub struct Coordinator {
    corrections: Corrections,
    config: CoordinatorConfig,
    phases: PhaseConfig,
    waiting: [f64; JOINTS],
    room: Option<Room>,
    armed: Option<Armed>,
    /// Number of the last call of the planner; 0 before the first step.
    calls: u64,
    sent_ns: u64,
    status: CatchStatus,
    told_ns: u64,
    looked_ns: u64,
    ordered_ns: u64,
    no_plans: u64,
}

impl Coordinator {
    /// Creates a coordinator in phase [`CatchPhase::Starting`].
    pub fn new(corrections: Corrections, config: CoordinatorConfig, phases: PhaseConfig) -> Self {
        Self {
            waiting: *corrections.waiting(),
            corrections,
            config,
            phases,
            room: None,
            armed: None,
            calls: 0,
            sent_ns: 0,
            status: CatchStatus {
                phase: CatchPhase::Starting as u64,
                reason: Text::new("has just begun"),
                ..CatchStatus::zeroed()
            },
            told_ns: 0,
            looked_ns: 0,
            ordered_ns: 0,
            no_plans: 0,
        }
    }

    /// Changes the waiting pose and the free space of platform and torso.
    pub fn wait_in(&mut self, waiting: [f64; JOINTS], room: Option<Room>) {
        self.waiting = waiting;
        self.room = room;
    }

    /// Returns the phase.
    pub fn phase(&self) -> CatchPhase {
        self.status.phase().unwrap_or(CatchPhase::Starting)
    }

    /// Returns the number of failed plans for valid balls.
    pub fn no_plans(&self) -> u64 {
        let current = self.armed.as_ref().map(|armed| armed.attempt.no_plans);
        self.no_plans + current.unwrap_or(0)
    }

    /// Returns the planned motion of the chest from `start_ns` on, in the frame of its measurement. `None` unless the
    /// robot may catch.
    pub fn chest_way(&self, start_ns: u64) -> Option<ChestWay> {
        let armed = self.armed.as_ref()?;
        Some(armed.attempt.chest_way(start_ns))
    }

    /// Takes the packets since the last step and returns those to send. Must be called at least every 2 ms, which
    /// bounds the reaction time to closing times and phase changes.
    pub fn step(&mut self, now_ns: u64, inputs: &CoordinatorInputs<'_>) -> CoordinatorOutputs {
        let mut step = Step {
            now_ns,
            outputs: CoordinatorOutputs::default(),
        };
        if self.calls == 0 {
            // Calls from before a restart have lower numbers.
            self.calls = now_ns.max(1);
            self.status.since_ns = now_ns;
        }
        self.follow_controller(inputs.controller, &mut step);
        let pose = MeasuredPose::of(inputs);
        if let (Some(balls), Some(pose)) = (inputs.predictions, pose) {
            self.request_plans([true; ARMS], balls, pose, &mut step);
        }
        inputs.results.iter().for_each(|result| self.take(result));
        self.answer(&mut step);
        if let Some(pose) = pose {
            self.correct_last(pose, &mut step);
            self.look_at_hand(pose, &mut step);
        }
        self.end_attempt(&mut step);
        if now_ns.saturating_sub(self.told_ns) > TELL_NS {
            self.tell(&mut step);
        }
        step.outputs
    }

    fn enter(&mut self, phase: CatchPhase, why: &str, step: &mut Step) {
        if self.phase() == phase {
            return;
        }
        self.status.phase = phase as u64;
        self.status.since_ns = step.now_ns;
        self.status.reason = Text::new(why);
        self.tell(step);
    }

    fn tell(&mut self, step: &mut Step) {
        self.told_ns = step.now_ns;
        step.outputs.status = Some(CatchStatus {
            t_ns: step.now_ns,
            no_plans: self.no_plans(),
            ..self.status
        });
    }

    fn arm(&mut self, now_ns: u64) {
        let robot = self.corrections.robot().clone();
        let room = self.room.clone();
        let attempt = CatchAttempt::new(robot, self.config, self.waiting, room);
        self.armed = Some(Armed::new(attempt, now_ns));
    }

    /// Ends the current attempt.
    fn disarm(&mut self) {
        self.no_plans = self.no_plans();
        self.armed = None;
    }

    fn order_back(&mut self, why: &str, step: &mut Step) {
        self.disarm();
        self.enter(CatchPhase::GoingBack, why, step);
        if step.now_ns.saturating_sub(self.ordered_ns) < AGAIN_NS {
            return;
        }
        self.ordered_ns = step.now_ns;
        step.outputs.order = Some(ControllerCommand {
            command_ns: step.now_ns,
            command: ControllerOrder::GoBack as u64,
            reason: Text::new(why),
        });
    }

    fn follow_controller(&mut self, state: Option<&ControllerState>, step: &mut Step) {
        let now_ns = step.now_ns;
        let fresh = |state: &&ControllerState| now_ns.saturating_sub(state.t_ns) < SILENT_NS;
        let Some(state) = state.filter(fresh) else {
            self.disarm();
            return self.enter(CatchPhase::Starting, "the controller is silent", step);
        };
        let armed = self.armed.is_some();
        let phase = match state.mode() {
            Some(ControllerMode::Ready) if !armed => {
                // States from before the order to return are outdated.
                if state.t_ns > self.ordered_ns + TAKEN_NS {
                    self.arm(now_ns);
                    self.enter(CatchPhase::Armed, "stands where it waits", step);
                }
                return;
            }
            Some(ControllerMode::Following) if !armed => {
                return self.order_back("has begun while the robot moved", step);
            }
            Some(ControllerMode::Ready | ControllerMode::Following) => {
                return self.compare_paths(state);
            }
            Some(ControllerMode::Standing) => {
                return self.order_back(state.reason.as_str(), step);
            }
            Some(ControllerMode::Braking) => CatchPhase::Braking,
            Some(ControllerMode::Throwing) => CatchPhase::Throwing,
            Some(ControllerMode::GoingBack) => CatchPhase::GoingBack,
            Some(ControllerMode::Stuck) | None => CatchPhase::Stuck,
        };
        self.disarm();
        self.enter(phase, state.reason.as_str(), step);
    }

    /// Takes refused paths back.
    fn compare_paths(&mut self, state: &ControllerState) {
        let counts = state.t_ns > self.sent_ns + TAKEN_NS;
        if let Some(armed) = self.armed.as_mut().filter(|_| counts) {
            for (arm, path) in state.paths.iter().enumerate() {
                let ramps = path.ramps.each_ref().map(Ramp::of);
                armed.attempt.carried_out(arm, path.start_ns, ramps);
                armed.sent[arm] = path.start_ns;
            }
        }
    }

    /// Publishes the progress of the attempt, and prepares for the next one after it.
    fn end_attempt(&mut self, step: &mut Step) {
        let now_ns = step.now_ns;
        let Some(armed) = &mut self.armed else {
            return;
        };
        armed.attempt.tick(now_ns);
        let state = armed.attempt.state;
        let (phase, why) = match state {
            CatchState::Armed => (CatchPhase::Armed, "stands where it waits"),
            CatchState::Tracking => (CatchPhase::Tracking, "a ball is valid"),
            CatchState::Reaching => (CatchPhase::Reaching, "a plan is carried out"),
            CatchState::Closed => (CatchPhase::Closed, "the hands have been told"),
        };
        let targets = (0..ARMS).filter_map(|arm| armed.attempt.target(arm));
        let catch_ns = targets.map(|(_, at)| at).max();
        let looking = self.phases.looks_at_hand.then_some(LOOKING);
        let after_ns = ((self.phases.after_catch + looking.unwrap_or(0.0)) * 1e9) as u64;
        let (end_ns, end) = match catch_ns {
            Some(at) => (at + after_ns, "the catch is over"),
            None => (armed.seen_ns + GONE_NS, "the ball is gone"),
        };
        self.enter(phase, why, step);
        if state == CatchState::Armed || now_ns <= end_ns {
            return;
        }
        match self.phases.next {
            NextPose::Waiting => self.order_back(end, step),
            NextPose::LastCatch => self.stay(end_ns, step),
        }
    }

    /// Turns the head back to where the ball came from, and then waits for the next ball in the current pose.
    fn stay(&mut self, end_ns: u64, step: &mut Step) {
        let Some(armed) = &self.armed else {
            return;
        };
        let turned_ns = end_ns + (LOOKING * 1e9) as u64;
        // A missed ball that still bounces is not the next one.
        if step.now_ns <= turned_ns.max(armed.seen_ns + GONE_NS) {
            if let Some(place) = armed.came_from {
                self.look_at(&place, step);
            }
            return;
        }
        let next = armed.attempt.next(step.now_ns);
        self.disarm();
        self.armed = Some(Armed::new(next, step.now_ns));
        step.outputs.gaze = Some(Gaze::zeroed());
        self.enter(CatchPhase::Armed, "stands where it caught", step);
    }
}

#[cfg(test)]
mod tests;
