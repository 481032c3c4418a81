use nalgebra::Vector3;
use proptest::prelude::*;
use tactnet_catching_packets::RobotDescription;

use super::*;
use crate::flight::Flight;
use crate::plan::Objective;
use crate::plan::problem::tests::passing;

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -3.0..3.0f64,
        1 => -1e6..1e6f64,
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(0.0), Just(-0.0), Just(1e300), Just(1e-300)],
    ]
}

fn objective() -> impl Strategy<Value = Objective> {
    prop_oneof![
        Just(Objective::Soft),
        Just(Objective::Latest),
        Just(Objective::Cool)
    ]
}

/// Returns requests from throws to the chest's front up to invalid numbers.
fn request() -> impl Strategy<Value = CatchRequest> {
    let sensible = (
        proptest::array::uniform3(-1.0..1.0f64),
        0.3..1.0f64,
        proptest::array::uniform3(-1.0..1.0f64),
    )
        .prop_map(|(aim, time, speed)| {
            let target = Vector3::new(0.6 + 0.4 * aim[0], 1.2 * aim[1], 0.6 * aim[2]);
            let v = Vector3::new(-5.5 + speed[0], speed[1], -2.0 + 2.0 * speed[2]);
            Flight::without_spin(target, v, 0.03).after(-time)
        });
    let hostile = (
        proptest::array::uniform3(number()),
        proptest::array::uniform3(number()),
        number(),
    )
        .prop_map(|(p, v, k)| Flight::without_spin(p.into(), v.into(), k));
    (
        prop_oneof![9 => sensible, 1 => hostile],
        proptest::array::uniform7(-1.0..1.0f64),
        proptest::array::uniform7(-1.0..1.0f64),
        prop_oneof![9 => Just([0.0, 1.8]), 1 => proptest::array::uniform2(number())],
        objective(),
        prop_oneof![4 => Just(0.0), 1 => number()],
    )
        .prop_map(|(ball, share, speed, [earliest, latest], objective, odd)| {
            let joints = RobotDescription::nominal().arms[0].joints;
            let mut q0: [f64; 7] = std::array::from_fn(|i| share[i] * joints[i].range[1]);
            q0[2] += odd;
            CatchRequest {
                ball,
                q0,
                w0: std::array::from_fn(|i| speed[i] * joints[i].speed),
                earliest,
                latest,
                objective,
                other: None,
            }
        })
}

fn after(last: Option<CatchPoint>) -> PlanConditions<'static> {
    PlanConditions {
        last,
        ..PlanConditions::default()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// For any request, the result is an error or a path that keeps ranges, speeds and accelerations at all times and
    /// ends at the ball.
    #[test]
    fn no_path_leaves_the_limits(request in request(), last in proptest::option::of((proptest::array::uniform7(number()), number()))) {
        let robot = Robot::nominal();
        let config = PlanConfig { first: Grid { times: 8, hands: 6, elbows: 6 }, starts: 2, ..PlanConfig::default() };
        let planner = Planner::new(&robot, 0, config);
        let conditions = after(last.map(|(q, t)| CatchPoint { q, t }));
        let ball_at = |t: f64| request.ball.after(t);
        if let Ok(plan) = planner.plan(&request, &conditions, || false) {
            keeps_limits(&plan, &request, &robot)?;
            let [apart, aslant] = misses(&plan, &ball_at(plan.t), &robot);
            prop_assert!(apart < 2e-5 && aslant < 2e-4);
        }
        // A near miss keeps all limits as well and reports its errors.
        if let Ok(plan) = planner.plan(&request, &conditions.nearest_miss(), || false) {
            keeps_limits(&plan, &request, &robot)?;
            let [apart, aslant] = misses(&plan, &ball_at(plan.t), &robot);
            prop_assert!((apart - plan.violation.position).abs() < 1e-5, "{apart} {:?}", plan.violation);
            prop_assert!((aslant - plan.violation.angle).abs() < 1e-4 + 1e-3 * aslant, "{aslant} {:?}", plan.violation);
            prop_assert!(apart <= 0.15);
        }
    }

    /// After a change of the prediction, a correction is never worse than continuing the current motion.
    #[test]
    fn a_near_miss_is_no_farther_off_than_carrying_on(aside in -0.5..0.5f64, rise in -0.3..0.3f64, heard in 0.1..0.45f64) {
        let robot = Robot::nominal();
        let planner = Planner::new(&robot, 0, PlanConfig::default());
        let first = CatchRequest { ball: caught(&robot).ball.after(0.2), ..caught(&robot) };
        let ball = first.ball;
        let plan = planner.plan(&first, &PlanConditions::default(), || false).unwrap();
        let mut elsewhere = ball.after(heard);
        elsewhere.v += Vector3::new(0.0, aside, rise);
        let on_the_way = plan.ramps.map(|ramp| ramp.at(heard));
        let request = CatchRequest { ball: elsewhere, q0: on_the_way.map(|(q, _)| q), w0: on_the_way.map(|(_, w)| w), ..first };
        let carried_on = misses_at(&plan.q, &elsewhere.after(plan.t - heard), &robot);
        let weigh = |[apart, aslant]: [f64; 2]| (apart / 0.005).powi(2) + (aslant.sin() / 0.15).powi(2);
        if let Ok(better) = planner.plan(&request, &after(Some(CatchPoint { q: plan.q, t: plan.t - heard })).nearest_miss(), || false) {
            prop_assert!(weigh(misses(&better, &elsewhere.after(better.t), &robot)) <= weigh(carried_on) * (1.0 + 1e-6) + 1e-6);
        } else {
            prop_assert!(carried_on[0] > 0.1 || carried_on[1] > 0.5, "{carried_on:?}");
        }
    }
}

fn keeps_limits(
    plan: &CatchPlan,
    request: &CatchRequest,
    robot: &Robot,
) -> Result<(), TestCaseError> {
    prop_assert!(plan.t >= request.earliest && plan.t <= request.latest);
    for (ramp, joint) in plan.ramps.iter().zip(robot.arm(0).joints()) {
        let most = joint.acceleration * (1.0 + 1e-6) + 1e-6;
        prop_assert!(ramp.a.abs() <= most, "{} {most}", ramp.a);
        prop_assert!(ramp.end <= plan.t + 1e-12);
        for i in 0..=200 {
            let (q, w) = ramp.at(ramp.end * f64::from(i) / 200.0);
            prop_assert!(joint.range[0] - 1e-6 <= q && q <= joint.range[1] + 1e-6);
            prop_assert!(w.abs() <= joint.speed * (1.0 + 1e-9));
        }
    }
    Ok(())
}

/// Returns the distance in m and the angle in rad between hand and ball at the end of the path.
fn misses(plan: &CatchPlan, ball: &Flight, robot: &Robot) -> [f64; 2] {
    let q = std::array::from_fn(|i| plan.ramps[i].at(plan.t).0);
    misses_at(&q, ball, robot)
}

fn misses_at(q: &[f64; 7], ball: &Flight, robot: &Robot) -> [f64; 2] {
    let pose = robot.arm(0).forward(q);
    let axis: Vector3<f64> = pose.rotation.column(2).into_owned();
    let against = -ball.v / ball.v.norm();
    [
        (pose.position - ball.p).norm(),
        axis.cross(&against).norm().atan2(axis.dot(&against)),
    ]
}

fn caught(robot: &Robot) -> CatchRequest {
    passing(robot, [0.6, 0.4, 0.1])
}

fn planned() -> (Planner, CatchRequest, CatchPlan) {
    let robot = Robot::nominal();
    let (planner, caught) = (
        Planner::new(&robot, 0, PlanConfig::default()),
        caught(&robot),
    );
    let plan = planner.plan(&caught, &PlanConditions::default(), || false);
    (planner, caught, plan.unwrap())
}

#[test]
fn reasons_are_told_apart() {
    let (planner, caught, plan) = planned();
    assert!((0.5..0.95).contains(&plan.t), "{}", plan.t);
    let mut away = caught;
    away.ball.v = Vector3::new(6.0, 0.0, 2.0);
    let why = |request: &CatchRequest, out_of_time: bool| {
        let plan = planner.plan(request, &PlanConditions::default(), || out_of_time);
        plan.unwrap_err()
    };
    assert_eq!(why(&away, false), NoPlan::OutOfReach);
    let mut soon = caught;
    soon.ball = caught.ball.after(0.78);
    soon.q0[0] += 1.5;
    assert_eq!(why(&soon, false), NoPlan::NoCatch);
    assert_eq!(why(&caught, true), NoPlan::OutOfTime);
    let mut numbers = caught;
    numbers.w0 = [f64::NAN; 7];
    let refused = why(&numbers, false).to_string();
    assert_eq!(refused, "the request has values that are not finite");
}

#[test]
fn a_repeated_plan_is_not_worse_and_needs_fewer_iterations() {
    let (planner, caught, plan) = planned();
    let CatchPlan { q, t, .. } = plan;
    let conditions = after(Some(CatchPoint { q, t }));
    let again = planner.plan(&caught, &conditions, || false).unwrap();
    assert!(again.cost <= plan.cost + 1e-9);
    assert!(again.effort.iterations <= plan.effort.iterations);
}
