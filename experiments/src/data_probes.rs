//! Probes of a data set that need no training: the order of its sweeps, and the likeness of sweeps of one block.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tactnet_data::{Dataset, Fold, Scheme, Seed};

/// Probes of a data set that need no training, on random folds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataProbes {
    /// Name of the data set.
    pub data: String,
    /// Accuracy of naming the material of the training sweep that is nearest in the order of the data set, which is that of recording unless
    /// the file is sorted; absent if it is sorted by material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording_order: Option<f64>,
    /// Accuracy of naming the material of the training sweep of the most similar length; absent if all sweeps have one length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweep_length: Option<f64>,
    /// Recognition of the recording block within a material; absent if no material was recorded in several blocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub block_identity: Option<BlockIdentity>,
}

/// Recognition of the recording block of a sweep among the blocks of its material, by taxel means.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BlockIdentity {
    /// Share of the sweeps whose nearest training sweep of the same material is of the same block.
    pub accuracy: f64,
    /// Accuracy of always naming the block with the most training sweeps of the material.
    pub guessing: f64,
}

impl DataProbes {
    /// Returns the probes of a data set; `None` if none applies, or if a material has too few sweeps for random folds.
    pub(crate) fn of(dataset: &Dataset, seed: u64) -> Option<Self> {
        let scheme = Scheme::folds_for(dataset);
        let folds = 0..scheme.folds(dataset).ok()?;
        let folds = folds.map(|fold| Fold::new(dataset, scheme, Seed(seed), 0, fold).ok());
        let folds: Vec<Fold<'_>> = folds.collect::<Option<_>>()?;
        let recording_order = is_interleaved(dataset).then(|| by_order(dataset, &folds));
        let sweep_length = dataset.lengths().map(|all| by_length(dataset, all, &folds));
        let block_identity = by_means(dataset, &folds);
        let probes = Self {
            data: dataset.name().into(),
            recording_order,
            sweep_length,
            block_identity,
        };
        let has_any = recording_order.or(sweep_length).is_some() || block_identity.is_some();
        has_any.then_some(probes)
    }
}

/// Returns true if materials alternate in a data set. Sweeps sorted by material, also within each block or within each side of the
/// author's split, say nothing about the order of recording.
fn is_interleaved(dataset: &Dataset) -> bool {
    let place = |sweep: usize| {
        let record = &dataset.records()[sweep];
        (record.block, record.test, record.label)
    };
    let mut longest = BTreeMap::new();
    let mut run = 0;
    for sweep in 0..dataset.len() {
        let continues = sweep > 0 && place(sweep) == place(sweep - 1);
        run = if continues { run + 1 } else { 1 };
        let most = longest.entry(place(sweep)).or_insert(0);
        *most = run.max(*most);
    }
    // A few sweeps out of place do not make another order.
    2 * longest.values().sum::<usize>() <= dataset.len()
}

/// Returns the accuracy of naming the material of the nearest training sweep in the order of the data set.
fn by_order(dataset: &Dataset, folds: &[Fold<'_>]) -> f64 {
    let label = |sweep: usize| dataset.records()[sweep].label;
    let right = folds.iter().map(|fold| {
        let train = fold.train.indices();
        let is_right = |sweep: &&usize| {
            let later = train.partition_point(|other| other < *sweep);
            let around = train[later.saturating_sub(1)..].iter().take(2);
            let nearest = around.min_by_key(|other| other.abs_diff(**sweep));
            nearest.is_some_and(|other| label(*other) == label(**sweep))
        };
        fold.test.indices().iter().filter(is_right).count()
    });
    right.sum::<usize>() as f64 / dataset.len() as f64
}

/// Returns the expected accuracy of naming the material of the training sweep of the most similar length; of several such sweeps one is
/// drawn.
fn by_length(dataset: &Dataset, lengths: &[usize], folds: &[Fold<'_>]) -> f64 {
    let label = |sweep: usize| dataset.records()[sweep].label;
    let mut right = 0.0;
    for fold in folds {
        for &sweep in fold.test.indices() {
            let distance = |other: usize| lengths[other].abs_diff(lengths[sweep]);
            let train = fold.train.indices().iter().copied();
            let least = train.clone().map(distance).min();
            let nearest = train.filter(|other| Some(distance(*other)) == least);
            let same = nearest
                .clone()
                .filter(|other| label(*other) == label(sweep));
            right += same.count() as f64 / nearest.count() as f64;
        }
    }
    right / dataset.len() as f64
}

/// Maximum number of tested sweeps of each fold.
const MOST: usize = 400;

/// Returns the recognition of blocks by the nearest neighbour on taxel means; `None` if no material has several blocks.
fn by_means(dataset: &Dataset, folds: &[Fold<'_>]) -> Option<BlockIdentity> {
    let (records, materials) = (dataset.records(), dataset.labels().len());
    let mut blocks = vec![BTreeSet::new(); materials];
    for record in records {
        blocks[record.label].insert(record.block?);
    }
    let sweeps = (0..dataset.len()).into_par_iter();
    let means: Vec<Vec<f32>> = sweeps.map(|sweep| means(dataset, sweep)).collect();
    let distance = |a: usize, b: usize| -> f32 {
        let pairs = means[a].iter().zip(&means[b]);
        pairs.map(|(a, b)| (a - b).powi(2)).sum()
    };
    let (mut tested, mut right, mut guessed) = (0, 0, 0);
    for fold in folds {
        let mut of_label = vec![Vec::new(); materials];
        for &sweep in fold.train.indices() {
            of_label[records[sweep].label].push(sweep);
        }
        let most_frequent = of_label.iter().zip(&blocks).map(|(train, blocks)| {
            let sweeps = |block: u32| {
                train
                    .iter()
                    .filter(|sweep| records[**sweep].block == Some(block))
                    .count()
            };
            blocks.iter().copied().max_by_key(|block| sweeps(*block))
        });
        let most_frequent: Vec<Option<u32>> = most_frequent.collect();
        let test = fold.test.indices().iter().copied();
        let test = test.filter(|sweep| blocks[records[*sweep].label].len() > 1);
        let test: Vec<usize> = test.step_by(fold.test.len() / MOST + 1).collect();
        let nearest = test.par_iter().map(|&sweep| {
            let train = of_label[records[sweep].label].iter().copied();
            train.min_by(|a, b| distance(*a, sweep).total_cmp(&distance(*b, sweep)))
        });
        let nearest: Vec<Option<usize>> = nearest.collect();
        for (sweep, nearest) in test.into_iter().zip(nearest) {
            let record = &records[sweep];
            tested += 1;
            right += usize::from(nearest.is_some_and(|other| records[other].block == record.block));
            guessed += usize::from(most_frequent[record.label] == record.block);
        }
    }
    let share = |count: usize| count as f64 / tested as f64;
    (tested > 0).then(|| BlockIdentity {
        accuracy: share(right),
        guessing: share(guessed),
    })
}

/// Returns the mean of every taxel of a sweep.
fn means(dataset: &Dataset, sweep: usize) -> Vec<f32> {
    let shape = dataset.shape();
    let mut sums = vec![0.0_f64; shape.taxels()];
    for frame in dataset.sweep(sweep).chunks_exact(shape.taxels()) {
        let values = sums.iter_mut().zip(frame);
        values.for_each(|(sum, value)| *sum += f64::from(*value));
    }
    let mean = |sum: f64| (sum / dataset.steps_of(sweep) as f64) as f32;
    sums.into_iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use tactnet_data::{LabelSet, Samples, SweepRecord, SweepShape};

    use super::*;

    /// Sweeps of three materials in the order `(material, block)`; a sweep is noise around the level of its block.
    fn sweeps(order: &[(usize, Option<u32>)], level: impl Fn(u32) -> f32) -> Dataset {
        let shape = SweepShape {
            steps: 20,
            rows: 2,
            cols: 2,
        };
        let mut rng = Seed(3).rng("noise");
        let (mut values, mut records) = (Vec::new(), Vec::new());
        for (sweep, &(label, block)) in order.iter().enumerate() {
            let level = level(block.unwrap_or_default());
            values.extend((0..shape.values()).map(|_| level + rng.random::<f32>()));
            records.push(SweepRecord {
                label,
                sweep,
                block,
                test: None,
            });
        }
        let labels = LabelSet::new(["cork", "felt", "wood"]).unwrap();
        Dataset::new(
            "sweeps",
            100.0,
            shape,
            labels,
            records,
            Samples::F32(values),
        )
        .unwrap()
    }

    /// `rounds` rounds over the materials, with `each` consecutive sweeps of a material.
    fn rounds(rounds: usize, each: usize) -> Vec<(usize, Option<u32>)> {
        let round = || (0..3).flat_map(move |label| (0..each).map(move |_| (label, None)));
        (0..rounds).flat_map(|_| round()).collect()
    }

    #[test]
    fn consecutive_sweeps_of_one_material_are_told_by_their_order() {
        let order = |order: &[(usize, Option<u32>)]| {
            DataProbes::of(&sweeps(order, |_| 0.0), 1).and_then(|probes| probes.recording_order)
        };
        let runs = order(&rounds(6, 10)).unwrap();
        assert!(runs > 0.85, "{runs}");
        // With a new material each time, the neighbour is always of another one.
        let alternating = order(&rounds(60, 1)).unwrap();
        assert!(alternating < 0.3, "{alternating}");
        // In random order the neighbour says nothing.
        let mut random = rounds(60, 1);
        tactnet_data::shuffle(&mut random, &mut Seed(2).rng("order"));
        let random = order(&random).unwrap();
        assert!((0.2..0.5).contains(&random), "{random}");
    }

    #[test]
    fn a_file_sorted_by_material_is_no_order_of_recording() {
        let mut sorted = rounds(1, 60);
        assert_eq!(DataProbes::of(&sweeps(&sorted, |_| 0.0), 1), None);
        // Neither is one with two sweeps out of place.
        sorted.swap(10, 100);
        assert_eq!(DataProbes::of(&sweeps(&sorted, |_| 0.0), 1), None);
        // Nor one that is sorted within each block.
        let blocks = |sweep: usize| Some((sweep / 30) as u32);
        let within = rounds(6, 10).into_iter().enumerate();
        let within: Vec<_> = within
            .map(|(sweep, (label, _))| (label, blocks(sweep)))
            .collect();
        let probes = DataProbes::of(&sweeps(&within, |_| 0.0), 1).unwrap();
        assert_eq!(probes.recording_order, None);
    }

    #[test]
    fn blocks_with_a_level_of_their_own_are_recognised_and_others_are_not() {
        let blocks: Vec<_> = (0..180)
            .map(|sweep| (sweep % 3, Some((sweep / 30) as u32)))
            .collect();
        let identity = |level: fn(u32) -> f32| {
            let probes = DataProbes::of(&sweeps(&blocks, level), 1).unwrap();
            probes.block_identity.unwrap()
        };
        let drifting = identity(|block| block as f32);
        assert!(drifting.accuracy > 0.95, "{drifting:?}");
        assert!(drifting.guessing < 0.25, "{drifting:?}");
        let alike = identity(|_| 0.0);
        assert!((0.05..0.35).contains(&alike.accuracy), "{alike:?}");
    }
}
