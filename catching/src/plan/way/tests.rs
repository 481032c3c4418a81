use proptest::prelude::*;

use super::super::problem::Problem;
use super::super::problem::tests::passing;
use super::*;
use crate::plan::{CatchRequest, PlanConditions, PlanConfig, Planner};

fn request(robot: &Robot) -> CatchRequest {
    passing(robot, [0.6, 0.45, 0.05])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn the_costs_gradient_is_a_difference(
        q in proptest::array::uniform7(-1.0..1.0f64), w in proptest::array::uniform7(-0.5..0.5f64), t in 0.5..1.2f64,
        away in proptest::array::uniform7(-0.6..0.6f64), end in 0.3..1.0f64, since in 0.0..0.3f64,
    ) {
        let robot = Robot::nominal();
        let from = robot.ready(1);
        let ramps = std::array::from_fn(|i| {
            Ramp::between(from[i], 0.0, from[i] + away[i], end, robot.arm(1).joints()[i].speed)
        });
        prop_assume!(ramps.iter().all(|ramp: &Ramp| ramp.a.is_finite()));
        let mut request = request(&robot);
        (request.w0, request.other) = (w, Some(OtherArm { ramps, since }));
        let own = OwnBodies::new(&robot, 0);
        let problem = Problem::new(&request, robot.arm(0), &own, 0.0);
        let config = WayConfig { soft: 0.4, weight: 1.0, ..WayConfig::default() };
        let x: Point = std::array::from_fn(|i| if i < ARM_JOINTS { request.q0[i] + 0.5 * q[i] } else { t });
        prop_assume!((0..ARM_JOINTS).all(|i| problem.motion.acceleration(&x, i).a.abs() < 30.0));
        let (cost, gradient) = own.cost(&config, &problem.motion, &x);
        prop_assert!(cost > 0.0);
        for i in 0..UNKNOWNS {
            let moved = |h: f64| { let mut y = x; y[i] += h; own.cost(&config, &problem.motion, &y).0 };
            let h = 1e-5;
            let (more, less) = (moved(h), moved(-h));
            // The cost has kinks where parts of ramps start at a sample or the closest corner of a hull changes.
            prop_assume!((more + less - 2.0 * cost).abs() < 1e-8);
            let slope = (more - less) / (2.0 * h);
            prop_assert!((slope - gradient[i]).abs() < 2e-3 * (1.0 + slope.abs()), "{i}: {slope} {}", gradient[i]);
        }
    }
}

/// The other arm moves to many positions. If it blocks the plan computed without it, the result is another plan or
/// none.
#[test]
fn a_plan_keeps_away_from_the_other_arms_way() {
    use rand::{RngExt, SeedableRng};
    let robot = Robot::nominal();
    let planner = Planner::new(&robot, 0, PlanConfig::default());
    let own = OwnBodies::new(&robot, 0);
    let config = WayConfig::default();
    let mut asked = request(&robot);
    asked.ball.p.y -= 0.4;
    let alone = planner.plan(&asked, &PlanConditions::default(), || false);
    let alone = alone.unwrap();
    let (from, joints) = (robot.ready(1), robot.arm(1).joints());
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let (mut in_the_way, mut gone_round) = (0, 0);
    for _ in 0..300 {
        let ramps = std::array::from_fn(|i| {
            let to = from[i] + rng.random_range(-1.0..1.0);
            Ramp::between(from[i], 0.0, to, 0.8, joints[i].speed)
        });
        let mut with = asked;
        with.other = Some(OtherArm { ramps, since: 0.0 });
        let problem = Problem::new(&with, robot.arm(0), &own, 0.0);
        if own.is_clear(&config, &problem.motion, &alone.ramps) {
            continue;
        }
        in_the_way += 1;
        if let Ok(plan) = planner.plan(&with, &PlanConditions::default(), || false) {
            gone_round += 1;
            assert!(own.least(&config, &problem.motion, &plan.ramps, 1.0) >= config.hard);
            assert!(plan.violation.is_feasible());
        }
    }
    let counts = [in_the_way, gone_round];
    assert!(in_the_way >= 5 && gone_round >= 1, "{counts:?}");
}
