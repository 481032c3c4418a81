use nalgebra::Vector3;
use tactnet_catching_packets::packets::BallPrediction;

use super::*;
use crate::control::Controller;
use crate::coordinate::{Answering, answer, request_for};
use crate::flight::Flight;
use crate::plan::{PlanConfig, Planner};
use crate::robot::Robot;

const TICK_NS: u64 = 1_000_000;
/// Time after the throw at which the ball is 0.6 m in front of the robot, in ns.
const ARRIVAL_NS: u64 = 850_000_000;
/// Phases of an attempt until the hand closes.
const ATTEMPT: [CatchPhase; 4] = [
    CatchPhase::Armed,
    CatchPhase::Tracking,
    CatchPhase::Reaching,
    CatchPhase::Closed,
];

/// A coordinator with planners, a controller, and exact measurements, in ticks of 1 ms.
struct Bench {
    coordinator: Coordinator,
    controller: Controller,
    planners: [Planner; ARMS],
    /// True while planners answer.
    plans: bool,
    /// Time of the throw, in ms.
    thrown_ms: u64,
    /// Period after the throw in which the ball is predicted, in ms.
    seen_ms: std::ops::Range<u64>,
    tick: u64,
    q: [f64; JOINTS],
    state: ControllerState,
    results: Vec<(u64, PlanResult)>,
    outputs: CoordinatorOutputs,
    told: Vec<(u64, CatchPhase)>,
    requests: Vec<u64>,
    /// Time in ns, planner and number of planners of each answer.
    answered: Vec<(u64, u32, u32)>,
    /// Reverses the order in which simultaneous results arrive.
    late_first: bool,
    orders: Vec<u64>,
}

impl Bench {
    fn new(looks_at_hand: bool) -> Self {
        let robot = Robot::nominal();
        let phases = PhaseConfig {
            drives: 0.003,
            after_catch: 0.4,
            next: NextPose::Waiting,
            looks_at_hand,
        };
        let corrections = Corrections::new(&robot, None);
        let coordinator = Coordinator::new(corrections, CoordinatorConfig::default(), phases);
        let waiting = robot.waiting();
        let controller = Controller::new(robot.clone(), waiting, &waiting);
        Self {
            coordinator,
            planners: [0, 1].map(|arm| Planner::new(&robot, arm, PlanConfig::default())),
            plans: true,
            thrown_ms: 0,
            seen_ms: 40..840,
            tick: 0,
            q: waiting,
            state: controller.state(0),
            controller,
            results: Vec::new(),
            outputs: CoordinatorOutputs::default(),
            told: Vec::new(),
            requests: Vec::new(),
            answered: Vec::new(),
            late_first: false,
            orders: Vec::new(),
        }
    }

    /// Runs until a time, in ms, with a real controller.
    fn run(&mut self, until_ms: u64) {
        while self.tick < until_ms {
            let now_ns = self.tick * TICK_NS;
            let effect_ns = now_ns + 3 * TICK_NS;
            for path in self.outputs.paths.iter().flatten() {
                self.controller.arm_path(effect_ns, path).unwrap();
            }
            if let Some(path) = &self.outputs.body {
                self.controller.body_path(path).unwrap();
            }
            if self.outputs.order.is_some() {
                self.controller.go_back();
            }
            self.q = *self.controller.tick(effect_ns).0;
            self.state = self.controller.state(now_ns);
            self.step();
        }
    }

    /// Performs a step with the current state of the controller.
    fn step(&mut self) {
        let now_ns = self.tick * TICK_NS;
        let robot = self.coordinator.corrections.robot();
        let mut joints = JointState::zeroed();
        joints.sensor_ns = now_ns;
        joints.q = self.q;
        let head = robot.chest(&self.q) * robot.head(&self.q);
        let head = HeadPose {
            t_ns: now_ns,
            position: head.translation.vector.into(),
            quaternion: head.rotation.coords.into(),
            ..HeadPose::zeroed()
        };
        let since_ms = self.tick - self.thrown_ms;
        let seen = self.seen_ms.contains(&since_ms) && self.tick.is_multiple_of(40);
        let predictions = seen.then(|| prediction(now_ns, ARRIVAL_NS + self.thrown_ms * TICK_NS));
        let due = |(due_ns, _): &mut (u64, PlanResult)| *due_ns <= now_ns;
        let results: Vec<PlanResult> = self.results.extract_if(.., due).map(|it| it.1).collect();
        let inputs = CoordinatorInputs {
            joints: Some(&joints),
            head: Some(&head),
            controller: Some(&self.state),
            predictions: predictions.as_ref(),
            results: &results,
        };
        self.outputs = self.coordinator.step(now_ns, &inputs);
        for request in self.outputs.requests.iter().flatten() {
            self.requests.push(now_ns);
            let planner = &self.planners[request.arm as usize];
            for request in (0..8).filter_map(|number| request_for(number, request)) {
                let plan = answer(planner, &request, &Answering::default(), || false).unwrap();
                if self.plans {
                    self.results.push((now_ns + 8 * TICK_NS, plan));
                    self.answered
                        .push((now_ns, request.planner, request.planners));
                }
            }
        }
        if self.late_first {
            self.results.reverse();
        }
        let phase = self.outputs.status.and_then(|status| status.phase());
        if let Some(phase) = phase.filter(|phase| self.told.last().map(|it| it.1) != Some(*phase)) {
            self.told.push((self.tick, phase));
        }
        self.orders.extend(self.outputs.order.map(|_| self.tick));
        self.tick += 1;
    }

    fn phases(&self) -> Vec<CatchPhase> {
        self.told.iter().map(|it| it.1).collect()
    }
}

/// Returns exact predictions of a ball that comes within reach of the left arm.
fn prediction(now_ns: u64, arrival_ns: u64) -> BallPredictions {
    let (p, v) = (Vector3::new(0.6, 0.35, 1.1), Vector3::new(-5.5, 0.0, -2.5));
    let there = Flight::without_spin(p, v, 0.03);
    let now = there.after((now_ns as f64 - arrival_ns as f64) * 1e-9);
    let mut predictions = BallPredictions::zeroed();
    predictions.count = 1;
    predictions.exposure_ns = now_ns;
    predictions.balls[0] = BallPrediction {
        ball: 7,
        t_ns: now_ns,
        p: now.p.into(),
        v: now.v.into(),
        k: now.k,
        existence: 1.0,
        frames: 9,
        ..BallPrediction::zeroed()
    };
    predictions
}

fn stands(mode: ControllerMode, t_ns: u64) -> ControllerState {
    ControllerState {
        t_ns,
        mode: mode as u64,
        ..ControllerState::zeroed()
    }
}

#[test]
fn a_catch_passes_all_phases_and_ends_in_the_waiting_pose() {
    let mut bench = Bench::new(false);
    bench.run(4000);
    assert_eq!(bench.phases()[..4], ATTEMPT);
    let back = [CatchPhase::GoingBack, CatchPhase::Armed];
    assert_eq!(bench.phases()[4..], back);
    // Armed after the outdated states of the first 5 ms, tracking with the first prediction, closed 10 ms before the
    // catch, going back 400 ms after it.
    let at = |i: usize| bench.told[i].0;
    assert_eq!((at(0), at(1)), (6, 40));
    assert!(at(2) > 40 && at(2) <= 40 + 11, "{}", at(2));
    let waited = at(4) - at(3);
    assert!(waited > 400 && waited <= 415, "{waited}");
}

#[test]
fn a_robot_that_stays_catches_the_next_ball_from_the_pose_of_the_last_catch() {
    let mut bench = Bench::new(false);
    bench.coordinator.phases.next = NextPose::LastCatch;
    bench.run(2400);
    assert_eq!(bench.phases()[..4], ATTEMPT);
    assert_eq!(bench.phases()[4..], [CatchPhase::Armed]);
    // Armed 400 ms after the catch and 600 ms of turning the head; closed 10 ms before the catch.
    let stood_ms = bench.told[4].0 - bench.told[3].0;
    assert!((1010..=1015).contains(&stood_ms), "{:?}", bench.told);
    let caught_at = bench.q;
    assert_ne!(caught_at, bench.coordinator.waiting);
    // `run` checks that the controller accepts all paths.
    bench.thrown_ms = 2400;
    bench.run(4800);
    assert_eq!(bench.phases()[4..8], ATTEMPT);
    assert!(bench.orders.is_empty());
}

#[test]
fn the_last_correction_uses_a_head_pose_that_is_newer_than_the_pictures() {
    let mut bench = Bench::new(false);
    // Without further pictures, only the last correction asks.
    bench.seen_ms = 40..300;
    bench.run(300);
    let asked = bench.requests.len();
    let armed = bench.coordinator.armed.as_ref().unwrap();
    let (_, catch_ns) = armed.attempt.target(0).unwrap();
    bench.run(1000);
    assert_eq!(bench.requests.len(), asked + 1);
    // 15 ms for the plan and 30 ms of motion before the catch, in a window of 4 ms.
    let ahead_ms = (catch_ns - bench.requests[asked]) / TICK_NS;
    assert!((45..=49).contains(&ahead_ms), "{ahead_ms}");
}

#[test]
fn several_planners_share_first_plans_and_correct_them_in_turns() {
    let paths = |late_first| {
        let mut bench = Bench::new(false);
        bench.coordinator.config.planners = 3;
        bench.late_first = late_first;
        let mut paths = Vec::new();
        while bench.tick < 400 {
            bench.run(bench.tick + 1);
            paths.extend(bench.outputs.paths);
        }
        assert_eq!(bench.phases()[..3], ATTEMPT[..3]);
        let first_ns = bench.answered[0].0;
        let (first, later): (Vec<_>, Vec<_>) =
            bench.answered.iter().partition(|(at, ..)| *at == first_ns);
        // Both arms, by three planners each.
        let numbers: Vec<u32> = first.iter().map(|(_, number, _)| *number).collect();
        assert_eq!(numbers, [0, 1, 2, 0, 1, 2]);
        assert!(first.iter().all(|(.., of)| *of == 3));
        assert!(later.len() > 6 && later.iter().all(|(.., of)| *of == 1));
        let turns = later.windows(2).all(|two| two[1].1 == (two[0].1 + 1) % 3);
        assert!(turns, "{later:?}");
        paths
    };
    // The order of their arrival does not matter.
    assert_eq!(paths(false), paths(true));
}

#[test]
fn late_plans_are_discarded_and_a_lost_ball_sends_the_robot_back() {
    let mut bench = Bench::new(false);
    bench.plans = false;
    bench.seen_ms = 40..300;
    bench.run(1200);
    assert!(bench.requests.len() > 6, "asks again with each prediction");
    assert_eq!(bench.controller.state(0).refused, 0);
    let order = [CatchPhase::Tracking, CatchPhase::GoingBack];
    assert_eq!(bench.phases()[1..3], order);
    // The last prediction came at 280 ms.
    assert_eq!(bench.told[2].0, 280 + 501);
}

#[test]
fn a_silent_controller_ends_an_attempt() {
    let mut bench = Bench::new(false);
    bench.run(100);
    assert_eq!(bench.coordinator.phase(), CatchPhase::Reaching);
    (0..250).for_each(|_| bench.step());
    assert_eq!(bench.coordinator.phase(), CatchPhase::Starting);
    assert!(bench.coordinator.armed.is_none());
}

#[test]
fn a_robot_that_stands_elsewhere_is_ordered_back_ten_times_per_second() {
    for mode in [ControllerMode::Standing, ControllerMode::Following] {
        let mut bench = Bench::new(false);
        bench.seen_ms = 0..0;
        bench.tick = 1000;
        for _ in 0..250 {
            bench.state = stands(mode, bench.tick * TICK_NS);
            bench.step();
        }
        assert_eq!(bench.orders, [1000, 1100, 1200]);
        assert_eq!(bench.phases(), [CatchPhase::GoingBack]);
        // States from before the order do not arm.
        bench.state = stands(ControllerMode::Ready, 1_204_000_000);
        bench.step();
        assert_eq!(bench.coordinator.phase(), CatchPhase::GoingBack);
        bench.state = stands(ControllerMode::Ready, 1_206_000_000);
        bench.step();
        assert_eq!(bench.coordinator.phase(), CatchPhase::Armed);
    }
}

#[test]
fn modes_that_accept_no_paths_end_an_attempt() {
    for (mode, phase) in [
        (Some(ControllerMode::Braking), CatchPhase::Braking),
        (Some(ControllerMode::Throwing), CatchPhase::Throwing),
        (Some(ControllerMode::GoingBack), CatchPhase::GoingBack),
        (Some(ControllerMode::Stuck), CatchPhase::Stuck),
        (None, CatchPhase::Stuck),
    ] {
        let mut bench = Bench::new(false);
        bench.run(100);
        bench.state.mode = mode.map_or(99, |mode| mode as u64);
        bench.step();
        assert_eq!(bench.coordinator.phase(), phase);
        assert!(bench.coordinator.armed.is_none());
        assert!(bench.orders.is_empty());
    }
}

#[test]
fn a_refused_path_is_taken_back_and_not_sent_again() {
    let mut bench = Bench::new(false);
    bench.run(40);
    let before = bench.state;
    let mut sent = 0;
    while bench.tick < 200 {
        // The controller takes no path.
        bench.state = ControllerState {
            t_ns: bench.tick * TICK_NS,
            ..before
        };
        bench.step();
        sent += bench.outputs.paths.iter().flatten().count();
    }
    // One path for each of the predictions at 40, 80, 120 and 160 ms.
    assert_eq!(sent, 4);
    assert_eq!(bench.coordinator.phase(), CatchPhase::Tracking);
}

#[test]
fn the_head_looks_at_the_hand_after_a_catch_only_for_the_slip_watch() {
    for looks in [false, true] {
        let mut bench = Bench::new(looks);
        let mut gazes = 0;
        while bench.coordinator.phase() != CatchPhase::GoingBack {
            bench.run(bench.tick + 1);
            gazes += usize::from(bench.outputs.gaze.is_some());
            assert!(bench.tick < 3000);
        }
        // One for each of 20 pictures and in the window of the last correction, and every 10 ms from 20 ms after the
        // catch on, for a second.
        assert_eq!(gazes > 110, looks, "{gazes}");
        assert!(looks || gazes <= 24, "{gazes}");
    }
}
