//! Hydra: competing random convolution kernels (Dempster, Schmidt & Webb, 2023).
//!
//! Kernels form groups of eight. At every step the kernel of a group with the largest result adds that result to its sum, and the kernel with
//! the smallest result increments its count. Half of the groups read the sweep, half its step-to-step change. With several taxels a group reads
//! the sum of some of them. Layout and rules follow aeon 1.6 (`HydraTransformer`), so that equal kernels give equal features
//! (`tests/golden/features_with_aeon.py`).

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::PipelineError;
use crate::features::arrays::of_length;
use crate::features::series::Series;

/// Number of weights of a kernel.
const TAPS: usize = 9;
/// Number of kernels in a group.
const KERNELS: usize = 8;
/// Number of groups per dilation and series.
const GROUPS: usize = 32;
/// Number of steps that are compared at once.
const BLOCK: usize = 128;

/// Kernels of all groups.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Hydra {
    /// `[dilations][2 series][32 groups][8 kernels][9 taps]`
    pub weights: Vec<f32>,
    /// Taxels that each group sums, `[dilations * 2 * 32 groups]`; a taxel may occur twice.
    pub taxels: Vec<Vec<usize>>,
}

impl Hydra {
    /// Draws kernels for sweeps of `taxels` x `steps`.
    pub fn draw([taxels, steps]: [usize; 2], rng: &mut ChaCha8Rng) -> Self {
        let dilations = dilations(steps);
        let mut weights = Vec::with_capacity(dilations * 2 * GROUPS * KERNELS * TAPS);
        for _ in 0..dilations * 2 * GROUPS * KERNELS {
            let mut kernel: [f64; TAPS] = std::array::from_fn(|_| StandardNormal.sample(rng));
            let mean = kernel.iter().sum::<f64>() / TAPS as f64;
            kernel.iter_mut().for_each(|weight| *weight -= mean);
            let size: f64 = kernel.iter().map(|weight| weight.abs()).sum();
            weights.extend(kernel.map(|weight| (weight / size) as f32));
        }
        let each = if taxels == 1 {
            1
        } else {
            (taxels / 2).clamp(2, 8)
        };
        let taxels = (0..dilations * 2 * GROUPS)
            .map(|_| (0..each).map(|_| rng.random_range(0..taxels)).collect())
            .collect();
        Self { weights, taxels }
    }

    /// Restores stored kernels for sweeps of `steps`.
    ///
    /// # Errors
    /// Another number of kernels than [`Hydra::draw`] draws.
    pub fn of(
        weights: Vec<f32>,
        taxels: Vec<Vec<usize>>,
        steps: usize,
    ) -> Result<Self, PipelineError> {
        let groups = dilations(steps) * 2 * GROUPS;
        of_length("hydra.taxel_counts", taxels.len(), groups)?;
        of_length("hydra.weights", weights.len(), groups * KERNELS * TAPS)?;
        Ok(Self { weights, taxels })
    }

    /// Returns the number of features.
    pub fn width(&self) -> usize {
        self.taxels.len() * 2 * KERNELS
    }

    /// Writes the features of one sweep: by dilation, series, then `[2: largest, smallest][32 groups][8 kernels]`.
    ///
    /// # Panics
    /// If `out` has another length.
    pub fn transform(&self, series: &Series, difference: &Series, out: &mut [f32]) {
        assert_eq!(out.len(), self.width(), "features of a series");
        // Compiled once for each vector width of processors.
        pulp::Arch::new().dispatch(|| self.transform_inner([series, difference], out));
    }

    #[inline(always)]
    fn transform_inner(&self, both: [&Series; 2], out: &mut [f32]) {
        let mut padded = Vec::new();
        let groups = self
            .taxels
            .iter()
            .zip(self.weights.chunks_exact(KERNELS * TAPS));
        for (index, (taxels, weights)) in groups.enumerate() {
            let (part, group) = (index / GROUPS, index % GROUPS);
            let series = both[part % 2];
            // A series that is shorter than those that the kernels were drawn for has a smaller largest dilation.
            let most = series.steps().saturating_sub(1) / (TAPS - 1);
            let dilation = (1 << (part / 2)).min(most.max(1));
            let padding = TAPS / 2 * dilation;
            padded.clear();
            padded.resize(series.steps() + 2 * padding, 0.0);
            for &taxel in taxels {
                for (sum, value) in padded[padding..].iter_mut().zip(series.taxel(taxel)) {
                    *sum += value;
                }
            }
            let (largest, smallest) = compete(&padded, weights, dilation, series.steps());
            let features = &mut out[part * 2 * GROUPS * KERNELS..][..2 * GROUPS * KERNELS];
            features[group * KERNELS..][..KERNELS].copy_from_slice(&largest);
            features[(GROUPS + group) * KERNELS..][..KERNELS].copy_from_slice(&smallest);
        }
    }
}

/// Returns the number of dilations 1, 2, 4, … that fit into a sweep.
fn dilations(steps: usize) -> usize {
    ((steps - 1) as f64 / (TAPS - 1) as f64).log2() as usize + 1
}

/// Returns for each kernel the sum of its results that were the largest of a step, and the number of steps with its result as the smallest.
#[inline(always)]
fn compete(
    padded: &[f32],
    weights: &[f32],
    dilation: usize,
    steps: usize,
) -> ([f32; KERNELS], [f32; KERNELS]) {
    let (mut largest_sum, mut smallest_count) = ([0.0_f32; KERNELS], [0.0_f32; KERNELS]);
    let mut results = [[0.0_f32; BLOCK]; KERNELS];
    for start in (0..steps).step_by(BLOCK) {
        let count = BLOCK.min(steps - start);
        for (result, kernel) in results.iter_mut().zip(weights.chunks_exact(TAPS)) {
            let result = &mut result[..count];
            result.fill(0.0);
            for (tap, weight) in kernel.iter().enumerate() {
                let read = &padded[start + tap * dilation..][..count];
                for (out, value) in result.iter_mut().zip(read) {
                    *out += weight * value;
                }
            }
        }
        let (mut largest, mut smallest) = ([0_u32; BLOCK], [0_u32; BLOCK]);
        let (mut high, mut low) = (results[0], results[0]);
        for (kernel, result) in results.iter().enumerate().skip(1) {
            for step in 0..count {
                let value = result[step];
                largest[step] = if value > high[step] {
                    kernel as u32
                } else {
                    largest[step]
                };
                high[step] = if value > high[step] {
                    value
                } else {
                    high[step]
                };
                smallest[step] = if value < low[step] {
                    kernel as u32
                } else {
                    smallest[step]
                };
                low[step] = if value < low[step] { value } else { low[step] };
            }
        }
        for kernel in 0..KERNELS {
            let (mut sum, mut wins) = ([0.0_f32; 16], 0_u32);
            for step in 0..count {
                wins += u32::from(smallest[step] == kernel as u32);
                sum[step % 16] += if largest[step] == kernel as u32 {
                    high[step]
                } else {
                    0.0
                };
            }
            largest_sum[kernel] += sum.iter().sum::<f32>();
            smallest_count[kernel] += wins as f32;
        }
    }
    (largest_sum, smallest_count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactnet_data::Seed;

    #[test]
    fn every_step_has_one_smallest_kernel_in_each_group() {
        let values: Vec<f32> = (0..3 * 300).map(|i| ((i * 7919) % 101) as f32).collect();
        let series = Series::from_frames(&values, 3);
        let hydra = Hydra::draw([3, 300], &mut Seed(1).rng("hydra"));
        let mut out = vec![0.0; hydra.width()];
        hydra.transform(&series, &series.difference(), &mut out);
        for (part, features) in out.chunks_exact(2 * GROUPS * KERNELS).enumerate() {
            let steps = if part % 2 == 0 { 300.0 } else { 299.0 };
            for group in features[GROUPS * KERNELS..].chunks_exact(KERNELS) {
                assert_eq!(group.iter().sum::<f32>(), steps);
            }
        }
        assert_eq!(out.len() % (2 * 2 * GROUPS * KERNELS), 0);
    }
}
