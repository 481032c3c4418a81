//! Choosing prior strengths and shrinkage on known materials alone: n-shot tasks among sweeps that the network was not trained on.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tactnet_data::shuffle;
use tactnet_models::{
    Features, LinearHead, ModelError, NearestMean, WeightPrior, Whitening, argmax,
};
use tactnet_pipeline::Embedding;

use super::Nshot;
use crate::context::{Cancelled, StudyContext};
use crate::pairs::rows_of_label;

/// Tasks that every setting is tried on.
const TASKS: usize = 12;
/// Strengths s of the penalty `s |w - m|^2`.
const STRENGTHS: [f64; 9] = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 10.0, 100.0, 300.0];
/// The same on whitened features, whose scale is another.
const WHITENED_STRENGTHS: [f64; 7] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];
/// Shares of the mean variance in a shrunk covariance.
const SHRINKAGES: [f64; 5] = [0.003, 0.01, 0.03, 0.1, 0.3];

/// Shrinkage and strengths where there are too few sweeps to choose.
const UNTRIED: (f64, f64) = (0.1, 0.1);

/// What was chosen, for each number of shots that could be tried.
pub(super) struct Tuned {
    shrinkage: f64,
    plain: BTreeMap<usize, f64>,
    whitened: BTreeMap<usize, f64>,
}

impl Tuned {
    /// Strength on plain features, from the closest number of shots that was tried.
    pub(super) fn plain(&self, shots: usize) -> f64 {
        closest(&self.plain, shots)
    }

    /// Strength on whitened features.
    pub(super) fn whitened(&self, shots: usize) -> f64 {
        closest(&self.whitened, shots)
    }

    /// Everything by name.
    pub(super) fn chosen(&self) -> BTreeMap<String, f64> {
        let mut chosen: BTreeMap<String, f64> =
            [("whitening.shrinkage".into(), self.shrinkage)].into();
        for (name, values) in [("tuned-ol", &self.plain), ("whitened-ol", &self.whitened)] {
            for (shots, strength) in values {
                chosen.insert(format!("{name}.strength, {shots} shots"), *strength);
            }
        }
        chosen
    }
}

/// A prior for every strength.
type PriorOfStrength<'a> = &'a dyn Fn(f64) -> WeightPrior;

/// The prior of an output layer on plain features, in tuning and in use: the known materials' mean and free biases.
pub(super) fn plain_prior(knowledge: &WeightPrior, strength: f64) -> WeightPrior {
    WeightPrior {
        strength,
        ..knowledge.clone()
    }
}

/// The prior of an output layer on whitened features, in tuning and in use.
pub(super) fn whitened_prior(width: usize, strength: f64) -> WeightPrior {
    WeightPrior {
        mean: vec![0.0; width + 1],
        strength,
        bias_scale: 1.0,
    }
}

/// The middle one of those that are best: accuracies tie where a task is easy.
fn middle_of_best(values: &[f64]) -> usize {
    let most = values[argmax(values)];
    let best: Vec<usize> = (0..values.len())
        .filter(|i| values[*i] >= most - 1e-12)
        .collect();
    best[best.len() / 2]
}

fn closest(values: &BTreeMap<usize, f64>, shots: usize) -> f64 {
    let found = values
        .range(..=shots)
        .next_back()
        .or_else(|| values.first_key_value());
    *found
        .unwrap_or_else(|| panic!("at least one number of shots was tried"))
        .1
}

/// A task among known materials: rows to learn from and rows to be judged by, with labels from 0.
struct Trial {
    support: Vec<usize>,
    support_labels: Vec<usize>,
    queries: Vec<usize>,
    query_labels: Vec<usize>,
}

impl Trial {
    fn draw(of_label: &[Vec<usize>], materials: usize, shots: usize, rng: &mut ChaCha8Rng) -> Self {
        let mut order: Vec<usize> = (0..of_label.len()).collect();
        shuffle(&mut order, rng);
        let mut trial = Self {
            support: vec![],
            support_labels: vec![],
            queries: vec![],
            query_labels: vec![],
        };
        for (label, material) in order.into_iter().take(materials).enumerate() {
            let mut rows = of_label[material].clone();
            shuffle(&mut rows, rng);
            for (position, row) in rows.into_iter().enumerate() {
                let (to, labels) = if position < shots {
                    (&mut trial.support, &mut trial.support_labels)
                } else {
                    (&mut trial.queries, &mut trial.query_labels)
                };
                to.push(row);
                labels.push(label);
            }
        }
        trial
    }

    fn accuracy(&self, scores: &[Vec<f64>]) -> f64 {
        let right = scores
            .iter()
            .zip(&self.query_labels)
            .filter(|(row, label)| argmax(row) == **label);
        right.count() as f64 / self.query_labels.len() as f64
    }

    fn linear(
        &self,
        features: &Features,
        materials: usize,
        prior: &WeightPrior,
    ) -> Result<f64, ModelError> {
        let support = features.select(&self.support);
        let head = LinearHead::fit(&support, &self.support_labels, materials, prior)?;
        Ok(self.accuracy(&head.log_probabilities(&features.select(&self.queries))))
    }
}

/// Fits the whitening to the sweeps that the network was trained on, and chooses on known materials' other sweeps.
///
/// - `knowledge`: the prior that the known materials give, of which only the strength is chosen
pub(super) fn tune(
    task: &Nshot,
    context: &StudyContext<'_>,
    seen: &Embedding,
    unseen: &Embedding,
    knowledge: &WeightPrior,
) -> Result<(Whitening, Tuned), Cancelled> {
    let known = seen.labels.iter().max().map_or(0, |label| label + 1);
    let of_label = rows_of_label(&unseen.labels);
    let fewest = of_label.iter().map(Vec::len).min().unwrap_or(0);
    let materials = task.new_materials.min(known);
    let mut shots: Vec<usize> = task
        .shots
        .iter()
        .copied()
        .filter(|n| 2 * n <= fewest)
        .collect();
    shots.sort_unstable();
    if shots.is_empty() {
        // Too few sweeps to try anything on.
        let whitening = Whitening::fit(&seen.hidden, &seen.labels, known, UNTRIED.0)?;
        let tuned = Tuned {
            shrinkage: UNTRIED.0,
            plain: [(1, UNTRIED.1)].into(),
            whitened: [(1, UNTRIED.1)].into(),
        };
        return Ok((whitening, tuned));
    }
    let trials = |shots: usize| -> Vec<Trial> {
        let mut rng = context.seed.rng(("tuning", context.part.stream(), shots));
        (0..TASKS)
            .map(|_| Trial::draw(&of_label, materials, shots, &mut rng))
            .collect()
    };
    // Shrinkage by nearest class means with the fewest shots, where it matters most.
    let first = trials(shots[0]);
    let mut candidates = Vec::new();
    for shrinkage in SHRINKAGES {
        let whitening = Whitening::fit(&seen.hidden, &seen.labels, known, shrinkage)?;
        let features = whitening.apply(&unseen.hidden);
        let accuracy: f64 = first
            .iter()
            .map(|trial| {
                let head = NearestMean::fit(
                    &features.select(&trial.support),
                    &trial.support_labels,
                    materials,
                );
                trial.accuracy(&head.scores(&features.select(&trial.queries)))
            })
            .sum();
        candidates.push((accuracy, shrinkage, whitening, features));
    }
    let accuracies: Vec<f64> = candidates.iter().map(|candidate| candidate.0).collect();
    let (_, shrinkage, whitening, features) = candidates.swap_remove(middle_of_best(&accuracies));
    let mut tuned = Tuned {
        shrinkage,
        plain: BTreeMap::new(),
        whitened: BTreeMap::new(),
    };
    for &shots in &shots {
        let trials = trials(shots);
        let heads: [(&Features, &[f64], PriorOfStrength<'_>, _); 2] = [
            (
                &unseen.hidden,
                &STRENGTHS,
                &|strength| plain_prior(knowledge, strength),
                &mut tuned.plain,
            ),
            (
                &features,
                &WHITENED_STRENGTHS,
                &|strength| whitened_prior(features.width(), strength),
                &mut tuned.whitened,
            ),
        ];
        for (features, strengths, prior, chosen) in heads {
            let mut totals = Vec::new();
            for &strength in strengths {
                let prior = prior(strength);
                let accuracies: Vec<f64> = trials
                    .par_iter()
                    .map(|trial| trial.linear(features, materials, &prior))
                    .collect::<Result<_, _>>()?;
                totals.push(accuracies.iter().sum());
            }
            chosen.insert(shots, strengths[middle_of_best(&totals)]);
        }
    }
    Ok((whitening, tuned))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strengths_are_chosen_with_the_prior_that_is_applied() {
        let knowledge = WeightPrior {
            mean: vec![0.5, -0.5, 0.25],
            strength: 7.0,
            bias_scale: 30.0,
        };
        let prior = plain_prior(&knowledge, 0.3);
        assert_eq!((prior.strength, prior.bias_scale), (0.3, 30.0));
        assert_eq!(prior.mean, knowledge.mean);
        // Tuning and use both ask these two functions; no prior is made elsewhere.
        let sources = [include_str!("tuning.rs"), include_str!("../nshot.rs")];
        let made = |source: &str| {
            let code = source.split("#[cfg(test)]").next().unwrap_or_default();
            code.matches("WeightPrior {\n").count() - code.matches("-> WeightPrior {\n").count()
        };
        assert_eq!(sources.map(made), [2, 0]);
    }
}
