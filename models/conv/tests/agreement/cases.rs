//! Test cases, and errors of results relative to the reference.

use tactnet_conv::{Block, BlockShape};

use crate::noise::noise;
use crate::reference::{Branch, Case, frozen, reference};

/// Unit roundoff of single precision.
const UNIT: f64 = f32::EPSILON as f64 / 2.0;
/// Number of roundings allowed in each term of the gradients of weights and input.
const ROUNDINGS: f64 = 1.0;
/// Number of roundings allowed if a map has one weight or a batch two values.
///
/// Normalisation then cancels the whole sum, which leaves the rounding of variance, root, factors and additions.
const ROUNDINGS_WHERE_ALL_CANCELS: f64 = 16.0;

pub(crate) fn case(s: &BlockShape, seed: u64) -> Case {
    let fan = (s.maps_in * s.kernel[0] * s.kernel[1]) as f32;
    Case {
        x: noise(s.input_len(), seed + 1),
        weight: noise(s.weight_len(), seed + 2)
            .iter()
            .map(|w| w / fan.sqrt())
            .collect(),
        // Both signs of gamma, none near zero.
        gamma: noise(s.maps_out, seed + 3)
            .iter()
            .map(|g| g + 0.5f32.copysign(*g))
            .collect(),
        beta: noise(s.maps_out, seed + 4)
            .iter()
            .map(|b| 0.3 * b)
            .collect(),
        grad: noise(s.output_len(), seed + 5),
    }
}

/// Returns the largest difference divided by the largest magnitude, which is at least 0.3 because normalisation cancels some gradients.
pub(crate) fn error(found: &[f32], expected: &[f64]) -> f64 {
    error_beyond(0.0, found, expected)
}

/// Returns the [`error`] of differences beyond `rounding`, the error of single precision for any order of summation.
fn error_beyond(rounding: f64, found: &[f32], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let scale = expected.iter().fold(0.3, |m: f64, v| m.max(v.abs()));
    let differences = found.iter().zip(expected);
    let largest = differences.fold(0.0, |m: f64, (f, e)| m.max((f64::from(*f) - e).abs()));
    (largest - rounding).max(0.0) / scale
}

/// Returns the errors of pooled, mean, variance, d_weight, d_gamma, d_beta and d_input.
///
/// For d_weight and d_input only the error beyond the rounding of the summed terms counts: a kernel of one tap and a batch of two values have
/// large terms that normalisation cancels.
pub(crate) fn errors(s: BlockShape, seed: u64) -> [f64; 7] {
    let c = case(&s, seed);
    let block = Block::plan(s);
    let t = block.forward_train(&c.x, &c.weight, &c.gamma, &c.beta);
    let branch = Branch {
        positions: t.saved.positions(),
        pooled: &t.pooled,
    };
    let r = reference(&s, &c, branch);
    let forward = [
        error(&t.pooled, &r.pooled),
        error(&t.mean, &r.mean),
        error(&t.variance, &r.variance),
    ];
    let g = block.backward(t.saved, &c.grad, true);
    let input = g.input.expect("asked for");
    let eval = block.forward_eval(&c.x, &c.weight, &c.gamma, &c.beta, &c.beta, &t.variance);
    let expected = frozen(&s, &c, &c.beta, &t.variance);
    let apart = error(&eval, &expected);
    assert!(apart < 2e-5, "eval {s:?}: {apart}");
    let all_cancels = s.maps_in * s.kernel[0] * s.kernel[1] == 1 || s.count() <= 2;
    let roundings = if all_cancels {
        ROUNDINGS_WHERE_ALL_CANCELS
    } else {
        ROUNDINGS
    };
    let rounding = |terms: f64| roundings * UNIT * terms;
    let [a, b, d] = forward;
    [
        a,
        b,
        d,
        error_beyond(rounding(r.weight_terms), &g.weight, &r.d_weight),
        error(&g.gamma, &r.d_gamma),
        error(&g.beta, &r.d_beta),
        error_beyond(rounding(r.input_terms), &input, &r.d_input),
    ]
}

pub(crate) fn shape(
    batch: usize,
    steps: usize,
    taxels: usize,
    maps: [usize; 2],
    kernel: [usize; 2],
    pool: usize,
) -> BlockShape {
    BlockShape {
        batch,
        steps,
        taxels,
        maps_in: maps[0],
        maps_out: maps[1],
        kernel,
        pool,
    }
}
