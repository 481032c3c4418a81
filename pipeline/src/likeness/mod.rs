//! Comparison of sweeps with the training sweeps of a classifier: like them, or unlike, and what differs.
//!
//! ```text
//! sweep ─> Descriptor ─> Distances (to the nearest material) ─> ReferenceScores (p-values) ─> LikenessReport
//!                                                                       └─ unlike ─> Difference: what differs
//! ```
//!
//! The comparison needs neither labels nor a network. A sweep is described by level, spread and rate of change of every
//! taxel and by a coarse spectrum; its distance is that to the nearest material's mean, whitened with the covariance within
//! materials. Conditions such as the speed are left out. Distances of training sweeps that were held out say how large a distance may be, so that the p-values of
//! further sweeps of the same kind are uniform (conformal: Vovk et al., 2005).

mod constant_taxels;
mod dead;
mod descriptor;
mod difference;
mod directions;
mod distances;
mod moved;
mod reference;
mod report;
mod search;
mod tables;
#[cfg(test)]
mod tests;
mod text;

use std::collections::BTreeMap;

use tactnet_data::{Seed, SweepShape, SweepView, TrainSplit, shuffle};
use tactnet_models::{Features, NamedTensor, Weights};

use crate::PipelineError;
use constant_taxels::{ConstantTaxels, constant_taxels};
use descriptor::Descriptor;
use directions::KnownDirections;
use distances::{Distance, Distances};
use reference::{ReferenceScores, ReferenceSweep};

pub(crate) use tables::LikenessTables;

pub use difference::{Difference, Property, TaxelOrder};
pub use report::{LikenessReport, LikenessVerdict};

/// Minimum number of training sweeps.
const MIN_SWEEPS: usize = 20;
/// Number of parts of the training sweeps, each of which is compared with the others.
const PARTS: usize = 10;
/// Name of the tensor that marks a description of other sweeps than those whose scores it has.
const MOVED: &str = "moved";
/// Minimum number of recording blocks for a comparison of whole blocks.
const MIN_BLOCKS: usize = 3;

/// Description of the training sweeps of a classifier, and of how much sweeps that are held out differ from them.
pub struct Likeness {
    descriptor: Descriptor,
    distances: Distances,
    constant: ConstantTaxels,
    /// Scores of training sweeps against others of the same recording blocks.
    within: ReferenceScores,
    /// Scores of training sweeps against other recording blocks; `None` without several blocks.
    between: Option<ReferenceScores>,
    /// Tensors that [`Likeness::from_weights`] restores it from.
    weights: Weights,
}

impl Likeness {
    /// Describes the training sweeps; returns `None` if they are too few to compare others with them: fewer than 20, or
    /// fewer than two for the mean material.
    ///
    /// # Errors
    /// A covariance without eigenvalues.
    pub fn fit(train: &TrainSplit<'_>, seed: Seed) -> Result<Option<Self>, PipelineError> {
        let labels: Vec<usize> = train.labels().collect();
        let materials = train.sweeps_per_label().iter().filter(|n| **n > 0).count();
        if labels.len() < MIN_SWEEPS.max(2 * materials) {
            return Ok(None);
        }
        let dataset = train.dataset().without_conditions();
        let skin = train.of_same_sweeps(&dataset);
        let shape = skin.shape();
        let descriptor = Descriptor::new(shape, Descriptor::floor_of(&skin));
        let known = Known {
            descriptions: descriptor.of_view(&skin),
            labels,
            blocks: blocks_of(&skin),
            constant: constant_taxels(&skin),
        };
        let weights = known.to_weights(descriptor.floor(), seed)?;
        Self::from_weights(weights, shape)
            .map(Some)
            .map_err(|reason| PipelineError::incompatible("description", "sound tensors", reason))
    }

    /// Returns the tensors of the description, for a file.
    pub fn weights(&self) -> &Weights {
        &self.weights
    }

    /// Restores a description from the tensors of [`Likeness::weights`].
    ///
    /// - `shape`: shape of the training sweeps, without conditions
    ///
    /// # Errors
    /// A sentence about the first invalid tensor.
    pub fn from_weights(weights: Weights, shape: SweepShape) -> Result<Self, String> {
        let vector = |name: &str, len: usize| match weights.0.get(name) {
            Some(tensor) if tensor.values.len() == len => Ok(&tensor.values),
            Some(tensor) => Err(format!(
                "`{name}`: expected {len} values, found {}",
                tensor.values.len()
            )),
            None => Err(format!("no tensor `{name}`")),
        };
        let floor = f64::from(vector("floor", 1)?[0]);
        let descriptor = Descriptor::new(shape, floor);
        let descriptions = weights
            .0
            .get("descriptions")
            .ok_or("no tensor `descriptions`")?;
        let width = descriptor.width();
        if descriptions.values.is_empty() || descriptions.values.len() % width != 0 {
            return Err(format!("`descriptions`: expected rows of {width} values"));
        }
        let known = Features::new(width, descriptions.values.clone());
        let labels: Vec<usize> = vector("labels", known.len())?
            .iter()
            .map(|label| *label as usize)
            .collect();
        let taxels = shape.taxels();
        let flags = weights.0.get("constant").ok_or("no tensor `constant`")?;
        if flags.values.is_empty() || flags.values.len() % taxels != 0 {
            return Err(format!("`constant`: expected rows of {taxels} values"));
        }
        let flags = flags.values.chunks_exact(taxels);
        let flags = flags.map(|of| of.iter().map(|flag| *flag != 0.0).collect());
        let constant = ConstantTaxels::new(flags.collect());
        let fitted = Distances::fit(&known, &labels).map_err(|error| error.to_string())?;
        let directions = KnownDirections::new(&fitted, &known, &labels);
        let scores = |kind: &str| -> Result<Option<ReferenceScores>, String> {
            let name = |of: &str| format!("{kind}.{of}");
            let Some(distances) = weights.0.get(&name("distance")) else {
                return Ok(None);
            };
            let held_out = distances.values.len();
            let nearest = vector(&name("nearest"), held_out)?;
            let sweeps = vector(&name("sweep"), held_out)?;
            let units = vector(&name("unit"), held_out)?;
            if let Some(sweep) = sweeps
                .iter()
                .find(|sweep| **sweep as usize >= constant.sweeps())
            {
                return Err(format!("`{}`: no sweep {sweep}", name("sweep")));
            }
            if let Some(label) = nearest
                .iter()
                .find(|label| fitted.labels().binary_search(&(**label as usize)).is_err())
            {
                return Err(format!("`{}`: no material {label}", name("nearest")));
            }
            // Other recording blocks differ in a common direction, too, so directions say nothing about them.
            let has_directions = kind == "within"
                && constant.sweeps() == known.len()
                && !weights.0.contains_key(MOVED);
            let direction = |at: usize| match has_directions {
                true => directions.of(sweeps[at] as usize, nearest[at] as usize),
                false => Vec::new(),
            };
            let scores = (0..held_out).map(|at| ReferenceSweep {
                direction: direction(at),
                distance: Distance {
                    log: f64::from(distances.values[at]),
                    nearest: nearest[at] as usize,
                    stuck: constant.surprise_of_training(sweeps[at] as usize),
                },
                constant: constant.scores_of_training(sweeps[at] as usize),
                unit: units[at] as usize,
            });
            Ok(Some(ReferenceScores::new(scores.collect())))
        };
        let within = scores("within")?.ok_or("no tensor `within.distance`")?;
        let between = scores("between")?;
        Ok(Self {
            within,
            between,
            distances: fitted,
            constant,
            descriptor,
            weights,
        })
    }

    /// Compares sweeps with the training sweeps.
    ///
    /// - `seed`: seed of the resampling behind the p-value of all sweeps together
    ///
    /// # Panics
    /// If the sweeps have another number of taxels than the training sweeps, or there are none.
    pub fn assess(&self, view: &SweepView<'_>, seed: Seed) -> LikenessReport {
        let dataset = view.dataset().without_conditions();
        LikenessReport::of(self, &view.of_same_sweeps(&dataset), seed)
    }

    /// Returns the description with another material, of whose sweeps those that are held out in turn are compared with the
    /// others.
    ///
    /// - `label`: label of the new material, in the order of the classifier
    ///
    /// # Errors
    /// A covariance without eigenvalues.
    pub fn extended(&self, sweeps: &SweepView<'_>, label: usize) -> Result<Self, PipelineError> {
        let values = |name: &str| match self.weights.0.get(name) {
            Some(tensor) => tensor.values.clone(),
            None => Vec::new(),
        };
        let dataset = sweeps.dataset().without_conditions();
        let sweeps = &sweeps.of_same_sweeps(&dataset);
        let new = self.descriptor.of_view(sweeps);
        let known = Features::new(new.width(), values("descriptions"));
        let mut labels = values("labels");
        let scores = self.scores_of_new(&known, &labels, &new, label)?;
        let unit = values("within.unit").into_iter().fold(0.0, f32::max) + 1.0;
        labels.extend(vec![label as f32; new.len()]);
        let constant = flags(&constant_taxels(sweeps));
        let constant = [values("constant"), constant.values].concat();
        let mut weights = self.weights.clone();
        let mut set = |name: &str, tensor| weights.0.insert(name.into(), tensor);
        set("constant", vector(constant));
        set("labels", vector(labels));
        set("descriptions", matrix(&joined(&known, &new)));
        let mut extend = |name: &str, own: Vec<f32>| {
            set(name, vector([values(name), own].concat()));
        };
        let of = |value: &dyn Fn(&(usize, Distance)) -> f32| scores.iter().map(value).collect();
        extend("within.distance", of(&|(_, of)| of.log as f32));
        extend("within.nearest", of(&|(_, of)| of.nearest as f32));
        extend(
            "within.sweep",
            of(&|(at, _)| (self.constant.sweeps() + at) as f32),
        );
        extend("within.unit", of(&|_| unit));
        Self::from_weights(weights, self.descriptor.shape())
            .map_err(|reason| PipelineError::incompatible("description", "sound tensors", reason))
    }

    /// Returns the distances of the sweeps of a new material, each from the known sweeps and the other new ones, with the
    /// position of the sweep; nothing for a single sweep.
    fn scores_of_new(
        &self,
        known: &Features,
        labels: &[f32],
        new: &Features,
        label: usize,
    ) -> Result<Vec<(usize, Distance)>, PipelineError> {
        let mut scores = Vec::new();
        for part in 0..PARTS.min(new.len()) {
            let (own, others): (Vec<usize>, Vec<usize>) =
                (0..new.len()).partition(|at| at % PARTS == part);
            if others.is_empty() {
                break;
            }
            let mut others_labels: Vec<usize> = labels.iter().map(|of| *of as usize).collect();
            others_labels.extend(vec![label; others.len()]);
            let distances = Distances::fit(&joined(known, &new.select(&others)), &others_labels)?;
            let own_distances = distances.of(&new.select(&own));
            scores.extend(own.into_iter().zip(own_distances));
        }
        Ok(scores)
    }

    /// Returns the distance of every sweep.
    fn distances_of(&self, descriptions: &Features, constant: &[Vec<bool>]) -> Vec<Distance> {
        let mut distances = self.distances.of(descriptions);
        for (distance, constant) in distances.iter_mut().zip(constant) {
            distance.stuck = self.constant.surprise(constant);
        }
        distances
    }
}

/// Training sweeps as they are described.
struct Known {
    descriptions: Features,
    labels: Vec<usize>,
    /// Recording block of every sweep; `None` if a sweep has none.
    blocks: Option<Vec<u32>>,
    /// True for the taxels that do not change: `[sweeps][taxels]`.
    constant: Vec<Vec<bool>>,
}

impl Known {
    /// Returns the tensors of a description, with the scores of the sweeps that are held out in turn.
    fn to_weights(&self, floor: f64, seed: Seed) -> Result<Weights, PipelineError> {
        let labels = self.labels.iter().map(|label| *label as f32).collect();
        let mut tensors = BTreeMap::from([
            ("descriptions".to_string(), matrix(&self.descriptions)),
            ("labels".into(), vector(labels)),
            ("constant".into(), flags(&self.constant)),
            ("floor".into(), vector(vec![floor as f32])),
        ]);
        let units = self.units();
        for (kind, parts) in [
            ("within", Some(self.random_parts(seed))),
            ("between", self.block_parts(seed)),
        ] {
            let Some(parts) = parts else { continue };
            let held_out = self.held_out(&parts)?;
            if held_out.len() < MIN_SWEEPS {
                continue;
            }
            let mut add = |name: &str, value: &dyn Fn(usize, &Distance) -> f32| {
                let values = held_out.iter().map(|(sweep, of)| value(*sweep, of));
                tensors.insert(format!("{kind}.{name}"), vector(values.collect()));
            };
            add("distance", &|_, of| of.log as f32);
            add("nearest", &|_, of| of.nearest as f32);
            add("sweep", &|sweep, _| sweep as f32);
            add("unit", &|sweep, _| units[sweep] as f32);
        }
        Ok(Weights(tensors))
    }

    /// Returns the distances of the sweeps of every part from the other parts, by sweep. Sweeps whose material the other
    /// parts lack are left out.
    fn held_out(&self, parts: &[usize]) -> Result<Vec<(usize, Distance)>, PipelineError> {
        let mut found = Vec::with_capacity(self.labels.len());
        for part in 0..PARTS {
            let (own, others): (Vec<usize>, Vec<usize>) =
                (0..self.labels.len()).partition(|sweep| parts[*sweep] == part);
            let labels: Vec<usize> = others.iter().map(|at| self.labels[*at]).collect();
            let own: Vec<usize> = own
                .into_iter()
                .filter(|sweep| labels.contains(&self.labels[*sweep]))
                .collect();
            if own.is_empty() {
                continue;
            }
            let distances = Distances::fit(&self.descriptions.select(&others), &labels)?;
            let own_distances = distances.of(&self.descriptions.select(&own));
            found.extend(own.into_iter().zip(own_distances));
        }
        found.sort_unstable_by_key(|(sweep, _)| *sweep);
        Ok(found)
    }

    /// Returns a random part for every sweep, with equal shares of every material.
    fn random_parts(&self, seed: Seed) -> Vec<usize> {
        let mut rng = seed.rng("likeness, parts");
        let mut order: Vec<usize> = (0..self.labels.len()).collect();
        shuffle(&mut order, &mut rng);
        let mut parts = vec![0; order.len()];
        let mut met: BTreeMap<usize, usize> = BTreeMap::new();
        for sweep in order {
            // Materials start at different parts, so that the parts are of equal size.
            let next = met.entry(self.labels[sweep]).or_insert(self.labels[sweep]);
            parts[sweep] = *next % PARTS;
            *next += 1;
        }
        parts
    }

    /// Returns a part for every sweep, the same for all sweeps of a block; `None` with too few blocks.
    fn block_parts(&self, seed: Seed) -> Option<Vec<usize>> {
        let blocks = self.blocks.as_ref()?;
        let mut numbers = blocks.clone();
        numbers.sort_unstable();
        numbers.dedup();
        if numbers.len() < MIN_BLOCKS {
            return None;
        }
        shuffle(&mut numbers, &mut seed.rng("likeness, blocks"));
        let part: BTreeMap<u32, usize> = numbers.into_iter().zip((0..PARTS).cycle()).collect();
        Some(blocks.iter().map(|block| part[block]).collect())
    }

    /// Returns the unit of every sweep that is resampled as a whole: its material in its block, or the sweep itself
    /// without blocks.
    fn units(&self) -> Vec<usize> {
        let Some(blocks) = &self.blocks else {
            return (0..self.labels.len()).collect();
        };
        let mut numbers = BTreeMap::new();
        let pairs = blocks.iter().zip(&self.labels);
        pairs
            .map(|pair| {
                let next = numbers.len();
                *numbers.entry(pair).or_insert(next)
            })
            .collect()
    }
}

fn vector(values: Vec<f32>) -> NamedTensor {
    NamedTensor {
        shape: vec![values.len()],
        values,
    }
}

fn matrix(features: &Features) -> NamedTensor {
    NamedTensor {
        shape: vec![features.len(), features.width()],
        values: features.values().to_vec(),
    }
}

fn flags(rows: &[Vec<bool>]) -> NamedTensor {
    let values = rows.iter().flatten();
    vector(values.map(|flag| f32::from(u8::from(*flag))).collect())
}

/// Returns the rows of both.
fn joined(first: &Features, second: &Features) -> Features {
    Features::new(first.width(), [first.values(), second.values()].concat())
}

/// Returns the recording block of every sweep; `None` if a sweep has none.
fn blocks_of(view: &SweepView<'_>) -> Option<Vec<u32>> {
    let records = view.dataset().records();
    let blocks = view.indices().iter().map(|index| records[*index].block);
    blocks.collect()
}
