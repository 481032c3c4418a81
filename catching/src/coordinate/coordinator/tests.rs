use bytemuck::Zeroable;
use tactnet_catching_packets::RobotDescription;

use super::*;
use crate::plan::{Effort, Objective, Violation};

/// Returns a plan that reaches `q` at all joints after one second.
fn planned(coordinator: &Coordinator, start_ns: u64, q: f64) -> Planned {
    let (_, ramps) = coordinator.arm(0);
    let ball = Flight {
        p: Vector3::zeros(),
        v: Vector3::x(),
        k: 0.0,
        lift: Vector3::zeros(),
    };
    let catch = CatchRequest {
        ball,
        q0: ramps.map(|ramp| ramp.q0),
        w0: [0.0; ARM_JOINTS],
        earliest: 0.0,
        latest: 1.8,
        objective: Objective::Soft,
        other: None,
    };
    Planned {
        request: PlanRequest {
            ball: 7,
            arm: 0,
            start_ns,
            last: None,
            catch,
        },
        plan: Ok(CatchPlan {
            q: [q; ARM_JOINTS],
            t: 1.0,
            ramps: [Ramp::standing(q); ARM_JOINTS],
            cost: 1.0,
            violation: Violation::default(),
            effort: Effort::default(),
        }),
    }
}

#[test]
fn a_refused_correction_leaves_the_arm_on_its_way_and_the_hand_told() {
    let robot = Robot::new(RobotDescription::nominal());
    let mut coordinator = Coordinator::new(robot, CoordinatorConfig::default(), [0.0; JOINTS]);
    let carried = |coordinator: &Coordinator| {
        let (start_ns, ramps) = coordinator.arm(0);
        (start_ns, *ramps)
    };
    let standing = carried(&coordinator);

    // A rejected first path leaves no target.
    coordinator.planned(&[planned(&coordinator, 1_000, 0.1)]);
    coordinator.carried_out(0, standing.0, standing.1);
    assert_eq!(coordinator.target(0), None);
    assert_eq!(coordinator.state(), CatchState::Tracking);

    coordinator.planned(&[planned(&coordinator, 2_000, 0.2)]);
    let first = carried(&coordinator);
    coordinator.carried_out(0, first.0, first.1);
    // Two rejected corrections.
    for start_ns in [3_000, 4_000] {
        coordinator.planned(&[planned(&coordinator, start_ns, 0.3)]);
        assert_eq!(coordinator.target(0), Some((7, 1_000_000_000 + start_ns)));
    }
    coordinator.carried_out(0, first.0, first.1);
    assert_eq!(coordinator.target(0), Some((7, 1_000_002_000)));
    assert_eq!(coordinator.state(), CatchState::Reaching);
    let hand = coordinator.hands()[0].map(|hand| hand.catch_ns);
    assert_eq!(hand, Some(1_000_002_000));
    assert_eq!(carried(&coordinator), first);
}
#[test]
fn an_arm_is_asked_for_once_its_path_has_begun_and_alone_where_that_is_wanted() {
    let robot = Robot::new(RobotDescription::nominal());
    let mut coordinator = Coordinator::new(robot, CoordinatorConfig::default(), [0.0; JOINTS]);
    let mut predictions = BallPredictions {
        count: 1,
        ..BallPredictions::zeroed()
    };
    predictions.balls[0] = BallPrediction {
        ball: 7,
        p: [4.0, 0.0, 1.5],
        v: [-6.0, 0.0, 2.0],
        existence: 1.0,
        frames: 9,
        ..BallPrediction::zeroed()
    };
    let chest = coordinator.robot.chest(&[0.0; JOINTS]);
    let mut asked = |arms: [bool; ARMS], now_ns: u64, plan: bool| {
        let requests = coordinator.predictions_for(arms, now_ns, &predictions, &chest);
        let first = requests.iter().flatten().find(|request| request.arm == 0);
        let answers: Vec<Planned> = first
            .filter(|_| plan)
            .map(|request| Planned {
                request: *request,
                ..planned(&coordinator, request.start_ns, 0.1)
            })
            .into_iter()
            .collect();
        coordinator.planned(&answers);
        requests
            .iter()
            .flatten()
            .map(|request| request.arm)
            .collect::<Vec<_>>()
    };
    assert_eq!(asked([true; ARMS], 0, false), [0, 1]);
    assert_eq!(asked([false, true], 0, false), [1]);
    assert_eq!(asked([true; ARMS], 0, true), [0, 1]);
    // Its path starts at 15 ms; the ball is assigned to it from then on.
    for (now_ms, arms) in [(2, &[][..]), (13, &[]), (14, &[0]), (40, &[0])] {
        assert_eq!(
            asked([true; ARMS], now_ms * 1_000_000, false),
            arms,
            "{now_ms}"
        );
    }
}
