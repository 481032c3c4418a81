use super::*;

/// Returns a plan that reaches `q` at all joints after one second.
fn planned(start_ns: u64, q: f64) -> PlanResult {
    PlanResult {
        request: PlanRequest {
            ball: 7,
            start_ns,
            ..PlanRequest::zeroed()
        },
        q: [q; ARM_JOINTS],
        t: 1.0,
        cost: 1.0,
        ramps: [Ramp::standing(q).packet(); ARM_JOINTS],
        ..PlanResult::zeroed()
    }
}

#[test]
fn a_refused_correction_leaves_the_arm_on_its_way_and_the_hand_told() {
    let robot = Robot::nominal();
    let mut attempt = CatchAttempt::new(robot, CoordinatorConfig::default(), [0.0; JOINTS], None);
    let carried = |attempt: &CatchAttempt| {
        let (start_ns, ramps) = attempt.arm(0);
        (start_ns, *ramps)
    };
    let standing = carried(&attempt);

    // A rejected first path leaves no target.
    attempt.planned(&[planned(1_000, 0.1)]);
    attempt.carried_out(0, standing.0, standing.1);
    assert_eq!(attempt.target(0), None);
    assert_eq!(attempt.state, CatchState::Tracking);

    attempt.planned(&[planned(2_000, 0.2)]);
    let first = carried(&attempt);
    attempt.carried_out(0, first.0, first.1);
    // Two rejected corrections.
    for start_ns in [3_000, 4_000] {
        attempt.planned(&[planned(start_ns, 0.3)]);
        assert_eq!(attempt.target(0), Some((7, 1_000_000_000 + start_ns)));
    }
    attempt.carried_out(0, first.0, first.1);
    assert_eq!(attempt.target(0), Some((7, 1_000_002_000)));
    assert_eq!(attempt.state, CatchState::Reaching);
    let hand = attempt.hands[0].map(|hand| hand.catch_ns);
    assert_eq!(hand, Some(1_000_002_000));
    assert_eq!(carried(&attempt), first);
}

#[test]
fn an_arm_is_asked_for_once_its_path_has_begun_and_alone_where_that_is_wanted() {
    let robot = Robot::nominal();
    let mut attempt = CatchAttempt::new(robot, CoordinatorConfig::default(), [0.0; JOINTS], None);
    let mut predictions = BallPredictions::zeroed();
    predictions.count = 1;
    predictions.balls[0] = BallPrediction {
        ball: 7,
        p: [4.0, 0.0, 1.5],
        v: [-6.0, 0.0, 2.0],
        existence: 1.0,
        frames: 9,
        ..BallPrediction::zeroed()
    };
    let chest = attempt.robot.chest(&[0.0; JOINTS]);
    let mut asked = |arms: [bool; ARMS], now_ns: u64, plan: bool| {
        let requests = attempt.predictions(arms, now_ns, &predictions, &chest);
        let requests: Vec<PlanRequest> = requests.into_iter().flatten().collect();
        let first = requests.iter().find(|request| plan && request.arm == 0);
        let answer = first.map(|request| planned(request.start_ns, 0.1));
        attempt.planned(answer.as_slice());
        requests
            .iter()
            .map(|request| request.arm)
            .collect::<Vec<_>>()
    };
    assert_eq!(asked([true; ARMS], 0, false), [0, 1]);
    assert_eq!(asked([false, true], 0, false), [1]);
    assert_eq!(asked([true; ARMS], 0, true), [0, 1]);
    // Its path starts at 15 ms; the ball is assigned to it from then on.
    for (now_ms, arms) in [(2, &[][..]), (13, &[]), (14, &[0]), (40, &[0])] {
        let asked = asked([true; ARMS], now_ms * 1_000_000, false);
        assert_eq!(asked, arms, "{now_ms}");
    }
}
