//! Process-wide cache of planned blocks.

use std::sync::{Arc, Mutex, PoisonError};

use super::block::Block;
use super::shape::BlockShape;

/// Maximum number of cached plans: three blocks for two batch sizes each in training and in evaluation.
const MAX_PLANS: usize = 12;

static PLANS: Mutex<Vec<Arc<Block>>> = Mutex::new(Vec::new());

/// Returns the block for `shape` from a process-wide cache of the twelve most recent plans; plans it if needed.
///
/// # Panics
/// As [`Block::plan`].
pub fn shared_block(shape: BlockShape) -> Arc<Block> {
    let mut plans = PLANS.lock().unwrap_or_else(PoisonError::into_inner);
    let found = plans.iter().position(|block| *block.shape() == shape);
    let block = found.map_or_else(|| Arc::new(Block::plan(shape)), |at| plans.remove(at));
    if plans.len() == MAX_PLANS {
        plans.remove(0);
    }
    plans.push(Arc::clone(&block));
    block
}
