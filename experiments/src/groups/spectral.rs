//! Spectral clustering.

use faer::{Mat, Side};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::affinity;
use super::k_means::k_means;

/// Returns the groups of spectral clustering (Ng, Jordan & Weiss, 2002) as `[materials]`, numbered in the order of
/// their first material.
///
/// The affinity is `A = 1/2 ((C - 1) + (C - 1)^T)` of thesis section 4.4.2. The 1 is interpreted as the identity, and
/// the diagonal is set to zero, because a material's affinity to itself carries no information about groups. k-means
/// clusters the rows of the first eigenvectors of the symmetric normalised Laplacian `I - D^-1/2 A D^-1/2`, scaled to
/// length one; there are as many eigenvectors as groups.
///
/// Materials without any confusion have no row to scale; they form one group. There may be fewer groups than
/// requested. If the matrix falls into more unconnected parts than `groups`, several solutions are equally good, and
/// one of them is returned.
///
/// - `confusion`: `[materials][materials]`, counts or row shares, rows are the true materials; rows are normalised to
///   sum one
/// - `groups`: at least 1
///
/// # Panics
/// If `confusion` is not square, an entry is negative or not finite, or `groups` is 0.
pub fn spectral_groups(confusion: &[Vec<f64>], groups: usize, seed: u64) -> Vec<usize> {
    assert!(groups > 0, "materials lie in at least one group");
    let affinity = affinity(confusion);
    let degrees: Vec<f64> = affinity.iter().map(|row| row.iter().sum()).collect();
    let linked: Vec<usize> = (0..degrees.len()).filter(|&i| degrees[i] > 0.0).collect();
    let left = if linked.len() < degrees.len() {
        (groups - 1).max(1)
    } else {
        groups
    };
    let count = left.min(linked.len());
    // The last index belongs to the isolated materials.
    let mut group_of = vec![if groups > 1 { count } else { 0 }; degrees.len()];
    if count > 0 {
        let points = embedding(&affinity, &degrees, &linked, count);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for (&material, cluster) in linked.iter().zip(k_means(&points, count, &mut rng)) {
            group_of[material] = cluster;
        }
    }
    by_first_material(&group_of)
}

/// Returns the first `count` eigenvectors of the linked materials' normalised Laplacian, `[linked][count]`, with rows
/// of length one.
fn embedding(
    affinity: &[Vec<f64>],
    degrees: &[f64],
    linked: &[usize],
    count: usize,
) -> Vec<Vec<f64>> {
    // The smallest eigenvalues of I - M are the largest of M.
    let scaled = Mat::<f64>::from_fn(linked.len(), linked.len(), |i, j| {
        let (i, j) = (linked[i], linked[j]);
        affinity[i][j] / (degrees[i] * degrees[j]).sqrt()
    });
    let eigen = scaled
        .self_adjoint_eigen(Side::Lower)
        .unwrap_or_else(|error| panic!("no eigenvalues of a finite symmetric matrix: {error:?}"));
    // Sorted by increasing eigenvalue.
    let vectors = eigen.U();
    (0..linked.len())
        .map(|i| {
            let row: Vec<f64> = (0..count)
                .map(|k| vectors[(i, linked.len() - 1 - k)])
                .collect();
            let length = row.iter().map(|v| v * v).sum::<f64>().sqrt();
            // A material of a small component may be zero in the first eigenvectors; its row is rounding noise.
            if length > 1e-9 {
                row.iter().map(|v| v / length).collect()
            } else {
                vec![0.0; count]
            }
        })
        .collect()
}

/// Renumbers groups in the order of their first material.
fn by_first_material(group_of: &[usize]) -> Vec<usize> {
    let mut order: Vec<usize> = Vec::new();
    for group in group_of {
        if !order.contains(group) {
            order.push(*group);
        }
    }
    let number = |group| order.iter().position(|other| other == group);
    group_of.iter().filter_map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{published, shares};
    use super::super::{consecutive, group_accuracy};
    use super::*;

    /// Returns 12 materials in three interleaved blocks, with asymmetric confusions.
    fn interleaved() -> Vec<Vec<f64>> {
        let block = [0, 1, 0, 2, 1, 0, 2, 1, 0, 1, 2, 0];
        (0..12)
            .map(|i: usize| {
                let mut row: Vec<f64> = (0..12)
                    .map(|j: usize| {
                        let level = if block[i] == block[j] { 0.08 } else { 0.004 };
                        level * (1.0 + ((7 * i + 13 * j) % 5) as f64 / 5.0)
                    })
                    .collect();
                row[i] = 0.0;
                row[i] = 1.0 - row.iter().sum::<f64>();
                row
            })
            .collect()
    }

    /// ```python
    /// import numpy as np
    /// from sklearn.cluster import SpectralClustering  # scikit-learn 1.9.1
    /// block = [0, 1, 0, 2, 1, 0, 2, 1, 0, 1, 2, 0]
    /// C = np.array([[(0.08 if block[i] == block[j] else 0.004) * (1 + (7 * i + 13 * j) % 5 / 5) if i != j else 0
    ///                for j in range(12)] for i in range(12)])
    /// A = (C + C.T) / 2  # the rows of C with their diagonal sum to one
    /// print(SpectralClustering(3, affinity="precomputed", assign_labels="kmeans", random_state=0).fit(A).labels_)
    /// # [1 2 1 0 2 1 0 2 1 2 0 1]
    /// ```
    #[test]
    fn interleaved_blocks_are_found_as_by_scikit_learn() {
        let golden = by_first_material(&[1, 2, 1, 0, 2, 1, 0, 2, 1, 2, 0, 1]);
        for seed in 0..20 {
            assert_eq!(spectral_groups(&interleaved(), 3, seed), golden);
        }
        let counts: Vec<Vec<f64>> = interleaved()
            .iter()
            .enumerate()
            .map(|(i, row)| row.iter().map(|v| v * (50 + 10 * i) as f64).collect())
            .collect();
        assert_eq!(spectral_groups(&counts, 3, 1), golden);
    }

    #[test]
    fn isolated_materials_share_a_group() {
        let mut confusion = interleaved();
        for isolated in [2, 7] {
            confusion[isolated].fill(0.0);
            confusion.iter_mut().for_each(|row| row[isolated] = 0.0);
        }
        // One material is always recognised, the other has no sweeps.
        confusion[2][2] = 1.0;
        let golden = [0, 1, 2, 3, 1, 0, 3, 2, 0, 1, 3, 0];
        assert_eq!(spectral_groups(&confusion, 4, 1), golden);
    }

    #[test]
    fn a_perfect_matrix_is_one_group() {
        let perfect: Vec<Vec<f64>> = (0..5)
            .map(|i| (0..5).map(|j| f64::from(u8::from(i == j))).collect())
            .collect();
        assert_eq!(spectral_groups(&perfect, 3, 1), [0; 5]);
        assert_eq!(spectral_groups(&interleaved(), 1, 1), [0; 12]);
        assert_eq!(spectral_groups(&interleaved(), 50, 1).len(), 12);
    }

    #[test]
    fn groups_follow_their_materials_into_another_order() {
        let confusion = interleaved();
        let moved: Vec<usize> = (0..12).map(|i| (5 * i + 3) % 12).collect();
        let shuffled: Vec<Vec<f64>> = moved
            .iter()
            .map(|&i| moved.iter().map(|&j| confusion[i][j]).collect())
            .collect();
        let groups = spectral_groups(&confusion, 3, 1);
        let expected: Vec<usize> = moved.iter().map(|&i| groups[i]).collect();
        assert_eq!(
            spectral_groups(&shuffled, 3, 1),
            by_first_material(&expected)
        );
    }

    /// The published groups are consecutive with an accuracy of 0.947; the published matrix gives other groups.
    #[test]
    fn the_published_matrix_gives_interleaved_groups() {
        let confusion = published();
        let groups = spectral_groups(&confusion, 6, 1);
        assert!(!consecutive(&groups), "{groups:?}");
        let accuracy = group_accuracy(&shares(&confusion), &groups);
        assert!((0.96..1.0).contains(&accuracy), "{accuracy} {groups:?}");
    }
}
