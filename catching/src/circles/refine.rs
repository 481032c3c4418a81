//! Sub-pixel refinement of circles: edges on rays from the centre, and a robust fit of a circle.

use nalgebra::{Matrix3, Vector3};
use tactnet_catching_packets::packets::Circle;

/// Number of rays from the centre.
const RAYS: usize = 48;
/// Maximum number of samples per ray.
const MOST_SAMPLES: usize = 64;
/// Length as a fraction of a circle's radius, with a minimum.
#[derive(Debug, Clone, Copy)]
struct Length {
    /// Fraction of the radius.
    share: f64,
    /// Minimum, in pixels.
    least: f64,
}

impl Length {
    const fn new(share: f64, least: f64) -> Self {
        Self { share, least }
    }

    /// Returns the length for a radius, in pixels.
    fn at(self, r: f64) -> f64 {
        (self.share * r).max(self.least)
    }
}

/// Search range around the circle in each pass.
const REACH: [Length; 3] = [
    Length::new(0.35, 3.5),
    Length::new(0.2, 2.5),
    Length::new(0.12, 2.0),
];
/// Scale of the Cauchy weights: a constant in pixels plus a fraction of the radius.
const SCALE: [f64; 2] = [0.5, 0.01];
/// Band around a circle in which its edges must be the strongest.
const BAND: Length = Length::new(0.4, 4.0);
/// Maximum distance of an edge from the circle.
const TOLERANCE: Length = Length::new(0.05, 0.9);
/// Maximum distance of an edge from the circle after the first and the second pass, and the share of rays within it,
/// relative to the share required at the end.
const EARLY: [(Length, f64); 2] = [(Length::new(0.1, 1.2), 0.6), (Length::new(0.06, 1.0), 0.9)];
/// Search range around a known circle at twice the resolution.
const POLISH_REACH: Length = Length::new(0.1, 2.5);
/// Minimum share of rays on a known circle at twice the resolution.
const POLISH_SHARE: f64 = 0.4;
/// Minimum distance between samples on a ray in the first and in later passes, in pixels.
const FINEST: [f64; 2] = [0.75, 0.5];
/// Brightness difference at which an edge has weight 0.5, in grey levels.
const HALF: f64 = 8.0;

#[derive(Debug, Clone, Copy, Default)]
struct Edge {
    cos: f64,
    sin: f64,
    /// Distance from the centre, in pixels.
    distance: f64,
    weight: f64,
}

/// Unit vectors of the rays: cosine and sine.
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

/// Returns the circle at a peak, or `None` if the surrounding edges do not form one or it exceeds the picture.
///
/// - `inliers`: minimum share of rays whose strongest edge lies on the circle
pub(super) fn refined(
    directions: &Rays,
    pixels: &[u8],
    size: [usize; 2],
    peak: &Circle,
    inliers: f64,
) -> Option<Circle> {
    let (mut u, mut v, mut r) = (peak.u, peak.v, peak.r);
    let mut edges = [Edge::default(); RAYS];
    for (pass, reach) in REACH.into_iter().enumerate() {
        let reach = reach.at(r);
        let margin = r + reach + 2.0;
        if !(contains(size, [u, v], margin) && r > 2.0) {
            return None;
        }
        // Most peaks are false; every third ray suffices to reject them.
        let stride = if pass == 0 { 3 } else { 1 };
        let rays = &mut edges[..RAYS / stride];
        for (i, edge) in rays.iter_mut().enumerate() {
            let ray = directions.0[i * stride];
            let finest = FINEST[pass.min(1)];
            *edge = edge_on_ray(pixels, size[0], [u, v], ray, r, [reach, reach], finest);
        }
        let scale = SCALE[0] + SCALE[1] * r;
        let step = fitted(rays, r, scale)?;
        if step.xy().norm().max(step.z.abs()) > 1.5 * reach {
            return None;
        }
        if let Some((tolerance, share)) = EARLY.get(pass) {
            let tolerance = tolerance.at(r);
            let near = rays
                .iter()
                .filter(|edge| edge.residual(r, &step).abs() < tolerance);
            let on_circle: f64 = near.map(|edge| edge.weight).sum();
            if on_circle < share * inliers * rays.len() as f64 {
                return None;
            }
        }
        (u, v, r) = (u + step.x, v + step.y, r + step.z);
    }
    let share = share_in_band(directions, pixels, size, [u, v], r)?;
    (share >= inliers).then_some(Circle {
        u,
        v,
        r,
        response: (0.25 * peak.response + 0.75 * share).min(1.0),
    })
}

/// Returns true if a point is at least a margin away from the edges of a picture.
fn contains(size: [usize; 2], place: [f64; 2], margin: f64) -> bool {
    let mut axes = place.into_iter().zip(size);
    axes.all(|(x, size)| x - margin >= 0.0 && x + margin < size as f64)
}

/// Returns the share of rays whose strongest edge in a wider band lies on the circle, or `None` beyond the picture.
/// Edges of texture lie anywhere in the band, edges of a circle lie on the circle.
fn share_in_band(
    directions: &Rays,
    pixels: &[u8],
    size: [usize; 2],
    [u, v]: [f64; 2],
    r: f64,
) -> Option<f64> {
    let reach = BAND.at(r);
    let margin = r + reach + 2.0;
    if !contains(size, [u, v], margin) {
        return None;
    }
    let tolerance = TOLERANCE.at(r);
    let mut on_circle = 0.0;
    for ray in directions.0 {
        let band = [reach, 2.0 * reach];
        let edge = edge_on_ray(pixels, size[0], [u, v], ray, r, band, FINEST[0]);
        if (edge.distance - r).abs() < tolerance {
            on_circle += edge.weight;
        }
    }
    Some(on_circle / RAYS as f64)
}

/// Refines a known circle at a higher resolution. Returns `None` if it is not visible there or is a different one.
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
    let reach = POLISH_REACH.at(r);
    let mut edges = [Edge::default(); RAYS];
    for _ in 0..2 {
        let margin = r + reach + 2.0;
        if !contains(size, [u, v], margin) {
            return None;
        }
        for (edge, ray) in edges.iter_mut().zip(directions.0) {
            *edge = edge_on_ray(pixels, size[0], [u, v], ray, r, [reach, reach], FINEST[1]);
        }
        let step = fitted(&edges, r, SCALE[0] + SCALE[1] * r)?;
        if step.xy().norm().max(step.z.abs()) > reach {
            return None;
        }
        (u, v, r) = (u + step.x, v + step.y, r + step.z);
    }
    let tolerance = TOLERANCE.at(r);
    let is_near = |edge: &&Edge| edge.residual(r, &Vector3::zeros()).abs() < tolerance;
    let near = edges.iter().filter(is_near);
    let on_circle: f64 = near.map(|edge| edge.weight).sum();
    (on_circle >= POLISH_SHARE * RAYS as f64).then_some(Circle { u, v, r, response })
}

impl Edge {
    /// Returns the distance of the edge from the circle of radius `r` after `step`.
    fn residual(&self, r: f64, step: &Vector3<f64>) -> f64 {
        self.distance - r - (step.x * self.cos + step.y * self.sin + step.z)
    }
}

/// Returns the strongest edge within `reach` of the circle. An edge at distance `width` has half the weight.
///
/// - `finest`: minimum distance between samples, in pixels
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
    // Prefix sums of the samples.
    let mut sums = [0_i32; MOST_SAMPLES + 1];
    let mut place = [u + first * cos - 0.5, v + first * sin - 0.5].map(fixed);
    let move_on = [step * cos, step * sin].map(fixed);
    for i in 0..count {
        sums[i + 1] = sums[i] + bilinear(pixels, stride, place);
        place = [place[0] + move_on[0], place[1] + move_on[1]];
    }
    // Compare means over 1.5 pixels (at least one sample) before and behind each position.
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
    // Centroid of the part above half of the peak.
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

/// Returns the step from a circle of radius `r` around the rays' origin to the fitted circle.
fn fitted(edges: &[Edge], r: f64, scale: f64) -> Option<Vector3<f64>> {
    let mut step = Vector3::zeros();
    // Start with a wide scale, so that a shifted centre causes no outliers.
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

/// Number of sub-pixel positions per pixel.
const SUB: i32 = 256;
/// Fraction bits of fixed-point coordinates.
const BITS: u32 = 16;

/// Converts a coordinate to fixed point.
fn fixed(x: f64) -> i32 {
    (x * f64::from(1 << BITS)) as i32
}

/// Returns the bilinearly interpolated brightness times [`SUB`] squared.
///
/// - `place`: fixed-point position relative to the centre of the upper left pixel
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
    let [upper, lower] = [from, from + stride].map(|from| mix(&pixels[from..from + 2]));
    SUB * upper + down * (lower - upper)
}
