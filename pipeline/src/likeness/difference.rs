//! What makes sweeps unlike the training sweeps.

use serde::Serialize;
use tactnet_data::SweepShape;

/// Difference between sweeps and the training sweeps.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Difference {
    /// Taxels that do not change, but do in the training sweeps.
    ConstantTaxels {
        /// Numbers of the taxels, from 0.
        taxels: Vec<usize>,
    },
    /// All values are larger or smaller by a factor.
    Scale {
        /// Factor on the values of the training sweeps.
        factor: f64,
    },
    /// Values have the opposite sign.
    Sign {
        /// Numbers of the taxels, from 0; all taxels if empty.
        taxels: Vec<usize>,
    },
    /// Taxels are in another order.
    Order {
        /// The order.
        order: TaxelOrder,
    },
    /// Everything happens faster or slower: another speed of the stroke or another sample rate.
    Speed {
        /// Speed relative to the training sweeps.
        factor: f64,
    },
    /// Neither of these; the property that deviates most.
    Property {
        /// The property.
        property: Property,
        /// Root mean square deviation from the nearest material, in standard deviations within materials.
        deviation: f64,
        /// Numbers of the taxels that deviate most, from 0.
        taxels: Vec<usize>,
    },
}

/// Order of the taxels relative to the training sweeps.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum TaxelOrder {
    /// Rows and columns are exchanged.
    Transposed,
    /// The patch is rotated clockwise.
    Rotated {
        /// 90, 180 or 270 degrees.
        degrees: u32,
    },
    /// The only row or column is reversed.
    Reversed,
    /// Every row is reversed.
    MirroredColumns,
    /// Every column is reversed.
    MirroredRows,
    /// Pairs of taxels are exchanged.
    Exchanged {
        /// Numbers of the taxels, from 0.
        pairs: Vec<[usize; 2]>,
    },
    /// Few taxels in another order.
    Permuted {
        /// For every taxel of the training sweeps, its place now, from 0.
        places: Vec<usize>,
    },
}

impl TaxelOrder {
    /// Returns the place of every taxel of the training sweeps: `[taxels]`.
    ///
    /// - `shape`: shape of the training sweeps
    ///
    /// # Example
    /// ```
    /// use tactnet_data::SweepShape;
    /// use tactnet_pipeline::TaxelOrder;
    ///
    /// let shape = SweepShape { steps: 1, rows: 2, cols: 3 };
    /// assert_eq!(TaxelOrder::MirroredColumns.places(shape), [2, 1, 0, 5, 4, 3]);
    /// // Written as three rows of two.
    /// assert_eq!(TaxelOrder::Transposed.places(shape), [0, 2, 4, 1, 3, 5]);
    /// ```
    pub fn places(&self, shape: SweepShape) -> Vec<usize> {
        let (rows, cols, taxels) = (shape.rows, shape.cols, shape.taxels());
        let by_position = |place: &dyn Fn(usize, usize) -> usize| {
            (0..taxels).map(|at| place(at / cols, at % cols)).collect()
        };
        match self {
            Self::Transposed => by_position(&|r, c| c * rows + r),
            Self::Rotated { degrees: 90 } => by_position(&|r, c| c * rows + rows - 1 - r),
            Self::Rotated { degrees: 270 } => by_position(&|r, c| (cols - 1 - c) * rows + r),
            Self::Rotated { .. } | Self::Reversed => (0..taxels).rev().collect(),
            Self::MirroredColumns => by_position(&|r, c| r * cols + cols - 1 - c),
            Self::MirroredRows => by_position(&|r, c| (rows - 1 - r) * cols + c),
            Self::Exchanged { pairs } => {
                let mut places: Vec<usize> = (0..taxels).collect();
                pairs.iter().for_each(|[a, b]| places.swap(*a, *b));
                places
            }
            Self::Permuted { places } => places.clone(),
        }
    }
}

/// Property of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Property {
    /// Means of the taxels.
    Level,
    /// Spreads of the taxels.
    Spread,
    /// Changes from frame to frame, relative to the spread.
    Change,
    /// Distribution of the power over frequencies.
    Spectrum,
}
