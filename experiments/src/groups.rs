//! Groups of materials by spectral clustering of a confusion matrix.
//!
//! [`spectral_groups`] finds the groups, and [`grouping_of_counts`] adds accuracy and stability.

mod k_means;
mod rand_index;
mod spectral;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use rand_index::adjusted_rand_index;
use spectral::spectral_groups;

/// Number of resampled confusion matrices for [`Grouping::stability`].
const RESAMPLES: u32 = 50;

/// Groups of materials that are confused with each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Grouping {
    /// `[materials]`, index of each material's group; groups are numbered in the order of their first material.
    pub group_of: Vec<usize>,
    /// Share of the sweeps whose predicted material is in the group of the true one, 0 to 1.
    pub accuracy: f64,
    /// The same share for three fused sweeps; absent if no material has three, and in results of earlier builds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy_of_three: Option<f64>,
    /// Mean adjusted Rand index between this grouping and those of resampled confusion matrices, -1 to 1; absent for a
    /// matrix without counts.
    pub stability: Option<f64>,
    /// True if every group is consecutive in label order.
    pub consecutive: bool,
}

/// Returns the groups of a confusion matrix of counts, with accuracy and stability.
///
/// The stability is the mean over 50 matrices in which the sweeps of each true material are resampled with
/// replacement. A high value means that other sweeps would give the same groups.
///
/// - `counts`: `[materials][materials]`, rows are the true materials
/// - `groups`: at least 1
/// - `repeats`: number of times that each sweep was counted (repeats of a cross-validation), at least 1; the number of
///   draws is divided by it
///
/// # Panics
/// If `counts` is not square or `groups` or `repeats` is 0.
pub fn grouping_of_counts(
    counts: &[Vec<usize>],
    groups: usize,
    repeats: usize,
    seed: u64,
) -> Grouping {
    let confusion = confusion_of(counts);
    let group_of = spectral_groups(&confusion, groups, seed);
    let counted = counts.iter().flatten().any(|&count| count > 0);
    let stability = counted.then(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Stream 0 belongs to the clustering.
        rng.set_stream(1);
        let indices = (0..RESAMPLES).map(|_| {
            let resampled: Vec<Vec<usize>> = counts
                .iter()
                .map(|row| resample(row, repeats, &mut rng))
                .collect();
            let again = spectral_groups(&confusion_of(&resampled), groups, seed);
            adjusted_rand_index(&group_of, &again)
        });
        indices.sum::<f64>() / f64::from(RESAMPLES)
    });
    Grouping {
        accuracy: group_accuracy(&confusion, &group_of),
        accuracy_of_three: None,
        stability,
        consecutive: consecutive(&group_of),
        group_of,
    }
}

impl Grouping {
    /// Adds the accuracy of three fused sweeps.
    ///
    /// - `counts`: `[materials][materials]`, rows are the true materials; zeros if nothing was fused
    ///
    /// # Panics
    /// If `counts` has another size.
    pub fn with_three_sweeps(mut self, counts: &[Vec<usize>]) -> Self {
        let counted = counts.iter().flatten().any(|&count| count > 0);
        self.accuracy_of_three =
            counted.then(|| group_accuracy(&confusion_of(counts), &self.group_of));
        self
    }
}

/// Returns true if every group is consecutive in label order.
///
/// - `group_of`: `[materials]`, index of each material's group
fn consecutive(group_of: &[usize]) -> bool {
    (1..group_of.len())
        .all(|i| group_of[i] == group_of[i - 1] || !group_of[..i].contains(&group_of[i]))
}

/// Returns the share of the sweeps whose predicted material is in the group of the true one, 0 to 1; 0 for a matrix of
/// zeros.
///
/// Entries are not normalised: pass rows that sum to one for the mean over materials.
///
/// - `confusion`: `[materials][materials]`, counts or row shares, rows are the true materials
/// - `group_of`: `[materials]`
///
/// # Panics
/// If `confusion` is not square or `group_of` has another length.
fn group_accuracy(confusion: &[Vec<f64>], group_of: &[usize]) -> f64 {
    assert_square(confusion);
    assert_eq!(confusion.len(), group_of.len(), "one group a material");
    let (mut inside, mut all) = (0.0, 0.0);
    for (row, group) in confusion.iter().zip(group_of) {
        for (share, other) in row.iter().zip(group_of) {
            all += share;
            inside += if group == other { *share } else { 0.0 };
        }
    }
    if all > 0.0 { inside / all } else { 0.0 }
}

/// Resamples a row with replacement, one draw for every `repeats` counts.
fn resample(row: &[usize], repeats: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let ends: Vec<usize> = row
        .iter()
        .scan(0, |sum, count| {
            *sum += count;
            Some(*sum)
        })
        .collect();
    let total = ends.last().copied().unwrap_or(0);
    let mut drawn = vec![0; row.len()];
    for _ in 0..total / repeats {
        let sweep = rng.random_range(0..total);
        drawn[ends.partition_point(|&end| end <= sweep)] += 1;
    }
    drawn
}

fn confusion_of(counts: &[Vec<usize>]) -> Vec<Vec<f64>> {
    let row = |row: &Vec<usize>| row.iter().map(|&count| count as f64).collect();
    counts.iter().map(row).collect()
}

/// Returns the symmetric affinity `A = 1/2 ((C - 1) + (C - 1)^T)` of thesis section 4.4.2, with zeros on the diagonal.
///
/// The 1 is interpreted as the identity, which removes the correct answers from `C`. The remaining diagonal `c_ii - 1`
/// is minus the sum of its row, so `C - 1` taken literally is a negated graph Laplacian with degrees near zero. A
/// material's affinity to itself carries no information about groups; it is set to zero, as in scipy's Laplacian.
///
/// Rows of `confusion` are first normalised to sum one; a row of zeros stays.
fn affinity(confusion: &[Vec<f64>]) -> Vec<Vec<f64>> {
    assert_square(confusion);
    let valid = |share: &f64| share.is_finite() && *share >= 0.0;
    assert!(
        confusion.iter().flatten().all(valid),
        "a confusion matrix holds counts or shares"
    );
    let sums: Vec<f64> = confusion.iter().map(|row| row.iter().sum()).collect();
    let share = |i: usize, j: usize| {
        if sums[i] > 0.0 {
            confusion[i][j] / sums[i]
        } else {
            0.0
        }
    };
    let entry = |i, j| {
        if i == j {
            0.0
        } else {
            0.5 * (share(i, j) + share(j, i))
        }
    };
    let row = |i| (0..sums.len()).map(|j| entry(i, j)).collect();
    (0..sums.len()).map(row).collect()
}

fn assert_square(confusion: &[Vec<f64>]) {
    let square = confusion.iter().all(|row| row.len() == confusion.len());
    assert!(square, "a confusion matrix is square");
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the published matrix of TactNet-II, measured from the figure's pixels.
    pub(super) fn published() -> Vec<Vec<f64>> {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../data/src/twin/tactmat_confusion_robot.csv"
        );
        let text = std::fs::read_to_string(path).unwrap();
        let row = |line: &str| line.split(',').map(|v| v.parse().unwrap()).collect();
        text.lines().map(row).collect()
    }

    /// Normalises rows to sum one.
    pub(super) fn shares(confusion: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let row = |row: &Vec<f64>| {
            let sum: f64 = row.iter().sum();
            row.iter().map(|v| v / sum).collect()
        };
        confusion.iter().map(row).collect()
    }

    /// Returns the counts of 100 sweeps for each material, `inside` of them confused with each other material of its
    /// block.
    fn blocks(blocks: &[usize], inside: usize, outside: usize) -> Vec<Vec<usize>> {
        let entry = |a, b| if a == b { inside } else { outside };
        (0..blocks.len())
            .map(|i| {
                let mut row: Vec<usize> = blocks.iter().map(|&b| entry(blocks[i], b)).collect();
                row[i] = 0;
                row[i] = 100 - row.iter().sum::<usize>();
                row
            })
            .collect()
    }

    #[test]
    fn planted_blocks_are_stable_and_accurate() {
        let planted = [0, 0, 0, 1, 1, 1, 2, 2, 2];
        let grouping = grouping_of_counts(&blocks(&planted, 15, 1), 3, 1, 4);
        assert_eq!(grouping.group_of, planted);
        assert!((grouping.accuracy - 0.94).abs() < 1e-12);
        assert!(grouping.consecutive);
        assert_eq!(grouping.stability, Some(1.0));
    }

    #[test]
    fn groups_of_noise_are_not_stable() {
        let grouping = grouping_of_counts(&blocks(&[0; 12], 4, 4), 4, 1, 4);
        let stability = grouping.stability.unwrap();
        assert!(stability < 0.5, "{stability}");
    }

    #[test]
    fn the_seed_decides_everything() {
        let counts: Vec<Vec<usize>> = published()
            .iter()
            .map(|row| row.iter().map(|v| (v * 200.0).round() as usize).collect())
            .collect();
        let grouping = grouping_of_counts(&counts, 6, 1, 11);
        assert_eq!(grouping, grouping_of_counts(&counts, 6, 1, 11));
        assert!(grouping.stability.unwrap().is_finite());
    }

    #[test]
    fn a_matrix_without_counts_has_no_stability() {
        let grouping = grouping_of_counts(&[vec![0, 0], vec![0, 0]], 2, 1, 1);
        assert_eq!(grouping.stability, None);
        assert_eq!(grouping.accuracy, 0.0);
        let nothing = grouping_of_counts(&[], 2, 1, 1);
        assert_eq!(nothing.group_of, Vec::<usize>::new());
    }

    /// Three fused sweeps use the groups of single sweeps.
    #[test]
    fn three_sweeps_are_counted_in_the_groups_of_one() {
        let counts = [vec![6, 4, 0], vec![4, 6, 0], vec![1, 0, 9]];
        let grouping = grouping_of_counts(&counts, 2, 1, 1);
        assert_eq!(grouping.group_of, [0, 0, 1]);
        assert!((grouping.accuracy - 29.0 / 30.0).abs() < 1e-12);
        let fused = [vec![18, 1, 1], vec![0, 20, 0], vec![0, 1, 19]];
        let with_three = grouping.clone().with_three_sweeps(&fused);
        assert!((with_three.accuracy_of_three.unwrap() - 58.0 / 60.0).abs() < 1e-12);
        assert_eq!(
            grouping
                .with_three_sweeps(&vec![vec![0; 3]; 3])
                .accuracy_of_three,
            None
        );
    }

    #[test]
    fn resampling_keeps_the_number_of_sweeps_and_where_none_fell() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let drawn = resample(&[0, 70, 0, 30, 0], 1, &mut rng);
        assert_eq!(drawn.iter().sum::<usize>(), 100);
        assert_eq!((drawn[0], drawn[2], drawn[4]), (0, 0, 0));
        assert!(drawn[1].abs_diff(70) < 20, "{drawn:?}");
    }

    #[test]
    fn a_group_that_comes_again_is_not_consecutive() {
        assert!(consecutive(&[0, 0, 1, 2, 2]));
        assert!(consecutive(&[2, 0, 0, 1]));
        assert!(consecutive(&[]));
        assert!(!consecutive(&[0, 1, 0]));
        assert!(!consecutive(&[0, 0, 1, 2, 1]));
    }

    #[test]
    fn accuracy_counts_the_groups_own_sweeps() {
        let confusion = [
            vec![6.0, 3.0, 1.0],
            vec![2.0, 8.0, 0.0],
            vec![5.0, 0.0, 5.0],
        ];
        assert!((group_accuracy(&confusion, &[0, 0, 1]) - 24.0 / 30.0).abs() < 1e-12);
        assert!((group_accuracy(&confusion, &[0, 1, 2]) - 19.0 / 30.0).abs() < 1e-12);
        assert_eq!(group_accuracy(&confusion, &[0, 0, 0]), 1.0);
    }
}
