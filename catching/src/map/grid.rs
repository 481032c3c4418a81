//! Grid of equal cells, in rows along x, then y, then z.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::checks::{all, finite, from_to};

use super::error::MapError;

/// Maximum number of cells of a grid: 256 in each direction.
const MOST_CELLS: usize = 1 << 24;

tactnet_catching_packets::settings! {
    /// Position and size of a grid.
    ///
    /// 2.56 m in each direction around the robot's workspace, in steps of 2 cm.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct VoxelGrid in "grid.": MapError {
        /// Corner with the lowest coordinates, in m.
        pub corner: [f64; 3] = [-0.78, -1.28, 0.0] => finite,
        /// Edge length of a cell, in m.
        pub voxel: f64 = 0.02 => from_to([1e-3, 1.0], "0.001 to 1 m"),
        /// Number of cells along x, y and z.
        pub cells: [usize; 3] = [128; 3],
    }
}

impl VoxelGrid {
    /// Validates the grid.
    ///
    /// # Errors
    /// Returns the first setting that is out of range.
    pub fn check(&self) -> Result<(), MapError> {
        self.check_settings()?;
        let mut cells = self.cells.iter();
        let count = cells.try_fold(1usize, |product, n| product.checked_mul(*n));
        let few = count.is_some_and(|count| count <= MOST_CELLS);
        let expected = "at least 2 in each direction, 16777216 at most in all";
        let possible = |n| n >= 2.0 && few;
        Ok(all("grid.cells", &self.cells, expected, possible)?)
    }

    /// Returns the number of cells.
    pub fn count(&self) -> usize {
        self.cells.iter().product()
    }

    /// Returns the centre of a cell, in m.
    pub fn middle(&self, cell: [usize; 3]) -> Vector3<f64> {
        Vector3::from(std::array::from_fn(|i| {
            self.corner[i] + (cell[i] as f64 + 0.5) * self.voxel
        }))
    }

    /// Returns the index of a cell.
    pub fn number(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.cells[0] * (y + self.cells[1] * z)
    }

    /// Returns the cell that contains a point, or `None` outside of the grid.
    pub fn cell_at(&self, p: &Vector3<f64>) -> Option<[usize; 3]> {
        let mut cell = [0; 3];
        for i in 0..3 {
            let along = ((p[i] - self.corner[i]) / self.voxel).floor();
            if !(along >= 0.0 && along < self.cells[i] as f64) {
                return None;
            }
            cell[i] = along as usize;
        }
        Some(cell)
    }
}
