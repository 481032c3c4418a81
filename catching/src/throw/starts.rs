//! Start points of descents: arm configurations distributed over the ranges, each with the velocities of its farthest
//! throw.

use nalgebra::Vector3;

use super::problem::{Aim, Point, Problem, THROW_UNKNOWNS};
use crate::flight::GRAVITY;
use tactnet_catching_packets::THROW_JOINTS;

/// Number of throwing directions about the vertical per configuration, before the torso rotation.
const DIRECTIONS: usize = 12;
/// Elevation of the throwing directions, in rad.
const ELEVATION: f64 = 0.6;
/// Acceleration time of the starts, in s.
const TIME: f64 = 0.25;

/// Returns the best of `candidates` configurations, at most one per sign pattern of the velocities and at most `most`,
/// sorted by quality.
pub(super) fn starts(problem: &Problem, candidates: usize, most: usize) -> Vec<Point> {
    let mut best: Vec<Option<(f64, Point)>> = vec![None; 1 << THROW_JOINTS];
    for number in 0..candidates {
        for direction in 0..DIRECTIONS {
            let Some((score, x, pattern)) = candidate(problem, number, direction) else {
                continue;
            };
            if best[pattern].is_none_or(|(least, _)| score > least) {
                best[pattern] = Some((score, x));
            }
        }
    }
    let mut found: Vec<(f64, Point)> = best.into_iter().flatten().collect();
    // The stable sort keeps equal scores in the order of patterns.
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(most);
    found.into_iter().map(|(_, x)| x).collect()
}

/// Returns the score (flight distance without air minus penalties), the start point, and its sign pattern.
fn candidate(problem: &Problem, number: usize, direction: usize) -> Option<(f64, Point, usize)> {
    let joints = &problem.swing.joints;
    let mut x = [0.0; THROW_UNKNOWNS];
    for i in 1..THROW_JOINTS {
        // Roberts' low-discrepancy sequence in seven dimensions.
        let place = (0.5 + (number + 1) as f64 * PLASTIC.powi(-(i as i32))).fract();
        let joint = &joints[i];
        let way = joint.speed * (TIME / 2.0 + problem.config.coast);
        let [low, high] = [joint.range[0] + way, joint.range[1] - way];
        x[i] = low + place * (high - low);
    }
    x[2 * THROW_JOINTS] = TIME;
    let at_rest = problem
        .swing
        .motion(&Problem::angles(&x), &[0.0; THROW_JOINTS]);
    let about = direction as f64 * std::f64::consts::TAU / DIRECTIONS as f64;
    let towards = Vector3::new(
        ELEVATION.cos() * about.cos(),
        ELEVATION.cos() * about.sin(),
        ELEVATION.sin(),
    );
    let mut pattern = 0;
    for i in 0..THROW_JOINTS {
        let along = at_rest.p_by_q.column(i).dot(&towards);
        let most = (joints[i].acceleration * TIME / joints[i].speed).min(1.0);
        x[THROW_JOINTS + i] = most.copysign(along);
        pattern |= usize::from(along > 0.0) << i;
    }
    let thrown = |x: &Point| problem.swing.motion(&Problem::angles(x), &problem.rates(x));
    let hand = thrown(&x);
    // Rotate the whole robot towards the target direction.
    let heading = problem.aim.heading(&hand.p);
    let turn = heading.y.atan2(heading.x) - hand.v.y.atan2(hand.v.x);
    x[0] = turn.sin().atan2(turn.cos());
    let hand = thrown(&x);
    let rise =
        hand.v.z + (hand.v.z.powi(2) + 2.0 * GRAVITY * (hand.p.z - problem.aim.height())).sqrt();
    if rise.is_nan() || rise <= 0.0 {
        return None;
    }
    let mut length = hand.v.xy().norm() * rise / GRAVITY;
    if let Aim::At { target } = problem.aim {
        // Reduce the velocities if the throw is too far, as for a flat throw.
        let wanted = (target - hand.p).xy().norm();
        let share = (wanted / length).min(1.0).sqrt();
        for u in &mut x[THROW_JOINTS..2 * THROW_JOINTS] {
            *u *= share;
        }
        length = length.min(wanted + 0.1 * (length - wanted));
    }
    let turned = &joints[0];
    let out = (turned.range[0] - x[0])
        .max(x[0] - turned.range[1])
        .max(0.0);
    // The ball cannot leave towards the palm.
    let along = hand.axis.dot(&hand.v) / hand.v.norm().max(1e-9);
    let towards_palm = (problem.config.palm.cos() - along).max(0.0);
    Some((length - 2.0 * out - 3.0 * towards_palm, x, pattern))
}

/// Root of `g^8 = g + 1`. The powers of its inverse give a low-discrepancy sequence in seven dimensions.
const PLASTIC: f64 = 1.096_981_557_798_559_8;

#[cfg(test)]
mod tests {
    use super::PLASTIC;

    #[test]
    fn the_sequences_constant_solves_its_equation() {
        let off = PLASTIC.powi(8) - PLASTIC - 1.0;
        assert!(off.abs() < 1e-9, "{off}");
    }
}
