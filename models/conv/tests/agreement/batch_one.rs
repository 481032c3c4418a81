//! Single sweeps with fixed statistics, which are transformed over time only.

use tactnet_conv::{Block, Isa};

use crate::cases::{case, error, shape};
use crate::reference::frozen;

#[test]
fn batch_one_agrees_with_f64_on_all_instruction_sets() {
    for s in [
        shape(1, 100, 16, [32, 64], [15, 5], 10),
        shape(1, 10, 16, [64, 128], [15, 5], 10),
        shape(1, 23, 5, [16, 24], [5, 3], 4),
        shape(1, 7, 2, [8, 8], [15, 5], 3),
        shape(1, 41, 19, [8, 16], [3, 7], 10),
    ] {
        let c = case(&s, 5);
        let variance: Vec<f32> = c.gamma.iter().map(|g| 0.2 + g * g).collect();
        let expected = frozen(&s, &c, &c.beta, &variance);
        for isa in Isa::all() {
            let block = Block::plan_for(s, isa);
            // Twice: the second run reuses buffers.
            for _ in 0..2 {
                let found =
                    block.forward_eval(&c.x, &c.weight, &c.gamma, &c.beta, &c.beta, &variance);
                let found = error(&found, &expected);
                assert!(found < 1e-5, "{s:?} with {isa:?}: {found}");
            }
        }
    }
}
