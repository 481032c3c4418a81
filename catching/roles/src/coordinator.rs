//! Coordinator: turns predictions into plan requests, paths and closing times.

use std::time::Duration;

use bytemuck::Zeroable;
use nalgebra::{Point3, Vector3};
use tactnet_catching::calibrate::Corrections;
use tactnet_catching::coordinate::{CatchState, Coordinator, Planned};
use tactnet_catching::flight::Flight;
use tactnet_catching::ramp::Ramp;
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, BodyPath, CatchPhase, CatchStatus, ControllerCommand, ControllerMode,
    ControllerOrder, ControllerState, Gaze, HandCommand, HeadPose, JointState, PlanRequest,
    PlanResult, Text,
};
use tactnet_catching_packets::{ARMS, joint};
use tactnet_channel::{Bus, Priority, PutPort, Start, Wait, now_ns};

use crate::channels::{
    ARM_PATH, BODY_PATH, CATCH_STATE, CONTROLLER_COMMAND, CONTROLLER_STATE, HAND_COMMAND,
    HEAD_GAZE, HEAD_POSE, JOINT_STATE, PLAN_REQUEST, PLAN_RESULT, PREDICTION,
};
use crate::latest_value::LatestValue;
use crate::times::Times;
use crate::translate::{Origin, body_packet, flight_packet, isometry, planned, request_packet};
use crate::{RoleError, RoleReport, RoleSettings};

/// Maximum sleep, which bounds the reaction time to closing times and phase changes.
const BEAT: Wait = Wait::Block {
    timeout: Duration::from_millis(2),
};
/// Time before its start at which a path is sent, in ns. It exceeds the delay of the drives.
const ON_THE_WAY_NS: u64 = 4_500_000;
/// Maximum delay after that moment at which a path is still sent, in ns.
const LATE_NS: u64 = 500_000;
/// Time after sending a path until the controller's state takes it into account, in ns.
const TAKEN_NS: u64 = 5_000_000;
/// Timeout after which a silent controller or estimator counts as lost, in ns.
const SILENT_NS: u64 = 200_000_000;
/// Time without detections after which a ball counts as gone, in ns.
const GONE_NS: u64 = 500_000_000;
/// Period at which the order to return to the waiting pose is repeated, in ns.
const AGAIN_NS: u64 = 100_000_000;
/// Window before the latest possible moment in which the last correction is requested, in ns: two cycles.
const LAST_CHANCE_NS: u64 = 4_000_000;
/// Delay between a catch and the head's turn towards the hand, in ns.
const CAUGHT_NS: u64 = 20_000_000;
/// Period at which the gaze target at the hand is repeated, in ns. A gaze follows a falling ball, so it drifts off a
/// fixed point.
const LOOK_AGAIN_NS: u64 = 10_000_000;
/// Time for which the head looks at the hand, in s.
const LOOKING: f64 = 0.6;
/// Minimum distance of the gaze target ahead of the chest, in m.
const AHEAD: f64 = 0.5;
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
    let mut pose = LatestValue::<HeadPose>::open(bus, HEAD_POSE)?;
    let mut group = bus.sync_group(&[&predictions, &results, &states])?;
    let mut times = Times::at(25);
    let mut live = CoordinatorTask::open(bus, settings, corrections)?;
    ready();
    while !stopped() {
        group.wait(BEAT)?;
        joints.look()?;
        pose.look()?;
        while let Some(packet) = states.try_get()? {
            packet
                .iter()
                .for_each(|state| live.controller = Some(*state));
        }
        live.follow_controller(now_ns())?;
        while let Some(packet) = predictions.try_get()? {
            let (Some(seen), Some(joints), Some(pose)) = (packet.first(), joints.get(), pose.get())
            else {
                continue;
            };
            let begun = now_ns();
            live.predictions([true; ARMS], begun, seen, joints, pose)?;
            times.push(now_ns() - begun);
        }
        while let Some(packet) = results.try_get()? {
            packet.iter().for_each(|result| live.take(result));
        }
        live.answer(now_ns())?;
        if let (Some(joints), Some(pose)) = (joints.get(), pose.get()) {
            live.correct_last(now_ns(), joints, pose)?;
            live.look_at_hand(now_ns(), joints, pose)?;
        }
        live.tick(now_ns())?;
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

/// Plan requests that wait for their results.
struct Asked {
    origin: Origin,
    start_ns: u64,
    count: usize,
    answers: Vec<Planned>,
}

struct CoordinatorTask {
    puts: Puts,
    corrections: Corrections,
    settings: RoleSettings,
    /// Present while the robot may catch.
    coordinator: Option<Coordinator>,
    controller: Option<ControllerState>,
    asked: Option<Asked>,
    /// Latest predictions of the current throw.
    seen: Option<BallPredictions>,
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
            asked: None,
            seen: None,
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
        self.asked = None;
        self.seen = None;
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

    /// Requests plans for a prediction.
    ///
    /// - `arms`: arms to plan for
    fn predictions(
        &mut self,
        arms: [bool; ARMS],
        now_ns: u64,
        seen: &BallPredictions,
        joints: &JointState,
        pose: &HeadPose,
    ) -> Result<(), RoleError> {
        let known = now_ns.saturating_sub(pose.t_ns) < SILENT_NS
            && now_ns.saturating_sub(joints.sensor_ns) < SILENT_NS;
        let Some(coordinator) = self.coordinator.as_mut().filter(|_| known) else {
            return Ok(());
        };
        self.seen = Some(*seen);
        let links = self.corrections.joints(joints).q;
        let chest = isometry(pose) * self.corrections.robot().head(&links).inverse();
        let before = coordinator.state();
        let requests = coordinator.predictions_for(arms, now_ns, seen, &chest);
        if coordinator.state() == CatchState::Armed {
            return Ok(());
        }
        let valid = seen
            .valid()
            .iter()
            .any(|ball| ball.existence >= self.settings.coordinator.existence);
        if valid {
            self.seen_ns = now_ns;
        }
        let body = coordinator.body();
        if body.start_ns != self.body_ns && before == CatchState::Armed {
            self.body_ns = body.start_ns;
            self.puts.body.put_copy(&[body_packet(body)])?;
        }
        let mut gaze = Gaze::zeroed();
        for (t_ns, flight) in coordinator.looked_at().iter().flatten() {
            gaze.flights[gaze.count as usize] = flight_packet(*t_ns, flight);
            gaze.count += 1;
        }
        if self.hand_to_look_at(now_ns).is_none() {
            self.puts.gaze.put_copy(&[gaze])?;
        }
        let count = requests.iter().flatten().count();
        if count > 0 {
            self.calls += 1;
            let origin = Origin {
                call: self.calls,
                exposure_ns: seen.exposure_ns,
                head_ns: pose.t_ns,
            };
            let mut start_ns = 0;
            for request in requests.iter().flatten() {
                start_ns = request.start_ns;
                self.puts
                    .requests
                    .put_copy(&[request_packet(request, origin)])?;
            }
            self.asked = Some(Asked {
                origin,
                start_ns,
                count,
                answers: Vec::with_capacity(count),
            });
        }
        self.tell_hands()
    }

    /// Requests one last correction from the latest head pose, just before a path becomes final. Pictures arrive
    /// every 40 ms, poses of the inertial unit much more often.
    fn correct_last(
        &mut self,
        now_ns: u64,
        joints: &JointState,
        pose: &HeadPose,
    ) -> Result<(), RoleError> {
        let config = &self.settings.coordinator;
        let nanoseconds = |seconds: f64| (seconds * 1e9) as u64;
        let ahead = nanoseconds(config.plan_delay + config.last_correction);
        let Some(seen) = self.seen.filter(|_| self.asked.is_none()) else {
            return Ok(());
        };
        let Some(coordinator) = self
            .coordinator
            .as_ref()
            .filter(|coordinator| coordinator.state() == CatchState::Reaching)
        else {
            return Ok(());
        };
        let due = std::array::from_fn(|arm| {
            coordinator.target(arm).is_some_and(|(_, catch_ns)| {
                let last = catch_ns.saturating_sub(ahead);
                (last.saturating_sub(LAST_CHANCE_NS)..last).contains(&now_ns)
            })
        });
        if due != [false; ARMS] {
            self.predictions(due, now_ns, &seen, joints, pose)?;
        }
        Ok(())
    }

    /// Returns the arm that has just caught a ball if the head should look at it.
    fn hand_to_look_at(&self, now_ns: u64) -> Option<usize> {
        let coordinator = self.coordinator.as_ref()?;
        let closed = coordinator.state() == CatchState::Closed;
        let looks = closed && self.settings.calibration.is_some();
        let over = |arm: &usize| {
            let target = coordinator.target(*arm);
            target.is_some_and(|(_, catch_ns)| now_ns > catch_ns + CAUGHT_NS)
        };
        (0..ARMS).find(|arm| looks && over(arm))
    }

    /// Turns the head to the wrist of the arm that has just caught. The slip watch uses the marker on the wrist to
    /// check the calibration.
    fn look_at_hand(
        &mut self,
        now_ns: u64,
        joints: &JointState,
        pose: &HeadPose,
    ) -> Result<(), RoleError> {
        let Some(arm) = self.hand_to_look_at(now_ns) else {
            return Ok(());
        };
        if now_ns < self.looked_ns + LOOK_AGAIN_NS {
            return Ok(());
        }
        self.looked_ns = now_ns;
        let links = self.corrections.joints(joints).q;
        let robot = self.corrections.robot();
        let chest = isometry(pose) * robot.head(&links).inverse();
        let own = joint::ARM[arm].start;
        let [_, _, wrist, _] = robot
            .arm(arm)
            .points(&std::array::from_fn(|i| links[own + i]));
        // The neck cannot look at points near the chest, so the target moves outwards along the same line.
        let neck = Vector3::new(0.0, 0.0, robot.description().neck.height);
        let farther = (AHEAD / wrist.x.max(0.05)).max(1.0);
        let place = chest * Point3::from(neck + (wrist - neck) * farther);
        let stands = Flight {
            p: place.coords,
            v: Vector3::zeros(),
            k: 0.0,
            lift: Vector3::zeros(),
        };
        let mut gaze = Gaze::zeroed();
        (gaze.count, gaze.flights[0]) = (1, flight_packet(now_ns, &stands));
        self.puts.gaze.put_copy(&[gaze])?;
        Ok(())
    }

    fn take(&mut self, result: &PlanResult) {
        let Some(asked) = self
            .asked
            .as_mut()
            .filter(|asked| asked.origin.call == result.request.call)
        else {
            return;
        };
        asked.answers.extend(planned(result));
    }

    /// Decides once all plans have arrived or the time is over.
    fn answer(&mut self, now_ns: u64) -> Result<(), RoleError> {
        let latest = |asked: &Asked| asked.start_ns.saturating_sub(ON_THE_WAY_NS);
        let Some(asked) = self
            .asked
            .take_if(|asked| asked.answers.len() >= asked.count || now_ns >= latest(asked))
        else {
            return Ok(());
        };
        let Some(coordinator) = &mut self.coordinator else {
            return Ok(());
        };
        // Late paths are discarded.
        let answers = if now_ns <= latest(&asked) + LATE_NS {
            &asked.answers[..]
        } else {
            &[]
        };
        coordinator.planned(answers);
        for arm in 0..ARMS {
            let (start_ns, ramps) = coordinator.arm(arm);
            let target = coordinator.target(arm);
            let Some((ball, _)) = target.filter(|_| start_ns != self.sent[arm]) else {
                continue;
            };
            self.sent[arm] = start_ns;
            self.sent_ns = now_ns;
            self.puts.arms.put_copy(&[ArmPath {
                arm: arm as u64,
                ball,
                exposure_ns: asked.origin.exposure_ns,
                head_ns: asked.origin.head_ns,
                start_ns,
                ramps: ramps.each_ref().map(Ramp::packet),
            }])?;
        }
        self.tell_hands()
    }

    fn tell_hands(&mut self) -> Result<(), RoleError> {
        let Some(coordinator) = &self.coordinator else {
            return Ok(());
        };
        let wanted = *coordinator.hands();
        for (told, hand) in self.hands.iter_mut().zip(wanted) {
            if let Some(command) = hand.filter(|_| *told != hand) {
                self.puts.hands.put_copy(&[command])?;
            }
            *told = hand;
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
