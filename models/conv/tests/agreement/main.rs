//! Comparison of every route, forward and backward, with a plain f64 reference, and between threads and instruction sets.
//!
//! Tolerances are errors relative to the largest magnitude: 2e-5 for random shapes, 1e-5 at full size. The blocks compute in f32,
//! with unit roundoff 6e-8, and add up to a few thousand products.

mod batch_one;
mod cases;
#[path = "../../src/noise.rs"]
mod noise;
mod reference;

use cases::{case, error, errors, shape};
use proptest::prelude::*;
use tactnet_conv::{Block, BlockShape, Isa};

fn holds(s: BlockShape, seed: u64) {
    let found = errors(s, seed);
    assert!(
        found.iter().all(|&e| e < 2e-5),
        "{s:?}, seed {seed}: {found:?}"
    );
}

#[test]
fn direct_route_agrees_with_f64() {
    holds(shape(2, 23, 5, [3, 5], [5, 3], 4), 1);
    holds(shape(1, 4, 3, [1, 2], [15, 5], 10), 2);
    holds(shape(3, 9, 1, [2, 3], [1, 1], 1), 3);
}

#[test]
fn first_layer_route_agrees_with_f64() {
    holds(shape(2, 230, 16, [1, 32], [15, 5], 10), 1);
    holds(shape(3, 23, 5, [1, 8], [5, 3], 4), 2);
    holds(shape(1, 4, 1, [1, 8], [15, 5], 10), 3);
    holds(shape(5, 105, 13, [1, 16], [7, 5], 7), 3);
}

/// Uses taps with AVX-512, else tiles.
#[test]
fn first_layer_route_by_taps_agrees_with_f64() {
    holds(shape(2, 230, 16, [1, 32], [15, 5], 10), 1);
    holds(shape(3, 47, 5, [1, 64], [7, 3], 20), 2);
    holds(shape(1, 4, 1, [1, 32], [15, 5], 10), 3);
    holds(shape(2, 125, 2, [1, 32], [1, 5], 30), 4);
}

#[test]
fn spectral_route_agrees_with_f64() {
    holds(shape(2, 30, 16, [8, 16], [15, 5], 10), 1);
    holds(shape(3, 23, 5, [16, 8], [5, 3], 4), 2);
    holds(shape(1, 4, 1, [8, 8], [15, 5], 10), 3);
    holds(shape(5, 10, 16, [32, 24], [15, 5], 10), 3);
    holds(shape(3, 40, 19, [16, 16], [15, 5], 10), 4);
    holds(shape(2, 23, 32, [8, 8], [5, 3], 4), 5);
}

#[test]
fn padded_route_agrees_with_f64() {
    holds(shape(2, 40, 19, [1, 16], [15, 5], 10), 1);
    holds(shape(3, 23, 20, [3, 16], [5, 3], 4), 2);
    holds(shape(2, 30, 4, [12, 24], [15, 5], 10), 3);
}

/// With one tap and one input map, normalisation makes the output independent of the weight, so the gradient is the rounding of a sum
/// that cancels.
#[test]
fn a_gradient_that_cancels_is_within_the_rounding_of_its_terms() {
    for seed in [80, 81, 82] {
        holds(shape(2, 94, 7, [1, 64], [1, 1], 30), seed);
    }
    for seed in [316, 1380, 1700] {
        holds(
            shape(1, 2 + seed as usize % 128, 14, [1, 32], [1, 1], 10),
            seed,
        );
    }
}

/// With two values per map, normalisation cancels their gradients up to the effect of its epsilon.
#[test]
fn gradients_of_two_values_are_within_the_rounding_of_their_terms() {
    for seed in [250, 251, 252] {
        holds(shape(1, 2, 1, [1, 32], [3, 3], 10), seed);
        holds(shape(1, 2, 1, [3, 2], [3, 3], 2), seed);
        holds(shape(1, 2, 1, [8, 16], [3, 1], 2), seed);
    }
}

/// Rows of taxels that are divided into bands, and sweeps that are divided into ranges of steps.
#[test]
fn wide_and_long_shapes_agree_with_f64() {
    holds(shape(2, 23, 33, [1, 8], [5, 3], 4), 1);
    holds(shape(1, 60, 64, [1, 32], [15, 5], 10), 2);
    holds(shape(2, 15, 60, [1, 16], [7, 1], 5), 3);
    holds(shape(1, 25, 36, [8, 16], [5, 3], 4), 4);
    holds(shape(2, 12, 64, [16, 8], [15, 5], 10), 5);
    holds(shape(1, 9, 131, [8, 8], [3, 7], 3), 6);
    holds(shape(1, 300, 3, [8, 8], [15, 3], 10), 7);
    holds(shape(2, 405, 2, [8, 16], [5, 1], 7), 8);
    holds(shape(1, 290, 34, [8, 8], [3, 3], 120), 9);
    holds(shape(1, 40, 20, [1, 16], [31, 7], 10), 10);
    holds(shape(1, 30, 70, [3, 16], [5, 5], 10), 11);
}

/// Some values are so close to zero that single and double precision differ in their sign.
#[test]
fn values_within_rounding_of_zero_may_take_either_side() {
    for seed in [623, 828] {
        holds(shape(3, 59, 13, [1, 16], [15, 5], 1), seed);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn any_small_shape_agrees_with_f64(
        batch in 1usize..4, steps in 2usize..40, taxels in 1usize..10,
        ins in 1usize..4, outs in 1usize..4, kt in 1usize..8, kw in 0usize..3, pool in 1usize..11, seed in 0u64..1000,
    ) {
        holds(shape(batch, steps, taxels, [ins, outs], [2 * kt + 1, 2 * kw + 1], pool), seed);
    }

    #[test]
    fn any_small_first_layer_shape_agrees_with_f64(
        batch in 1usize..4, steps in 2usize..130, taxels in 1usize..17,
        outs in 1usize..4, kt in 1usize..8, kw in 0usize..3, pool in 1usize..11, seed in 0u64..1000,
    ) {
        holds(shape(batch, steps, taxels, [1, 8 * outs], [2 * kt + 1, 2 * kw + 1], pool), seed);
    }

    #[test]
    fn any_small_shape_by_taps_agrees_with_f64(
        batch in 1usize..3, steps in 2usize..130, taxels in 1usize..17,
        outs in 1usize..3, kt in 0usize..8, kw in 0usize..3, pool in 1usize..4, seed in 0u64..1000,
    ) {
        holds(shape(batch, steps, taxels, [1, 32 * outs], [2 * kt + 1, 2 * kw + 1], 10 * pool), seed);
    }

    #[test]
    fn any_small_spectral_shape_agrees_with_f64(
        batch in 1usize..4, steps in 2usize..30, taxels in 1usize..33,
        ins in 1usize..3, outs in 1usize..4, kt in 1usize..8, kw in 0usize..3, pool in 1usize..11, seed in 0u64..1000,
    ) {
        holds(shape(batch, steps, taxels, [8 * ins, 8 * outs], [2 * kt + 1, 2 * kw + 1], pool), seed);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn any_wide_first_layer_agrees_with_f64(
        batch in 1usize..3, steps in 2usize..130, taxels in 17usize..90,
        outs in 1usize..5, kt in 1usize..8, kw in 0usize..3, pool in 1usize..21, seed in 0u64..1000,
    ) {
        holds(shape(batch, steps, taxels, [1, 8 * outs], [2 * kt + 1, 2 * kw + 1], pool), seed);
    }

    #[test]
    fn any_wide_spectral_shape_agrees_with_f64(
        batch in 1usize..3, steps in 2usize..30, taxels in 33usize..140,
        ins in 1usize..3, outs in 1usize..3, kt in 1usize..8, kw in 0usize..4, pool in 1usize..11, seed in 0u64..1000,
    ) {
        holds(shape(batch, steps, taxels, [8 * ins, 8 * outs], [2 * kt + 1, 2 * kw + 1], pool), seed);
    }

    #[test]
    fn any_long_spectral_shape_agrees_with_f64(
        batch in 1usize..3, steps in 257usize..700, taxels in 1usize..5,
        ins in 1usize..3, outs in 1usize..3, kt in 1usize..16, kw in 0usize..3, pool in 1usize..200, seed in 0u64..1000,
    ) {
        holds(shape(batch, steps, taxels, [8 * ins, 8 * outs], [2 * kt + 1, 2 * kw + 1], pool), seed);
    }
}

/// Returns all results of a training step in one list.
fn step(s: BlockShape, isa: Isa, threads: usize) -> Vec<f32> {
    let c = case(&s, 7);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads");
    pool.install(|| {
        let block = Block::plan_for(s, isa);
        // Twice: the second run reuses buffers.
        let first = block.forward_train(&c.x, &c.weight, &c.gamma, &c.beta);
        block.backward(first.saved, &c.grad, true);
        let t = block.forward_train(&c.x, &c.weight, &c.gamma, &c.beta);
        let g = block.backward(t.saved, &c.grad, true);
        [
            t.pooled,
            t.mean,
            t.variance,
            g.weight,
            g.gamma,
            g.beta,
            g.input.expect("asked for"),
        ]
        .concat()
    })
}

fn routes() -> [BlockShape; 5] {
    [
        shape(3, 50, 19, [1, 16], [15, 5], 10),
        shape(3, 230, 16, [1, 16], [15, 5], 10),
        shape(3, 230, 16, [1, 32], [15, 5], 10),
        shape(5, 50, 16, [16, 24], [15, 5], 10),
        shape(3, 30, 6, [3, 5], [5, 3], 4),
    ]
}

#[test]
fn threads_change_no_bit() {
    for s in routes() {
        let one = step(s, Isa::detect(), 1);
        for threads in [2, 4] {
            let more = step(s, Isa::detect(), threads);
            assert!(
                one.iter()
                    .zip(&more)
                    .all(|(a, b)| a.to_bits() == b.to_bits()),
                "{s:?} on {threads} threads"
            );
        }
    }
}

#[test]
fn plain_arrays_agree_with_all_instruction_sets() {
    for s in routes() {
        let plain: Vec<f64> = step(s, Isa::Portable, 2)
            .into_iter()
            .map(f64::from)
            .collect();
        for isa in Isa::all() {
            let found = error(&step(s, isa, 2), &plain);
            assert!(found < 1e-5, "{s:?} with {isa:?}: {found}");
        }
    }
}

/// Few full-size sweeps, since the f64 reference is slow.
#[test]
fn full_size_blocks_agree_with_f64() {
    for (steps, maps, batch) in [(1000, [1, 32], 2), (100, [32, 64], 2), (10, [64, 128], 4)] {
        let found = errors(shape(batch, steps, 16, maps, [15, 5], 10), 11);
        println!("{maps:?}: {:?}", found.map(|e| format!("{e:.1e}")));
        assert!(found.iter().all(|&e| e < 1e-5), "{maps:?}: {found:?}");
    }
}
