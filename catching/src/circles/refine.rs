//! Circles to a fraction of a pixel: edges on rays from the centre, and a circle through them that outliers do not move.

use nalgebra::{Matrix3, Vector3};
use tactnet_catching_packets::packets::Circle;

use super::votes::Peak;

/// Rays from the centre.
const RAYS: usize = 48;
/// Most samples of a ray.
const MOST_SAMPLES: usize = 64;
/// How far from the circle edges are looked for, shares of the radius, pass by pass, and at least this many pixels.
const REACH: [(f64, f64); 3] = [(0.35, 3.5), (0.2, 2.5), (0.12, 2.0)];
/// Scale of the Cauchy weights, pixels, and share of the radius.
const SCALE: (f64, f64) = (0.5, 0.01);
/// Band around a circle in which its edges have to be the strongest, share of the radius, and at least so many pixels.
const BAND: (f64, f64) = (0.4, 4.0);
/// How far from the circle they may lie, share of the radius, and at least so many pixels.
const TOLERANCE: (f64, f64) = (0.05, 0.9);
/// The same after the first pass, and the share of the rays that are asked for in the end.
const FIRST: (f64, f64, f64) = (0.1, 1.2, 0.6);
/// How far from a known circle its edges are looked for at twice the resolution, share of the radius, and at least so many pixels; least
/// share of rays on which they lie on it.
const POLISH: (f64, f64, f64) = (0.1, 2.5, 0.4);
/// Distance of samples on a ray, pixels: for a first look, and for a closer one.
const FINEST: [f64; 2] = [0.75, 0.5];
/// Difference of brightness across an edge that counts half, digits.
const HALF: f64 = 8.0;

/// The edge on a ray.
#[derive(Debug, Clone, Copy, Default)]
struct Edge {
    cos: f64,
    sin: f64,
    /// Distance from the centre, pixels.
    distance: f64,
    weight: f64,
}

/// Directions of rays: cosine and sine.
#[derive(Debug, Clone)]
pub(super) struct Rays([[f64; 2]; RAYS]);

impl Default for Rays {
    fn default() -> Self {
        Self(std::array::from_fn(|i| {
            let angle = std::f64::consts::TAU * i as f64 / RAYS as f64;
            [angle.cos(), angle.sin()]
        }))
    }
}

/// Returns the circle of a peak; `None` if the edges around it lie on none, or beyond the picture.
///
/// - `inliers`: least share of rays whose strongest edge around the circle lies on it
pub(super) fn refined(
    directions: &Rays,
    pixels: &[u8],
    size: [usize; 2],
    peak: &Peak,
    inliers: f64,
) -> Option<Circle> {
    let (mut u, mut v, mut r) = (peak.u, peak.v, peak.r);
    let mut edges = [Edge::default(); RAYS];
    for (pass, (share, least)) in REACH.into_iter().enumerate() {
        let reach = (share * r).max(least);
        let margin = r + reach + 2.0;
        let inside = |x: f64, size: usize| x - margin >= 0.0 && x + margin < size as f64;
        if !(inside(u, size[0]) && inside(v, size[1]) && r > 2.0) {
            return None;
        }
        // Most peaks are none of a ball, which every third ray tells.
        let stride = if pass == 0 { 3 } else { 1 };
        let rays = &mut edges[..RAYS / stride];
        for (i, edge) in rays.iter_mut().enumerate() {
            let ray = directions.0[i * stride];
            *edge = edge_on_ray(
                pixels,
                size[0],
                [u, v],
                ray,
                r,
                [reach, reach],
                FINEST[pass.min(1)],
            );
        }
        let scale = SCALE.0 + SCALE.1 * r;
        let step = fitted(rays, r, scale)?;
        if step.xy().norm().max(step.z.abs()) > 1.5 * reach {
            return None;
        }
        if pass == 0 {
            let tolerance = (FIRST.0 * r).max(FIRST.1);
            let on_circle: f64 = rays
                .iter()
                .filter(|edge| edge.residual(r, &step).abs() < tolerance)
                .map(|edge| edge.weight)
                .sum();
            if on_circle < FIRST.2 * inliers * rays.len() as f64 {
                return None;
            }
        }
        (u, v, r) = (u + step.x, v + step.y, r + step.z);
    }
    // Looked for again over a wider band: edges of a texture lie anywhere in it, those of a circle lie on the circle.
    let reach = (BAND.0 * r).max(BAND.1);
    let margin = r + reach + 2.0;
    let inside = |x: f64, size: usize| x - margin >= 0.0 && x + margin < size as f64;
    if !(inside(u, size[0]) && inside(v, size[1])) {
        return None;
    }
    let tolerance = (TOLERANCE.0 * r).max(TOLERANCE.1);
    let mut on_circle = 0.0;
    for ray in directions.0 {
        let edge = edge_on_ray(
            pixels,
            size[0],
            [u, v],
            ray,
            r,
            [reach, 2.0 * reach],
            FINEST[0],
        );
        if (edge.distance - r).abs() < tolerance {
            on_circle += edge.weight;
        }
    }
    let share = on_circle / RAYS as f64;
    (share >= inliers).then_some(Circle {
        u,
        v,
        r,
        response: (0.25 * peak.response + 0.75 * share).min(1.0),
    })
}

/// Returns a circle that is known, looked at once more at a higher resolution; `None` if it cannot be seen there, or is another one.
pub(super) fn polished(
    directions: &Rays,
    pixels: &[u8],
    size: [usize; 2],
    circle: &Circle,
) -> Option<Circle> {
    let Circle {
        mut u,
        mut v,
        mut r,
        response,
    } = *circle;
    let reach = (POLISH.0 * r).max(POLISH.1);
    let mut edges = [Edge::default(); RAYS];
    for _ in 0..2 {
        let margin = r + reach + 2.0;
        let inside = |x: f64, size: usize| x - margin >= 0.0 && x + margin < size as f64;
        if !(inside(u, size[0]) && inside(v, size[1])) {
            return None;
        }
        for (edge, ray) in edges.iter_mut().zip(directions.0) {
            *edge = edge_on_ray(pixels, size[0], [u, v], ray, r, [reach, reach], FINEST[1]);
        }
        let step = fitted(&edges, r, SCALE.0 + SCALE.1 * r)?;
        if step.xy().norm().max(step.z.abs()) > reach {
            return None;
        }
        (u, v, r) = (u + step.x, v + step.y, r + step.z);
    }
    let tolerance = (TOLERANCE.0 * r).max(TOLERANCE.1);
    let on_circle: f64 = edges
        .iter()
        .filter(|edge| edge.residual(r, &Vector3::zeros()).abs() < tolerance)
        .map(|edge| edge.weight)
        .sum();
    (on_circle >= POLISH.2 * RAYS as f64).then_some(Circle { u, v, r, response })
}

impl Edge {
    /// Distance from the circle of radius `r` that a step has moved.
    fn residual(&self, r: f64, step: &Vector3<f64>) -> f64 {
        self.distance - r - (step.x * self.cos + step.y * self.sin + step.z)
    }
}

/// The strongest edge within `reach` of the circle; one a `width` away counts half.
///
/// - `finest`: least distance of samples, pixels
#[inline]
fn edge_on_ray(
    pixels: &[u8],
    stride: usize,
    [u, v]: [f64; 2],
    [cos, sin]: [f64; 2],
    r: f64,
    [reach, width]: [f64; 2],
    finest: f64,
) -> Edge {
    let step = (2.0 * (reach + 1.5) / (MOST_SAMPLES - 1) as f64).max(finest);
    let count = ((2.0 * (reach + 1.5) / step) as usize + 1).min(MOST_SAMPLES);
    let first = r - reach - 1.5;
    // Sums of the samples before each place.
    let mut sums = [0_i32; MOST_SAMPLES + 1];
    let mut place = [u + first * cos - 0.5, v + first * sin - 0.5].map(fixed);
    let move_on = [step * cos, step * sin].map(fixed);
    for i in 0..count {
        sums[i + 1] = sums[i] + bilinear(pixels, stride, place);
        place = [place[0] + move_on[0], place[1] + move_on[1]];
    }
    // Means of a pixel and a half, or a sample where those are farther apart, before and behind a place.
    let half = ((1.5 / step).round() as usize).max(1);
    let mean = 1.0 / (half as f32 * (SUB * SUB) as f32);
    let (from, each) = (((first - r) / width) as f32, (step / width) as f32);
    let mut differences = [0.0_f32; MOST_SAMPLES];
    let mut best = (0.0, 0);
    for i in half..count - half {
        let behind = sums[i + half + 1] - sums[i + 1];
        let before = sums[i] - sums[i - half];
        let difference = mean * (behind - before) as f32;
        differences[i] = difference;
        let away = from + i as f32 * each;
        let size = difference.abs() / (1.0 + away * away);
        if size > best.0 {
            best = (size, i);
        }
    }
    let (_, i) = best;
    if i <= half || i + half + 1 >= count {
        return Edge {
            cos,
            sin,
            distance: r,
            weight: 0.0,
        };
    }
    // The middle of what rises above half of the peak.
    let peak = differences[i];
    let (mut mass, mut moment) = (0.0, 0.0);
    for (k, difference) in differences[i - half..=i + half].iter().enumerate() {
        let above = f64::from((difference / peak - 0.5).max(0.0));
        mass += above;
        moment += above * (k as f64 - half as f64);
    }
    let (shift, here) = (moment / mass, f64::from(peak.abs()));
    Edge {
        cos,
        sin,
        distance: first + (i as f64 + shift) * step,
        weight: here * here / (here * here + HALF * HALF),
    }
}

/// The step from a circle of radius `r` around the rays' origin to the one through the edges.
fn fitted(edges: &[Edge], r: f64, scale: f64) -> Option<Vector3<f64>> {
    let mut step = Vector3::zeros();
    // Wide at first, so that a shifted centre makes no outliers.
    for widen in [4.0, 2.0, 1.0, 1.0] {
        let (mut normal, mut right) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
        for edge in edges {
            let row = Vector3::new(edge.cos, edge.sin, 1.0);
            let residual = edge.residual(r, &step) / (scale * widen);
            let weight = edge.weight / (1.0 + residual * residual);
            normal += row * row.transpose() * weight;
            right += row * (weight * (edge.distance - r));
        }
        step = normal.cholesky()?.solve(&right);
    }
    Some(step)
}

/// Parts of a pixel that are told apart.
const SUB: i32 = 256;
/// Bits of a fixed-point coordinate below the pixel.
const BITS: u32 = 16;

/// A coordinate in fixed point.
fn fixed(x: f64) -> i32 {
    (x * f64::from(1 << BITS)) as i32
}

/// The brightness between four pixels, times [`SUB`] squared.
///
/// - `place`: pixels from the middle of the picture's upper left one, in fixed point
#[inline(always)]
fn bilinear(pixels: &[u8], stride: usize, [u, v]: [i32; 2]) -> i32 {
    let (column, line) = ((u >> BITS) as usize, (v >> BITS) as usize);
    let part = |x: i32| (x >> (BITS - 8)) & (SUB - 1);
    let (right, down) = (part(u), part(v));
    let from = line * stride + column;
    let mix = |pair: &[u8]| {
        let (a, b) = (i32::from(pair[0]), i32::from(pair[1]));
        SUB * a + right * (b - a)
    };
    let (upper, lower) = (
        mix(&pixels[from..from + 2]),
        mix(&pixels[from + stride..from + stride + 2]),
    );
    SUB * upper + down * (lower - upper)
}
