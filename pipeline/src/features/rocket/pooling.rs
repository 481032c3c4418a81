//! Pooling of a kernel's result into features.

/// Pooling of a kernel's result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pooling {
    /// Share of steps above the bias, for MiniRocket.
    Share,
    /// Share, longest stretch, mean value and mean position, for MultiRocket.
    FourWays,
}

/// Number of features that [`Pooling::FourWays`] computes per bias.
pub(crate) const WAYS: usize = 4;
/// Features of [`Pooling::FourWays`] that are numbers of steps: longest stretch and mean position.
pub(crate) const IN_STEPS: [usize; 2] = [1, 3];

impl Pooling {
    /// Returns the number of features per bias.
    pub fn ways(self) -> usize {
        match self {
            Self::Share => 1,
            Self::FourWays => WAYS,
        }
    }
}

/// Number of values compared at once: four vectors of eight, so that no remainder needs a scalar loop.
const BLOCK: usize = 32;

/// Result of one kernel, padded to a complete block with minus infinity, which exceeds no bias.
#[derive(Default)]
pub(super) struct KernelResult {
    values: Vec<f32>,
    steps: usize,
}

impl KernelResult {
    /// Returns all results for the caller to overwrite.
    #[inline(always)]
    pub fn resize(&mut self, steps: usize) -> &mut [f32] {
        self.steps = steps;
        self.values
            .resize(steps.next_multiple_of(BLOCK), f32::NEG_INFINITY);
        self.values[steps..].fill(f32::NEG_INFINITY);
        &mut self.values[..steps]
    }

    /// Returns all results.
    pub fn steps(&self) -> &[f32] {
        &self.values[..self.steps]
    }

    /// Writes the share of steps above each bias (PPV).
    #[inline(always)]
    pub fn shares(&self, biases: &[f32], out: &mut [f32]) {
        for (bias, out) in biases.iter().zip(out) {
            let count: u32 = self
                .values
                .iter()
                .map(|value| u32::from(value > bias))
                .sum();
            *out = count as f32 / self.steps as f32;
        }
    }
}

/// Returns four features: share of steps above `bias`; longest stretch between steps below it; mean of value plus bias over the steps above it
/// (0 if none); mean position of those steps (-1 if none).
///
/// - `below`: scratch memory
#[inline(always)]
pub(super) fn four_ways(result: &[f32], bias: f32, below: &mut Vec<u8>) -> [f32; WAYS] {
    let (mut count, mut positions) = (0_u32, 0_u32);
    for (position, value) in result.iter().enumerate() {
        let above = *value > bias;
        count += u32::from(above);
        positions += if above { position as u32 } else { 0 };
    }
    let sum = sum_above(result, bias);
    let stretch = longest_stretch(result, bias, below);
    let above = count as f32;
    let (mean, position) = if count == 0 {
        (0.0, -1.0)
    } else {
        (
            ((sum + f64::from(count) * f64::from(bias)) / f64::from(count)) as f32,
            (f64::from(positions) / f64::from(count)) as f32,
        )
    };
    [above / result.len() as f32, stretch as f32, mean, position]
}

/// Returns the sum of the values above `bias`, in single precision within a block and in double precision over blocks.
#[inline(always)]
fn sum_above(result: &[f32], bias: f32) -> f64 {
    const LANES: usize = 16;
    let mut total = 0.0;
    for block in result.chunks(16 * LANES) {
        let mut lanes = [0.0_f32; LANES];
        let mut chunks = block.chunks_exact(LANES);
        for chunk in &mut chunks {
            for (lane, value) in lanes.iter_mut().zip(chunk) {
                *lane += if *value > bias { *value } else { 0.0 };
            }
        }
        let rest = chunks.remainder().iter().filter(|value| **value > bias);
        total += f64::from(lanes.iter().sum::<f32>() + rest.sum::<f32>());
    }
    total
}

/// Returns the largest distance between successive steps below `bias`. The first stretch begins at the first step, the last one ends at the last.
#[inline(always)]
fn longest_stretch(result: &[f32], bias: f32, below: &mut Vec<u8>) -> usize {
    below.clear();
    below.extend(result.iter().map(|value| u8::from(*value < bias)));
    below.resize(result.len().next_multiple_of(8), 0);
    let mut last = 0;
    let mut longest = 0;
    for (word, bytes) in below.chunks_exact(8).enumerate() {
        let mut bits = pack(bytes);
        while bits != 0 {
            let first = bits.trailing_zeros();
            let run = (bits >> first).trailing_ones();
            let start = word * 8 + first as usize;
            longest = longest.max(start - last);
            last = start + run as usize - 1;
            if run > 1 {
                longest = longest.max(1);
            }
            bits &= !(((1_u32 << run) - 1) << first);
        }
    }
    longest.max(result.len() - 1 - last)
}

/// Packs eight bytes of 0 or 1 into eight bits, the first byte lowest.
#[inline(always)]
fn pack(bytes: &[u8]) -> u32 {
    let mut word = [0; 8];
    word.copy_from_slice(bytes);
    (u64::from_le_bytes(word).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Computes the features by definition, step by step (aeon 1.6, `_multirocket.py`).
    fn by_definition(result: &[f32], bias: f32) -> [f64; WAYS] {
        let (mut count, mut last, mut longest, mut positions, mut sum) = (0, 0, 0, 0, 0.0);
        for (step, value) in result.iter().enumerate() {
            if *value > bias {
                count += 1;
                positions += step;
                sum += f64::from(*value) + f64::from(bias);
            } else if *value < bias {
                longest = longest.max(step - last);
                last = step;
            }
        }
        longest = longest.max(result.len() - 1 - last);
        let mean = |sum: f64, none: f64| {
            if count > 0 {
                sum / f64::from(count)
            } else {
                none
            }
        };
        [
            f64::from(count) / result.len() as f64,
            longest as f64,
            mean(sum, 0.0),
            mean(positions as f64, -1.0),
        ]
    }

    proptest! {
        #[test]
        fn pooling_follows_its_definition(
            result in prop::collection::vec(-4_i8..5, 1..700), bias in -5_i8..6,
        ) {
            let result: Vec<f32> = result.into_iter().map(f32::from).collect();
            let bias = f32::from(bias);
            let expected = by_definition(&result, bias);
            let found = four_ways(&result, bias, &mut Vec::new());
            for (found, expected) in found.into_iter().zip(expected) {
                prop_assert!((f64::from(found) - expected).abs() <= 1e-6 * expected.abs().max(1.0));
            }
            let (mut kernel, mut share) = (KernelResult::default(), [0.0]);
            kernel.resize(result.len()).copy_from_slice(&result);
            kernel.shares(&[bias], &mut share);
            prop_assert_eq!(share[0], found[0]);
        }
    }
}
