//! Tighter bounds of a pair's distance during braking by division of the motion into parts.

use super::bodies::Bodies;
use super::gjk::distance;
use super::sweep::Braking;

/// Maximum number of stored parts.
const MAX_PARTS: usize = 128;

/// Part of a braking motion: seconds until the drives brake, seconds of braking, and a bound of the pair's distance.
#[derive(Debug, Clone, Copy)]
struct Part {
    begun: [f64; 2],
    braked: [f64; 2],
    bound: f64,
}

/// Returns a lower bound of a pair's distance during braking, in m. At any time, all joints are within the intervals of
/// one part, which are much smaller than those of the whole motion. The part with the smallest bound is halved
/// repeatedly (branch and bound) until all parts are `enough` apart, a violation is found, or no evaluations are left.
///
/// - `looks`: number of remaining evaluations, which is updated
pub(super) fn least_in_parts(
    bodies: &Bodies,
    pair: usize,
    braking: &Braking,
    enough: f64,
    looks: &mut usize,
) -> f64 {
    let mut parts = [Part {
        begun: [0.0, braking.reaction],
        braked: [0.0, braking.longest()],
        bound: f64::NEG_INFINITY,
    }; MAX_PARTS];
    let mut count = 1;
    loop {
        let (place, part) = least(&parts[..count]);
        if part.bound >= enough || *looks < 2 || count == MAX_PARTS {
            return part.bound;
        }
        let middle = [part.begun, part.braked].map(|[from, to]| 0.5 * (from + to));
        let [a, b] = bodies.placed(pair, &braking.at(middle[0], middle[1]));
        if distance(&a, &b) < enough {
            return part.bound;
        }
        // Halve the dimension with the larger motion.
        let way = |begun: [f64; 2], braked: [f64; 2]| -> f64 {
            let intervals = braking.between(begun, braked);
            let of = |joint: usize| 2.0 * intervals[joint].half() * bodies.reach(pair, joint);
            (0..intervals.len()).map(of).sum()
        };
        let start = [part.begun[0]; 2];
        let by_begin = way(part.begun, [part.braked[0]; 2]) > way(start, part.braked);
        let halves = [0, 1].map(|half| {
            let of = |[from, to]: [f64; 2]| {
                let middle = 0.5 * (from + to);
                [[from, middle], [middle, to]][half]
            };
            let (begun, braked) = if by_begin {
                (of(part.begun), part.braked)
            } else {
                (part.begun, of(part.braked))
            };
            let [a, b] = bodies.swept(pair, &braking.between(begun, braked));
            Part {
                begun,
                braked,
                bound: distance(&a, &b).max(part.bound),
            }
        });
        *looks -= 2;
        parts[place] = halves[0];
        parts[count] = halves[1];
        count += 1;
    }
}

fn least(parts: &[Part]) -> (usize, Part) {
    let mut least = 0;
    for (place, part) in parts.iter().enumerate() {
        if part.bound < parts[least].bound {
            least = place;
        }
    }
    (least, parts[least])
}
