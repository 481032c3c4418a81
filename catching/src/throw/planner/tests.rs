use super::*;
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

/// Checks ranges, speeds and, by finite differences, accelerations of the whole motion.
fn keeps_limits(robot: &Robot, plan: &ThrowPlan) {
    let h = 1e-3;
    let mut last = plan.motion.at(0.0);
    for i in 1..=(plan.motion.end() / h) as usize {
        let now = plan.motion.at(i as f64 * h);
        for (joint, limits) in robot.joints().iter().enumerate() {
            let [low, high] = limits.range;
            let range = low - 1e-6..=high + 1e-6;
            assert!(range.contains(&now.0[joint]), "{joint}");
            assert!(now.1[joint].abs() <= limits.speed * (1.0 + 1e-6), "{joint}");
            let change = (now.1[joint] - last.1[joint]) / h;
            let most = limits.acceleration * (1.0 + 1e-6);
            assert!(change.abs() <= most, "{joint} {change}");
            let way = now.0[joint] - last.0[joint] - (now.1[joint] + last.1[joint]) / 2.0 * h;
            // Excludes jumps; allows a change of acceleration within the step.
            assert!(way.abs() < limits.acceleration * h * h, "{joint} {way}");
        }
        last = now;
    }
    assert!(last.1.iter().all(|w| w.abs() < 0.1));
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
        let there = plan.released_late(&robot, 0.0, DRAG, 1.2).unwrap();
        assert!((there.p - plan.landing.p).norm() < 1e-6);
        let late = plan.released_late(&robot, 2e-3, DRAG, 1.2).unwrap();
        assert!((1e-3..0.2).contains(&(late.p - plan.landing.p).norm()));
    }
}

#[test]
fn a_throw_beside_an_earlier_one_is_found_from_it() {
    let robot = Robot::nominal();
    let thrower = thrower(&robot);
    let first = thrower.plan(&request(at(4.0, 0.3))).unwrap();
    let mut again = request(at(4.1, 0.25));
    again.last = Some(first.unknowns);
    let second = thrower.plan(&again).unwrap();
    assert_eq!(second.effort.starts, 1);
    assert!((second.landing.p - Vector3::new(4.1, 0.25, 1.2)).norm() < 1e-3);
    assert!((0..8).all(|i| (first.q[i] - second.q[i]).abs() < 0.3));
    // If there is none close to it, all starts are tried.
    let mut far = again;
    far.aim = at(9.0, 0.0);
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
    assert_eq!(refused(|request| request.holding = None), NoThrow::NoBall);
    let third = refused(|request| request.holding = Some(2));
    assert_eq!(third, NoThrow::NoBall);
    let drag = refused(|request| request.drag = f64::NAN);
    assert_eq!(drag, NoThrow::NotFinite);
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
