//! Growth of one extremely randomised tree.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{LeafCount, TreeNode, TreeSweeps};

/// Range of a feature up to which it counts as constant in a node, as in scikit-learn.
const LEAST_RANGE: f32 = 1e-7;

/// Growth of one tree.
pub(super) struct Growth<'a> {
    sweeps: TreeSweeps<'a>,
    /// `n ln(n)` for all `n` up to the number of training sweeps.
    terms: &'a [f64],
    /// Number of features that are tried at a node.
    tried: usize,
    rng: ChaCha8Rng,
    /// All features. Those that a node has tried come first.
    features: Vec<u32>,
    /// Values of one feature in one node.
    values: Vec<f32>,
}

/// Node that is not grown yet.
struct Open {
    /// Positions of its training sweeps, by label.
    positions: Vec<usize>,
    /// Node whose child for large values it is.
    right_of: Option<usize>,
}

/// Best split of a node so far.
struct Split {
    feature: usize,
    threshold: f32,
    score: f64,
}

impl<'a> Growth<'a> {
    /// - `terms`: result of [`terms`] for the number of training sweeps
    pub fn new(sweeps: TreeSweeps<'a>, terms: &'a [f64], tried: usize, rng: ChaCha8Rng) -> Self {
        Self {
            features: (0..sweeps.columns.width() as u32).collect(),
            values: Vec::new(),
            sweeps,
            terms,
            tried,
            rng,
        }
    }

    /// Returns the nodes of the tree.
    pub fn grow(mut self) -> Vec<TreeNode> {
        let labels = self.sweeps.labels;
        let mut positions = self.sweeps.positions.to_vec();
        positions.sort_by_key(|position| labels[*position]);
        let mut nodes = Vec::new();
        let mut open = vec![Open {
            positions,
            right_of: None,
        }];
        while let Some(Open {
            positions,
            right_of,
        }) = open.pop()
        {
            let at = nodes.len();
            if let Some(parent) = right_of
                && let TreeNode::Split { right, .. } = &mut nodes[parent]
            {
                *right = at - parent;
            }
            let counts = self.counts(&positions);
            let Some(split) = self.best_split(&positions, &counts) else {
                nodes.push(TreeNode::Leaf(counts));
                continue;
            };
            nodes.push(TreeNode::Split {
                feature: split.feature,
                threshold: split.threshold,
                right: 0,
            });
            let column = self.sweeps.columns.column(split.feature);
            let (small, large) = positions
                .into_iter()
                .partition(|position| column[*position] <= split.threshold);
            open.push(Open {
                positions: large,
                right_of: Some(at),
            });
            open.push(Open {
                positions: small,
                right_of: None,
            });
        }
        nodes
    }

    /// Returns the number of sweeps of each material in a node, in the order of `positions`.
    fn counts(&self, positions: &[usize]) -> Vec<LeafCount> {
        let label = |position: &usize| self.sweeps.labels[*position];
        let runs = positions.chunk_by(|a, b| label(a) == label(b));
        let counts = runs.map(|run| LeafCount {
            material: label(&run[0]),
            sweeps: run.len(),
        });
        counts.collect()
    }

    /// Returns the best of one random threshold for each of the features that are tried; `None` for a leaf.
    ///
    /// Constant features are tried as well; if all that are tried are constant, more follow until one is not.
    fn best_split(&mut self, positions: &[usize], counts: &[LeafCount]) -> Option<Split> {
        if counts.len() < 2 {
            return None;
        }
        let mut best: Option<Split> = None;
        for tried in 0..self.features.len() {
            if tried >= self.tried && best.is_some() {
                break;
            }
            let drawn = self.rng.random_range(tried..self.features.len());
            self.features.swap(tried, drawn);
            let feature = self.features[tried] as usize;
            let column = self.sweeps.columns.column(feature);
            self.values.clear();
            self.values
                .extend(positions.iter().map(|position| column[*position]));
            let Some(threshold) = self.threshold() else {
                continue;
            };
            let score = self.score(threshold, counts);
            if best.as_ref().is_none_or(|best| score > best.score) {
                best = Some(Split {
                    feature,
                    threshold,
                    score,
                });
            }
        }
        best
    }

    /// Returns a random threshold that divides the values; `None` if they are constant.
    fn threshold(&mut self) -> Option<f32> {
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for value in &self.values {
            low = if *value < low { *value } else { low };
            high = if *value > high { *value } else { high };
        }
        if high - low <= LEAST_RANGE {
            return None;
        }
        let drawn = low + (high - low) * self.rng.random::<f32>();
        // Rounding may reach the largest value, which would leave one side empty.
        Some(if drawn < high { drawn } else { low })
    }

    /// Returns minus the entropy of the materials on both sides, weighted by numbers of sweeps and up to a constant.
    fn score(&self, threshold: f32, counts: &[LeafCount]) -> f64 {
        let (mut rest, mut small, mut score) = (self.values.as_slice(), 0, 0.0);
        for count in counts {
            let (own, after) = rest.split_at(count.sweeps);
            rest = after;
            let below: u32 = own.iter().map(|value| u32::from(*value <= threshold)).sum();
            let below = below as usize;
            score += self.terms[below] + self.terms[count.sweeps - below];
            small += below;
        }
        score - self.terms[small] - self.terms[self.values.len() - small]
    }
}

/// Returns `n ln(n)` for all `n` up to `most`; zero for zero.
pub(super) fn terms(most: usize) -> Vec<f64> {
    let term = |n: usize| n as f64 * (n.max(1) as f64).ln();
    (0..=most).map(term).collect()
}
