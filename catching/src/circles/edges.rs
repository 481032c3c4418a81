//! Contrast-normalised edges, projected onto twelve directions.

use super::Window;

/// Number of directions, 15 degrees apart, with opposite ones equal. Direction `k + 6` is perpendicular to `k`.
pub(super) const DIRECTIONS: usize = 12;
/// Value of an edge with full contrast.
const FULL: f32 = 127.0;
/// Value of a squared edge with full contrast in the planes. Sums of four fit into eight bits.
pub(super) const SHARE: f64 = 31.5;

/// Working memory of one row.
#[derive(Debug, Clone, Default)]
pub(super) struct Rows {
    /// Sums over a column with weights 1 2 1, of brightness and squared brightness, and the difference between the rows
    /// below and above.
    sums: Vec<i32>,
    squares: Vec<i32>,
    differences: Vec<i32>,
    /// Edge times [`FULL`].
    x: Vec<i16>,
    y: Vec<i16>,
}

impl Rows {
    fn resize(&mut self, width: usize) {
        for sums in [&mut self.sums, &mut self.squares, &mut self.differences] {
            sums.resize(width, 0);
        }
        self.x.resize(width, 0);
        self.y.resize(width, 0);
    }
}

/// Writes `(n . C)^2 - (t . C)^2`, times [`SHARE`], for each pixel of a window and each direction `n` with its
/// perpendicular `t`. The output is `planes[direction]`, each `[height][width]` of the window. The outermost pixels
/// have no edges.
///
/// - `noise`: contrast of noise, in grey levels
pub(super) fn directed(
    pixels: &[u8],
    stride: usize,
    window: Window,
    noise: f64,
    rows: &mut Rows,
    planes: &mut [Vec<i8>; DIRECTIONS],
) {
    rows.resize(window.width);
    // Scaled like the sums, whose weights add up to 16.
    let floor = (256.0 * noise * noise) as f32;
    let turns: [[i16; 2]; DIRECTIONS] = std::array::from_fn(|k| {
        let angle = std::f64::consts::PI * k as f64 / DIRECTIONS as f64;
        [127.0 * angle.cos(), 127.0 * angle.sin()].map(|x| x.round() as i16)
    });
    pulp::Arch::new().dispatch(Lines {
        pixels,
        stride,
        window,
        floor,
        turns: &turns,
        rows,
        planes,
    });
}

/// Arguments of the projection, which is compiled for each vector width.
struct Lines<'a> {
    pixels: &'a [u8],
    stride: usize,
    window: Window,
    floor: f32,
    turns: &'a [[i16; 2]; DIRECTIONS],
    rows: &'a mut Rows,
    planes: &'a mut [Vec<i8>; DIRECTIONS],
}

impl pulp::NullaryFnOnce for Lines<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self {
            pixels,
            stride,
            window,
            floor,
            turns,
            rows,
            planes,
        } = self;
        for line in 0..window.height {
            let range = line * window.width..(line + 1) * window.width;
            if line == 0 || line + 1 == window.height {
                planes
                    .iter_mut()
                    .for_each(|plane| plane[range.clone()].fill(0));
                continue;
            }
            let row = |line: usize| {
                let from = (window.top + line) * stride + window.left;
                &pixels[from..from + window.width]
            };
            edges([row(line - 1), row(line), row(line + 1)], floor, rows);
            for (plane, turn) in planes.iter_mut().zip(turns) {
                project(&rows.x, &rows.y, *turn, &mut plane[range.clone()]);
            }
        }
    }
}

#[inline(always)]
fn edges([above, row, below]: [&[u8]; 3], floor: f32, rows: &mut Rows) {
    let width = row.len();
    let (sums, squares) = (&mut rows.sums[..width], &mut rows.squares[..width]);
    let differences = &mut rows.differences[..width];
    for i in 0..width {
        let (a, b, c) = (i32::from(above[i]), i32::from(row[i]), i32::from(below[i]));
        sums[i] = a + 2 * b + c;
        squares[i] = a * a + 2 * b * b + c * c;
        differences[i] = c - a;
    }
    let (x, y) = (&mut rows.x[..width], &mut rows.y[..width]);
    (x[0], y[0], x[width - 1], y[width - 1]) = (0, 0, 0, 0);
    let (left, middle, right) = (&sums[..width - 2], &sums[1..width - 1], &sums[2..]);
    let (q_left, q_middle, q_right) =
        (&squares[..width - 2], &squares[1..width - 1], &squares[2..]);
    let (d_left, d_middle, d_right) = (
        &differences[..width - 2],
        &differences[1..width - 1],
        &differences[2..],
    );
    let (x, y) = (&mut x[1..width - 1], &mut y[1..width - 1]);
    for i in 0..width - 2 {
        let sobel_x = (right[i] - left[i]) as f32;
        let sobel_y = (d_left[i] + 2 * d_middle[i] + d_right[i]) as f32;
        let mean = left[i] + 2 * middle[i] + right[i];
        let square = q_left[i] + 2 * q_middle[i] + q_right[i];
        let contrast = (16 * square - mean * mean) as f32 + floor;
        let scale = FULL * std::f32::consts::SQRT_2 / contrast.sqrt();
        x[i] = (sobel_x * scale) as i16;
        y[i] = (sobel_y * scale) as i16;
    }
}

#[inline(always)]
fn project(x: &[i16], y: &[i16], [cos, sin]: [i16; 2], plane: &mut [i8]) {
    for ((to, &x), &y) in plane.iter_mut().zip(x).zip(y) {
        let along = (x.wrapping_mul(cos).wrapping_add(y.wrapping_mul(sin))) >> 7;
        let across = (y.wrapping_mul(cos).wrapping_sub(x.wrapping_mul(sin))) >> 7;
        let difference = along.wrapping_mul(along) - across.wrapping_mul(across);
        *to = ((difference + 256) >> 9).min(31) as i8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn planes_of(pixels: &[u8], width: usize, noise: f64) -> [Vec<i8>; DIRECTIONS] {
        let height = pixels.len() / width;
        let window = Window::whole(width, height);
        let mut planes = std::array::from_fn(|_| vec![0; width * height]);
        let mut rows = Rows::default();
        directed(pixels, width, window, noise, &mut rows, &mut planes);
        planes
    }

    proptest! {
        /// The integer result equals the formula in double precision up to rounding.
        #[test]
        fn edges_are_shares_of_the_contrast(pixels in proptest::collection::vec(any::<u8>(), 25), noise in 0.5..20.0f64) {
            let planes = planes_of(&pixels, 5, noise);
            let at = |u: usize, v: usize| f64::from(pixels[v * 5 + u]);
            let weights = [1.0, 2.0, 1.0];
            for (u, v) in [(1, 1), (2, 2), (3, 2)] {
                let (mut sx, mut sy, mut mean, mut square) = (0.0, 0.0, 0.0, 0.0);
                for i in 0..3 {
                    for j in 0..3 {
                        let value = at(u + i - 1, v + j - 1);
                        sx += weights[j] * (i as f64 - 1.0) * value;
                        sy += weights[i] * (j as f64 - 1.0) * value;
                        mean += weights[i] * weights[j] * value;
                        square += weights[i] * weights[j] * value * value;
                    }
                }
                let scale = 2.0_f64.sqrt() / (16.0 * square - mean * mean + 256.0 * noise * noise).sqrt();
                let (cx, cy) = (sx * scale, sy * scale);
                prop_assert!(cx.hypot(cy) <= 1.0 + 1e-9);
                for (k, plane) in planes.iter().enumerate() {
                    let angle = std::f64::consts::PI * k as f64 / 12.0;
                    let along = cx * angle.cos() + cy * angle.sin();
                    let across = cy * angle.cos() - cx * angle.sin();
                    let exact = along * along - across * across;
                    let found = f64::from(plane[v * 5 + u]) / SHARE;
                    // Rounding of integers up to 127, squared.
                    prop_assert!((found - exact).abs() < 0.06, "{found} {exact}");
                }
            }
        }
    }

    #[test]
    fn edges_do_not_depend_on_illumination() {
        let bright: Vec<u8> = (0..64).map(|i| if i % 8 < 4 { 40 } else { 240 }).collect();
        let dark: Vec<u8> = bright.iter().map(|value| value / 4).collect();
        let [bright, dark] = [bright, dark].map(|pixels| planes_of(&pixels, 8, 0.5)[0][3 * 8 + 3]);
        assert!(bright >= 20 && bright.abs_diff(dark) < 2, "{bright} {dark}");
    }
}
