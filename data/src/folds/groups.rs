//! Folds of whole groups of sweeps: recordings, sessions, days.

use std::collections::BTreeMap;

use crate::{Dataset, Seed, shuffle};

/// Groups of a data set: sweeps with one block number, of any material.
pub(super) struct Groups {
    /// Numbers of sweeps by group and label; sweeps of labels that occur in a single group are not counted.
    counts: Vec<Vec<usize>>,
    /// Group of each sweep that can be tested: `[sweeps]`.
    of_sweep: Vec<Option<usize>>,
}

impl Groups {
    /// Returns the groups of a data set whose sweeps all have blocks.
    pub(super) fn of(dataset: &Dataset) -> Self {
        let labels = dataset.labels().len();
        let mut numbers: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for record in dataset.records() {
            let block = record.block.unwrap_or_default();
            numbers.entry(block).or_insert_with(|| vec![0; labels])[record.label] += 1;
        }
        let in_groups = |label: usize| numbers.values().filter(|of| of[label] > 0).count();
        let is_tested: Vec<bool> = (0..labels).map(|label| in_groups(label) > 1).collect();
        let place: BTreeMap<u32, usize> = numbers.keys().copied().zip(0..).collect();
        let of_sweep = dataset.records().iter().map(|record| {
            let block = record.block.unwrap_or_default();
            is_tested[record.label].then(|| place[&block])
        });
        let mut counts: Vec<Vec<usize>> = numbers.into_values().collect();
        for of_group in &mut counts {
            for (count, tested) in of_group.iter_mut().zip(&is_tested) {
                *count *= usize::from(*tested);
            }
        }
        Self {
            of_sweep: of_sweep.collect(),
            counts,
        }
    }

    /// Returns the number of groups with sweeps that can be tested.
    pub(super) fn len(&self) -> usize {
        let has_sweeps = |counts: &&Vec<usize>| counts.iter().any(|count| *count > 0);
        self.counts.iter().filter(has_sweeps).count()
    }

    /// Returns true for the test sweeps of fold `fold` of `folds`: `[sweeps]`.
    ///
    /// - `repeat`: number of the random order in which equal groups are assigned
    pub(super) fn tested(&self, folds: usize, seed: Seed, repeat: usize, fold: usize) -> Vec<bool> {
        let mut order: Vec<usize> = (0..self.counts.len()).collect();
        shuffle(&mut order, &mut seed.rng(("groups", repeat)));
        let shuffled: Vec<Vec<usize>> = order.iter().map(|&at| self.counts[at].clone()).collect();
        let mut assigned = assign(&shuffled, folds);
        spread_labels(&shuffled, folds, &mut assigned);
        let mut fold_of = vec![0; order.len()];
        for (group, fold) in order.into_iter().zip(assigned) {
            fold_of[group] = fold;
        }
        let is_tested = |group: &Option<usize>| group.is_some_and(|group| fold_of[group] == fold);
        self.of_sweep.iter().map(is_tested).collect()
    }
}

/// Assigns groups to folds, so that the shares of each label in the folds are as equal as possible. The groups with the
/// most unequal numbers of sweeps come first; each gets the fold for which the mean over the labels of the standard deviation
/// of the folds' shares is smallest, or of several such folds the smallest one. That is the method of
/// `StratifiedGroupKFold` of scikit-learn.
///
/// - `counts`: `[groups][labels]`
fn assign(counts: &[Vec<usize>], folds: usize) -> Vec<usize> {
    let labels = counts.first().map_or(0, Vec::len);
    let totals: Vec<f64> = (0..labels)
        .map(|label| counts.iter().map(|of| of[label] as f64).sum())
        .collect();
    let spread: Vec<f64> = counts
        .iter()
        .map(|of| deviation(of.iter().map(|count| *count as f64)))
        .collect();
    let mut order: Vec<usize> = (0..counts.len()).collect();
    order.sort_by(|a, b| spread[*b].total_cmp(&spread[*a]));
    let mut of_fold = vec![vec![0.0; labels]; folds];
    let mut fold_of = vec![0; counts.len()];
    for group in order {
        let mut best = (f64::INFINITY, f64::INFINITY, 0);
        for fold in 0..folds {
            let sweeps: f64 = of_fold[fold].iter().sum();
            add(&mut of_fold[fold], &counts[group], 1.0);
            let score = inequality(&of_fold, &totals);
            add(&mut of_fold[fold], &counts[group], -1.0);
            let is_equal = (score - best.0).abs() <= 1e-8 + 1e-5 * best.0.abs();
            if score < best.0 || (is_equal && sweeps < best.1) {
                best = (score, sweeps, fold);
            }
        }
        add(&mut of_fold[best.2], &counts[group], 1.0);
        fold_of[group] = best.2;
    }
    fold_of
}

fn add(to: &mut [f64], counts: &[usize], factor: f64) {
    for (to, count) in to.iter_mut().zip(counts) {
        *to += factor * *count as f64;
    }
}

/// Returns the mean over the labels of the deviation of the folds' shares of it.
fn inequality(of_fold: &[Vec<f64>], totals: &[f64]) -> f64 {
    let present: Vec<usize> = (0..totals.len())
        .filter(|label| totals[*label] > 0.0)
        .collect();
    let of_label = |label: &usize| deviation(of_fold.iter().map(|of| of[*label] / totals[*label]));
    present.iter().map(of_label).sum::<f64>() / present.len().max(1) as f64
}

fn deviation(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    (values.map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// Moves a group of every label that is in one fold alone to the smallest other fold: without training sweeps its test
/// sweeps could not be recognised.
fn spread_labels(counts: &[Vec<usize>], folds: usize, fold_of: &mut [usize]) {
    let labels = counts.first().map_or(0, Vec::len);
    for _ in 0..labels {
        let mut moved = false;
        for label in 0..labels {
            let groups = (0..counts.len()).filter(|group| counts[*group][label] > 0);
            let Some(first) = groups.clone().next() else {
                continue;
            };
            if groups.clone().any(|group| fold_of[group] != fold_of[first]) {
                continue;
            }
            let sweeps = |fold: usize| -> usize {
                let inside = (0..counts.len()).filter(|group| fold_of[*group] == fold);
                inside
                    .map(|group| counts[group].iter().sum::<usize>())
                    .sum()
            };
            let others = (0..folds).filter(|fold| *fold != fold_of[first]);
            let smallest = groups.min_by_key(|group| counts[*group].iter().sum::<usize>());
            if let (Some(group), Some(fold)) = (smallest, others.min_by_key(|fold| sweeps(*fold))) {
                fold_of[group] = fold;
                moved = true;
            }
        }
        if !moved {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of sweeps of groups by label, and their folds by scikit-learn 1.9, `StratifiedGroupKFold(folds)` without
    /// shuffling.
    fn of_scikit_learn() -> [(usize, Vec<Vec<usize>>, Vec<usize>); 3] {
        let rows = |width: usize, counts: &[usize]| counts.chunks(width).map(Vec::from).collect();
        [
            (
                3,
                rows(
                    3,
                    &[
                        4, 2, 2, 2, 3, 2, 2, 2, 6, 2, 1, 1, 0, 5, 0, 1, 0, 7, 6, 0, 1, 2, 2, 2, 1,
                        3, 1,
                    ],
                ),
                vec![0, 1, 2, 2, 2, 0, 1, 0, 1],
            ),
            (
                2,
                rows(2, &[10, 3, 2, 6, 11, 1, 1, 5, 5, 1]),
                vec![1, 0, 0, 1, 1],
            ),
            (
                4,
                rows(
                    6,
                    &[
                        4, 3, 0, 2, 0, 1, 0, 3, 2, 0, 0, 0, 1, 1, 5, 1, 0, 0, 1, 0, 0, 6, 0, 3, 1,
                        1, 1, 0, 2, 1, 0, 1, 1, 0, 1, 5, 4, 0, 1, 3, 0, 0, 1, 3, 0, 0, 0, 0, 0, 1,
                        6, 0, 1, 1, 1, 0, 1, 5, 0, 2, 0, 1, 1, 1, 4, 0, 1, 1, 0, 2, 0, 3, 1, 0, 0,
                        1, 0, 0, 0, 3, 1, 0, 0, 1, 0, 0, 3, 0, 1, 0, 0, 0, 0, 3, 1, 0, 0, 0, 0, 1,
                        1, 0, 0, 0, 0, 0, 0, 4, 1, 1, 0, 1, 1, 0, 1, 3, 0, 0, 0, 0,
                    ],
                ),
                vec![1, 0, 2, 0, 1, 2, 3, 3, 3, 1, 0, 0, 2, 1, 1, 2, 3, 3, 2, 2],
            ),
        ]
    }

    #[test]
    fn groups_are_assigned_as_scikit_learn_does() {
        for (folds, counts, expected) in of_scikit_learn() {
            assert_eq!(assign(&counts, folds), expected);
        }
    }

    #[test]
    fn a_label_in_one_fold_is_spread() {
        let counts = vec![vec![5, 0], vec![5, 0], vec![0, 5], vec![0, 5]];
        let mut fold_of = vec![0, 0, 0, 1];
        spread_labels(&counts, 2, &mut fold_of);
        assert_ne!(fold_of[0], fold_of[1]);
        assert_ne!(fold_of[2], fold_of[3]);
    }
}
