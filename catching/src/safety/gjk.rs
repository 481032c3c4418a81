//! Distance of convex hulls (Gilbert, Johnson and Keerthi 1988).

use nalgebra::Vector3;

use super::hull::Hull;

/// Maximum number of iterations. Convergence takes only a few; otherwise the result is a lower bound.
const MOST_STEPS: usize = 64;
/// Relative gap between distance and lower bound at which the iteration ends.
const GAP: f64 = 1e-13;

/// Simplex of the Minkowski difference of two hulls that contains the point closest to the origin, with the
/// corresponding points of the first hull.
#[derive(Debug, Clone, Copy)]
struct Simplex {
    points: [Vector3<f64>; 4],
    of_a: [Vector3<f64>; 4],
    count: usize,
}

/// Closest points of two hulls.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nearest {
    /// Distance as in [`distance`], in m.
    pub distance: f64,
    /// Unit normal from the second hull to the first; zero if the hulls without radii touch.
    pub normal: Vector3<f64>,
    /// Point of the first hull without radius that is closest to the second hull.
    pub point: Vector3<f64>,
}

/// Returns the distance of two hulls, in m. An inexact result is a lower bound, accurate to 1e-12 m for hulls of the
/// robot's size. If the hulls without radii touch, the result is the negative sum of the radii, not the penetration
/// depth.
pub fn distance(a: &Hull, b: &Hull) -> f64 {
    core_bounds(a, b)[0] - a.radius - b.radius
}

/// Returns the distance of two hulls and their closest points.
pub(crate) fn nearest(a: &Hull, b: &Hull) -> Nearest {
    let ([below, above], simplex, v) = search(a, b);
    let count = simplex.count;
    if above == 0.0 {
        return Nearest {
            distance: -a.radius - b.radius,
            normal: Vector3::zeros(),
            point: simplex.of_a[0],
        };
    }
    let shares = shares(&simplex.points[..count], &v);
    Nearest {
        distance: below - a.radius - b.radius,
        normal: v / above,
        point: (0..count).map(|i| simplex.of_a[i] * shares[i]).sum(),
    }
}

/// Returns the barycentric coordinates of a point in the interior of a simplex.
fn shares(corners: &[Vector3<f64>], v: &Vector3<f64>) -> [f64; 4] {
    match *corners {
        [a, b] => {
            let edge = b - a;
            let of_b = (v - a).dot(&edge) / edge.norm_squared();
            [1.0 - of_b, of_b, 0.0, 0.0]
        }
        [a, b, c] => {
            let (ab, ac, av) = (b - a, c - a, v - a);
            let normal = ab.cross(&ac);
            let squared = normal.norm_squared();
            let of_b = av.cross(&ac).dot(&normal) / squared;
            let of_c = ab.cross(&av).dot(&normal) / squared;
            [1.0 - of_b - of_c, of_b, of_c, 0.0]
        }
        _ => [1.0, 0.0, 0.0, 0.0],
    }
}

/// Returns lower and upper bound of the distance without radii; 0 if they touch.
pub(super) fn core_bounds(a: &Hull, b: &Hull) -> [f64; 2] {
    search(a, b).0
}

/// Returns these bounds, the simplex that contains the point of the difference closest to the origin, and that point.
fn search(a: &Hull, b: &Hull) -> ([f64; 2], Simplex, Vector3<f64>) {
    let mut v = a.points()[0] - b.points()[0];
    let mut simplex = Simplex {
        points: [v; 4],
        of_a: [a.points()[0]; 4],
        count: 1,
    };
    let mut bound = 0.0_f64;
    for _ in 0..MOST_STEPS {
        let squared = v.norm_squared();
        if squared < 1e-24 {
            return ([0.0; 2], simplex, v);
        }
        let of_a = a.support(&-v);
        let w = of_a - b.support(&v);
        // The plane through w perpendicular to v separates the origin from the difference.
        bound = bound.max(v.dot(&w) / squared.sqrt());
        let is_known = simplex.points[..simplex.count].contains(&w);
        if is_known || squared - v.dot(&w) <= GAP * squared {
            return ([bound.max(0.0), squared.sqrt()], simplex, v);
        }
        let before = simplex;
        simplex.points[simplex.count] = w;
        simplex.of_a[simplex.count] = of_a;
        simplex.count += 1;
        match simplex.nearest() {
            None => return ([0.0; 2], simplex, v),
            Some(nearest) if nearest.norm_squared() >= squared => {
                return ([bound.max(0.0), squared.sqrt()], before, v);
            }
            Some(nearest) => v = nearest,
        }
    }
    ([bound.max(0.0), v.norm()], simplex, v)
}

impl Simplex {
    /// Reduces the simplex to the face closest to the origin and returns its closest point, or `None` if the origin is
    /// inside.
    fn nearest(&mut self) -> Option<Vector3<f64>> {
        let mut best = (f64::INFINITY, Vector3::zeros(), 0_usize);
        for subset in 1_usize..(1 << self.count) {
            // The latest point always belongs to the closest face.
            if subset >> (self.count - 1) == 0 {
                continue;
            }
            let mut corners = [Vector3::zeros(); 4];
            let mut count = 0;
            for (i, point) in self.points[..self.count].iter().enumerate() {
                if subset >> i & 1 == 1 {
                    corners[count] = *point;
                    count += 1;
                }
            }
            if count == 4 {
                if holds_origin(&corners) {
                    return None;
                }
                continue;
            }
            if let Some(point) = inner_nearest(&corners[..count]) {
                let squared = point.norm_squared();
                if squared < best.0 {
                    best = (squared, point, subset);
                }
            }
        }
        let mut kept = 0;
        for i in 0..self.count {
            if best.2 >> i & 1 == 1 {
                self.points[kept] = self.points[i];
                self.of_a[kept] = self.of_a[i];
                kept += 1;
            }
        }
        self.count = kept;
        Some(best.1)
    }
}

/// Returns the closest point to the origin of a corner, an edge or a triangle if it lies in the interior.
fn inner_nearest(corners: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    match *corners {
        [a] => Some(a),
        [a, b] => {
            let edge = b - a;
            let share = -a.dot(&edge) / edge.norm_squared();
            (share > 0.0 && share < 1.0).then(|| a + edge * share)
        }
        [a, b, c] => {
            let (ab, ac) = (b - a, c - a);
            let normal = ab.cross(&ac);
            let squared = normal.norm_squared();
            // A degenerate triangle is covered by its edges.
            if squared <= 1e-28 * ab.norm_squared() * ac.norm_squared() {
                return None;
            }
            // Foot of the perpendicular in barycentric coordinates.
            let of_b = -a.cross(&ac).dot(&normal) / squared;
            let of_c = -ab.cross(&a).dot(&normal) / squared;
            let inside = of_b > 0.0 && of_c > 0.0 && of_b + of_c < 1.0;
            inside.then(|| normal * (a.dot(&normal) / squared))
        }
        _ => None,
    }
}

/// Returns true if the origin is on the inner side of all four faces.
fn holds_origin(corners: &[Vector3<f64>; 4]) -> bool {
    (0..4).all(|i| {
        let [a, b, c] = [1, 2, 3].map(|k| corners[(i + k) % 4]);
        let normal = (b - a).cross(&(c - a));
        let inner = normal.dot(&(corners[i] - a));
        inner != 0.0 && inner * normal.dot(&-a) >= 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vectors(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Vector3<f64>>> {
        let point = proptest::array::uniform3(-1.0..1.0f64).prop_map(Vector3::from);
        proptest::collection::vec(point, count)
    }

    proptest! {
        /// The result is symmetric and agrees with a simple reference method.
        #[test]
        fn distances_are_exact(a in vectors(1..30), b in vectors(1..30), away in 0.0..3.0f64) {
            let b: Vec<Vector3<f64>> = b.iter().map(|p| p + Vector3::new(away, 0.2 * away, 0.0)).collect();
            let (a, b) = (Hull::new(&a, 0.0), Hull::new(&b, 0.0));
            let found = distance(&a, &b);
            prop_assert!((found - distance(&b, &a)).abs() < 1e-11);
            // Reference: Frank and Wolfe's method, which is slow but simple.
            let mut v = a.points()[0] - b.points()[0];
            for _ in 0..4000 {
                let w = a.support(&-v) - b.support(&v);
                let step = v - w;
                let share = (v.dot(&step) / step.norm_squared()).clamp(0.0, 1.0);
                if !share.is_finite() { break; }
                v -= step * share;
            }
            prop_assert!(found <= v.norm() + 1e-12, "{found} {}", v.norm());
            prop_assert!(found >= v.norm() - 2e-2, "{found} {}", v.norm());
            let grown = Hull::new(a.points(), 0.1);
            prop_assert!((distance(&grown, &b) - (found - 0.1)).abs() < 1e-12);
        }

        /// Axis-aligned boxes, whose distance is known exactly.
        #[test]
        fn boxes_are_as_far_as_their_faces(gap in proptest::array::uniform3(-0.09..1.0f64), half in proptest::array::uniform3(0.05..0.5f64)) {
            let corners = |centre: Vector3<f64>| -> Vec<Vector3<f64>> {
                (0..8).map(|i| {
                    let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
                    centre + Vector3::new(sign(0) * half[0], sign(1) * half[1], sign(2) * half[2])
                }).collect()
            };
            let centre = Vector3::from_fn(|i, _| 2.0 * half[i] + gap[i]);
            let exact = gap.iter().map(|gap| gap.max(0.0).powi(2)).sum::<f64>().sqrt();
            let found = distance(&Hull::new(&corners(Vector3::zeros()), 0.0), &Hull::new(&corners(centre), 0.0));
            prop_assert!((found - exact).abs() < 1e-12, "{found} {exact}");
        }
    }
}
