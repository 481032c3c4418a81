use super::*;
use crate::{LabelSet, Samples, SweepRecord, SweepShape};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Returns a data set with `counts[label]` sweeps, recorded in blocks of `block` sweeps that alternate between the
/// materials, like TactMat's days.
pub(super) fn recorded(counts: &[usize], block: usize) -> Dataset {
    let mut records: Vec<SweepRecord> = (counts.iter().enumerate())
        .flat_map(|(label, &count)| {
            (0..count).map(move |sweep| SweepRecord {
                label,
                sweep,
                block: Some((sweep / block) as u32),
                test: Some(sweep % 5 == 4),
            })
        })
        .collect();
    records.sort_by_key(|record| (record.block, record.label));
    assemble(counts.len(), records)
}

fn assemble(materials: usize, records: Vec<SweepRecord>) -> Dataset {
    let labels = LabelSet::new((0..materials).map(|label| format!("material {label}"))).unwrap();
    let shape = SweepShape {
        steps: 1,
        rows: 1,
        cols: 1,
    };
    let values = Samples::U8((0..records.len()).map(|i| (i % 251) as u8).collect());
    Dataset::new("recorded", 750.0, shape, labels, records, values).unwrap()
}

fn stripped(dataset: &Dataset) -> Dataset {
    let mut records = dataset.records().to_vec();
    records
        .iter_mut()
        .for_each(|r| (r.block, r.test) = (None, None));
    assemble(dataset.labels().len(), records)
}

fn refusal(dataset: &Dataset, scheme: Scheme, repeat: usize, fold: usize) -> String {
    Fold::new(dataset, scheme, Seed(0), repeat, fold)
        .unwrap_err()
        .to_string()
}

fn sides(fold: &Fold) -> (Vec<usize>, Vec<usize>) {
    (fold.train.indices().to_vec(), fold.test.indices().to_vec())
}

fn spread(counts: impl IntoIterator<Item = usize> + Clone) -> usize {
    let largest = counts.clone().into_iter().max().unwrap_or(0);
    largest - counts.into_iter().min().unwrap_or(0)
}

prop_compose! {
    /// Generates 1 to 5 materials with 10 to 30 sweeps each, in blocks of 2 to 5.
    fn any_recording()(
        counts in prop::collection::vec(10usize..=30, 1..=5),
        block in 2usize..=5,
    ) -> Dataset {
        recorded(&counts, block)
    }
}

fn any_scheme() -> impl Strategy<Value = Scheme> {
    prop_oneof![
        (2usize..=7, 1usize..=3)
            .prop_map(|(folds, repeats)| Scheme::StratifiedKFold { folds, repeats }),
        Just(Scheme::TestFlag),
        Just(Scheme::LeaveBlockOut),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn train_and_test_partition_the_sweeps(
        dataset in any_recording(), scheme in any_scheme(), seed: u64,
    ) {
        for fold in 0..scheme.folds(&dataset).unwrap() {
            let fold = Fold::new(&dataset, scheme, Seed(seed), 0, fold).unwrap();
            let (mut all, test) = sides(&fold);
            prop_assert!(!all.is_empty() && !test.is_empty());
            all.extend(test);
            all.sort_unstable();
            prop_assert_eq!(all, (0..dataset.len()).collect::<Vec<_>>());
        }
    }

    #[test]
    fn over_all_folds_every_sweep_is_tested_once(
        dataset in any_recording(), folds in 2usize..=7, by_block: bool, seed: u64,
    ) {
        let k_fold = Scheme::StratifiedKFold { folds, repeats: 1 };
        let scheme = if by_block { Scheme::LeaveBlockOut } else { k_fold };
        let mut tested = Vec::new();
        for fold in 0..scheme.folds(&dataset).unwrap() {
            tested.extend(sides(&Fold::new(&dataset, scheme, Seed(seed), 0, fold).unwrap()).1);
        }
        tested.sort_unstable();
        prop_assert_eq!(tested, (0..dataset.len()).collect::<Vec<_>>());
    }

    #[test]
    fn stratified_folds_differ_by_at_most_one_sweep(
        dataset in any_recording(), folds in 2usize..=7, seed: u64,
    ) {
        let scheme = Scheme::StratifiedKFold { folds, repeats: 1 };
        let tests: Vec<_> = (0..folds)
            .map(|fold| Fold::new(&dataset, scheme, Seed(seed), 0, fold).unwrap().test)
            .collect();
        prop_assert!(spread(tests.iter().map(|test| test.len())) <= 1);
        for label in 0..dataset.labels().len() {
            prop_assert!(spread(tests.iter().map(|test| test.sweeps_per_label()[label])) <= 1);
        }
    }

    #[test]
    fn a_fold_depends_on_the_seed_alone(
        dataset in any_recording(), seed in 0..u64::MAX, repeat in 0usize..2, fold in 0usize..5,
    ) {
        let split = |dataset, seed| {
            sides(&Fold::new(dataset, Scheme::default(), Seed(seed), repeat, fold).unwrap())
        };
        let first = split(&dataset, seed);
        // The split depends neither on earlier draws nor on metadata other than labels.
        let other = Fold::new(&dataset, Scheme::default(), Seed(seed), 1 - repeat, fold).unwrap();
        other.inner(0).unwrap();
        prop_assert_eq!(&split(&dataset, seed), &first);
        prop_assert_eq!(&split(&stripped(&dataset), seed), &first);
    }

    #[test]
    fn inner_splits_partition_the_training_sweeps(
        dataset in any_recording(), scheme in any_scheme(), seed: u64,
    ) {
        let fold = Fold::new(&dataset, scheme, Seed(seed), 0, 0).unwrap();
        prop_assume!(fold.train.sweeps_per_label().iter().all(|&n| n >= 2));
        let mut validated = Vec::new();
        let mut per_label = Vec::new();
        for part in 0..fold.train.inner_folds() {
            let (train, validation) = fold.inner(part).unwrap();
            let mut all = [train.indices(), validation.indices()].concat();
            all.sort_unstable();
            prop_assert_eq!(&all, fold.train.indices());
            prop_assert!(all.iter().all(|index| !fold.test.indices().contains(index)));
            validated.extend_from_slice(validation.indices());
            per_label.push(validation.sweeps_per_label());
        }
        validated.sort_unstable();
        prop_assert_eq!(&validated, fold.train.indices());
        for label in 0..dataset.labels().len() {
            prop_assert!(spread(per_label.iter().map(|counts| counts[label])) <= 1);
        }
    }

    #[test]
    fn a_block_left_out_has_no_sweep_in_training(dataset in any_recording()) {
        for fold in 0..Scheme::LeaveBlockOut.folds(&dataset).unwrap() {
            let fold = Fold::new(&dataset, Scheme::LeaveBlockOut, Seed(0), 0, fold).unwrap();
            let blocks = |view: &SweepView| -> BTreeSet<_> {
                let records = view.indices().iter().map(|&i| &dataset.records()[i]);
                records.map(|record| (record.label, record.block)).collect()
            };
            let (train, test) = (blocks(&fold.train), blocks(&fold.test));
            prop_assert!(train.is_disjoint(&test));
            let tested: BTreeSet<_> = test.iter().map(|(label, _)| label).collect();
            prop_assert_eq!(test.len(), tested.len(), "one block of a material at a time");
        }
    }

    #[test]
    fn a_manifest_stands_for_one_split_only(
        dataset in any_recording(), scheme in any_scheme(), seed: u64, at: prop::sample::Index,
    ) {
        let fold = Fold::new(&dataset, scheme, Seed(seed), 0, 0).unwrap();
        let manifest = fold.manifest();
        let text = serde_json::to_string(&manifest).unwrap();
        let read: SplitManifest = serde_json::from_str(&text).unwrap();
        let again = read.fold(&dataset).unwrap();
        prop_assert_eq!(sides(&again), sides(&fold));

        let mut other = manifest.clone();
        *at.get_mut(&mut other.test) += 1;
        prop_assert_ne!(other.digest(), manifest.digest());
        prop_assert!(other.fold(&dataset).is_err());
        let mut moved = manifest.clone();
        moved.train.push(moved.test.remove(at.index(moved.test.len())));
        prop_assert_ne!(moved.digest(), manifest.digest());
    }
}

#[test]
fn the_published_scheme_tests_20_of_100_sweeps_and_tunes_on_16_of_80() {
    let dataset = recorded(&[100; 36], 10);
    let fold = Fold::new(&dataset, Scheme::default(), Seed(0), 1, 4).unwrap();
    assert_eq!(fold.train.sweeps_per_label(), [80; 36]);
    assert_eq!(fold.test.sweeps_per_label(), [20; 36]);
    let (train, validation) = fold.inner(4).unwrap();
    assert_eq!(train.sweeps_per_label(), [64; 36]);
    assert_eq!(validation.sweeps_per_label(), [16; 36]);
}

#[test]
fn seeds_runs_and_folds_give_different_splits() {
    let dataset = recorded(&[20, 20], 5);
    let tested = |seed, repeat, fold| {
        sides(&Fold::new(&dataset, Scheme::default(), Seed(seed), repeat, fold).unwrap()).1
    };
    let different: BTreeSet<_> = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
        .map(|(s, r, f)| tested(s, r, f))
        .into();
    assert_eq!(different.len(), 4);
    // The same training sweeps under other numbers are split anew.
    let validated = |repeat, fold| {
        let sweeps: Vec<usize> = (0..dataset.len()).collect();
        let key = SplitKey {
            scheme: Scheme::default(),
            seed: Seed(0),
            repeat,
            fold,
        };
        let train = TrainSplit::new(&dataset, sweeps, key);
        train.inner(0).unwrap().1.indices().to_vec()
    };
    let different: BTreeSet<_> = [validated(0, 0), validated(0, 1), validated(1, 0)].into();
    assert_eq!(different.len(), 3);
}

#[test]
fn the_test_flag_is_followed_to_the_letter() {
    let dataset = recorded(&[10, 15], 5);
    assert_eq!(Scheme::default_for(&dataset), Scheme::TestFlag);
    assert_eq!(Scheme::default_for(&stripped(&dataset)), Scheme::default());
    let fold = Fold::new(&dataset, Scheme::TestFlag, Seed(0), 0, 0).unwrap();
    assert!(
        fold.test
            .indices()
            .iter()
            .all(|&i| dataset.records()[i].sweep % 5 == 4)
    );
    assert_eq!(fold.test.sweeps_per_label(), [2, 3]);
}

#[test]
fn a_material_with_fewer_blocks_trains_when_its_blocks_are_used_up() {
    let dataset = recorded(&[10, 15], 5);
    assert_eq!(Scheme::LeaveBlockOut.folds(&dataset).unwrap(), 3);
    let fold = Fold::new(&dataset, Scheme::LeaveBlockOut, Seed(0), 0, 2).unwrap();
    assert_eq!(fold.test.sweeps_per_label(), [0, 5]);
    assert_eq!(fold.train.sweeps_per_label(), [10, 10]);
}

#[test]
fn impossible_splits_say_what_is_missing() {
    let dataset = recorded(&[20, 4], 2);
    let k_fold = Scheme::default();
    let (flagged, by_block) = (Scheme::TestFlag, Scheme::LeaveBlockOut);
    let one_fold = Scheme::StratifiedKFold {
        folds: 1,
        repeats: 1,
    };
    let bare = stripped(&dataset);
    for (dataset, scheme, repeat, fold, complaint) in [
        (&dataset, k_fold, 0, 5, "fold: expected a number below 5"),
        (&dataset, k_fold, 2, 0, "repeat: expected a number below 2"),
        (&dataset, flagged, 0, 1, "fold: expected a number below 1"),
        (
            &dataset,
            by_block,
            0,
            10,
            "fold: expected a number below 10",
        ),
        (
            &dataset,
            k_fold,
            0,
            0,
            "sweeps of `material 1`: expected at least 5",
        ),
        (&bare, flagged, 0, 0, "`test_flag` of data set `recorded`"),
        (&bare, by_block, 0, 0, "`blocks` of data set `recorded`"),
        (
            &recorded(&[20, 4], 4),
            by_block,
            0,
            0,
            "blocks of `material 1`: expected at least 2",
        ),
        (
            &recorded(&[4, 4], 2),
            flagged,
            0,
            0,
            "found 8 training, 0 test",
        ),
        (&dataset, one_fold, 0, 0, "`folds`: expected at least 2"),
    ] {
        let error = refusal(dataset, scheme, repeat, fold);
        assert!(error.contains(complaint), "{error}");
    }
}

#[test]
fn inner_folds_are_limited_by_the_fewest_sweeps() {
    let dataset = recorded(&[20, 4], 2);
    let fold = Fold::new(&dataset, Scheme::LeaveBlockOut, Seed(0), 0, 0).unwrap();
    assert_eq!(fold.train.inner_folds(), 2, "as many as the fewest sweeps");
    assert!(
        fold.inner(2)
            .unwrap_err()
            .to_string()
            .contains("inner fold: expected a number below 2")
    );
    let pairs = recorded(&[2, 2], 1);
    let halves = Scheme::StratifiedKFold {
        folds: 2,
        repeats: 1,
    };
    let fold = Fold::new(&pairs, halves, Seed(0), 0, 0).unwrap();
    let error = fold.inner(0).unwrap_err().to_string();
    assert!(
        error.contains("sweeps of `material 0`: expected at least 2, one for each fold, found 1"),
        "{error}"
    );
}

#[test]
fn the_only_sweep_of_a_material_is_a_training_sweep_of_every_inner_part() {
    let dataset = recorded(&[1, 3], 1);
    let train = TrainSplit::all(&dataset, Seed(5));
    let train = train.weighted(vec![1.0, 2.0, 3.0, 4.0]).unwrap();
    let mut validated = Vec::new();
    for part in 0..train.inner_folds() {
        let (fit, held) = train.inner(part).unwrap();
        assert_eq!(fit.indices()[0], 0, "the only sweep of the first material");
        // Weights follow their sweeps; the mean of 1 to 4 is 2.5.
        let weights = fit.weights().unwrap();
        for (&index, weight) in fit.indices().iter().zip(weights) {
            assert_eq!(*weight, (index + 1) as f64 / 2.5);
        }
        validated.extend_from_slice(held.indices());
    }
    validated.sort_unstable();
    assert_eq!(validated, [1, 2, 3]);
}

#[test]
fn weights_that_are_not_positive_or_not_one_a_sweep_are_refused() {
    let dataset = recorded(&[2, 2], 1);
    for (weights, complaint) in [
        (vec![1.0; 3], "one for each of 4 training sweeps, found 3"),
        (vec![1.0, 0.0, 1.0, 1.0], "positive numbers, found 0"),
        (vec![1.0, f64::NAN, 1.0, 1.0], "positive numbers, found NaN"),
    ] {
        let train = TrainSplit::all(&dataset, Seed(5));
        let refused = train.weighted(weights).unwrap_err().to_string();
        assert!(refused.contains(complaint), "{refused}");
    }
}

#[test]
fn a_nested_fold_never_sees_the_test_sweeps() {
    let dataset = recorded(&[20, 25], 5);
    let outer = Fold::new(&dataset, Scheme::default(), Seed(3), 1, 2).unwrap();
    let nested = outer.nested(4).unwrap();
    let (mut inside, validation) = sides(&nested);
    assert!(!validation.is_empty());
    inside.extend(validation);
    inside.sort_unstable();
    assert_eq!(inside, outer.train.indices());
    assert_eq!(
        nested.manifest().fold(&dataset).unwrap().manifest(),
        nested.manifest()
    );
    assert_ne!(nested.manifest().sha256, outer.manifest().sha256);
}

#[test]
fn fewer_shots_are_a_part_of_more_and_never_test_sweeps() {
    let dataset = recorded(&[20, 25], 5);
    let fold = Fold::new(&dataset, Scheme::default(), Seed(3), 0, 1).unwrap();
    let [few, many] = [2, 9].map(|shots| fold.shots(shots).unwrap());
    assert_eq!(few.train.sweeps_per_label(), [2, 2]);
    assert_eq!(many.train.sweeps_per_label(), [9, 9]);
    let many = many.train.indices();
    assert!(few.train.indices().iter().all(|i| many.contains(i)));
    assert!(many.iter().all(|i| fold.train.indices().contains(i)));
    assert_eq!(few.test.indices(), fold.test.indices());
    let other = Fold::new(&dataset, Scheme::default(), Seed(3), 0, 2).unwrap();
    assert_ne!(other.shots(2).unwrap().train.indices(), few.train.indices());
    for shots in [0, 17] {
        let refused = fold.shots(shots).unwrap_err().to_string();
        assert!(
            refused.contains("training sweeps of `material 0`"),
            "{refused}"
        );
    }
}

#[test]
fn permuted_labels_keep_their_counts_and_nothing_else() {
    let dataset = recorded(&[20, 25, 30], 5);
    let (counts, sha256) = (dataset.sweeps_per_label(), dataset.sha256().to_string());
    let labels: Vec<usize> = dataset.records().iter().map(|r| r.label).collect();
    let permuted = dataset.permute_labels(Seed(1)).unwrap();
    assert_eq!(permuted.sweeps_per_label(), counts);
    assert_ne!(permuted.sha256(), sha256);
    let kept = permuted
        .records()
        .iter()
        .zip(labels)
        .filter(|(r, l)| r.label == *l)
        .count();
    assert!(kept < 75 / 2, "{kept} of 75 kept their label");
    assert!(permuted.name().contains("permuted"));
}

#[test]
fn training_sweeps_know_the_split_that_they_belong_to() {
    let dataset = recorded(&[20, 23], 4);
    let fold = Fold::new(&dataset, Scheme::default(), Seed(3), 1, 2).unwrap();
    assert_eq!(fold.train.manifest().unwrap(), fold.manifest());
    let (inner, validation) = fold.train.inner(1).unwrap();
    let manifest = inner.manifest().unwrap();
    assert_eq!(manifest.train, inner.indices());
    assert_eq!(manifest.test, fold.test.indices());
    assert!(
        validation
            .indices()
            .iter()
            .all(|index| !manifest.train.contains(index) && !manifest.test.contains(index))
    );
}

#[test]
fn all_sweeps_train_where_none_is_tested() {
    let dataset = recorded(&[10, 10], 5);
    let train = TrainSplit::all(&dataset, Seed(3));
    assert_eq!(train.indices(), (0..20).collect::<Vec<_>>());
    let manifest = train.manifest().unwrap();
    assert!(manifest.test.is_empty());
    let again = manifest.fold(&dataset).unwrap();
    assert_eq!((again.train.len(), again.test.len()), (20, 0));
    let (inner, aside) = train.inner(1).unwrap();
    assert_eq!((inner.len(), aside.len()), (16, 4));
}

proptest! {
    #[test]
    fn group_folds_test_every_sweep_once_and_keep_blocks_whole(dataset in any_recording(), folds in 2usize..=4) {
        let scheme = Scheme::GroupKFold { folds, repeats: 2 };
        prop_assume!(scheme.folds(&dataset).is_ok());
        for repeat in 0..2 {
            let mut tested = vec![0; dataset.len()];
            for fold in 0..folds {
                let Ok(fold) = Fold::new(&dataset, scheme, Seed(5), repeat, fold) else { continue };
                let block = |sweep: &usize| {
                    let record = &dataset.records()[*sweep];
                    (record.label, record.block)
                };
                let trained: BTreeSet<_> = fold.train.indices().iter().map(block).collect();
                for sweep in fold.test.indices() {
                    tested[*sweep] += 1;
                    prop_assert!(!trained.contains(&block(sweep)));
                    // Every tested material has training sweeps.
                    prop_assert!(trained.iter().any(|(label, _)| *label == block(sweep).0));
                }
            }
            prop_assert!(tested.iter().all(|times| *times <= 1));
        }
    }
}
