use super::*;
use crate::control::Controller;
use tactnet_catching_packets::RobotDescription;

fn request(aim: Aim) -> ThrowRequest {
    ThrowRequest::new(1, aim)
}

fn farthest() -> Aim {
    Aim::Farthest {
        heading: 0.0,
        height: 1.1,
    }
}

fn at(x: f64, y: f64) -> Aim {
    Aim::At {
        target: Vector3::new(x, y, 1.2),
    }
}

fn thrower(robot: &Robot) -> Thrower {
    Thrower::new(robot, ThrowPlanConfig::default())
}

/// Checks that the controller accepts the motion, which must keep ranges, speeds and accelerations without a jump.
fn keeps_limits(robot: &Robot, plan: &ThrowPlan) {
    let waiting = robot.waiting();
    let mut controller = Controller::new(robot.clone(), waiting, &waiting);
    let taken = controller.throw_path(0, &plan.path(0, 1, [0.0; 3]));
    assert_eq!(taken, Ok(()));
}

#[test]
fn the_farthest_throw_keeps_its_limits_and_its_direction_and_more_starts_find_none_farther() {
    let robot = Robot::nominal();
    let plan = thrower(&robot).plan(&request(farthest())).unwrap();
    assert!(plan.violation.is_feasible() && plan.v.y.abs() < 1e-4 && plan.v.x > 0.0);
    keeps_limits(&robot, &plan);
    let more = ThrowPlanConfig {
        starts: 200,
        candidates: 4000,
        ..ThrowPlanConfig::default()
    };
    let best = Thrower::new(&robot, more)
        .plan(&request(farthest()))
        .unwrap();
    assert!(plan.distance() > 0.999 * best.distance());
    // Requires a hand speed of 7 m/s.
    assert!(plan.distance() > 4.5, "{}", plan.distance());
}

#[test]
fn faster_joints_throw_farther() {
    let distance = |turn: f64, arm: f64| {
        let mut description = RobotDescription::nominal();
        description.torso.joints[0].speed *= turn;
        for joint in description.arms.iter_mut().flat_map(|arm| &mut arm.joints) {
            joint.speed *= arm;
        }
        let robot = Robot::new(description);
        let plan = thrower(&robot).plan(&request(farthest()));
        plan.unwrap().distance()
    };
    let nominal = distance(1.0, 1.0);
    assert!(distance(0.7, 1.0) < nominal && distance(1.0, 0.8) < nominal);
}

#[test]
fn a_throw_to_a_place_comes_down_there_from_both_hands_and_repeats_to_the_bit() {
    let robot = Robot::nominal();
    let thrower = thrower(&robot);
    for (arm, y) in [(0, 0.4), (1, -0.3), (1, 0.5)] {
        let request = ThrowRequest::new(arm, at(4.0, y));
        let plan = thrower.plan(&request).unwrap();
        assert!((plan.landing.p - Vector3::new(4.0, y, 1.2)).norm() < 1e-3);
        assert!(plan.v.z.atan2(plan.v.xy().norm()) < ThrowPlanConfig::default().rise + 1e-6);
        keeps_limits(&robot, &plan);
        assert_eq!(plan, thrower.plan(&request).unwrap());
        // The commanded motion at the release time equals the throw.
        let there = plan.released_late(&robot, 0.0, 1.2).unwrap();
        assert!((there.p - plan.landing.p).norm() < 1e-6);
        let late = plan.released_late(&robot, 2e-3, 1.2).unwrap();
        assert!((1e-3..0.2).contains(&(late.p - plan.landing.p).norm()));
    }
}

#[test]
fn a_throw_beside_an_earlier_one_is_found_from_it() {
    let robot = Robot::nominal();
    let thrower = thrower(&robot);
    let there = request(at(4.0, 0.3));
    let first = thrower.plan(&there).unwrap();
    assert_eq!(thrower.plan_beside(&there, &Vector3::zeros()), Ok(first));
    let beside = Vector3::new(0.1, -0.05, 0.0);
    let second = thrower.plan_beside(&there, &beside).unwrap();
    assert_eq!(second.effort.starts, 1);
    assert!((second.landing.p - Vector3::new(4.1, 0.25, 1.2)).norm() < 1e-3);
    assert!((0..8).all(|i| (first.q[i] - second.q[i]).abs() < 0.3));
    // If there is none close to it, all starts are tried.
    let mut far = request(at(9.0, 0.0));
    far.last = Some(first.unknowns);
    assert_eq!(thrower.plan(&far), Err(NoThrow::OutOfReach { wanted: 9.0 }));
}

#[test]
fn impossible_throws_are_rejected_with_a_reason() {
    let robot = Robot::nominal();
    let thrower = thrower(&robot);
    let good = request(at(4.0, 0.0));
    let refused = |change: fn(&mut ThrowRequest)| {
        let mut request = good;
        change(&mut request);
        thrower.plan(&request).unwrap_err()
    };
    assert_eq!(refused(|request| request.arm = 2), NoThrow::NoBall);
    let nowhere = refused(|request| request.aim = at(f64::NAN, 0.0));
    assert_eq!(nowhere, NoThrow::NotFinite);
    let hasty = ThrowPlanConfig {
        coast: -0.1,
        ..ThrowPlanConfig::default()
    };
    let error = Thrower::new(&robot, hasty).plan(&good).unwrap_err();
    assert!(error.to_string().contains("`coast`"), "{error}");
    let far = thrower.plan(&request(at(9.0, 0.0))).unwrap_err();
    assert_eq!(far, NoThrow::OutOfReach { wanted: 9.0 });
    assert!(far.to_string().contains("9.00 m"), "{far}");
    let timid = ThrowPlanConfig {
        margin: 1.0,
        ..ThrowPlanConfig::default()
    };
    let error = Thrower::new(&robot, timid).plan(&good).unwrap_err();
    assert!(matches!(error, NoThrow::Obstructed { .. }), "{error}");
    assert!(error.to_string().contains("than 1 m"), "{error}");
}
