//! Feature vectors, one a sweep.

/// A matrix of feature vectors: `[sweeps][width]`, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    width: usize,
    values: Vec<f32>,
}

impl Features {
    /// Returns `values` (`[sweeps][width]`) as rows.
    ///
    /// # Panics
    /// If `width` is zero or the values do not fill whole rows.
    pub fn new(width: usize, values: Vec<f32>) -> Self {
        assert!(width > 0, "features have a width");
        assert_eq!(values.len() % width, 0, "whole rows of {width} values");
        Self { width, values }
    }

    /// Values of a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len() / self.width
    }

    /// Returns whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// `[sweeps][width]`
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// `[sweeps][width]`
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// The row of one sweep.
    pub fn row(&self, sweep: usize) -> &[f32] {
        &self.values[sweep * self.width..][..self.width]
    }

    /// Every row in turn.
    pub fn rows(&self) -> std::slice::ChunksExact<'_, f32> {
        self.values.chunks_exact(self.width)
    }

    /// The rows at `positions`, in that order.
    pub fn select(&self, positions: &[usize]) -> Self {
        let mut values = Vec::with_capacity(positions.len() * self.width);
        for &position in positions {
            values.extend_from_slice(self.row(position));
        }
        Self::new(self.width, values)
    }

    /// The same in `f64`, as linfa wants it.
    pub(crate) fn to_ndarray(&self) -> ndarray::Array2<f64> {
        let values = self.values.iter().map(|v| f64::from(*v)).collect();
        ndarray::Array2::from_shape_vec((self.len(), self.width), values)
            .unwrap_or_else(|error| panic!("rows are whole: {error}"))
    }
}
