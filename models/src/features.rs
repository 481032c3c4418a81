//! Matrix of feature vectors.

/// Matrix of feature vectors in row-major order, `[sweeps][width]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    width: usize,
    values: Vec<f32>,
}

impl Features {
    /// Creates a matrix from `values`, `[sweeps][width]`.
    ///
    /// # Panics
    /// If `width` is zero or the values do not fill whole rows.
    pub fn new(width: usize, values: Vec<f32>) -> Self {
        assert!(width > 0, "features have a width");
        assert_eq!(values.len() % width, 0, "whole rows of {width} values");
        Self { width, values }
    }

    /// Returns the number of values in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.values.len() / self.width
    }

    /// Returns true if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns all values, `[sweeps][width]`.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns all values for writing, `[sweeps][width]`.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// Returns the row of one sweep.
    pub fn row(&self, sweep: usize) -> &[f32] {
        &self.values[sweep * self.width..][..self.width]
    }

    /// Returns the row of one sweep for writing.
    pub fn row_mut(&mut self, sweep: usize) -> &mut [f32] {
        &mut self.values[sweep * self.width..][..self.width]
    }

    /// Returns an iterator over the rows.
    pub fn rows(&self) -> std::slice::ChunksExact<'_, f32> {
        self.values.chunks_exact(self.width)
    }

    /// Returns the rows at `positions`, in that order.
    pub fn select(&self, positions: &[usize]) -> Self {
        let mut values = Vec::with_capacity(positions.len() * self.width);
        for &position in positions {
            values.extend_from_slice(self.row(position));
        }
        Self::new(self.width, values)
    }

    /// Converts to an `f64` matrix for linfa.
    pub(crate) fn to_ndarray(&self) -> ndarray::Array2<f64> {
        let values = self.values.iter().map(|v| f64::from(*v)).collect();
        ndarray::Array2::from_shape_vec((self.len(), self.width), values)
            .unwrap_or_else(|error| panic!("rows are whole: {error}"))
    }
}
