//! Fusion of depth pictures into a truncated signed distance function (Curless and Levoy 1996; KinectFusion, Newcombe
//! et al. 2011). Each cell holds a weighted mean over the views.
//!
//! For a cell at depth `z` on a ray with measured depth `m`, a view contributes `clamp((m - z) / truncation, -1, 1)`
//! with weight `1 / z^2`. It contributes nothing if the cell is farther behind the surface than the truncation.

use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::checks::{all, finite, positive};

use super::error::MapError;
use super::field::DistanceField;
use super::grid::VoxelGrid;
use super::own_body::mask;
use super::spheres::Sphere;

tactnet_catching_packets::settings! {
    /// Depth camera. It measures depth along its axis, in m. Its axes are those of the head frame (x forward, y left, z
    /// up).
    ///
    /// 0.5 megapixels and a horizontal field of view of 70 degrees, mounted between the stereo cameras.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct DepthCamera in "camera.": MapError {
        /// Position in the head frame, in m.
        pub position: [f64; 3] = [0.08, 0.0, 0.1] => finite,
        /// Width of a picture, in pixels.
        pub width: usize = 816 => positive,
        /// Height of a picture, in pixels.
        pub height: usize = 612 => positive,
        /// Focal length, in pixels.
        pub focal: f64 = 582.7 => positive,
    }
}

impl DepthCamera {
    /// Returns the principal point, in pixels.
    pub fn middle(&self) -> [f64; 2] {
        [0.5 * self.width as f64, 0.5 * self.height as f64]
    }
}

tactnet_catching_packets::settings! {
    /// Settings of a [`Fusion`].
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct FusionConfig in "": MapError {
        /// Grid of cells, in the frame of the head pose.
        pub grid: VoxelGrid = VoxelGrid::default() => |_, grid: &VoxelGrid| grid.check(),
        /// Depth camera.
        pub camera: DepthCamera = DepthCamera::default() => |_, camera: &DepthCamera| camera.check_settings(),
        /// Truncation of the distances, in m.
        pub truncation: f64 = 0.06,
        /// Maximum weight of earlier looks, relative to a picture from 1 m. It lets moved objects disappear from their
        /// old position.
        pub memory: f64 = 0.2 => positive,
        /// Points closer than this to the robot's own spheres count as robot, in m.
        pub own_margin: f64 = 0.04 => positive,
    }
}

impl FusionConfig {
    fn check(&self) -> Result<(), MapError> {
        self.check_settings()?;
        // With a thinner band, a surface could lie between the cells.
        let thick = |x: f64| x >= self.grid.voxel && x.is_finite();
        let expected = "at least the edge of a cell";
        Ok(all("truncation", &self.truncation, expected, thick)?)
    }
}

/// Flag: seen from the front in this look.
const SEEN: u8 = 1;
/// Flag: in view in this look, far behind a surface.
const HIDDEN: u8 = 2;

/// Fused depth pictures.
#[derive(Debug, Clone)]
pub struct Fusion {
    config: FusionConfig,
    /// Truncated distances, from -1 (inside) to 1, relative to the truncation.
    values: Vec<f32>,
    weights: Vec<f32>,
    /// Flags of the current look.
    views: Vec<u8>,
    masked: Vec<f32>,
}

impl Fusion {
    /// Creates a map of unknown cells.
    ///
    /// # Errors
    /// Returns the first setting that is out of range.
    pub fn new(config: FusionConfig) -> Result<Self, MapError> {
        config.check()?;
        let count = config.grid.count();
        Ok(Self {
            values: vec![0.0; count],
            weights: vec![0.0; count],
            views: vec![0; count],
            masked: Vec::new(),
            config,
        })
    }

    /// Starts a new look and reduces the weights of earlier ones, so that moved objects appear at their new position.
    pub fn look_again(&mut self) {
        let most = self.config.memory as f32;
        for weight in &mut self.weights {
            *weight = weight.min(most);
        }
        self.views.fill(0);
    }

    /// Adds a depth picture: depths in m, row by row from the top left, 0 for unmeasured pixels.
    ///
    /// - `head`: head pose in the map frame
    /// - `own`: spheres of the robot in the map frame
    ///
    /// # Errors
    /// Returns an error and leaves the map unchanged if the picture has the wrong size, invalid depths or no measured
    /// pixel.
    pub fn push(
        &mut self,
        depth: &[f32],
        head: &Isometry3<f64>,
        own: &[Sphere],
    ) -> Result<(), MapError> {
        let camera = self.config.camera;
        check_picture(depth, &camera)?;
        if !head.translation.vector.iter().all(|x| x.is_finite())
            || !head.rotation.coords.iter().all(|x| x.is_finite())
        {
            return Err(MapError::Pose);
        }
        let [x, y, z] = camera.position;
        let to_camera = (head * nalgebra::Translation3::new(x, y, z)).inverse();
        let mut masked = std::mem::take(&mut self.masked);
        masked.clear();
        masked.extend_from_slice(depth);
        mask(
            &mut masked,
            &camera,
            &to_camera,
            own,
            self.config.own_margin,
        );
        self.fuse(&masked, &to_camera);
        self.masked = masked;
        Ok(())
    }

    fn fuse(&mut self, depth: &[f32], to_camera: &Isometry3<f64>) {
        let (grid, camera) = (self.config.grid, self.config.camera);
        let [nx, ny, _] = grid.cells;
        let [middle_u, middle_v] = camera.middle().map(|middle| middle as f32);
        let (focal, truncation) = (camera.focal as f32, self.config.truncation as f32);
        let (width, height) = (camera.width as f32, camera.height as f32);
        let step = (to_camera.rotation * Vector3::x() * grid.voxel).cast::<f32>();
        for row in 0..self.values.len() / nx {
            let first = to_camera * Point3::from(grid.middle([0, row % ny, row / ny]));
            let first = first.coords.cast::<f32>();
            let cells = row * nx..(row + 1) * nx;
            let values = &mut self.values[cells.clone()];
            let weights = &mut self.weights[cells.clone()];
            let views = &mut self.views[cells];
            // Visibility is bounded linearly along a row. One more cell on each side covers rounding.
            let bounds = [
                Vector3::new(1.0, 0.0, 0.0),
                Vector3::new(middle_u, -focal, 0.0),
                Vector3::new(middle_u, focal, 0.0),
                Vector3::new(middle_v, 0.0, -focal),
                Vector3::new(middle_v, 0.0, focal),
            ];
            for i in where_positive(&first, &step, &bounds, nx) {
                let at = first + step * i as f32;
                if at.x < 0.1 {
                    continue;
                }
                let u = middle_u - focal * at.y / at.x;
                let v = middle_v - focal * at.z / at.x;
                if !(u >= 0.0 && u < width && v >= 0.0 && v < height) {
                    continue;
                }
                let measured = depth[v as usize * camera.width + u as usize];
                if measured == 0.0 {
                    continue;
                }
                let before = (measured - at.x) / truncation;
                if before < -1.0 {
                    views[i] |= HIDDEN;
                    continue;
                }
                views[i] |= SEEN;
                let weight = 1.0 / (at.x * at.x);
                let sum = weights[i] + weight;
                values[i] += (before.min(1.0) - values[i]) * (weight / sum);
                weights[i] = sum;
            }
        }
    }

    /// Returns the solid cells: those behind a seen surface, and those that this look saw only from far behind a
    /// surface.
    pub fn solid(&self) -> Vec<bool> {
        self.values
            .iter()
            .zip(&self.weights)
            .zip(&self.views)
            .map(|((value, weight), views)| match views & (SEEN | HIDDEN) {
                HIDDEN => true,
                _ => *weight > 0.0 && *value < 0.0,
            })
            .collect()
    }

    /// Returns the distances to all solid cells.
    pub fn field(&self) -> DistanceField {
        DistanceField::new(self.config.grid, &self.solid())
    }
}

/// Returns the steps from `first` along `step` at which the products with all `bounds` are non-negative, plus one on
/// each side.
fn where_positive(
    first: &Vector3<f32>,
    step: &Vector3<f32>,
    bounds: &[Vector3<f32>],
    count: usize,
) -> std::ops::Range<usize> {
    let (mut low, mut high) = (0.0f32, count as f32);
    for bound in bounds {
        let (here, slope) = (bound.dot(first), bound.dot(step));
        let root = -here / slope;
        if slope > 0.0 {
            low = low.max(root - 1.0);
        } else if slope < 0.0 {
            high = high.min(root + 2.0);
        } else if here < 0.0 {
            return 0..0;
        }
    }
    let low = low.max(0.0).min(count as f32) as usize;
    low..(high.max(0.0) as usize).max(low).min(count)
}

fn check_picture(depth: &[f32], camera: &DepthCamera) -> Result<(), MapError> {
    if depth.len() != camera.width * camera.height {
        return Err(MapError::Size {
            found: depth.len(),
            width: camera.width,
            height: camera.height,
        });
    }
    let is_none = |depth: &f32| !(depth.is_finite() && *depth >= 0.0);
    if let Some(pixel) = depth.iter().position(is_none) {
        return Err(MapError::Depth {
            pixel,
            found: depth[pixel],
        });
    }
    if depth.iter().all(|depth| *depth == 0.0) {
        return Err(MapError::Blind);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> FusionConfig {
        FusionConfig {
            grid: VoxelGrid {
                corner: [0.2, -0.5, -0.5],
                voxel: 0.02,
                cells: [80, 50, 50],
            },
            camera: DepthCamera {
                position: [0.0; 3],
                width: 200,
                height: 160,
                focal: 150.0,
            },
            ..FusionConfig::default()
        }
    }

    /// Returns a picture of a wall at `wall` m with a square of half width `half` in front of it at `near` m, centred
    /// on the camera axis.
    fn wall_and_square(camera: &DepthCamera, wall: f32, near: f32, half: f64) -> Vec<f32> {
        let [u, v] = camera.middle();
        (0..camera.width * camera.height)
            .map(|i| {
                let b = (i % camera.width) as f64 + 0.5 - u;
                let c = (i / camera.width) as f64 + 0.5 - v;
                let within = f64::from(near) * b.abs().max(c.abs()) / camera.focal < half;
                if within { near } else { wall }
            })
            .collect()
    }

    /// Returns an empty map, and a picture of a wall at 1.5 m with a square at 0.8 m in front of it.
    fn square() -> (Fusion, Vec<f32>) {
        let fusion = Fusion::new(small()).unwrap();
        let picture = wall_and_square(&fusion.config.camera, 1.5, 0.8, 0.1);
        (fusion, picture)
    }

    fn sees(fusion: &Fusion, p: [f64; 3]) -> bool {
        let grid = fusion.config.grid;
        let cell = grid.cell_at(&Vector3::from(p)).unwrap();
        fusion.solid()[grid.number(cell)]
    }

    #[test]
    fn surfaces_lie_where_they_were_measured_and_what_is_behind_is_solid() {
        let (mut fusion, picture) = square();
        fusion.push(&picture, &Isometry3::identity(), &[]).unwrap();
        let field = fusion.field();
        for (x, y, expected) in [(0.7, 0.0, 0.1), (0.84, 0.0, -0.04), (1.3, 0.42, 0.2)] {
            let found = field.distance(&Vector3::new(x, y, 0.0));
            assert!((found - expected).abs() < 0.015, "{x} {y}: {found}");
        }
        // The square hides the region behind it up to the wall. Cells outside of the picture are free.
        assert!(sees(&fusion, [1.1, 0.0, 0.0]) && sees(&fusion, [1.49, 0.0, 0.0]));
        assert!(!sees(&fusion, [0.3, 0.45, 0.0]));
    }

    #[test]
    fn moved_objects_appear_only_at_their_new_position() {
        let (mut fusion, picture) = square();
        let turned = Isometry3::rotation(Vector3::z() * 0.1);
        for _ in 0..4 {
            fusion.push(&picture, &Isometry3::identity(), &[]).unwrap();
        }
        fusion.look_again();
        // The same square, seen by a rotated head: 8 cm to the left.
        let moved = wall_and_square(&fusion.config.camera, 1.5, 0.8, 0.04);
        for _ in 0..4 {
            fusion.push(&moved, &turned, &[]).unwrap();
        }
        assert!(!sees(&fusion, [0.83, -0.07, 0.0]));
        assert!(sees(&fusion, [0.83, 0.08, 0.0]));
        // Deep inside, in formerly free space.
        assert!(sees(&fusion, [1.1, 0.11, 0.0]));
    }

    #[test]
    fn cells_outside_the_picture_are_left_out_and_none_inside() {
        let config = small();
        let camera = config.camera;
        let [middle_u, middle_v] = camera.middle();
        let turned = Isometry3::new(Vector3::new(0.4, 0.1, 0.05), Vector3::new(0.2, 0.3, -0.5));
        let mut fusion = Fusion::new(config).unwrap();
        let far = vec![5.0; camera.width * camera.height];
        fusion.push(&far, &turned, &[]).unwrap();
        let grid = config.grid;
        for number in 0..grid.count() {
            let [nx, ny, _] = grid.cells;
            let cell = [number % nx, number / nx % ny, number / nx / ny];
            let p = turned.inverse() * Point3::from(grid.middle(cell));
            let (u, v) = (
                middle_u - camera.focal * p.y / p.x,
                middle_v - camera.focal * p.z / p.x,
            );
            // Allow a thousandth of a pixel for rounding.
            let within = |slack: f64| {
                p.x >= 0.1 + slack
                    && (slack..camera.width as f64 - slack).contains(&u)
                    && (slack..camera.height as f64 - slack).contains(&v)
            };
            let seen = fusion.views[number] & SEEN != 0;
            assert!(seen || !within(1e-3), "{cell:?} {u} {v}");
            assert!(!seen || within(-1e-3), "{cell:?} {u} {v}");
        }
    }

    #[test]
    fn the_robot_itself_is_no_obstacle_and_hides_nothing() {
        let (mut fusion, picture) = square();
        let (centre, radius) = (Vector3::new(0.85, 0.0, 0.0), 0.16);
        let own = [Sphere { centre, radius }];
        fusion.push(&picture, &Isometry3::identity(), &own).unwrap();
        assert!(!sees(&fusion, [0.83, 0.0, 0.0]) && !sees(&fusion, [1.1, 0.0, 0.0]));
        assert!(sees(&fusion, [1.53, 0.42, 0.0]));
    }

    #[test]
    fn pictures_that_are_none_are_refused_and_change_nothing() {
        let (mut fusion, good) = square();
        let (config, head) = (small(), Isometry3::identity());
        fusion.push(&good, &head, &[]).unwrap();
        let before = fusion.solid();
        let mut spoilt = good.clone();
        spoilt[77] = f32::NAN;
        let says = |fusion: &mut Fusion, picture: &[f32]| {
            fusion.push(picture, &head, &[]).unwrap_err().to_string()
        };
        let short = says(&mut fusion, &good[1..]);
        let expected = "the depth picture has 31999 pixels, expected 200 x 160";
        assert_eq!(short, expected);
        assert!(says(&mut fusion, &spoilt).starts_with("pixel 77 of the depth picture is NaN m"));
        spoilt[77] = -1.0;
        assert!(says(&mut fusion, &spoilt).contains("is -1 m"));
        assert!(says(&mut fusion, &vec![0.0; good.len()]).contains("no measured pixel"));
        let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
        assert_eq!(fusion.push(&good, &nowhere, &[]), Err(MapError::Pose));
        assert_eq!(fusion.solid(), before);
        let mut thin = config;
        thin.truncation = 0.0;
        let error = Fusion::new(thin).unwrap_err().to_string();
        assert!(error.contains("`truncation`: expected at least the edge of a cell, found 0"));
        let mut huge = config;
        huge.grid.cells = [usize::MAX, 2, 2];
        assert!(Fusion::new(huge).is_err());
    }
}
