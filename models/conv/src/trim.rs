//! Kernels that are longer or wider than the sweep.

use rayon::prelude::*;

use super::shape::BlockShape;
use super::spare;

/// Minimum number of kernels per thread.
const RUN: usize = 512;

/// Taps of a kernel that can reach a sweep: for a sweep of one step only the middle one of 15 time steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Trim {
    kernel: [usize; 2],
    met: [usize; 2],
}

impl Trim {
    /// Returns `None` if all taps can reach a sweep.
    pub(super) fn of(shape: &BlockShape) -> Option<Self> {
        let met = |kernel: usize, len: usize| kernel.min(2 * len - 1);
        let [kernel_steps, kernel_taxels] = shape.kernel;
        let met = [
            met(kernel_steps, shape.steps),
            met(kernel_taxels, shape.taxels),
        ];
        (met != shape.kernel).then_some(Self {
            kernel: shape.kernel,
            met,
        })
    }

    /// Returns the shape with a kernel of these taps only.
    pub(super) fn shape(&self, shape: BlockShape) -> BlockShape {
        BlockShape {
            kernel: self.met,
            ..shape
        }
    }

    /// Returns these taps of all kernels, `[kernel, steps, taxels]`.
    pub(super) fn trimmed(&self, weights: &[f32]) -> Vec<f32> {
        let kernels = weights.len() / self.taps();
        let taps = self.met[0] * self.met[1];
        let mut met = spare::take(kernels * taps);
        met.par_chunks_exact_mut(taps)
            .zip(weights.par_chunks_exact(self.taps()))
            .with_min_len(RUN)
            .for_each(|(met, weights)| {
                for (met, row) in met.chunks_exact_mut(self.met[1]).zip(self.rows()) {
                    met.copy_from_slice(&weights[row..row + self.met[1]]);
                }
            });
        met
    }

    /// Returns gradients of all taps, with zeros for the other taps.
    pub(super) fn expanded(&self, gradient: Vec<f32>) -> Vec<f32> {
        let taps = self.met[0] * self.met[1];
        let mut all = spare::take(gradient.len() / taps * self.taps());
        all.par_chunks_exact_mut(self.taps())
            .zip(gradient.par_chunks_exact(taps))
            .with_min_len(RUN)
            .for_each(|(all, met)| {
                all.fill(0.0);
                for (row, met) in self.rows().zip(met.chunks_exact(self.met[1])) {
                    all[row..row + self.met[1]].copy_from_slice(met);
                }
            });
        spare::give(gradient);
        all
    }

    fn taps(&self) -> usize {
        self.kernel[0] * self.kernel[1]
    }

    /// Iterates over the offsets of these taps' rows in a kernel.
    fn rows(&self) -> impl Iterator<Item = usize> {
        let [above, beside] = [0, 1].map(|axis| (self.kernel[axis] - self.met[axis]) / 2);
        let width = self.kernel[1];
        (above..above + self.met[0]).map(move |row| row * width + beside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_taps_are_kept_and_the_others_get_no_gradient() {
        let shape = BlockShape {
            batch: 1,
            steps: 2,
            taxels: 1,
            maps_in: 1,
            maps_out: 2,
            kernel: [5, 3],
            pool: 1,
        };
        let trim = Trim::of(&shape).unwrap();
        assert_eq!(trim.shape(shape).kernel, [3, 1]);
        let weights: Vec<f32> = (0..30).map(|value| value as f32).collect();
        let met = trim.trimmed(&weights);
        assert_eq!(met, [4.0, 7.0, 10.0, 19.0, 22.0, 25.0]);
        let all = trim.expanded(met);
        for (tap, value) in all.iter().enumerate() {
            let expected = if [4, 7, 10, 19, 22, 25].contains(&tap) {
                tap as f32
            } else {
                0.0
            };
            assert_eq!(*value, expected);
        }
        let wide = BlockShape {
            steps: 3,
            taxels: 2,
            ..shape
        };
        assert_eq!(Trim::of(&wide), None);
    }
}
