use nalgebra::Vector3;
use proptest::prelude::*;

use super::*;
use crate::plan::seeds::{Grid, Seeds, Share};
use crate::robot::Robot;

pub(crate) fn thrown() -> impl Strategy<Value = Flight> {
    (
        proptest::array::uniform3(-1.0..1.0f64),
        0.02..0.04f64,
        0.4..0.9f64,
        proptest::array::uniform3(-1.0..1.0f64),
    )
        .prop_map(|(aim, k, time, speed)| {
            // Towards the chest's front after `time` seconds, at about 6 m/s.
            let target = Vector3::new(0.6 + 0.3 * aim[0], 0.9 * aim[1], 0.5 * aim[2]);
            let v = Vector3::new(-5.5 + 0.5 * speed[0], 0.4 * speed[1], -2.5 + speed[2]);
            Flight::without_spin(target, v, k).after(-time)
        })
}

/// Returns a request of the resting left arm for a ball that passes `p`, in m, after 0.8 s.
pub(crate) fn passing(robot: &Robot, p: [f64; 3]) -> CatchRequest {
    let v = Vector3::new(-5.5, 0.0, -2.0);
    CatchRequest {
        ball: Flight::without_spin(p.into(), v, 0.03).after(-0.8),
        q0: robot.ready(0),
        w0: [0.0; ARM_JOINTS],
        earliest: 0.0,
        latest: 1.8,
        objective: Objective::Soft,
        other: None,
    }
}

#[test]
fn the_numbers_of_equations_and_inequalities_are_the_thesis_ones() {
    assert_eq!((UNKNOWNS, EQUALITIES, INEQUALITIES), (8, 5, 31));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn linear_forms_are_differences(
        ball in thrown(), arm in 0..2usize, q in proptest::array::uniform7(-1.8..1.8f64), t in 0.3..1.2f64,
        w in proptest::array::uniform7(-0.5..0.5f64),
    ) {
        let robot = Robot::nominal();
        let request = CatchRequest { ball, q0: [0.1; 7], w0: w, earliest: 0.0, latest: 1.8, objective: Objective::Soft, other: None };
        let own = OwnBodies::new(&robot, arm);
        let problem = Problem::new(&request, robot.arm(arm), &own, 0.02);
        let x: Point = std::array::from_fn(|i| if i < 7 { q[i] } else { t });
        let here = problem.linearise(&x, 0.1);
        let h = 1e-6;
        for i in 0..UNKNOWNS {
            let moved = |h: f64| { let mut y = x; y[i] += h; problem.linearise(&y, 0.1) };
            let (more, less) = (moved(h), moved(-h));
            // A joint that reverses only after the step adds a row.
            prop_assume!(more.count == here.count && less.count == here.count);
            for row in 0..here.count - 2 * UNKNOWNS {
                let slope = (less.rows[row].bound - more.rows[row].bound) / (2.0 * h);
                prop_assert!((slope - here.rows[row].normal[i]).abs() < 1e-4 * (1.0 + slope.abs()), "row {row} unknown {i}: {slope} {}", here.rows[row].normal[i]);
            }
        }
        let (cost, gradient) = Objective::Soft.cost(&problem.motion, &x);
        prop_assume!(cost.is_finite());
        for objective in [Objective::Soft, Objective::Latest, Objective::Cool] {
            let (_, gradient) = if objective == Objective::Soft { (cost, gradient) } else { objective.cost(&problem.motion, &x) };
            for i in 0..UNKNOWNS {
                let moved = |h: f64| { let mut y = x; y[i] += h; objective.cost(&problem.motion, &y).0 };
                let slope = (8.0 * (moved(h) - moved(-h)) - (moved(2.0 * h) - moved(-2.0 * h))) / (12.0 * h);
                prop_assert!((slope - gradient[i]).abs() < 1e-3 * (1.0 + slope.abs()), "{objective:?} {i}: {slope} {}", gradient[i]);
            }
        }
    }

    #[test]
    fn candidates_are_catches(ball in thrown(), arm in 0..2usize) {
        let robot = Robot::nominal();
        let request = CatchRequest { ball, q0: robot.ready(arm), w0: [0.0; 7], earliest: 0.0, latest: 1.8, objective: Objective::Soft, other: None };
        let own = OwnBodies::new(&robot, arm);
        let problem = Problem::new(&request, robot.arm(arm), &own, 0.02);
        let seeds = Seeds::search(&problem, Grid { times: 6, hands: 6, elbows: 6 }, Share::default(), || false);
        for seed in seeds.best() {
            let violation = problem.violation(&seed.x);
            prop_assert!(violation.position < 1e-9 && violation.angle < 1e-9, "{violation:?}");
            // Near misses exceed their intervals by at most their lack.
            let q = std::array::from_fn(|i| seed.x[i]);
            prop_assert!(violation.limits <= seed.lack.max(problem.too_near(&q)) + 1e-9, "{violation:?} {}", seed.lack);
            prop_assert!(seed.lack > 0.0 || violation.is_feasible(), "{violation:?}");
        }
    }
}
