//! Groups that are consecutive in label order.

use super::affinity;

/// Returns true if every group is consecutive in label order.
///
/// - `group_of`: `[materials]`, index of each material's group
pub fn consecutive(group_of: &[usize]) -> bool {
    (1..group_of.len())
        .all(|i| group_of[i] == group_of[i - 1] || !group_of[..i].contains(&group_of[i]))
}

/// Returns the consecutive groups with the smallest normalised cut (Shi & Malik, 2000), as `[materials]`, and that
/// cut, 0 to the number of groups.
///
/// The affinity is that of [`spectral_groups`](super::spectral_groups). The cut sums, over all groups, the affinity
/// that leaves the group divided by all affinity of its materials, or 0 if they have none. Dynamic programming over
/// the last group's first material makes it exact. With fewer materials than groups, every material is a group.
///
/// - `confusion`: `[materials][materials]`, counts or row shares, rows are the true materials; rows are normalised to
///   sum one
/// - `groups`: at least 1
///
/// # Panics
/// If `confusion` is not square, an entry is negative or not finite, or `groups` is 0.
pub fn best_consecutive_cut(confusion: &[Vec<f64>], groups: usize) -> (Vec<usize>, f64) {
    assert!(groups > 0, "materials lie in at least one group");
    let affinity = affinity(confusion);
    let materials = affinity.len();
    let groups = groups.min(materials);
    if groups == 0 {
        return (Vec::new(), 0.0);
    }
    // best[end]: smallest cut of the materials before `end` into as many groups as completed rounds.
    let mut best = vec![f64::INFINITY; materials + 1];
    best[0] = 0.0;
    let costs: Vec<Vec<f64>> = (0..materials)
        .map(|start| costs(&affinity, start))
        .collect();
    let mut starts_of: Vec<Vec<usize>> = Vec::with_capacity(groups);
    for _ in 0..groups {
        let mut next = vec![f64::INFINITY; materials + 1];
        let mut starts = vec![0; materials + 1];
        for end in 1..=materials {
            for start in 0..end {
                let cut = best[start] + costs[start][end - start - 1];
                if cut < next[end] {
                    (next[end], starts[end]) = (cut, start);
                }
            }
        }
        best = next;
        starts_of.push(starts);
    }
    let mut group_of = vec![0; materials];
    let mut end = materials;
    for (group, starts) in starts_of.iter().enumerate().rev() {
        group_of[starts[end]..end].fill(group);
        end = starts[end];
    }
    (group_of, best[materials])
}

/// Returns the normalised cuts of the groups `start..start + 1`, `start..start + 2`, …
fn costs(affinity: &[Vec<f64>], start: usize) -> Vec<f64> {
    let (mut leaving, mut all) = (0.0, 0.0);
    (start..affinity.len())
        .map(|new| {
            let degree: f64 = affinity[new].iter().sum();
            let inside: f64 = affinity[new][start..new].iter().sum();
            all += degree;
            leaving += degree - 2.0 * inside;
            if all > 0.0 {
                (leaving / all).max(0.0)
            } else {
                0.0
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::group_accuracy;
    use super::super::tests::{published, shares};
    use super::*;
    use rand::RngExt;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn a_group_that_comes_again_is_not_consecutive() {
        assert!(consecutive(&[0, 0, 1, 2, 2]));
        assert!(consecutive(&[2, 0, 0, 1]));
        assert!(consecutive(&[]));
        assert!(!consecutive(&[0, 1, 0]));
        assert!(!consecutive(&[0, 0, 1, 2, 1]));
    }

    /// Computes the cut from its definition.
    fn normalised_cut(affinity: &[Vec<f64>], group_of: &[usize]) -> f64 {
        let groups = group_of.iter().max().map_or(0, |g| g + 1);
        (0..groups)
            .map(|group| {
                let (mut leaving, mut all) = (0.0, 0.0);
                for (i, row) in affinity.iter().enumerate() {
                    for (j, weight) in row.iter().enumerate() {
                        if group_of[i] == group {
                            all += weight;
                            leaving += if group_of[j] == group { 0.0 } else { *weight };
                        }
                    }
                }
                if all > 0.0 { leaving / all } else { 0.0 }
            })
            .sum()
    }

    #[test]
    fn no_other_cut_is_smaller() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..10 {
            let mut confusion: Vec<Vec<f64>> = (0..9)
                .map(|_| (0..9).map(|_| rng.random::<f64>().powi(4)).collect())
                .collect();
            confusion[4] = vec![0.0; 9];
            let affinity = affinity(&confusion);
            let (found, cut) = best_consecutive_cut(&confusion, 3);
            assert!((normalised_cut(&affinity, &found) - cut).abs() < 1e-12);
            let mut smallest = f64::INFINITY;
            for first in 1..8 {
                for second in first + 1..9 {
                    let groups: Vec<usize> = (0..9)
                        .map(|i| usize::from(i >= first) + usize::from(i >= second))
                        .collect();
                    smallest = smallest.min(normalised_cut(&affinity, &groups));
                }
            }
            assert!((smallest - cut).abs() < 1e-12, "{smallest} {cut}");
        }
    }

    #[test]
    fn more_groups_than_materials_are_single_materials() {
        let confusion = [vec![0.9, 0.1], vec![0.2, 0.8]];
        assert_eq!(best_consecutive_cut(&confusion, 5), (vec![0, 1], 2.0));
        assert_eq!(best_consecutive_cut(&confusion, 1), (vec![0, 0], 0.0));
        assert_eq!(best_consecutive_cut(&[], 3), (vec![], 0.0));
    }

    /// Smallest of all 324 632 cuts, enumerated with numpy: 2.2054986690105536 at 4, 9, 14, 19, 34, accuracy
    /// 0.9577399637777434. Tolerance: sums of 36 terms in another order.
    #[test]
    fn the_published_matrix_has_one_best_cut() {
        let confusion = published();
        let (group_of, cut) = best_consecutive_cut(&confusion, 6);
        let firsts: Vec<usize> = (1..36)
            .filter(|&i| group_of[i] != group_of[i - 1])
            .collect();
        assert_eq!(firsts, [4, 9, 14, 19, 34]);
        assert!((cut - 2.2054986690105536).abs() < 1e-10, "{cut}");
        let accuracy = group_accuracy(&shares(&confusion), &group_of);
        assert!((accuracy - 0.9577399637777434).abs() < 1e-10, "{accuracy}");
    }
}
