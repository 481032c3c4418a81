//! k-means for a few dozen points.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Number of random starts; the one with the smallest sum of squared distances wins.
const STARTS: usize = 50;
/// Maximum number of Lloyd iterations; a few dozen points converge within ten.
const ROUNDS: usize = 100;

/// Returns the index of the nearest centre for each point, after Lloyd's iteration from k-means++ starts (Arthur &
/// Vassilvitskii, 2007).
///
/// If points coincide, there may be fewer than `count` clusters.
///
/// - `points`: `[points][dimensions]`
/// - `count`: at least 1
pub(super) fn k_means(points: &[Vec<f64>], count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut best = (f64::INFINITY, vec![0; points.len()]);
    if points.is_empty() {
        return best.1;
    }
    for _ in 0..STARTS {
        let mut centres = spread_centres(points, count, rng);
        let mut nearest: Vec<usize> = Vec::new();
        for _ in 0..ROUNDS {
            let now: Vec<usize> = points.iter().map(|p| closest(p, &centres).0).collect();
            if now == nearest {
                break;
            }
            nearest = now;
            for (cluster, centre) in centres.iter_mut().enumerate() {
                let members = points.iter().zip(&nearest);
                let members: Vec<&Vec<f64>> = members
                    .filter(|(_, n)| **n == cluster)
                    .map(|(p, _)| p)
                    .collect();
                // A centre without points stays in place.
                if !members.is_empty() {
                    for (axis, value) in centre.iter_mut().enumerate() {
                        *value =
                            members.iter().map(|p| p[axis]).sum::<f64>() / members.len() as f64;
                    }
                }
            }
        }
        let spread = points.iter().map(|p| closest(p, &centres).1).sum();
        // The margin keeps rounding from choosing between equal starts.
        if spread < best.0 - 1e-12 {
            best = (spread, nearest);
        }
    }
    best.1
}

/// Draws k-means++ centres: each is a point drawn in proportion to the squared distance to the nearest centre so far.
fn spread_centres(points: &[Vec<f64>], count: usize, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let mut centres = vec![points[rng.random_range(0..points.len())].clone()];
    while centres.len() < count {
        let weights: Vec<f64> = points.iter().map(|p| closest(p, &centres).1).collect();
        let mut left = rng.random::<f64>() * weights.iter().sum::<f64>();
        let drawn = weights.iter().position(|weight| {
            left -= weight;
            left < 0.0
        });
        centres.push(points[drawn.unwrap_or(0)].clone());
    }
    centres
}

/// Returns the index of the nearest centre and the squared distance to it.
fn closest(point: &[f64], centres: &[Vec<f64>]) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for (number, centre) in centres.iter().enumerate() {
        let distance = point
            .iter()
            .zip(centre)
            .map(|(a, b)| (a - b) * (a - b))
            .sum();
        if distance < best.1 {
            best = (number, distance);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn far_heaps_are_told_apart() {
        let points: Vec<Vec<f64>> = (0..30)
            .map(|i| vec![f64::from(i % 3) * 10.0, f64::from(i) * 0.01])
            .collect();
        let found = k_means(&points, 3, &mut ChaCha8Rng::seed_from_u64(1));
        for i in 0..30 {
            for j in 0..30 {
                assert_eq!(found[i] == found[j], i % 3 == j % 3, "{i} {j}");
            }
        }
    }

    #[test]
    fn coinciding_points_share_a_cluster() {
        let points = vec![vec![1.0]; 5];
        let found = k_means(&points, 3, &mut ChaCha8Rng::seed_from_u64(1));
        assert!(found.iter().all(|n| *n == found[0]));
    }
}
