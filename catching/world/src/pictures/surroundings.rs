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

/// Number of pixels between two places that are computed; places between them are interpolated, within 0.1 pixels.
const RUN: usize = 16;
/// Subdivision of a pixel for places.
const UNIT: f32 = 65536.0;

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
        let place = |i: usize| {
            let (right, down) = (rays.right[i], rays.down[i]);
            Place::new(
                m.m11 - m.m12 * right - m.m13 * down,
                m.m21 - m.m22 * right - m.m23 * down,
                m.m31 - m.m32 * right - m.m33 * down,
            )
        };
        let mut first = place(0);
        for start in (0..row.len()).step_by(RUN) {
            let last = (start + RUN).min(row.len() - 1);
            let next = place(last);
            let run = &mut row[start..(start + RUN).min(rays.right.len())];
            if next.face == first.face {
                let steps = (last - start).max(1) as f32;
                let step = [0, 1].map(|i| ((next.at[i] - first.at[i]) * UNIT / steps) as i32);
                add_run(&self.faces[first.face], first.fixed(), step, share, run);
            } else {
                for (i, sum) in run.iter_mut().enumerate() {
                    let place = place(start + i);
                    let (face, run) = (&self.faces[place.face], std::slice::from_mut(sum));
                    add_run(face, place.fixed(), [0; 2], share, run);
                }
            }
            first = next;
        }
    }
}

/// Place on a face, in pixels.
struct Place {
    face: usize,
    at: [f32; 2],
}

impl Place {
    /// Returns where a direction meets the cube.
    fn new(x: f32, y: f32, z: f32) -> Self {
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
        // Rounding may exceed the edge of a face slightly.
        let at = [a, b].map(|x| (middle + x * middle / depth).clamp(0.0, 2.0 * middle));
        Self { face, at }
    }

    /// Returns the place in units of `1 / UNIT` pixels.
    fn fixed(&self) -> [i32; 2] {
        self.at.map(|x| (x * UNIT) as i32)
    }
}

/// Adds `share` of the brightness along a line to a run of pixels.
///
/// - `first`, `step`: place of the first pixel and way to the next one, in units of `1 / UNIT` pixels
#[inline(always)]
fn add_run(face: &[u8], first: [i32; 2], step: [i32; 2], share: f32, run: &mut [f32]) {
    let at = |i: usize| [0, 1].map(|axis| (first[axis] + step[axis] * i as i32) as u32);
    // The pixels around each place: left and right above, left and right below.
    let mut four = [[0_i32; RUN]; 4];
    for i in 0..run.len().min(RUN) {
        let [a, b] = at(i).map(|x| x as usize / UNIT as usize);
        let from = &face[b * SIDE + a..][..SIDE + 2];
        for (pixels, offset) in four.iter_mut().zip([0, 1, SIDE, SIDE + 1]) {
            pixels[i] = i32::from(from[offset]);
        }
    }
    for (i, sum) in run.iter_mut().enumerate().take(RUN) {
        let [right, down] = at(i).map(|x| (x % UNIT as u32) as i32 as f32 / UNIT);
        let mix = |left: i32, next: i32| left as f32 + right * (next - left) as f32;
        let upper = mix(four[0][i], four[1][i]);
        let lower = mix(four[2][i], four[3][i]);
        *sum += share * (upper + down * (lower - upper));
    }
}

fn face_of(discs: usize, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let mut picture = vec![between(70.0, 150.0) as f32; SIDE * SIDE];
    for (cells, digits) in STAINS {
        let grid: Vec<f32> = (0..(cells + 1) * (cells + 1))
            .map(|_| digits * between(-1.0, 1.0) as f32)
            .collect();
        let step = cells as f32 / SIDE as f32;
        // The grid lines above and below a row, interpolated to all columns.
        let along = |i: usize| -> Vec<f32> {
            let grid = &grid[i * (cells + 1)..][..cells + 1];
            let columns = (0..SIDE).map(|column| column as f32 * step);
            let at = |a: f32| {
                let (j, right) = (a as usize, a - (a as usize) as f32);
                grid[j] + right * (grid[j + 1] - grid[j])
            };
            columns.map(at).collect()
        };
        let (mut upper, mut lower) = (along(0), along(1));
        let mut above = 0;
        for (line, row) in picture.chunks_exact_mut(SIDE).enumerate() {
            let b = line as f32 * step;
            let (i, down) = (b as usize, b - (b as usize) as f32);
            if i > above {
                (upper, lower, above) = (lower, along(i + 1), i);
            }
            for ((value, upper), lower) in row.iter_mut().zip(&upper).zip(&lower) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    /// A row equals its pixels one by one within a small part of a grey level, also across faces. One pixel is never
    /// interpolated.
    #[test]
    fn interpolated_places_are_those_of_each_pixel() {
        let surroundings = Surroundings::draw(12, 3);
        let right: Vec<f32> = (0..1600).map(|u| (u as f32 - 799.5) / 1386.0).collect();
        let mut sum = 0.0;
        for number in 0..40 {
            let (down, angle) = (
                vec![0.02 * number as f32 - 0.4; 1600],
                0.1 * f64::from(number),
            );
            let turn = Rotation3::from_euler_angles(angle, 0.5 * angle.sin(), angle.cos());
            let add = |range: std::ops::Range<usize>, row: &mut [f32]| {
                let (right, down) = (&right[range.clone()], &down[range]);
                surroundings.add(turn.matrix(), RayRow { right, down }, 1.0, row);
            };
            let mut row = vec![0.0; 1600];
            add(0..1600, &mut row);
            for (u, value) in row.into_iter().enumerate() {
                let mut one = [0.0];
                add(u..u + 1, &mut one);
                sum += (value - one[0]).abs();
                assert!(
                    (value - one[0]).abs() < 8.0,
                    "{number} {u}: {value} {one:?}"
                );
            }
        }
        let mean = sum / 64_000.0;
        assert!(mean < 0.05, "{mean}");
    }
}
