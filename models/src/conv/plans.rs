//! Planned blocks, kept for the next call of the same shape.

use std::sync::{Arc, Mutex, PoisonError};

use super::block::Block;
use super::shape::BlockShape;

/// Plans kept: three blocks for two batch sizes of a training run and two of an evaluation.
const MOST: usize = 12;

static PLANS: Mutex<Vec<Arc<Block>>> = Mutex::new(Vec::new());

/// The block for `shape`; the least recently used plan makes room for a new one.
pub(super) fn plan(shape: BlockShape) -> Arc<Block> {
    let mut plans = PLANS.lock().unwrap_or_else(PoisonError::into_inner);
    let found = plans.iter().position(|block| *block.shape() == shape);
    let block = found.map_or_else(|| Arc::new(Block::plan(shape)), |at| plans.remove(at));
    if plans.len() == MOST {
        plans.remove(0);
    }
    plans.push(Arc::clone(&block));
    block
}
