//! Background: a distant room with walls, floor, ceiling, furniture, discs and stains, on the faces of a cube.

use nalgebra::Matrix3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::optics::RayRow;
use crate::stream::Stream;

/// Side length of a face, in pixels.
const SIDE: usize = 2048;
/// Number of faces: ahead, left, right, up, down. The cameras never look back.
const FACES: usize = 5;
/// Grids of the stains: cells along a face, amplitude in grey levels.
const STAINS: [(usize, f32); 4] = [(6, 26.0), (24, 18.0), (96, 12.0), (384, 8.0)];
/// Number of boxes, posters and shelves on a face.
const BOXES: usize = 60;

/// Background at infinite distance.
#[derive(Debug, Clone)]
pub(super) struct Surroundings {
    faces: std::sync::Arc<[Vec<u8>; FACES]>,
}

impl Surroundings {
    /// - `discs`: number of discs on the wall ahead
    pub(super) fn draw(discs: usize, seed: u64) -> Self {
        let faces = std::array::from_fn(|face| {
            let mut rng = Stream::Surroundings.rng(seed, face as u64);
            let ahead = face == 0;
            face_of(if ahead { discs } else { 0 }, &mut rng)
        });
        Self {
            faces: std::sync::Arc::new(faces),
        }
    }

    /// Adds `share` of the background along rays to a row of brightness.
    ///
    /// - `turn`: rotation from the camera frame to the inertial frame
    pub(super) fn add(&self, turn: &Matrix3<f64>, rays: RayRow<'_>, share: f32, row: &mut [f32]) {
        let m: Matrix3<f32> = turn.cast();
        for ((sum, right), down) in row.iter_mut().zip(rays.right).zip(rays.down) {
            let x = m.m11 - m.m12 * right - m.m13 * down;
            let y = m.m21 - m.m22 * right - m.m23 * down;
            let z = m.m31 - m.m32 * right - m.m33 * down;
            *sum += share * self.seen(x, y, z);
        }
    }

    #[inline(always)]
    fn seen(&self, x: f32, y: f32, z: f32) -> f32 {
        let (face, a, b, depth) = if x >= y.abs() && x >= z.abs() {
            (0, -y, -z, x)
        } else if y.abs() >= z.abs() {
            if y > 0.0 {
                (1, x, -z, y)
            } else {
                (2, x, -z, -y)
            }
        } else if z > 0.0 {
            (3, -y, x, z)
        } else {
            (4, -y, x, -z)
        };
        let middle = 0.5 * (SIDE - 2) as f32;
        let scale = middle / depth;
        bilinear(&self.faces[face], middle + a * scale, middle + b * scale)
    }
}

#[inline(always)]
fn bilinear(face: &[u8], a: f32, b: f32) -> f32 {
    // Rounding may exceed the edge of a face slightly.
    let (column, line) = (
        (a as i32).clamp(0, SIDE as i32 - 2),
        (b as i32).clamp(0, SIDE as i32 - 2),
    );
    let (right, down) = (a - column as f32, b - line as f32);
    let from = line as usize * SIDE + column as usize;
    let four = &face[from..from + SIDE + 2];
    let mix = |left: u8, next: u8| f32::from(left) + right * (f32::from(next) - f32::from(left));
    let upper = mix(four[0], four[1]);
    let lower = mix(four[SIDE], four[SIDE + 1]);
    upper + down * (lower - upper)
}

fn face_of(discs: usize, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let mut picture = vec![between(70.0, 150.0) as f32; SIDE * SIDE];
    for (cells, digits) in STAINS {
        let grid: Vec<f32> = (0..(cells + 1) * (cells + 1))
            .map(|_| digits * between(-1.0, 1.0) as f32)
            .collect();
        let step = cells as f32 / SIDE as f32;
        for (line, row) in picture.chunks_exact_mut(SIDE).enumerate() {
            let b = line as f32 * step;
            let (i, down) = (b as usize, b.fract());
            for (column, value) in row.iter_mut().enumerate() {
                let a = column as f32 * step;
                let (j, right) = (a as usize, a.fract());
                let of = |i: usize, j: usize| grid[i * (cells + 1) + j];
                let upper = of(i, j) + right * (of(i, j + 1) - of(i, j));
                let lower = of(i + 1, j) + right * (of(i + 1, j + 1) - of(i + 1, j));
                *value += upper + down * (lower - upper);
            }
        }
    }
    let side = SIDE as f64;
    for _ in 0..BOXES {
        let (left, top) = (between(0.0, side), between(0.0, side));
        let (width, height) = (between(8.0, 260.0), between(8.0, 260.0));
        let (shift, frame) = (between(-70.0, 70.0) as f32, between(0.0, 1.0) > 0.5);
        paint(&mut picture, [left, top], [width, height], |a, b| {
            let inside = a.abs() <= 1.0 && b.abs() <= 1.0;
            let rim = a.abs() > 0.9 || b.abs() > 0.9;
            if inside && (!frame || rim) {
                shift
            } else {
                0.0
            }
        });
    }
    for _ in 0..discs {
        let centre = [between(0.2, 0.8) * side, between(0.2, 0.8) * side];
        let radius = between(6.0, 60.0);
        let shift = between(25.0, 90.0) as f32 * if between(0.0, 1.0) > 0.5 { 1.0 } else { -1.0 };
        // Two additional pixels for a soft edge.
        paint(&mut picture, centre, [radius + 2.0; 2], |a, b| {
            let distance = a.hypot(b) * (radius as f32 + 2.0);
            shift * (radius as f32 + 0.5 - distance).clamp(0.0, 1.0)
        });
    }
    picture
        .into_iter()
        .map(|value| value.clamp(5.0, 250.0) as u8)
        .collect()
}

/// Adds `shade(a, b)` around a centre, with `a` and `b` from -1 to 1 over the half sides.
fn paint(picture: &mut [f32], centre: [f64; 2], half: [f64; 2], shade: impl Fn(f32, f32) -> f32) {
    let range = |i: usize| {
        let low = (centre[i] - half[i]).max(0.0) as usize;
        let high = ((centre[i] + half[i]).ceil().max(0.0) as usize).min(SIDE);
        low..high
    };
    for line in range(1) {
        let b = ((line as f64 + 0.5 - centre[1]) / half[1]) as f32;
        for column in range(0) {
            let a = ((column as f64 + 0.5 - centre[0]) / half[0]) as f32;
            picture[line * SIDE + column] += shade(a, b);
        }
    }
}
