//! Slow straight way between two poses at rest, and its collision check.

use tactnet_catching_packets::JOINTS;

use crate::ramp::{Ramp, together};
use crate::robot::Robot;
use crate::safety::{Bodies, PAIRS, distance};

/// Time between collision checks, in s.
const CHECK_PERIOD: f64 = 0.01;

/// Returns ramps of all joints that start and end together, and their duration in s.
///
/// - `pace`: fraction of the maximum speeds. Accelerations use its square.
pub(super) fn straight(
    robot: &Robot,
    from: &[f64; JOINTS],
    to: &[f64; JOINTS],
    pace: f64,
) -> ([Ramp; JOINTS], f64) {
    let gentle = robot.joints().map(|mut joint| {
        joint.speed *= pace;
        joint.acceleration *= pace * pace;
        joint
    });
    together(from, to, &gentle)
}

/// Returns the first pair of bodies that comes closer than `margin` and closer than at the start.
pub(super) fn touching(
    bodies: &Bodies,
    margin: f64,
    end: f64,
    at: impl Fn(f64) -> [f64; JOINTS],
) -> Option<usize> {
    let apart = |pair: usize, q: &[f64; JOINTS]| {
        let [a, b] = bodies.placed(pair, q);
        distance(&a, &b)
    };
    let first = at(0.0);
    let least: [f64; PAIRS] = std::array::from_fn(|pair| apart(pair, &first).min(margin));
    (1..=(end / CHECK_PERIOD).ceil() as usize).find_map(|i| {
        let q = at(i as f64 * CHECK_PERIOD);
        (0..PAIRS).find(|pair| apart(*pair, &q) < least[*pair] - 1e-6)
    })
}
