//! Random catch problems for benchmarks of the planner.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tactnet_catching::Robot;
use tactnet_catching::flight::Flight;
use tactnet_catching::plan::{CatchRequest, Objective};

/// A catch problem.
#[derive(Debug, Clone, Copy)]
pub struct PlanProblem {
    /// Arm, 0 for left and 1 for right.
    pub arm: usize,
    /// Request to the planner.
    pub request: CatchRequest,
}

/// Returns problem `number` of a seed. The throw comes from 4 to 6 m with 6 to 8 m/s, is seen 0.15 to 0.5 s after its
/// release, and is aimed into a box in front of one of the arms. Every second problem starts at rest in the waiting
/// pose, the others in motion from a random pose. Some problems are infeasible.
pub fn plan_problem(robot: &Robot, objective: Objective, seed: u64, number: u64) -> PlanProblem {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(number);
    let mut between = |low: f64, high: f64| rng.random_range(low..high);
    let arm = number as usize % 2;
    let side = if arm == 0 { 1.0 } else { -1.0 };
    // The chest is 1.2 m above the floor.
    let release = Vector3::new(between(4.0, 6.0), between(-0.5, 0.5), between(0.0, 0.6));
    let target = Vector3::new(
        between(0.25, 0.8),
        side * between(-0.2, 1.0),
        between(-0.5, 0.7),
    );
    let speed = between(6.0, 8.0);
    let k = between(0.027, 0.037);
    let v = aim(&release, &target, speed, k);
    let seen = between(0.15, 0.5);
    let joints = robot.arm(arm).joints();
    let mut q0 = robot.ready(arm);
    let mut w0 = [0.0; 7];
    if number % 4 >= 2 {
        for i in 0..7 {
            let [low, high] = joints[i].range;
            q0[i] = (q0[i] + between(-0.8, 0.8)).clamp(0.95 * low, 0.95 * high);
            w0[i] = between(-0.5, 0.5) * joints[i].speed;
        }
    }
    let ball = Flight::without_spin(release, v, k).after(seen);
    PlanProblem {
        arm,
        request: CatchRequest {
            ball,
            q0,
            w0,
            earliest: 0.0,
            latest: 1.8,
            objective,
            other: None,
        },
    }
}

/// Returns the velocity of length `speed` with which a ball gets nearest to `target`; the flatter one of two hits.
fn aim(release: &Vector3<f64>, target: &Vector3<f64>, speed: f64, k: f64) -> Vector3<f64> {
    let away = target - release;
    let level = Vector3::new(away.x, away.y, 0.0);
    let heading = level.normalize();
    let velocity =
        |angle: f64| heading * (speed * angle.cos()) + Vector3::z() * (speed * angle.sin());
    let height_at_target = |angle: f64| {
        let mut ball = Flight::without_spin(*release, velocity(angle), k);
        for _ in 0..300 {
            let next = ball.after(0.01);
            if (next.p - release).dot(&heading) >= level.norm() {
                let left = (level.norm() - (ball.p - release).dot(&heading)) / ball.v.dot(&heading);
                return ball.after(left).p.z;
            }
            ball = next;
        }
        f64::NEG_INFINITY
    };
    let steps = 60;
    let angles = (0..=steps).map(|i| -0.6 + 1.4 * f64::from(i) / f64::from(steps));
    let (mut low, mut best) = (None, (f64::INFINITY, 0.0));
    for angle in angles {
        let miss = height_at_target(angle) - target.z;
        if miss.abs() < best.0 {
            best = (miss.abs(), angle);
        }
        if miss >= 0.0 {
            break;
        }
        low = Some(angle);
    }
    let Some(mut low) = low else {
        return velocity(best.1);
    };
    let mut high = low + 1.4 / f64::from(steps);
    if height_at_target(high) < target.z {
        return velocity(best.1);
    }
    for _ in 0..30 {
        let middle = (low + high) / 2.0;
        if height_at_target(middle) < target.z {
            low = middle
        } else {
            high = middle
        }
    }
    velocity(high)
}
