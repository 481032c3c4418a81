//! Commands stay smooth and within limits for any input.

use proptest::prelude::*;

use super::*;

const TICK_NS: u64 = 1_000_000;

/// Returns a robot, its waiting pose, and its controller in that pose.
fn waiting() -> (Robot, [f64; JOINTS], Controller) {
    let robot = Robot::nominal();
    let ready = robot.waiting();
    let controller = Controller::new(robot.clone(), ready, &ready);
    (robot, ready, controller)
}

/// Returns a path that continues the current motion towards a position given as fractions of the ranges, in `seconds`.
fn path(
    robot: &Robot,
    state: &ControllerState,
    arm: usize,
    start_ns: u64,
    shares: &[f64],
    seconds: f64,
) -> ArmPath {
    let before = &state.paths[arm];
    ArmPath {
        arm: arm as u64,
        start_ns,
        ramps: std::array::from_fn(|i| {
            let limits = &robot.joints()[joint::ARM[arm].start + i];
            let (q, w) = at(before, i, start_ns);
            let wanted = limits.range[0] + (limits.range[1] - limits.range[0]) * shares[i];
            // Only a tenth of the distance, so that the motion keeps the limits if there is enough time.
            Ramp::between(q, w, q + 0.1 * (wanted - q), seconds, limits.speed).packet()
        }),
        ..ArmPath::zeroed()
    }
}

#[derive(Debug, Clone)]
enum Event {
    Path {
        arm: usize,
        shares: Vec<f64>,
        seconds: f64,
        early_ms: u64,
        shifted: f64,
    },
    Body {
        turn: f64,
    },
    Brake,
    GoBack,
}

fn events() -> impl Strategy<Value = Vec<(u64, Event)>> {
    let path = (
        0..3usize,
        proptest::collection::vec(0.0..1.0f64, ARM_JOINTS),
        0.2..1.0f64,
        0..20u64,
        prop_oneof![4 => Just(0.0), 1 => -1.0..1.0f64],
    )
        .prop_map(|(arm, shares, seconds, early_ms, shifted)| Event::Path {
            arm,
            shares,
            seconds,
            early_ms,
            shifted,
        });
    let event = prop_oneof![6 => path, 1 => (-0.5..0.5f64).prop_map(|turn| Event::Body { turn }), 1 => Just(Event::Brake), 1 => Just(Event::GoBack)];
    let wait = prop_oneof![2 => 1..400u64, 1 => 1..12u64];
    proptest::collection::vec((wait, event), 1..12)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// For any input, commands are smooth and within limits, and the robot returns to its waiting pose.
    #[test]
    fn commands_stay_within_limits_and_the_robot_finds_back(events in events()) {
        let (robot, ready, mut controller) = waiting();
        let (mut now, mut last) = (TICK_NS, (ready, [0.0; JOINTS]));
        let mut tick = |controller: &mut Controller, now: u64| -> Result<(), TestCaseError> {
            let (q, dq) = controller.tick(now);
            for (i, limits) in robot.joints().iter().enumerate() {
                prop_assert!(q[i] >= limits.range[0] - 1e-9 && q[i] <= limits.range[1] + 1e-9, "joint {i} at {}", q[i]);
                prop_assert!(dq[i].abs() <= limits.speed * 1.001, "joint {i}: {}", dq[i]);
                let change = (dq[i] - last.1[i]).abs();
                prop_assert!(change <= limits.acceleration * 1.6e-3 + 2e-3, "joint {i} changes by {change}");
                let moved = q[i] - last.0[i];
                prop_assert!((moved - 0.5e-3 * (dq[i] + last.1[i])).abs() < limits.acceleration * 1.1e-6 + POSITION_TOLERANCE, "joint {i} moved by {moved}");
            }
            last = (*q, *dq);
            Ok(())
        };
        for (wait, event) in events {
            for _ in 0..wait {
                tick(&mut controller, now)?;
                now += TICK_NS;
            }
            match event {
                Event::Path { arm, shares, seconds, early_ms, shifted } => {
                    let state = controller.state(now);
                    let mut path = path(&robot, &state, arm.min(1), now + early_ms * TICK_NS, &shares, seconds);
                    path.arm = arm as u64;
                    path.ramps[3].q0 += shifted;
                    let refused = state.refused;
                    let taken = controller.arm_path(now, &path);
                    prop_assert_eq!(controller.state(now).refused, refused + u64::from(taken.is_err()));
                    prop_assert!(taken.is_err() || (arm < 2 && shifted.abs() <= POSITION_TOLERANCE));
                }
                Event::Body { turn } => {
                    let mut body = BodyPath::zeroed();
                    let q = controller.q;
                    body.start_ns = now;
                    body.platform = Ramp::standing(q[joint::PLATFORM]).packet();
                    let from = q[joint::TORSO.start];
                    body.turn = Ramp::between(from, 0.0, from + turn, 1.0, robot.joints()[joint::TORSO.start].speed).packet();
                    let _ = controller.body_path(&body);
                }
                Event::Brake => controller.brake("asked"),
                Event::GoBack => controller.go_back(),
            }
        }
        let mut asked = 0;
        while controller.mode() != ControllerMode::Ready {
            if matches!(controller.mode(), ControllerMode::Following | ControllerMode::Standing) {
                controller.go_back();
            }
            tick(&mut controller, now)?;
            now += TICK_NS;
            asked += 1;
            prop_assert!(asked < 40_000, "{:?}", controller.mode());
        }
        prop_assert_eq!(controller.q, ready);
    }
}

#[test]
fn the_way_back_is_the_way_that_it_came() {
    let (robot, _, mut controller) = waiting();
    controller.tick(TICK_NS);
    let way = path(&robot, &controller.state(0), 1, 5 * TICK_NS, &[0.9; 7], 0.7);
    controller.arm_path(TICK_NS, &way).unwrap();
    let (mut there, mut now) = (Vec::new(), TICK_NS);
    for _ in 0..800 {
        now += TICK_NS;
        there.push(*controller.tick(now).0);
    }
    controller.go_back();
    let mut ticks = 0;
    while controller.mode() == ControllerMode::GoingBack {
        now += TICK_NS;
        let q = *controller.tick(now).0;
        let apart = |t: &[f64; JOINTS]| {
            let pairs = t.iter().zip(&q);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let nearest = there.iter().map(apart).fold(f64::INFINITY, f64::min);
        assert!(nearest < 3e-3, "{nearest} rad beside the way");
        ticks += 1;
    }
    assert_eq!(controller.mode(), ControllerMode::Ready);
    assert!((1400..2200).contains(&ticks), "half as fast: {ticks}");
}

/// After a stop anywhere on the way back, the robot continues without a jump.
#[test]
fn a_way_back_that_is_interrupted_goes_on_smoothly() {
    for ticks in (40..400).step_by(7) {
        let (robot, _, mut controller) = waiting();
        controller.tick(TICK_NS);
        let way = path(&robot, &controller.state(0), 0, 5 * TICK_NS, &[0.9; 7], 0.5);
        controller.arm_path(TICK_NS, &way).unwrap();
        let (mut now, mut last) = (TICK_NS, [0.0; JOINTS]);
        let mut run = |controller: &mut Controller, ticks: usize| {
            for _ in 0..ticks {
                now += TICK_NS;
                let dq = *controller.tick(now).1;
                for (i, limits) in robot.joints().iter().enumerate() {
                    let change = (dq[i] - last[i]).abs();
                    let most = limits.acceleration * 1.1e-3 + 1e-3;
                    assert!(change <= most, "joint {i} changes by {change}");
                }
                last = dq;
            }
        };
        run(&mut controller, 600);
        controller.go_back();
        run(&mut controller, ticks);
        controller.brake("asked");
        run(&mut controller, 200);
        assert_eq!(controller.mode(), ControllerMode::Standing);
        controller.go_back();
        run(&mut controller, 4000);
        assert_eq!(controller.mode(), ControllerMode::Ready);
    }
}

#[test]
fn a_controller_that_starts_elsewhere_goes_back_where_the_way_is_free() {
    let robot = Robot::nominal();
    let ready = robot.waiting();
    let mut elsewhere = ready;
    elsewhere[joint::RIGHT_ARM.start + 3] += 0.4;
    let mut controller = Controller::new(robot, ready, &elsewhere);
    assert_eq!(controller.mode(), ControllerMode::Standing);
    controller.tick(TICK_NS);
    controller.go_back();
    for tick in 2..6000 {
        controller.tick(tick * TICK_NS);
    }
    assert_eq!(controller.mode(), ControllerMode::Ready);
}

/// Returns a path of the left arm from its waiting pose.
fn path_at(robot: &Robot, controller: &Controller, start_ms: u64, share: f64) -> ArmPath {
    let (state, shares) = (controller.state(0), [share; ARM_JOINTS]);
    path(robot, &state, 0, start_ms * TICK_NS, &shares, 0.8)
}

#[test]
fn late_paths_and_paths_that_jump_are_refused_with_a_reason() {
    let (robot, _, mut controller) = waiting();
    let now = 10 * TICK_NS;
    controller.tick(now);
    let good = path_at(&robot, &controller, 20, 0.2);
    type Spoil = fn(&mut ArmPath);
    let cases: [(Spoil, PathError); 4] = [
        (
            |path| path.start_ns = 5 * TICK_NS,
            PathError::Time { late_us: 5000 },
        ),
        (
            |path| path.ramps[2].q0 += 0.01,
            PathError::Jump { joint: 2 },
        ),
        (
            |path| path.ramps[1].a *= 40.0,
            PathError::Limits { joint: 1 },
        ),
        (|path| path.ramps[0].t2 = f64::NAN, PathError::NotFinite),
    ];
    for (spoil, refusal) in cases {
        let mut spoilt = good;
        spoil(&mut spoilt);
        assert_eq!(controller.arm_path(now, &spoilt), Err(refusal));
    }
    let mode = controller.mode();
    assert_eq!(mode, ControllerMode::Ready, "nothing has changed");
    controller.arm_path(now, &good).unwrap();
    controller.brake("asked");
    let late = controller.arm_path(now, &good);
    assert_eq!(late, Err(PathError::NotFollowing));
    assert_eq!(controller.state(0).refused, 5);
}

/// With two waiting paths, the first one would be skipped.
#[test]
fn a_path_behind_one_that_waits_is_refused() {
    let (robot, _, mut controller) = waiting();
    controller.tick(10 * TICK_NS);
    let first = path_at(&robot, &controller, 20, 0.2);
    controller.arm_path(10 * TICK_NS, &first).unwrap();
    let second = path_at(&robot, &controller, 24, 0.9);
    let refused = controller.arm_path(11 * TICK_NS, &second);
    assert_eq!(refused, Err(PathError::Waiting));
    for tick in 11..=20 {
        controller.tick(tick * TICK_NS);
    }
    controller.arm_path(20 * TICK_NS, &second).unwrap();
}
