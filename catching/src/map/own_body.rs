//! Removal of the robot's own body from depth pictures.

use nalgebra::Isometry3;

use super::fusion::DepthCamera;
use super::spheres::Sphere;

/// Sets pixels to 0 (unmeasured) whose points lie within `margin` m of a sphere of the robot.
///
/// - `to_camera`: transform from the frame of the spheres to the camera frame (x forward, y left, z up)
pub(super) fn mask(
    depth: &mut [f32],
    camera: &DepthCamera,
    to_camera: &Isometry3<f64>,
    spheres: &[Sphere],
    margin: f64,
) {
    let [middle_u, middle_v] = camera.middle();
    for sphere in spheres {
        let centre = to_camera * nalgebra::Point3::from(sphere.centre);
        let radius = sphere.radius + margin;
        if centre.x + radius <= 0.0 {
            continue;
        }
        let [columns, rows] = [
            (centre.y, middle_u, camera.width),
            (centre.z, middle_v, camera.height),
        ]
        .map(|(aside, middle, count)| span(centre.x, aside, radius, camera.focal, middle, count));
        for row in rows.clone() {
            let c = (middle_v - (row as f64 + 0.5)) / camera.focal;
            for column in columns.clone() {
                let pixel = &mut depth[row * camera.width + column];
                let x = f64::from(*pixel);
                let b = (middle_u - (column as f64 + 0.5)) / camera.focal;
                let squared = (x - centre.x).powi(2)
                    + (x * b - centre.y).powi(2)
                    + (x * c - centre.z).powi(2);
                if x > 0.0 && squared <= radius * radius {
                    *pixel = 0.0;
                }
            }
        }
    }
}

/// Returns the range of pixels along one picture axis that a sphere can cover, or all if it reaches behind the camera.
fn span(
    ahead: f64,
    aside: f64,
    radius: f64,
    focal: f64,
    middle: f64,
    count: usize,
) -> std::ops::Range<usize> {
    let near = ahead - radius;
    if near < 0.05 {
        return 0..count;
    }
    // Extreme slopes of the box around the sphere.
    let slopes =
        [aside - radius, aside + radius].map(|side| [side / near, side / (ahead + radius)]);
    let slopes = slopes.as_flattened();
    let most = slopes.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = slopes.iter().copied().fold(f64::INFINITY, f64::min);
    let pixel = |slope: f64| (middle - focal * slope).clamp(0.0, count as f64);
    pixel(most).floor() as usize..pixel(least).ceil() as usize
}
