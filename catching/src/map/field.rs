//! Signed distances to obstacles, with gradients.

use nalgebra::Vector3;

use super::grid::VoxelGrid;
use super::transform::squared_distances;

/// Signed distance to the nearest obstacle, in m: positive in free space, negative inside.
///
/// Surfaces lie halfway between a solid and a free cell. The distance is trilinear between cell centres. Outside of the
/// grid, it is that of the nearest point of the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct DistanceField {
    grid: VoxelGrid,
    /// Distance at the centre of each cell, in m.
    distances: Vec<f32>,
    /// Field of a part of the grid, with smaller cells.
    finer: Option<Box<DistanceField>>,
}

impl DistanceField {
    /// Computes the distances to solid cells.
    ///
    /// # Panics
    /// Panics if `solid` does not have one entry per cell.
    pub fn new(grid: VoxelGrid, solid: &[bool]) -> Self {
        // The diagonal of the grid replaces infinite distances.
        let squares = grid.cells.iter().map(|n| (n * n) as f32);
        let farthest = squares.sum::<f32>().sqrt();
        let free: Vec<bool> = solid.iter().map(|solid| !solid).collect();
        let (mut distances, inside) = std::thread::scope(|scope| {
            let inside = scope.spawn(|| squared_distances(grid.cells, &free));
            let distances = squared_distances(grid.cells, solid);
            let inside = inside.join();
            (
                distances,
                inside.unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            )
        });
        let voxel = grid.voxel as f32;
        for ((distance, inside), solid) in distances.iter_mut().zip(&inside).zip(solid) {
            let (squared, sign) = if *solid {
                (*inside, -voxel)
            } else {
                (*distance, voxel)
            };
            *distance = sign * (squared.sqrt() - 0.5).min(farthest);
        }
        Self {
            grid,
            distances,
            finer: None,
        }
    }

    /// Returns a field without obstacles.
    pub fn empty(grid: VoxelGrid) -> Self {
        Self::new(grid, &vec![false; grid.count()])
    }

    /// Returns the field with smaller cells in a part of the grid, which must contain the same obstacles.
    pub fn with_finer(self, finer: Self) -> Self {
        Self {
            finer: Some(Box::new(finer)),
            ..self
        }
    }

    /// Returns the grid.
    pub fn grid(&self) -> &VoxelGrid {
        &self.grid
    }

    /// Returns the distance at the centre of a cell, in m.
    pub fn of_cell(&self, cell: [usize; 3]) -> f64 {
        f64::from(self.distances[self.grid.number(cell)])
    }

    /// Returns the distance at a point, in m.
    pub fn distance(&self, p: &Vector3<f64>) -> f64 {
        let own = self.own_distance(p);
        match self.within_finer(p) {
            Some((finer, edge)) => finer.distance(p).min(own.max(edge)),
            None => own,
        }
    }

    /// Returns the finer field that contains a point, and the distance to its edge, in m. Obstacles outside of it are at
    /// least as far away.
    fn within_finer(&self, p: &Vector3<f64>) -> Option<(&Self, f64)> {
        let finer = self.finer.as_deref()?;
        let grid = &finer.grid;
        let edges = (0..3).map(|i| {
            let from_corner = p[i] - grid.corner[i] - 0.5 * grid.voxel;
            from_corner.min((grid.cells[i] - 1) as f64 * grid.voxel - from_corner)
        });
        let edge = edges.fold(f64::INFINITY, f64::min);
        (edge > 0.0).then_some((finer, edge))
    }

    fn own_distance(&self, p: &Vector3<f64>) -> f64 {
        let (cell, [u, v, w]) = self.place(p).0;
        let [along_x, _] = self.corners(cell, u);
        let along_y = [0, 1].map(|k| along_x[k][0] * (1.0 - v) + along_x[k][1] * v);
        along_y[0] * (1.0 - w) + along_y[1] * w
    }

    /// Returns the distance at a point, in m, and its gradient.
    pub fn gradient(&self, p: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let own = self.own_gradient(p);
        let Some((finer, edge)) = self.within_finer(p) else {
            return own;
        };
        let inside = finer.gradient(p);
        if inside.0 <= own.0.max(edge) {
            inside
        } else {
            (own.0.max(edge), own.1)
        }
    }

    fn own_gradient(&self, p: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let ((cell, [u, v, w]), inside) = self.place(p);
        let [along_x, by_x] = self.corners(cell, u);
        let over_y =
            |values: [[f64; 2]; 2]| [0, 1].map(|k| values[k][0] * (1.0 - v) + values[k][1] * v);
        let (value, by_x) = (over_y(along_x), over_y(by_x));
        let by_y = [0, 1].map(|k| along_x[k][1] - along_x[k][0]);
        let over_z = |values: [f64; 2]| values[0] * (1.0 - w) + values[1] * w;
        let slope = [over_z(by_x), over_z(by_y), value[1] - value[0]];
        let gradient = std::array::from_fn(|i| {
            if inside[i] {
                slope[i] / self.grid.voxel
            } else {
                0.0
            }
        });
        (over_z(value), Vector3::from(gradient))
    }

    /// Returns the cell whose centre precedes the point in each direction and the fraction of the way to the next
    /// centre. The flags are true in directions in which the point lies between cell centres.
    #[allow(clippy::type_complexity)]
    fn place(&self, p: &Vector3<f64>) -> (([usize; 3], [f64; 3]), [bool; 3]) {
        let mut cell = [0; 3];
        let mut part = [0.0; 3];
        let mut inside = [true; 3];
        for i in 0..3 {
            let last = (self.grid.cells[i] - 1) as f64;
            let along = (p[i] - self.grid.corner[i]) / self.grid.voxel - 0.5;
            inside[i] = along >= 0.0 && along <= last;
            let along = along.clamp(0.0, last);
            cell[i] = (along as usize).min(self.grid.cells[i] - 2);
            part[i] = along - cell[i] as f64;
        }
        ((cell, part), inside)
    }

    /// Returns values interpolated along x and their differences along x, at the four corners `[z][y]`.
    fn corners(&self, cell: [usize; 3], u: f64) -> [[[f64; 2]; 2]; 2] {
        let first = self.grid.number(cell);
        let [nx, ny, _] = self.grid.cells;
        let mut values = [[0.0; 2]; 2];
        let mut slopes = [[0.0; 2]; 2];
        for k in 0..2 {
            for j in 0..2 {
                let at = first + nx * (j + ny * k);
                let (a, b) = (
                    f64::from(self.distances[at]),
                    f64::from(self.distances[at + 1]),
                );
                values[k][j] = a * (1.0 - u) + b * u;
                slopes[k][j] = b - a;
            }
        }
        [values, slopes]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Returns the field of a box of solid cells.
    pub(crate) fn boxed() -> (VoxelGrid, DistanceField) {
        let grid = VoxelGrid {
            corner: [-0.4, -0.3, 0.0],
            voxel: 0.02,
            cells: [40, 30, 25],
        };
        let solid: Vec<bool> = (0..grid.count())
            .map(|number| {
                let cell = [number % 40, number / 40 % 30, number / 1200];
                (15..22).contains(&cell[0])
                    && (10..20).contains(&cell[1])
                    && (5..15).contains(&cell[2])
            })
            .collect();
        (grid, DistanceField::new(grid, &solid))
    }

    #[test]
    fn distances_change_their_sign_at_the_surface() {
        let (grid, field) = boxed();
        let middle = grid.middle([18, 15, 10]);
        // The surface lies between cells 14 and 15 along x.
        let surface = grid.corner[0] + 15.0 * grid.voxel;
        let at = |x: f64| field.distance(&Vector3::new(x, middle.y, middle.z));
        assert!(at(surface).abs() < 1e-6);
        assert!((at(surface - 0.1) - 0.1).abs() < 1e-6);
        assert!((at(surface + 0.05) + 0.05).abs() < 1e-6);
        // Without obstacles the gradient is zero and the distance exceeds the grid.
        let (distance, gradient) = DistanceField::empty(grid).gradient(&middle);
        assert!(distance > 0.8 && gradient.norm() == 0.0);
    }

    /// Next to a box, the finer field is exact within its own cells, and continuous at its edge.
    #[test]
    fn smaller_cells_give_smaller_errors_near_a_box() {
        let solid = |grid: &VoxelGrid| -> Vec<bool> {
            let [nx, ny, _] = grid.cells;
            let middles =
                (0..grid.count()).map(|n| grid.middle([n % nx, n / nx % ny, n / (nx * ny)]));
            middles
                .map(|p| (p - Vector3::new(0.013, 0.007, 0.2)).abs().max() < 0.1)
                .collect()
        };
        let coarse = VoxelGrid {
            corner: [-0.4, -0.3, 0.0],
            voxel: 0.02,
            cells: [40, 30, 25],
        };
        let fine = VoxelGrid {
            corner: [-0.2, -0.2, 0.05],
            voxel: 0.005,
            cells: [80, 80, 60],
        };
        let both = [coarse, fine].map(|grid| DistanceField::new(grid, &solid(&grid)));
        let [plain, finer] = both;
        let field = plain.clone().with_finer(finer);
        let mut errors = [0.0_f64; 2];
        for step in 0..900 {
            let p = Vector3::new(-0.19 + 4e-4 * f64::from(step), 0.02, 0.2);
            let truth = ((p.x - 0.013).abs() - 0.1).max(-0.087);
            for (error, field) in errors.iter_mut().zip([&plain, &field]) {
                *error = error.max((field.distance(&p) - truth).abs());
            }
            assert!((field.gradient(&p).0 - field.distance(&p)).abs() < 1e-12);
        }
        // One and a half cells.
        assert!(errors[1] < 0.0075 && errors[0] > 0.01, "{errors:?}");
        let far = Vector3::new(0.35, 0.25, 0.45);
        assert_eq!(field.distance(&far), plain.distance(&far));
    }

    proptest! {
        #[test]
        fn gradients_are_differences_within_cells(
            cell in (0..39usize, 0..29usize, 0..24usize), part in proptest::array::uniform3(0.01..0.99f64),
        ) {
            let (grid, field) = boxed();
            let p = grid.middle([cell.0, cell.1, cell.2]) + Vector3::from(part) * grid.voxel;
            let (distance, gradient) = field.gradient(&p);
            prop_assert!((distance - field.distance(&p)).abs() < 1e-15);
            for i in 0..3 {
                let mut step = Vector3::zeros();
                step[i] = 1e-5;
                let slope = (field.distance(&(p + step)) - field.distance(&(p - step))) / 2e-5;
                prop_assert!((slope - gradient[i]).abs() < 1e-8, "{i}: {slope} {}", gradient[i]);
            }
        }

        #[test]
        fn outside_the_grid_is_as_its_nearest_point(p in proptest::array::uniform3(-3.0..3.0f64)) {
            let (grid, field) = boxed();
            let p = Vector3::from(p);
            let nearest = Vector3::from(std::array::from_fn(|i| {
                let low = grid.corner[i] + 0.5 * grid.voxel;
                p[i].clamp(low, low + (grid.cells[i] - 1) as f64 * grid.voxel)
            }));
            prop_assert!((field.distance(&p) - field.distance(&nearest)).abs() < 1e-9);
            let (_, gradient) = field.gradient(&p);
            for i in 0..3 {
                prop_assert!((p[i] - nearest[i]).abs() < 1e-12 || gradient[i] == 0.0);
            }
        }
    }
}
