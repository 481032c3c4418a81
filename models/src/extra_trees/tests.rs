use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use std::collections::BTreeMap;

use super::*;
use crate::argmax;

const SETTINGS: ExtraTreesSettings = ExtraTreesSettings {
    trees: 10,
    feature_share: 0.5,
};

/// Returns a forest of all sweeps.
fn forest(features: &Features, labels: &[usize], materials: usize, seed: u64) -> ExtraTrees {
    let positions: Vec<usize> = (0..labels.len()).collect();
    let sweeps = TreeSweeps {
        columns: &Columns::of(features),
        labels,
        positions: &positions,
        materials,
    };
    ExtraTrees::fit(sweeps, SETTINGS, &mut ChaCha8Rng::seed_from_u64(seed))
}

#[derive(Deserialize)]
struct Golden {
    width: usize,
    materials: usize,
    trees: usize,
    feature_share: f64,
    forests: usize,
    train: Vec<f32>,
    train_labels: Vec<usize>,
    queries: Vec<f32>,
    query_labels: Vec<usize>,
    statistics: BTreeMap<String, Statistics>,
}

#[derive(Deserialize)]
struct Statistics {
    mean: f64,
    deviation: f64,
}

/// Returns the number of splits on the longest path from the first node, and the number of nodes below and at it.
fn depth_and_size(tree: &[TreeNode]) -> (usize, usize) {
    match &tree[0] {
        TreeNode::Leaf(_) => (0, 1),
        TreeNode::Split { right, .. } => {
            let ((left, before), (above, after)) =
                (depth_and_size(&tree[1..]), depth_and_size(&tree[*right..]));
            assert_eq!(1 + before, *right);
            (1 + left.max(above), 1 + before + after)
        }
    }
}

/// Returns the probabilities without the extra vote.
fn shares(forest: &ExtraTrees, queries: &Features) -> Vec<Vec<f64>> {
    let votes = forest.trees.len() as f64;
    let even = 1.0 / forest.materials as f64;
    let rows = forest.log_probabilities(queries).into_iter();
    rows.map(|row| {
        row.iter()
            .map(|log_p| (log_p.exp() * (votes + 1.0) - even) / votes)
            .collect()
    })
    .collect()
}

/// Returns the measurements that the golden statistics are of.
fn measure(golden: &Golden, forest: &ExtraTrees) -> BTreeMap<&'static str, f64> {
    let shares = shares(forest, &Features::new(golden.width, golden.queries.clone()));
    let (mut correct, mut of_truth, mut largest) = (0.0, 0.0, 0.0);
    for (row, truth) in shares.iter().zip(&golden.query_labels) {
        let best = argmax(row);
        correct += f64::from(u8::from(best == *truth));
        of_truth += row[*truth];
        largest += row[best];
    }
    let (queries, trees) = (shares.len() as f64, forest.trees.len() as f64);
    let shapes = forest.trees.iter().map(|tree| depth_and_size(tree));
    let (mut depth, mut nodes) = (0, 0);
    for (tree, (own_depth, size)) in forest.trees.iter().zip(shapes) {
        assert_eq!(size, tree.len());
        depth += own_depth;
        nodes += size;
    }
    BTreeMap::from([
        ("accuracy", correct / queries),
        ("probability", of_truth / queries),
        ("largest_probability", largest / queries),
        ("nodes", nodes as f64 / trees),
        ("depth", depth as f64 / trees),
    ])
}

/// Golden values from `tests/golden/extra_trees_with_sklearn.py` (`sklearn.ensemble.ExtraTreesClassifier`).
#[test]
fn forests_are_like_scikit_learns() {
    let golden = include_str!("../../../tests/golden/extra_trees_with_sklearn.json");
    let golden: Golden = serde_json::from_str(golden).unwrap();
    let columns = Columns::of(&Features::new(golden.width, golden.train.clone()));
    let positions: Vec<usize> = (0..golden.train_labels.len()).collect();
    let sweeps = TreeSweeps {
        columns: &columns,
        labels: &golden.train_labels,
        positions: &positions,
        materials: golden.materials,
    };
    let settings = ExtraTreesSettings {
        trees: golden.trees,
        feature_share: golden.feature_share,
    };
    let forests = 200;
    let measured: Vec<_> = (0..forests)
        .map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            measure(&golden, &ExtraTrees::fit(sweeps, settings, &mut rng))
        })
        .collect();
    for (name, expected) in &golden.statistics {
        let mean = measured.iter().map(|of| of[name.as_str()]).sum::<f64>() / forests as f64;
        let error = (1.0 / forests as f64 + 1.0 / golden.forests as f64).sqrt();
        // Of five means of 200 forests each, none is 4 standard errors off but once in 3000 choices of seeds.
        let away = (mean - expected.mean) / (expected.deviation * error);
        assert!(
            away.abs() < 4.0,
            "{name}: {mean}, {away} standard errors off"
        );
    }
}

#[test]
fn equal_seeds_give_equal_forests_and_others_do_not() {
    let values = (0..40 * 6).map(|i| ((i * 7919) % 101) as f32).collect();
    let features = Features::new(6, values);
    let labels: Vec<usize> = (0..40).map(|i| i % 3).collect();
    let first = forest(&features, &labels, 3, 1);
    assert_eq!(first, forest(&features, &labels, 3, 1));
    assert_ne!(first, forest(&features, &labels, 3, 2));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1);
    let alone = one.build().unwrap();
    assert_eq!(first, alone.install(|| forest(&features, &labels, 3, 1)));
}

#[test]
fn only_the_sweeps_at_the_given_positions_are_learnt() {
    let features = Features::new(1, vec![0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
    let labels = [0, 1, 0, 1, 2, 2];
    let sweeps = TreeSweeps {
        columns: &Columns::of(&features),
        labels: &labels,
        positions: &[3, 0, 1],
        materials: 3,
    };
    let forest = ExtraTrees::fit(sweeps, SETTINGS, &mut ChaCha8Rng::seed_from_u64(1));
    let expected = [
        TreeNode::Leaf(vec![LeafCount {
            material: 0,
            sweeps: 1,
        }]),
        TreeNode::Leaf(vec![LeafCount {
            material: 1,
            sweeps: 2,
        }]),
    ];
    for tree in &forest.trees {
        assert_eq!(tree[1..], expected);
    }
    let columns = Columns::of(&features);
    let rows = forest.log_probabilities(&features);
    assert_eq!(rows[4..], forest.log_probabilities_at(&columns, &[4, 5]));
    // Ten votes of ten and a third of the extra vote.
    assert!((rows[0][0].exp() - (10.0 + 1.0 / 3.0) / 11.0).abs() < 1e-12);
}

proptest! {
    /// Few values make ties, equal rows and constant features likely.
    #[test]
    fn leaves_hold_all_training_sweeps_and_probabilities_sum_to_one(
        rows in prop::collection::vec(([0_u8..3, 0..3, 5..6], 0_usize..3), 1..30),
        seed in 0_u64..1000,
    ) {
        let values = rows.iter().flat_map(|(row, _)| row.map(f32::from)).collect();
        let labels: Vec<usize> = rows.iter().map(|(_, label)| *label).collect();
        let features = Features::new(3, values);
        let forest = forest(&features, &labels, 3, seed);
        for tree in &forest.trees {
            let mut found = [0; 3];
            for node in tree {
                match node {
                    TreeNode::Leaf(counts) => counts.iter().for_each(|count| found[count.material] += count.sweeps),
                    // Two features vary, and every split divides the values that it sees.
                    TreeNode::Split { feature, threshold, .. } => prop_assert!(*feature < 2 && (0.0..2.0).contains(threshold)),
                }
            }
            let expected = [0, 1, 2].map(|label| labels.iter().filter(|of| **of == label).count());
            prop_assert_eq!(found, expected);
        }
        let shares = shares(&forest, &features);
        for (sweep, row) in shares.iter().enumerate() {
            prop_assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            // Trees grow until equal rows are left, whose materials are counted.
            let equal: Vec<usize> = (0..rows.len()).filter(|other| rows[*other].0 == rows[sweep].0).collect();
            for (material, share) in row.iter().enumerate() {
                let own = equal.iter().filter(|other| labels[**other] == material).count();
                prop_assert!((share - own as f64 / equal.len() as f64).abs() < 1e-9, "{share}");
            }
        }
    }
}
