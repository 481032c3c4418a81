//! Coordinator: turns predictions into plan requests, paths and closing times.

mod gaze;
mod plan_requests;

use std::time::Duration;

use bytemuck::Zeroable;
use nalgebra::Isometry3;
use tactnet_catching::calibrate::Corrections;
use tactnet_catching::coordinate::{CatchState, Coordinator};
use tactnet_catching::ramp::Ramp;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, BodyPath, CatchPhase, CatchStatus, ControllerCommand, ControllerMode,
    ControllerOrder, ControllerState, Gaze, HandCommand, HeadPose, JointState, PlanRequest,
    PlanResult, Text,
};
use tactnet_channel::{Bus, Priority, PutPort, Start, Wait, now_ns};

use crate::channels::{
    ARM_PATH, BODY_PATH, CATCH_STATE, CONTROLLER_COMMAND, CONTROLLER_STATE, HAND_COMMAND,
    HEAD_GAZE, HEAD_POSE, JOINT_STATE, PLAN_REQUEST, PLAN_RESULT, PREDICTION,
};
use crate::latest_value::{LatestValue, drain};
use crate::times::Times;
use crate::translate::isometry;
use crate::{RoleError, RoleReport, RoleSettings};
use plan_requests::PendingPlans;

/// Maximum sleep, which bounds the reaction time to closing times and phase changes.
const BEAT: Wait = Wait::Block {
    timeout: Duration::from_millis(2),
};
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

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let corrections = settings.corrections()?;
    let predictions = bus.get_port::<BallPredictions>(PREDICTION, Start::Now)?;
    let results = bus.get_port::<PlanResult>(PLAN_RESULT, Start::Now)?;
    let states = bus.get_port::<ControllerState>(CONTROLLER_STATE, Start::Now)?;
    let mut joints = LatestValue::<JointState>::open(bus, JOINT_STATE)?;
    let mut head = LatestValue::<HeadPose>::open(bus, HEAD_POSE)?;
    let mut group = bus.sync_group(&[&predictions, &results, &states])?;
    let mut times = Times::at(25);
    let mut task = CoordinatorTask::open(bus, settings, corrections)?;
    ready();
    while !stopped() {
        group.wait(BEAT)?;
        joints.look()?;
        head.look()?;
        drain(&states, |state| task.controller = Some(*state))?;
        task.follow_controller(now_ns())?;
        while let Some(packet) = predictions.try_get()? {
            let (Some(balls), Some(pose)) = (packet.first(), MeasuredPose::of(&joints, &head))
            else {
                continue;
            };
            let begun = now_ns();
            task.request_plans([true; ARMS], begun, balls, pose)?;
            times.push(now_ns() - begun);
        }
        drain(&results, |result| task.take(result))?;
        task.answer(now_ns())?;
        if let Some(pose) = MeasuredPose::of(&joints, &head) {
            task.correct_last(now_ns(), pose)?;
            task.look_at_hand(now_ns(), pose)?;
        }
        task.tick(now_ns())?;
    }
    Ok(RoleReport {
        lost: predictions.lost() + results.lost() + states.lost(),
        ..times.report()
    })
}

struct Puts {
    requests: PutPort<PlanRequest>,
    arms: PutPort<ArmPath>,
    body: PutPort<BodyPath>,
    gaze: PutPort<Gaze>,
    hands: PutPort<HandCommand>,
    orders: PutPort<ControllerCommand>,
    status: PutPort<CatchStatus>,
}

/// Measured pose of the robot.
#[derive(Clone, Copy)]
struct MeasuredPose<'a> {
    joints: &'a JointState,
    head: &'a HeadPose,
}

impl<'a> MeasuredPose<'a> {
    fn of(joints: &'a LatestValue<JointState>, head: &'a LatestValue<HeadPose>) -> Option<Self> {
        Some(Self {
            joints: joints.get()?,
            head: head.get()?,
        })
    }

    fn is_fresh(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.head.t_ns) < SILENT_NS
            && now_ns.saturating_sub(self.joints.sensor_ns) < SILENT_NS
    }

    /// Returns the pose of the chest in the inertial frame.
    fn chest(&self, corrections: &Corrections) -> Isometry3<f64> {
        let links = corrections.joints(self.joints).q;
        isometry(self.head) * corrections.robot().head(&links).inverse()
    }
}

struct CoordinatorTask {
    puts: Puts,
    corrections: Corrections,
    settings: RoleSettings,
    /// Present while the robot may catch.
    coordinator: Option<Coordinator>,
    controller: Option<ControllerState>,
    pending: Option<PendingPlans>,
    /// Latest predictions of the current throw.
    predictions: Option<BallPredictions>,
    /// Number of the last call of the planner.
    calls: u64,
    sent: [u64; ARMS],
    sent_ns: u64,
    body_ns: u64,
    hands: [Option<HandCommand>; ARMS],
    seen_ns: u64,
    status: CatchStatus,
    told_ns: u64,
    looked_ns: u64,
    ordered_ns: u64,
    no_plans: u64,
}

impl CoordinatorTask {
    fn open(
        bus: &Bus,
        settings: &RoleSettings,
        corrections: Corrections,
    ) -> Result<Self, RoleError> {
        let puts = Puts {
            requests: bus.put_port(PLAN_REQUEST, Priority::High)?,
            arms: bus.put_port(ARM_PATH, Priority::High)?,
            body: bus.put_port(BODY_PATH, Priority::High)?,
            gaze: bus.put_port(HEAD_GAZE, Priority::High)?,
            hands: bus.put_port(HAND_COMMAND, Priority::High)?,
            orders: bus.put_port(CONTROLLER_COMMAND, Priority::High)?,
            status: bus.put_port(CATCH_STATE, Priority::Normal)?,
        };
        Ok(Self {
            puts,
            corrections,
            settings: settings.clone(),
            coordinator: None,
            controller: None,
            pending: None,
            predictions: None,
            calls: now_ns(),
            sent: [0; ARMS],
            sent_ns: 0,
            body_ns: 0,
            hands: [None; ARMS],
            seen_ns: 0,
            status: CatchStatus {
                phase: CatchPhase::Starting as u64,
                since_ns: now_ns(),
                reason: Text::new("has just begun"),
                ..CatchStatus::zeroed()
            },
            told_ns: 0,
            looked_ns: 0,
            ordered_ns: 0,
            no_plans: 0,
        })
    }

    fn phase(&self) -> CatchPhase {
        self.status.phase().unwrap_or(CatchPhase::Starting)
    }

    fn enter(&mut self, now_ns: u64, phase: CatchPhase, why: &str) -> Result<(), RoleError> {
        if self.phase() == phase {
            return Ok(());
        }
        self.status.phase = phase as u64;
        self.status.since_ns = now_ns;
        self.status.reason = Text::new(why);
        self.tell(now_ns)
    }

    fn tell(&mut self, now_ns: u64) -> Result<(), RoleError> {
        self.told_ns = now_ns;
        let current = self.coordinator.as_ref().map_or(0, Coordinator::no_plans);
        self.puts.status.put_copy(&[CatchStatus {
            t_ns: now_ns,
            no_plans: self.no_plans + current,
            ..self.status
        }])?;
        Ok(())
    }

    /// Ends the current catch attempt.
    fn disarm(&mut self) {
        if let Some(coordinator) = self.coordinator.take() {
            self.no_plans += coordinator.no_plans();
        }
        self.pending = None;
        self.predictions = None;
        self.hands = [None; ARMS];
    }

    fn order_back(&mut self, now_ns: u64, why: &str) -> Result<(), RoleError> {
        self.disarm();
        self.enter(now_ns, CatchPhase::GoingBack, why)?;
        if now_ns.saturating_sub(self.ordered_ns) < AGAIN_NS {
            return Ok(());
        }
        self.ordered_ns = now_ns;
        self.puts.orders.put_copy(&[ControllerCommand {
            command_ns: now_ns,
            command: ControllerOrder::GoBack as u64,
            reason: Text::new(why),
        }])?;
        Ok(())
    }

    /// Reacts to the state of the controller.
    fn follow_controller(&mut self, now_ns: u64) -> Result<(), RoleError> {
        let Some(state) = self
            .controller
            .filter(|state| now_ns.saturating_sub(state.t_ns) < SILENT_NS)
        else {
            self.disarm();
            return self.enter(now_ns, CatchPhase::Starting, "the controller is silent");
        };
        match state.mode() {
            Some(ControllerMode::Ready) if self.coordinator.is_none() => {
                // States from before the order to return are outdated.
                if state.t_ns > self.ordered_ns + TAKEN_NS {
                    self.coordinator = Some(Coordinator::new(
                        self.corrections.robot().clone(),
                        self.settings.coordinator,
                        *self.corrections.waiting(),
                    ));
                    (self.sent, self.body_ns, self.seen_ns) = ([0; ARMS], 0, now_ns);
                    self.enter(now_ns, CatchPhase::Armed, "stands where it waits")?;
                }
            }
            Some(ControllerMode::Following) if self.coordinator.is_none() => {
                self.order_back(now_ns, "has begun while the robot moved")?;
            }
            Some(ControllerMode::Ready | ControllerMode::Following) => {
                let counts = state.t_ns > self.sent_ns + TAKEN_NS;
                if let Some(coordinator) = self.coordinator.as_mut().filter(|_| counts) {
                    for (arm, path) in state.paths.iter().enumerate() {
                        let ramps = path.ramps.each_ref().map(Ramp::of);
                        coordinator.carried_out(arm, path.start_ns, ramps);
                    }
                }
            }
            Some(ControllerMode::Braking) => {
                self.disarm();
                self.enter(now_ns, CatchPhase::Braking, state.reason.as_str())?;
            }
            Some(ControllerMode::Standing) => self.order_back(now_ns, state.reason.as_str())?,
            Some(ControllerMode::Throwing) => {
                self.disarm();
                self.enter(now_ns, CatchPhase::Throwing, state.reason.as_str())?;
            }
            Some(ControllerMode::GoingBack) => {
                self.disarm();
                self.enter(now_ns, CatchPhase::GoingBack, state.reason.as_str())?;
            }
            Some(ControllerMode::Stuck) | None => {
                self.disarm();
                self.enter(now_ns, CatchPhase::Stuck, state.reason.as_str())?;
            }
        }
        Ok(())
    }

    fn tick(&mut self, now_ns: u64) -> Result<(), RoleError> {
        if let Some(coordinator) = &mut self.coordinator {
            coordinator.tick(now_ns);
            let state = coordinator.state();
            let phase = match state {
                CatchState::Armed => CatchPhase::Armed,
                CatchState::Tracking => CatchPhase::Tracking,
                CatchState::Reaching => CatchPhase::Reaching,
                CatchState::Closed => CatchPhase::Closed,
            };
            let why = match state {
                CatchState::Armed => "stands where it waits",
                CatchState::Tracking => "a ball is valid",
                CatchState::Reaching => "a plan is carried out",
                CatchState::Closed => "the hands have been told",
            };
            let catch_ns = (0..ARMS)
                .filter_map(|arm| coordinator.target(arm))
                .map(|(_, at)| at)
                .max();
            let looks = self.settings.calibration.is_some();
            let looking = if looks { LOOKING } else { 0.0 };
            let after_ns = ((self.settings.after_catch + looking) * 1e9) as u64;
            let over = catch_ns.is_some_and(|at| now_ns > at + after_ns);
            let gone = catch_ns.is_none() && now_ns > self.seen_ns + GONE_NS;
            self.enter(now_ns, phase, why)?;
            if state != CatchState::Armed && (over || gone) {
                let why = if over {
                    "the catch is over"
                } else {
                    "the ball is gone"
                };
                self.order_back(now_ns, why)?;
            }
        }
        if now_ns.saturating_sub(self.told_ns) > TELL_NS {
            self.tell(now_ns)?;
        }
        Ok(())
    }
}
