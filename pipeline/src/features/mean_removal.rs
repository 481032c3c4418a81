//! Removal of each taxel's mean over a sweep.

use serde::{Deserialize, Serialize};
use tactnet_data::SweepShape;

/// Removal of each taxel's mean over a sweep. In some recordings these means alone identify the material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum MeanRemoval {
    /// The mean is kept.
    #[default]
    #[serde(rename = "kept", alias = "none")]
    None,
    /// The mean of every taxel over the sweep is subtracted.
    #[serde(rename = "removed", alias = "per-sweep")]
    PerSweep,
}

impl MeanRemoval {
    /// Returns the name in arguments and results.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "kept",
            Self::PerSweep => "removed",
        }
    }

    /// Returns true if the means are kept.
    pub fn is_none(&self) -> bool {
        *self == Self::None
    }

    /// Removes the means of complete sweeps in place.
    ///
    /// - `sweeps`: `[sweeps][steps][taxels]`
    ///
    /// # Panics
    /// If the values are not complete sweeps of `shape`.
    pub fn apply(self, sweeps: &mut [f32], shape: SweepShape) {
        self.apply_to_taxels(sweeps, shape, 0);
    }

    /// Removes the means of complete sweeps in place, except those of the last `conditions` columns.
    ///
    /// # Panics
    /// As [`MeanRemoval::apply`].
    pub(crate) fn apply_to_taxels(self, sweeps: &mut [f32], shape: SweepShape, conditions: usize) {
        assert_eq!(sweeps.len() % shape.values(), 0, "whole sweeps of {shape}");
        if self == Self::None {
            return;
        }
        let taxels = shape.taxels();
        for sweep in sweeps.chunks_exact_mut(shape.values()) {
            let mut means = vec![0.0_f64; taxels];
            for frame in sweep.chunks_exact(taxels) {
                means
                    .iter_mut()
                    .zip(frame)
                    .for_each(|(mean, v)| *mean += f64::from(*v));
            }
            means
                .iter_mut()
                .for_each(|mean| *mean /= shape.steps as f64);
            means[taxels - conditions..].fill(0.0);
            for frame in sweep.chunks_exact_mut(taxels) {
                for (value, mean) in frame.iter_mut().zip(&means) {
                    *value = (f64::from(*value) - mean) as f32;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn removing_levels_leaves_changes_alone() {
        let shape = SweepShape {
            steps: 2,
            rows: 1,
            cols: 2,
        };
        let mut sweeps = [1.0, 10.0, 3.0, 20.0, 5.0, 5.0, 5.0, 7.0];
        MeanRemoval::None.apply(&mut sweeps, shape);
        assert_eq!(sweeps[0], 1.0);
        MeanRemoval::PerSweep.apply(&mut sweeps, shape);
        assert_eq!(sweeps, [-1.0, -5.0, 1.0, 5.0, 0.0, -1.0, 0.0, 1.0]);
    }
}
