//! Block with fixed statistics, row by row: each row is added to the outputs around it when it arrives.
//!
//! Output row `r` sums the input rows `r - h ... r + h` (`h` is half the kernel), so it is complete `h` rows after its own input. Until then
//! it is in a ring as long as the kernel. At any time the ring holds the results of a sweep that ends now, since SAME padding adds
//! only zeros after the last row: [`StreamBlock::end`] just reads them. A row costs `taxels * kernel * maps_in * maps_out` products,
//! spread evenly over the sweep. Batch normalisation is folded into the weights.

use std::sync::Arc;

use super::simd::{Isa, Kernel, Lanes, Octet, Octets, Walk, floats};

/// Sizes of a [`StreamBlock`]; see [`crate::BlockShape`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StreamShape {
    /// Number of taxels in a row.
    pub taxels: usize,
    /// Number of input maps.
    pub maps_in: usize,
    /// Number of output maps.
    pub maps_out: usize,
    /// Kernel size, time steps by taxels; both are odd.
    pub kernel: [usize; 2],
    /// Number of rows in one pooled row.
    pub pool: usize,
}

/// Block with fixed statistics that receives a sweep row by row, with the rows that are not pooled yet.
///
/// Only [`StreamBlock::new`] and `clone` allocate; [`StreamBlock::copy_from`] updates a clone. Everything runs on the calling thread.
#[derive(Debug, Clone)]
pub struct StreamBlock {
    shape: StreamShape,
    isa: Isa,
    weights: Arc<Weights>,
    /// `[taxels rounded up + padding][maps_in]`: latest row with zeros around it
    row: Vec<f32>,
    /// `[kernel steps][taxels rounded up][octets]`: row `r` is at `r % kernel steps`
    ring: Octets,
    /// `[taxels][maps_out]`: largest values of the open window
    largest: Vec<f32>,
    /// `[taxels][maps_out]`: the window that was closed last
    pooled: Vec<f32>,
    /// Number of rows pushed.
    pushed: usize,
    /// Number of rows pooled.
    complete: usize,
}

/// Weights with the running statistics folded in.
#[derive(Debug)]
struct Weights {
    /// `[kernel steps][panels][kernel taxels x maps_in][octets of a panel]`
    values: Octets,
    /// `[maps_out]`
    shift: Vec<f32>,
    octets: usize,
}

/// Returns the octets of outputs per pass through the weights: two vectors.
fn panel(isa: Isa) -> usize {
    2 * isa.group(2)
}

impl StreamBlock {
    /// Copies the weights and folds the normalisation in.
    ///
    /// - `weight`: `[maps_out, maps_in, kernel steps, kernel taxels]`
    /// - `scale`, `shift`: `[maps_out]`, from convolution output to normalised map
    ///
    /// # Panics
    /// If `weight` has the wrong length.
    pub fn new(shape: StreamShape, weight: &[f32], scale: &[f32], shift: &[f32]) -> Self {
        Self::on(Isa::detect(), shape, weight, scale, shift)
    }

    fn on(isa: Isa, shape: StreamShape, weight: &[f32], scale: &[f32], shift: &[f32]) -> Self {
        let StreamShape {
            taxels,
            maps_in,
            maps_out,
            kernel: [time, wide],
            ..
        } = shape;
        assert_eq!(weight.len(), maps_out * maps_in * time * wide);
        let panel = panel(isa);
        let octets = maps_out.div_ceil(8).next_multiple_of(panel);
        let inner = wide * maps_in;
        let mut values = Octets::zeros(time * octets * inner);
        for (map, scale) in scale.iter().enumerate() {
            let (octet, lane) = (map / 8, map % 8);
            for from in 0..maps_in {
                for tap in 0..time {
                    for across in 0..wide {
                        let weight = weight[((map * maps_in + from) * time + tap) * wide + across];
                        let k = across * maps_in + from;
                        let row = (tap * (octets / panel) + octet / panel) * inner + k;
                        values[row * panel + octet % panel].0[lane] = weight * scale;
                    }
                }
            }
        }
        let even = taxels.next_multiple_of(2);
        Self {
            isa,
            row: vec![0.0; (even + wide - 1) * maps_in],
            ring: Octets::zeros(time * even * octets),
            largest: vec![0.0; taxels * maps_out],
            pooled: vec![0.0; taxels * maps_out],
            pushed: 0,
            complete: 0,
            weights: Arc::new(Weights {
                values,
                shift: shift.to_vec(),
                octets,
            }),
            shape,
        }
    }

    /// Starts a new sweep: discards all rows.
    pub fn restart(&mut self) {
        self.ring.fill(Octet::ZERO);
        self.pushed = 0;
        self.complete = 0;
    }

    /// Copies the rows of `other`; one of the two blocks must be a clone of the other.
    pub fn copy_from(&mut self, other: &Self) {
        debug_assert!(Arc::ptr_eq(&self.weights, &other.weights));
        self.ring.copy_from_slice(&other.ring);
        self.largest.copy_from_slice(&other.largest);
        self.pushed = other.pushed;
        self.complete = other.complete;
    }

    /// Adds the next row and returns the pooled row `[taxels][maps_out]` that it completes, if any.
    ///
    /// - `row`: `[taxels][maps_in]`
    /// - `rows`: number of rows in the whole sweep
    ///
    /// # Panics
    /// If `row` has the wrong length.
    pub fn push(&mut self, row: &[f32], rows: usize) -> Option<&[f32]> {
        let StreamShape {
            taxels,
            maps_in,
            kernel: [time, wide],
            ..
        } = self.shape;
        let before = wide / 2 * maps_in;
        self.row[before..before + taxels * maps_in].copy_from_slice(row);
        let (half, at) = (time / 2, self.pushed);
        self.isa.run(
            2,
            Spread {
                row: &self.row,
                maps_in,
                weights: &self.weights.values,
                ring: &mut self.ring,
                targets: at.saturating_sub(half)..(at + half + 1).min(rows),
                reach: at + half,
                time,
                octets: self.weights.octets,
            },
        );
        self.pushed += 1;
        if self.pushed <= half {
            return None;
        }
        self.finish_row(rows)
    }

    /// Returns the next pooled row of a sweep that ends with the latest row; call it until it returns `None`.
    pub fn end(&mut self) -> Option<&[f32]> {
        let rows = self.pushed;
        let pool = self.shape.pool;
        if self.complete == rows {
            return None;
        }
        let close = (self.complete / pool * pool + pool).min(rows);
        while self.complete + 1 < close {
            self.finish_row(rows);
        }
        self.finish_row(rows)
    }

    /// Moves the oldest row of the ring into its window; returns the window that it completes.
    fn finish_row(&mut self, rows: usize) -> Option<&[f32]> {
        let StreamShape {
            taxels,
            maps_out,
            kernel: [time, _],
            pool,
            ..
        } = self.shape;
        let width = self.weights.octets;
        let even = taxels.next_multiple_of(2);
        let slot = self.complete % time * even * width;
        let row = &mut self.ring[slot..slot + even * width];
        let first = self.complete.is_multiple_of(pool);
        let taxel_rows = floats(row).chunks_exact(8 * width);
        for (largest, row) in self.largest.chunks_exact_mut(maps_out).zip(taxel_rows) {
            for (largest, value) in largest.iter_mut().zip(row) {
                *largest = if first || *value > *largest {
                    *value
                } else {
                    *largest
                };
            }
        }
        row.fill(Octet::ZERO);
        self.complete += 1;
        if !self.complete.is_multiple_of(pool) && self.complete < rows {
            return None;
        }
        let windows = self.largest.chunks_exact(maps_out);
        for (pooled, largest) in self.pooled.chunks_exact_mut(maps_out).zip(windows) {
            for ((pooled, largest), shift) in
                pooled.iter_mut().zip(largest).zip(&self.weights.shift)
            {
                *pooled = (largest + shift).max(0.0);
            }
        }
        Some(&self.pooled)
    }
}

/// Addition of one input row, times the weights of each tap, to the output rows around it.
struct Spread<'a> {
    row: &'a [f32],
    maps_in: usize,
    weights: &'a [Octet],
    ring: &'a mut [Octet],
    /// Output rows to add to.
    targets: std::ops::Range<usize>,
    /// Output row of tap 0.
    reach: usize,
    time: usize,
    octets: usize,
}

impl Kernel for Spread<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let panel = 2 * L::OCTETS;
        let (tap_len, slot_len) = (self.weights.len() / self.time, self.ring.len() / self.time);
        let taxels = slot_len / self.octets;
        for target in self.targets {
            let weights = &self.weights[(self.reach - target) * tap_len..][..tap_len];
            let sums = &mut self.ring[target % self.time * slot_len..][..slot_len];
            let panels = weights.chunks_exact(tap_len / (self.octets / panel));
            for (number, weights) in panels.enumerate() {
                let mut taxel = 0;
                while taxel < taxels {
                    let row = &self.row[taxel * self.maps_in..];
                    let sums = &mut sums[taxel * self.octets + number * panel..];
                    // Sixteen accumulators of thirty-two registers, or eight of sixteen.
                    taxel += if L::OCTETS == 2 && taxels - taxel >= 8 {
                        add::<L, 4>(row, self.maps_in, weights, sums, self.octets)
                    } else if taxels - taxel >= 4 {
                        add::<L, 2>(row, self.maps_in, weights, sums, self.octets)
                    } else {
                        add::<L, 1>(row, self.maps_in, weights, sums, self.octets)
                    };
                }
            }
        }
    }
}

/// Adds a register block of `PAIRS` pairs of taxels by two vectors of maps; returns the number of taxels.
#[inline(always)]
fn add<L: Lanes, const PAIRS: usize>(
    row: &[f32],
    maps_in: usize,
    weights: &[Octet],
    sums: &mut [Octet],
    octets: usize,
) -> usize {
    let inner = weights.len() / (2 * L::OCTETS);
    let mut acc = [[[L::splat(0.0); 2]; 2]; PAIRS];
    let mut offsets = [[0; 2]; PAIRS];
    for pair in 0..PAIRS {
        for side in 0..2 {
            let taxel = 2 * pair + side;
            offsets[pair][side] = taxel * maps_in;
            for half in 0..2 {
                acc[pair][side][half] = L::load(sums, taxel * octets + half * L::OCTETS);
            }
        }
    }
    let mut row = Walk::<f32, L, PAIRS>::new(row, 1, inner, offsets);
    let mut weights = Walk::<Octet, L, 1>::new(weights, 2 * L::OCTETS, inner, [[0, L::OCTETS]]);
    while let (Some(row), Some([weights])) = (row.step(), weights.step()) {
        for pair in 0..PAIRS {
            for side in 0..2 {
                let value = L::splat(row[pair][side]);
                for half in 0..2 {
                    acc[pair][side][half] = value.mul_add(weights[half], acc[pair][side][half]);
                }
            }
        }
    }
    for pair in 0..PAIRS {
        for side in 0..2 {
            for half in 0..2 {
                let at = (2 * pair + side) * octets + half * L::OCTETS;
                acc[pair][side][half].store(sums, at);
            }
        }
    }
    2 * PAIRS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Block;
    use crate::noise::noise;
    use crate::shape::BlockShape;
    use proptest::prelude::*;

    /// Returns the output of the block for a whole sweep.
    fn whole(
        shape: StreamShape,
        steps: usize,
        input: &[f32],
        weight: &[f32],
        norm: [&[f32]; 2],
    ) -> Vec<f32> {
        let StreamShape {
            taxels,
            maps_in,
            maps_out,
            kernel,
            pool,
        } = shape;
        let block = Block::plan(BlockShape {
            batch: 1,
            steps,
            taxels,
            maps_in,
            maps_out,
            kernel,
            pool,
        });
        let [scale, shift] = norm;
        // The standard deviation is one.
        let (mean, variance) = (vec![0.0; maps_out], vec![1.0 - 1e-5; maps_out]);
        block.forward_eval(input, weight, scale, shift, &mean, &variance)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn rows_one_by_one_give_what_the_whole_sweep_gives(
            steps in 1_usize..60, taxels in 1_usize..18, maps_in in 1_usize..10, maps_out in 1_usize..40,
            half in (0_usize..5, 0_usize..3), pool in 1_usize..12, seed in 0_u64..1000,
        ) {
            let shape = StreamShape { taxels, maps_in, maps_out, kernel: [2 * half.0 + 1, 2 * half.1 + 1], pool };
            let input = noise(steps * taxels * maps_in, seed);
            let weight = noise(maps_out * maps_in * shape.kernel[0] * shape.kernel[1], seed + 1);
            let (scale, shift) = (noise(maps_out, seed + 2), noise(maps_out, seed + 3));
            let expected = whole(shape, steps, &input, &weight, [&scale, &shift]);
            for isa in Isa::all() {
                let mut block = StreamBlock::on(isa, shape, &weight, &scale, &shift);
                let mut copy = block.clone();
                // Rows pushed before a restart have no effect.
                for row in input.chunks_exact(taxels * maps_in).take(seed as usize % 7) {
                    block.push(row, steps);
                }
                block.restart();
                let mut found = Vec::new();
                for row in input.chunks_exact(taxels * maps_in) {
                    found.extend_from_slice(block.push(row, steps).unwrap_or(&[]));
                }
                copy.copy_from(&block);
                while let Some(row) = copy.end() {
                    found.extend_from_slice(row);
                }
                prop_assert_eq!(found.len(), expected.len());
                for (found, expected) in found.iter().zip(&expected) {
                    prop_assert!((found - expected).abs() < 1e-3, "{} {}", found, expected);
                }
            }
        }
    }
}
