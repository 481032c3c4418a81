//! Convolution blocks of TactNet-II, evaluated frame by frame.

use tactnet_conv::{StreamBlock, StreamShape};

use crate::InputShape;
use crate::conv_trunk::ConvTrunk;
use crate::values::values;

/// Features of the frames so far; pooled steps that have not begun are zero.
#[derive(Debug, Clone)]
pub(crate) struct ConvStream {
    blocks: Vec<StreamBlock>,
    /// Copies of `blocks` that are flushed to complete the features so far.
    ends: Vec<StreamBlock>,
    features: FeatureRows,
    /// `features` plus the rows that flushing added after `ended_at` frames.
    ended: FeatureRows,
    ended_at: Option<usize>,
    frames: usize,
    /// Number of rows of a whole sweep in front of each block.
    rows: Vec<usize>,
    pools: Vec<usize>,
    /// Number of rows so far in front of each block.
    rows_now: Vec<usize>,
}

/// `[maps][pooled steps][taxels]`, filled row by row.
#[derive(Debug, Clone)]
struct FeatureRows {
    values: Vec<f32>,
    rows: usize,
    taxels: usize,
    filled: usize,
}

impl FeatureRows {
    /// - `row`: `[taxels][maps]`
    fn push(&mut self, row: &[f32]) {
        let maps = row.len() / self.taxels;
        for (taxel, values) in row.chunks_exact(maps).enumerate() {
            for (map, value) in values.iter().enumerate() {
                self.values[(map * self.rows + self.filled) * self.taxels + taxel] = *value;
            }
        }
        self.filled += 1;
    }
}

impl ConvStream {
    /// Copies the weights of `trunk`.
    pub(crate) fn new(trunk: &ConvTrunk, input: InputShape) -> Self {
        let blocks: Vec<StreamBlock> = trunk
            .blocks
            .iter()
            .map(|block| {
                let [maps_out, maps_in, time, wide] = block.weight.dims();
                let shape = StreamShape {
                    taxels: input.taxels,
                    maps_in,
                    maps_out,
                    kernel: [time, wide],
                    pool: block.pool,
                };
                let (scale, shift) = block.folded_norm();
                StreamBlock::new(shape, &values(block.weight.val()), &scale, &shift)
            })
            .collect();
        let pools: Vec<usize> = trunk.blocks.iter().map(|block| block.pool).collect();
        let mut rows = vec![input.steps];
        for pool in &pools {
            rows.push(rows[rows.len() - 1].div_ceil(*pool));
        }
        let pooled = rows[pools.len()];
        let maps = trunk
            .blocks
            .last()
            .map_or(1, |block| block.weight.dims()[0]);
        let features = FeatureRows {
            values: vec![0.0; maps * pooled * input.taxels],
            rows: pooled,
            taxels: input.taxels,
            filled: 0,
        };
        Self {
            ends: blocks.clone(),
            blocks,
            ended: features.clone(),
            ended_at: None,
            features,
            frames: 0,
            rows_now: rows.clone(),
            rows,
            pools,
        }
    }

    pub(crate) fn restart(&mut self) {
        self.blocks.iter_mut().for_each(StreamBlock::restart);
        self.features.values.fill(0.0);
        self.features.filled = 0;
        self.frames = 0;
        self.ended_at = None;
    }

    /// - `frame`: `[taxels]`, normalised; at most as many as a sweep has
    pub(crate) fn push(&mut self, frame: &[f32]) {
        self.frames += 1;
        push(&mut self.blocks, &self.rows, frame, &mut self.features);
    }

    /// Returns the features of the frames so far, `[maps x pooled steps x taxels]`.
    pub(crate) fn features(&mut self) -> &[f32] {
        self.end();
        &self.ended.values
    }

    fn end(&mut self) {
        if self.ended_at == Some(self.frames) {
            return;
        }
        self.ended_at = Some(self.frames);
        if self.frames == self.rows[0] {
            // The blocks receive no further frame before the next restart, so they need no copy.
            std::mem::swap(&mut self.ends, &mut self.blocks);
        } else {
            for (end, block) in self.ends.iter_mut().zip(&self.blocks) {
                end.copy_from(block);
            }
        }
        self.ended.values.copy_from_slice(&self.features.values);
        self.ended.filled = self.features.filled;
        self.rows_now[0] = self.frames;
        for (block, pool) in self.pools.iter().enumerate() {
            self.rows_now[block + 1] = self.rows_now[block].div_ceil(*pool);
        }
        for block in 0..self.ends.len() {
            let (this, next) = self.ends[block..].split_at_mut(1);
            while let Some(row) = this[0].end() {
                push(next, &self.rows_now[block + 1..], row, &mut self.ended);
            }
        }
    }
}

/// Pushes a row through the blocks; each completed pooled row goes to the next block.
fn push(blocks: &mut [StreamBlock], rows: &[usize], row: &[f32], features: &mut FeatureRows) {
    let [first, rest @ ..] = blocks else {
        features.push(row);
        return;
    };
    if let Some(pooled) = first.push(row, rows[0]) {
        push(rest, &rows[1..], pooled, features);
    }
}
