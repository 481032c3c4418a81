//! Selection of prior strengths and shrinkage on n-shot tasks of known materials, with held-out sweeps.

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

/// Number of tasks on which each setting is evaluated.
const TASKS: usize = 12;
/// Candidate strengths s of the penalty `s |w - m|^2`.
const STRENGTHS: [f64; 9] = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 10.0, 100.0, 300.0];
/// Candidate strengths on whitened features.
const WHITENED_STRENGTHS: [f64; 7] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];
/// Candidate shares of the mean variance in a shrunk covariance.
const SHRINKAGES: [f64; 5] = [0.003, 0.01, 0.03, 0.1, 0.3];

/// Shrinkage and strength if there are too few sweeps for a selection.
const UNTRIED: (f64, f64) = (0.1, 0.1);

/// The selected shrinkage, and the selected priors for each evaluated number of shots.
pub(super) struct Tuned {
    shrinkage: f64,
    plain: BTreeMap<usize, WeightPrior>,
    whitened: BTreeMap<usize, WeightPrior>,
}

impl Tuned {
    /// Returns the prior on plain features for the closest evaluated number of shots.
    pub(super) fn plain(&self, shots: usize) -> &WeightPrior {
        closest(&self.plain, shots)
    }

    /// Returns the prior on whitened features for the closest evaluated number of shots.
    pub(super) fn whitened(&self, shots: usize) -> &WeightPrior {
        closest(&self.whitened, shots)
    }

    /// Returns all selected settings by name.
    pub(super) fn chosen(&self) -> BTreeMap<String, f64> {
        let mut chosen: BTreeMap<String, f64> =
            [("whitening.shrinkage".into(), self.shrinkage)].into();
        for (name, values) in [("tuned-ol", &self.plain), ("whitened-ol", &self.whitened)] {
            for (shots, prior) in values {
                chosen.insert(format!("{name}.strength, {shots} shots"), prior.strength);
            }
        }
        chosen
    }
}

/// Returns a prior of an output layer on plain features: the mean of the known materials and free biases.
fn plain_prior(knowledge: &WeightPrior, strength: f64) -> WeightPrior {
    WeightPrior {
        strength,
        ..knowledge.clone()
    }
}

/// Returns a prior of an output layer on whitened features.
fn whitened_prior(width: usize, strength: f64) -> WeightPrior {
    WeightPrior {
        mean: vec![0.0; width + 1],
        strength,
        bias_scale: 1.0,
    }
}

/// Returns the middle index of the best values; easy tasks give equal accuracies.
fn middle_of_best(values: &[f64]) -> usize {
    let most = values[argmax(values)];
    let best: Vec<usize> = (0..values.len())
        .filter(|i| values[*i] >= most - 1e-12)
        .collect();
    best[best.len() / 2]
}

fn closest(values: &BTreeMap<usize, WeightPrior>, shots: usize) -> &WeightPrior {
    let found = values
        .range(..=shots)
        .next_back()
        .or_else(|| values.first_key_value());
    found
        .unwrap_or_else(|| panic!("at least one number of shots was tried"))
        .1
}

/// A task of known materials: rows for training and for evaluation, with labels from 0.
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

/// Fits the whitening to the training sweeps and selects settings on held-out sweeps of the known materials.
///
/// - `knowledge`: prior of the known materials, of which only the strength is selected
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
        // There are too few sweeps for a selection.
        let whitening = Whitening::fit(&seen.hidden, &seen.labels, known, UNTRIED.0)?;
        let tuned = Tuned {
            shrinkage: UNTRIED.0,
            plain: [(1, plain_prior(knowledge, UNTRIED.1))].into(),
            whitened: [(1, whitened_prior(seen.hidden.width(), UNTRIED.1))].into(),
        };
        return Ok((whitening, tuned));
    }
    let trials = |shots: usize| -> Vec<Trial> {
        let mut rng = context.seed.rng(("tuning", context.part.stream(), shots));
        (0..TASKS)
            .map(|_| Trial::draw(&of_label, materials, shots, &mut rng))
            .collect()
    };
    let first = trials(shots[0]);
    let (shrinkage, whitening, features) =
        select_whitening(seen, unseen, known, materials, &first)?;
    let mut tuned = Tuned {
        shrinkage,
        plain: BTreeMap::new(),
        whitened: BTreeMap::new(),
    };
    for &shots in &shots {
        let trials = trials(shots);
        let plain = STRENGTHS.map(|strength| plain_prior(knowledge, strength));
        let prior = best_prior(&trials, &unseen.hidden, materials, &plain)?;
        tuned.plain.insert(shots, prior);
        let width = features.width();
        let whitened = WHITENED_STRENGTHS.map(|strength| whitened_prior(width, strength));
        let prior = best_prior(&trials, &features, materials, &whitened)?;
        tuned.whitened.insert(shots, prior);
    }
    Ok((whitening, tuned))
}

/// Selects the shrinkage by nearest class means with the fewest shots, where it matters most. Returns it with the
/// whitening and the whitened features of `unseen`.
///
/// - `known`: number of known materials
/// - `materials`: number of materials of each trial
fn select_whitening(
    seen: &Embedding,
    unseen: &Embedding,
    known: usize,
    materials: usize,
    trials: &[Trial],
) -> Result<(f64, Whitening, Features), ModelError> {
    let mut candidates = Vec::new();
    for shrinkage in SHRINKAGES {
        let whitening = Whitening::fit(&seen.hidden, &seen.labels, known, shrinkage)?;
        let features = whitening.apply(&unseen.hidden);
        let accuracy: f64 = trials
            .iter()
            .map(|trial| {
                let support = features.select(&trial.support);
                let head = NearestMean::fit(&support, &trial.support_labels, materials);
                trial.accuracy(&head.scores(&features.select(&trial.queries)))
            })
            .sum();
        candidates.push((accuracy, (shrinkage, whitening, features)));
    }
    let accuracies: Vec<f64> = candidates.iter().map(|candidate| candidate.0).collect();
    Ok(candidates.swap_remove(middle_of_best(&accuracies)).1)
}

/// Returns the prior with the highest accuracy on the trials' queries.
fn best_prior(
    trials: &[Trial],
    features: &Features,
    materials: usize,
    priors: &[WeightPrior],
) -> Result<WeightPrior, ModelError> {
    let mut totals = Vec::new();
    for prior in priors {
        let accuracies: Vec<f64> = trials
            .par_iter()
            .map(|trial| trial.linear(features, materials, prior))
            .collect::<Result<_, _>>()?;
        totals.push(accuracies.iter().sum());
    }
    Ok(priors[middle_of_best(&totals)].clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactnet_data::Seed;

    #[test]
    fn the_prior_that_is_applied_is_one_that_was_tried() {
        let knowledge = WeightPrior {
            mean: vec![0.5, -0.5, 0.25],
            strength: 7.0,
            bias_scale: 30.0,
        };
        // Two materials around (1, 0) and (0, 1).
        let rows: Vec<f32> = (0..40)
            .flat_map(|i| {
                let noise = 0.01 * i as f32;
                if i % 2 == 0 {
                    [1.0 - noise, noise]
                } else {
                    [noise, 1.0 - noise]
                }
            })
            .collect();
        let features = Features::new(2, rows);
        let labels: Vec<usize> = (0..40).map(|i| i % 2).collect();
        let trials: Vec<Trial> = (0..3)
            .map(|draw| {
                let mut rng = Seed(1).rng(("trial", draw));
                Trial::draw(&rows_of_label(&labels), 2, 3, &mut rng)
            })
            .collect();
        let tried = STRENGTHS.map(|strength| plain_prior(&knowledge, strength));
        let best = best_prior(&trials, &features, 2, &tried).unwrap();
        let tuned = Tuned {
            shrinkage: 0.1,
            plain: [(3, best)].into(),
            whitened: [(3, whitened_prior(2, 1.0))].into(),
        };
        for shots in [1, 3, 50] {
            let applied = tuned.plain(shots);
            assert!(tried.contains(applied), "{applied:?}");
            assert_eq!((&applied.mean, applied.bias_scale), (&knowledge.mean, 30.0));
        }
        assert_eq!(
            tuned.chosen()["tuned-ol.strength, 3 shots"],
            tuned.plain(3).strength
        );
    }

    /// Returns 20 noisy sweeps of each of four materials.
    ///
    /// - `apart`: distance of a material from the others, on an axis of its own
    fn embedding(seed: u64, apart: f32) -> Embedding {
        let mut rng = Seed(seed).rng("noise");
        let labels: Vec<usize> = (0..80).map(|i| i % 4).collect();
        let rows = labels.iter().flat_map(|&label| {
            (0..4)
                .map(|k| if k == label { apart } else { 0.0 } + noise(&mut rng))
                .collect::<Vec<f32>>()
        });
        Embedding {
            convolution: Features::new(1, vec![0.0; 80]),
            hidden: Features::new(4, rows.collect()),
            logits: Features::new(1, vec![0.0; 80]),
            labels,
        }
    }

    /// The selection only depends on the held-out sweeps, not on the training sweeps.
    #[test]
    fn strengths_are_chosen_on_sweeps_that_the_network_was_not_trained_on() {
        let twin = tactnet_data::twin::small(2, 1, 1).unwrap();
        let recipe = tactnet_pipeline::ModelRecipe::load("fast").unwrap();
        let folder = tempfile::tempdir().unwrap();
        let context = StudyContext {
            dataset: &twin,
            data: "twin",
            model: &recipe,
            device: &tactnet_models::Compute::Cpu.open().unwrap(),
            seed: Seed(1),
            part: crate::Part::Draw(0),
            networks: &crate::networks::FinishedNetworks::of_task(folder.path()),
            on_progress: &|_, _| true,
        };
        let task: Nshot =
            serde_json::from_str(r#"{"shots": [1, 3, 5], "new_materials": 4}"#).unwrap();
        let knowledge = WeightPrior {
            mean: vec![0.0; 5],
            strength: 1.0,
            bias_scale: 30.0,
        };
        let chosen = |seen: &Embedding, unseen: &Embedding| {
            let (_, tuned) = tune(&task, &context, seen, unseen, &knowledge)
                .unwrap_or_else(|_| panic!("there are sweeps to choose on"));
            let plain = tuned.chosen().into_iter();
            plain
                .filter(|(name, _)| name.starts_with("tuned-ol"))
                .map(|(_, strength)| strength)
                .collect::<Vec<_>>()
        };
        let unseen = embedding(1, 1.5);
        let all: Vec<Vec<f64>> = (2..6)
            .map(|seed| chosen(&embedding(seed, 0.0), &unseen))
            .collect();
        assert!(all.iter().all(|found| *found == all[0]), "{all:?}");
        let others: Vec<Vec<f64>> = (2..6)
            .map(|seed| chosen(&embedding(2, 0.0), &embedding(seed, 0.7)))
            .collect();
        assert!(others.iter().any(|found| *found != others[0]), "{others:?}");
    }

    fn noise(rng: &mut ChaCha8Rng) -> f32 {
        rand::RngExt::random_range(rng, -1.0..1.0)
    }
}
