//! Collision check of a motion.

use tactnet_catching_packets::JOINTS;

use crate::safety::{Bodies, PAIRS, distance};

/// Time between collision checks, in s.
const CHECK_PERIOD: f64 = 0.01;

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
