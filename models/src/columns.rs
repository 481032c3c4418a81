//! Matrix of feature vectors with the values of one feature in succession.

use rayon::prelude::*;

use crate::Features;

/// Number of features that are copied at once, so that the cache lines that are read of a row are used whole.
const BLOCK: usize = 64;

/// Matrix of feature vectors in column-major order, `[width][sweeps]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    sweeps: usize,
    values: Vec<f32>,
}

impl Columns {
    /// Returns the transpose of `features`.
    pub fn of(features: &Features) -> Self {
        let sweeps = features.len();
        let mut values = vec![0.0; features.values().len()];
        let blocks = values.par_chunks_mut((BLOCK * sweeps).max(1));
        blocks.enumerate().for_each(|(block, columns)| {
            for (sweep, row) in features.rows().enumerate() {
                let values = row[block * BLOCK..].iter();
                for (column, value) in columns.chunks_exact_mut(sweeps).zip(values) {
                    column[sweep] = *value;
                }
            }
        });
        Self { sweeps, values }
    }

    /// Returns the number of features.
    pub fn width(&self) -> usize {
        self.values.len().checked_div(self.sweeps).unwrap_or(0)
    }

    /// Returns one feature of all sweeps.
    pub fn column(&self, feature: usize) -> &[f32] {
        &self.values[feature * self.sweeps..][..self.sweeps]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_has_one_feature_of_all_sweeps() {
        let width = 2 * BLOCK + 5;
        let values = (0..3 * width).map(|value| value as f32).collect();
        let features = Features::new(width, values);
        let columns = Columns::of(&features);
        assert_eq!(columns.width(), width);
        for feature in 0..width {
            let expected: Vec<f32> = features.rows().map(|row| row[feature]).collect();
            assert_eq!(columns.column(feature), expected);
        }
    }
}
