//! Extremely randomised trees (Geurts, Ernst & Wehenkel, 2006), with the rules of scikit-learn's `ExtraTreesClassifier`.

mod growth;
#[cfg(test)]
mod tests;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::{Columns, Features};
use growth::{Growth, terms};

/// Settings of a forest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtraTreesSettings {
    /// Number of trees.
    pub trees: usize,
    /// Share of the features that are tried at a node, above 0 and at most 1.
    pub feature_share: f64,
}

/// Training sweeps of a forest.
#[derive(Debug, Clone, Copy)]
pub struct TreeSweeps<'a> {
    /// Features of all sweeps.
    pub columns: &'a Columns,
    /// Labels of all sweeps.
    pub labels: &'a [usize],
    /// Positions of the sweeps that the forest is fitted to.
    pub positions: &'a [usize],
    /// Number of materials.
    pub materials: usize,
}

/// Forest of extremely randomised trees.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtraTrees {
    /// Nodes of every tree; the first is the root. The next node after a split is its child for small values.
    pub trees: Vec<Vec<TreeNode>>,
    /// Number of materials.
    pub materials: usize,
}

/// Node of a tree.
#[derive(Debug, Clone, PartialEq)]
pub enum TreeNode {
    /// Node that compares a feature with a threshold.
    Split {
        /// Number of the feature.
        feature: usize,
        /// Largest value of the feature that goes to the next node.
        threshold: f32,
        /// Number of nodes from this one to its child for larger values, at least two.
        right: usize,
    },
    /// End of a path, with the training sweeps that reached it; at least one.
    Leaf(Vec<LeafCount>),
}

/// Number of training sweeps of one material in a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LeafCount {
    /// Label of the material.
    pub material: usize,
    /// Number of sweeps, at least one.
    pub sweeps: usize,
}

impl ExtraTrees {
    /// Grows a forest until every leaf has a single material or equal features. Results do not depend on the number of threads.
    ///
    /// # Panics
    /// If `sweeps.positions` is empty.
    pub fn fit(sweeps: TreeSweeps<'_>, settings: ExtraTreesSettings, rng: &mut ChaCha8Rng) -> Self {
        assert!(!sweeps.positions.is_empty(), "a forest has training sweeps");
        let width = sweeps.columns.width();
        let tried = ((settings.feature_share * width as f64) as usize).max(1);
        let terms = terms(sweeps.positions.len());
        let seeds: Vec<u64> = (0..settings.trees).map(|_| rng.random()).collect();
        let trees = seeds.into_par_iter().map(|seed| {
            let rng = ChaCha8Rng::seed_from_u64(seed);
            Growth::new(sweeps, &terms, tried, rng).grow()
        });
        Self {
            trees: trees.collect(),
            materials: sweeps.materials,
        }
    }

    /// Returns log-probabilities `[sweeps][materials]`: the mean over the trees of each leaf's shares of materials.
    ///
    /// One extra tree votes evenly for all materials, so that a material without votes is not ruled out when sweeps are fused.
    pub fn log_probabilities(&self, queries: &Features) -> Vec<Vec<f64>> {
        let rows = queries.values().par_chunks_exact(queries.width());
        rows.map(|row| self.mean(|feature| row[feature])).collect()
    }

    /// Returns the log-probabilities of the sweeps at `positions`.
    pub fn log_probabilities_at(&self, columns: &Columns, positions: &[usize]) -> Vec<Vec<f64>> {
        let positions = positions.par_iter();
        positions
            .map(|position| self.mean(|feature| columns.column(feature)[*position]))
            .collect()
    }

    /// Returns the log-probabilities of one sweep.
    ///
    /// - `value`: returns a feature of the sweep
    fn mean(&self, value: impl Fn(usize) -> f32) -> Vec<f64> {
        let mut sums = vec![1.0 / self.materials as f64; self.materials];
        for tree in &self.trees {
            let counts = leaf(tree, &value);
            let all: usize = counts.iter().map(|count| count.sweeps).sum();
            for count in counts {
                sums[count.material] += count.sweeps as f64 / all as f64;
            }
        }
        let votes = self.trees.len() as f64 + 1.0;
        sums.iter().map(|sum| (sum / votes).ln()).collect()
    }
}

/// Returns the leaf that a sweep reaches.
fn leaf(tree: &[TreeNode], value: impl Fn(usize) -> f32) -> &[LeafCount] {
    let mut at = 0;
    loop {
        match &tree[at] {
            TreeNode::Leaf(counts) => return counts,
            TreeNode::Split {
                feature,
                threshold,
                right,
            } => {
                at += match value(*feature) <= *threshold {
                    true => 1,
                    false => *right,
                };
            }
        }
    }
}
