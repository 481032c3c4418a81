//! Extremely randomised trees, with calibrated temperature.

use serde::{Deserialize, Serialize};
use tactnet_models::{
    Columns, ExtraTrees, ExtraTreesSettings, Features, LeafCount, ModelError, TreeNode, TreeSweeps,
    Weights, fit_inverse_temperature,
};

use super::method::{Fit, FittedMethod, Method, Stored, TrainFeatures, tempered};
use crate::PipelineError;
use crate::error::InvalidSetting;
use crate::features::arrays::{
    get, get_indices, get_indices_below, of_length, put, put_doubles, put_indices,
};

/// Settings of extremely randomised trees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExtraTreesRecipe {
    /// Number of trees.
    pub trees: usize,
    /// Share of the features that are tried at a node, above 0 and at most 1.
    pub feature_share: f64,
}

/// Forest with the inverse temperature of its log-probabilities.
struct TemperedTrees {
    forest: ExtraTrees,
    inverse_temperature: f64,
}

impl ExtraTreesRecipe {
    fn settings(&self) -> ExtraTreesSettings {
        ExtraTreesSettings {
            trees: self.trees,
            feature_share: self.feature_share,
        }
    }
}

impl Method for ExtraTreesRecipe {
    fn validate(&self) -> Result<(), InvalidSetting> {
        if self.trees == 0 {
            return Err(InvalidSetting {
                setting: "classifier.trees",
                expected: "a whole number from 1",
                found: "0".into(),
            });
        }
        if self.feature_share > 0.0 && self.feature_share <= 1.0 {
            return Ok(());
        }
        Err(InvalidSetting {
            setting: "classifier.feature_share",
            expected: "a number above 0 and at most 1",
            found: self.feature_share.to_string(),
        })
    }

    fn fit(
        &self,
        mut train: TrainFeatures<'_>,
        progress: &mut dyn FnMut(String),
    ) -> Result<Fit, PipelineError> {
        let scaler = train.scaler(&train.features);
        if let Some(scaler) = &scaler {
            scaler.apply(&mut train.features);
        }
        let inner = train.inner(0)?;
        let TrainFeatures {
            features,
            labels,
            materials,
            seed,
            ..
        } = train;
        let columns = Columns::of(&features);
        // The features of many sweeps are large.
        drop(features);
        let fit = |positions: &[usize], stream: &str| {
            let sweeps = TreeSweeps {
                columns: &columns,
                labels: &labels,
                positions,
                materials,
            };
            ExtraTrees::fit(sweeps, self.settings(), &mut seed.rng(stream))
        };
        progress("calibrating on an inner split …".into());
        let inner_forest = fit(&inner.fit, "inner trees");
        let scores = inner_forest.log_probabilities_at(&columns, &inner.held);
        let truth: Vec<usize> = inner.held.iter().map(|&at| labels[at]).collect();
        let inverse_temperature = fit_inverse_temperature(&scores, &truth);
        progress("fitting …".into());
        let all: Vec<usize> = (0..labels.len()).collect();
        let forest = fit(&all, "trees");
        let chosen = [("temperature".into(), 1.0 / inverse_temperature)];
        Ok(Fit {
            classifier: Box::new(TemperedTrees {
                forest,
                inverse_temperature,
            }),
            scaler,
            chosen: chosen.into(),
        })
    }

    fn load(&self, stored: &Stored<'_>) -> Result<Box<dyn FittedMethod>, PipelineError> {
        let arrays = Arrays::read(stored)?;
        let mut trees = Vec::with_capacity(arrays.sizes.len());
        let (mut nodes, mut counts) = (0, 0);
        for &size in &arrays.sizes {
            let mut tree = Vec::with_capacity(size);
            for at in 0..size {
                tree.push(arrays.node(nodes + at, size - at, &mut counts, stored.width)?);
            }
            nodes += size;
            trees.push(tree);
        }
        Ok(Box::new(TemperedTrees {
            forest: ExtraTrees {
                trees,
                materials: stored.materials,
            },
            inverse_temperature: stored.number("trees.inverse_temperature")?,
        }))
    }
}

/// Trees as arrays.
#[derive(Default)]
struct Arrays {
    /// Number of nodes of each tree.
    sizes: Vec<usize>,
    /// Feature of a split; number of materials of a leaf.
    features: Vec<usize>,
    thresholds: Vec<f32>,
    /// Number of nodes to the child for larger values; 0 for a leaf.
    right: Vec<usize>,
    /// Materials of all leaves.
    materials: Vec<usize>,
    /// Number of training sweeps of each of them.
    sweeps: Vec<usize>,
}

impl Arrays {
    fn of(forest: &ExtraTrees) -> Self {
        let mut arrays = Self::default();
        for tree in &forest.trees {
            arrays.sizes.push(tree.len());
            for node in tree {
                match node {
                    TreeNode::Split {
                        feature,
                        threshold,
                        right,
                    } => {
                        arrays.features.push(*feature);
                        arrays.thresholds.push(*threshold);
                        arrays.right.push(*right);
                    }
                    TreeNode::Leaf(counts) => {
                        arrays.features.push(counts.len());
                        arrays.thresholds.push(0.0);
                        arrays.right.push(0);
                        let materials = counts.iter().map(|count| count.material);
                        arrays.materials.extend(materials);
                        arrays
                            .sweeps
                            .extend(counts.iter().map(|count| count.sweeps));
                    }
                }
            }
        }
        arrays
    }

    fn read(stored: &Stored<'_>) -> Result<Self, PipelineError> {
        let weights = stored.weights;
        let arrays = Self {
            sizes: get_indices(weights, "trees.sizes")?,
            features: get_indices(weights, "trees.features")?,
            thresholds: get(weights, "trees.thresholds")?.values.clone(),
            right: get_indices(weights, "trees.right")?,
            materials: get_indices_below(weights, "trees.leaf_materials", stored.materials)?,
            sweeps: get_indices(weights, "trees.leaf_sweeps")?,
        };
        let nodes = arrays.sizes.iter().sum();
        of_length("trees.features", arrays.features.len(), nodes)?;
        of_length("trees.thresholds", arrays.thresholds.len(), nodes)?;
        of_length("trees.right", arrays.right.len(), nodes)?;
        let counts = arrays.materials.len();
        of_length("trees.leaf_sweeps", arrays.sweeps.len(), counts)?;
        match arrays.sizes.iter().find(|size| **size == 0) {
            Some(_) => Err(refused("trees.sizes", "at least one node", 0)),
            None => Ok(arrays),
        }
    }

    /// Returns a node.
    ///
    /// - `left`: number of nodes of the tree from this one on
    /// - `counts`: position among the materials of all leaves, which is moved
    /// - `width`: number of features
    fn node(
        &self,
        node: usize,
        left: usize,
        counts: &mut usize,
        width: usize,
    ) -> Result<TreeNode, PipelineError> {
        let (feature, right) = (self.features[node], self.right[node]);
        if right == 0 {
            let range = *counts..*counts + feature;
            let own = self
                .materials
                .get(range.clone())
                .zip(self.sweeps.get(range));
            let Some((materials, sweeps)) = own.filter(|(own, _)| !own.is_empty()) else {
                return Err(refused("trees.features", "materials of a leaf", feature));
            };
            *counts += feature;
            if sweeps.contains(&0) {
                return Err(refused("trees.leaf_sweeps", "numbers from 1", 0));
            }
            let pairs = materials.iter().zip(sweeps);
            let of = |(&material, &sweeps)| LeafCount { material, sweeps };
            return Ok(TreeNode::Leaf(pairs.map(of).collect()));
        }
        if feature >= width {
            return Err(refused("trees.features", "numbers of features", feature));
        }
        // Between the two children is at least the first of them.
        if right < 2 || right >= left {
            return Err(refused("trees.right", "nodes of the same tree", right));
        }
        Ok(TreeNode::Split {
            feature,
            threshold: self.thresholds[node],
            right,
        })
    }
}

fn refused(tensor: &str, expected: &str, found: usize) -> PipelineError {
    PipelineError::Model(ModelError::Weights {
        tensor: tensor.into(),
        expected: expected.into(),
        found: found.to_string(),
    })
}

impl FittedMethod for TemperedTrees {
    fn log_probabilities(&self, features: &Features) -> Vec<Vec<f64>> {
        let rows = self.forest.log_probabilities(features).into_iter();
        rows.map(|row| tempered(&row, self.inverse_temperature))
            .collect()
    }

    fn save(&self, weights: &mut Weights) {
        let arrays = Arrays::of(&self.forest);
        put_indices(weights, "trees.sizes", &arrays.sizes);
        put_indices(weights, "trees.features", &arrays.features);
        put(weights, "trees.thresholds", arrays.thresholds);
        put_indices(weights, "trees.right", &arrays.right);
        put_indices(weights, "trees.leaf_materials", &arrays.materials);
        put_indices(weights, "trees.leaf_sweeps", &arrays.sweeps);
        let inverse = [self.inverse_temperature];
        put_doubles(weights, "trees.inverse_temperature", &inverse);
    }
}
