//! n-shot transfer: a network learns 30 materials well and six new ones from a few sweeps each (thesis, section 4.6.4).
//!
//! ```text
//! materials ─┬─ 30 known ─┬─ 80 % of their sweeps: train the network, covariance, prior
//!            │            └─ 20 %: choose what has to be chosen
//!            └─ 6 new ──── five folds: n sweeps of each material of 80 %, judged on 20 %
//! ```

use rayon::prelude::*;
use tactnet_data::{Fold, MaterialSplit, Scheme, Seed, SweepView};
use tactnet_models::{
    DenseWeights, Features, LinearHead, NearestMean, SimpleShot, WeightPrior, Whitening, argmax,
};
use tactnet_pipeline::{Classifier, Embedding, MlpTraining, Recipe, fit_embedding, fit_labels};

use super::knowledge::{embedded, trained};
use super::pairs::random_pairs;
use super::tuning::{Tuned, plain_prior, tune, whitened_prior};
use super::{Answer, Cancelled, Measurement, StudyContext, StudyTask, TransferMethod};

/// Folds of the new materials' sweeps.
const FOLDS: usize = 5;
/// Steps of the optimiser, about, when the dense layer is tuned to few sweeps.
const FINE_TUNING_STEPS: usize = 150;
/// Steps of the optimiser, about, when a whole network learns few sweeps; one epoch of a single batch is one step.
const SCRATCH_STEPS: usize = 300;
/// Pairs that the Siamese embedding is trained on.
const PAIRS: usize = 20_000;

/// What the knowledge set gives to every method.
struct Knowledge {
    classifier: Classifier,
    prior: WeightPrior,
    centre: Vec<f64>,
    whitening: Whitening,
    tuned: Tuned,
    siamese: Option<Vec<DenseWeights>>,
}

pub(super) fn transfer(task: &StudyTask, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let split = MaterialSplit::draw(
        context.dataset,
        task.new_materials,
        context.seed,
        task.number,
    )?;
    let knowledge = learn(task, context, &split)?;
    let everything = SweepView::all(&split.new);
    let whole = embedded(&knowledge.classifier, &everything)?;
    // Draws deal folds and shots of their own, which all methods share.
    let own = context.seed_for("folds of new materials", task.number);
    let folds: Vec<Fold<'_>> = (0..FOLDS)
        .map(|fold| Fold::new(&split.new, Scheme::default(), own, 0, fold))
        .collect::<Result<_, _>>()?;
    let mut measurements = Vec::new();
    let materials = split.new.labels().len();
    for &shots in &task.shots {
        // A data set with fewer sweeps has fewer points on its curve.
        let Ok(few) = folds
            .iter()
            .map(|fold| fold.shots(shots))
            .collect::<Result<Vec<_>, _>>()
        else {
            continue;
        };
        for &method in &task.methods {
            context.say(&format!("{} with {shots} shots", method.name()))?;
            let own: &[Fold<'_>] = match method {
                // Another fold in every draw.
                TransferMethod::Nk => {
                    &rotated(&few, task.number)[..task.scratch_folds.clamp(1, FOLDS)]
                }
                _ => &few,
            };
            let mut right = 0;
            let mut decisions = 0;
            let answers: Vec<Result<Vec<usize>, Cancelled>> = if method == TransferMethod::Nk {
                own.iter()
                    .map(|fold| from_scratch(task, context, fold))
                    .collect()
            } else {
                let recipe = context.recipe;
                let seeds: Vec<Seed> = (0..FOLDS)
                    .map(|fold| context.seed_for("fine-tuning", task.number * FOLDS + fold))
                    .collect();
                own.par_iter()
                    .map(|fold| {
                        let support = whole.part(&everything, &fold.train);
                        let queries = whole.part(&everything, &fold.test);
                        let few = FewShots {
                            knowledge: &knowledge,
                            recipe,
                            support: &support,
                            materials,
                            shots,
                        };
                        few.answers(method, &queries, seeds[fold.fold()])
                    })
                    .collect()
            };
            for (fold, answers) in own.iter().zip(answers) {
                let answers = answers?;
                right += fold
                    .test
                    .labels()
                    .zip(&answers)
                    .filter(|(label, answer)| label == *answer)
                    .count();
                decisions += answers.len();
            }
            let value = right as f64 / decisions as f64;
            measurements
                .push(Measurement::new("accuracy", method.name(), value, decisions).shots(shots));
        }
    }
    let names: Vec<&str> = split.new.labels().names().collect();
    Ok(Answer {
        measurements,
        split: format!("new materials: {}", names.join(", ")),
        split_content: format!("{:?} {}", split.new_labels, folds[0].manifest().sha256),
        chosen: knowledge.tuned.chosen(),
    })
}

/// The folds from another one on.
fn rotated<'a>(folds: &[Fold<'a>], by: usize) -> Vec<Fold<'a>> {
    let mut folds = folds.to_vec();
    let by = by % folds.len();
    folds.rotate_left(by);
    folds
}

/// Trains the network on the known materials and derives what the methods need.
fn learn(
    task: &StudyTask,
    context: &StudyContext<'_>,
    split: &MaterialSplit,
) -> Result<Knowledge, Cancelled> {
    let fold = Fold::new(&split.known, Scheme::default(), context.seed, 0, 0)?;
    let seed = context.seed_for("knowledge network", task.number);
    let classifier = trained(context, "network of the known materials", &fold.train, seed)?;
    context.say("embedding")?;
    let seen = embedded(&classifier, &fold.train)?;
    let unseen = embedded(&classifier, &fold.test)?;
    let width = seen.hidden.width();
    let mut centre = vec![0.0; width];
    for row in seen.hidden.rows() {
        centre
            .iter_mut()
            .zip(row)
            .for_each(|(sum, v)| *sum += f64::from(*v) / seen.len() as f64);
    }
    context.say("whitening, prior strengths")?;
    let prior = WeightPrior::of_knowledge(&classifier.network()?.output_layer());
    let (whitening, tuned) = tune(task, context, &seen, &unseen, &prior)?;
    let siamese = if task.methods.contains(&TransferMethod::Siamese) {
        context.say("Siamese embedding")?;
        Some(siamese_layers(context, &classifier, &seen, task.number)?)
    } else {
        None
    };
    Ok(Knowledge {
        prior,
        centre,
        whitening,
        tuned,
        siamese,
        classifier,
    })
}

/// The dense layer, trained further so that sweeps of one known material come close and others keep away. The margin is the mean
/// distance between materials before.
fn siamese_layers(
    context: &StudyContext<'_>,
    classifier: &Classifier,
    seen: &Embedding,
    number: usize,
) -> Result<Vec<DenseWeights>, Cancelled> {
    let seed = context.seed_for("siamese", number);
    let pairs = random_pairs(&seen.labels, PAIRS, &mut seed.rng("pairs"));
    let apart: Vec<f64> = pairs
        .iter()
        .filter(|pair| pair.different)
        .take(2000)
        .map(|pair| {
            squared_distance(seen.hidden.row(pair.first), seen.hidden.row(pair.second)).sqrt()
        })
        .collect();
    let margin = apart.iter().sum::<f64>() / apart.len() as f64;
    let training = MlpTraining {
        epochs: 1,
        batch: 64,
        learning_rate: 1e-4,
        l2: 0.0,
        keep: None,
    };
    let layers = [classifier.network()?.folded_hidden()];
    let mlp = fit_embedding(&layers, &seen.convolution, &pairs, margin, training, seed)?;
    Ok(mlp.layers())
}

/// A network trained on the few sweeps alone: its answers to the test sweeps.
fn from_scratch(
    task: &StudyTask,
    context: &StudyContext<'_>,
    fold: &Fold<'_>,
) -> Result<Vec<usize>, Cancelled> {
    let batches = fold.train.len().div_ceil(context.recipe.training.batch);
    let mut recipe: Recipe = context.recipe.clone();
    recipe.training.epochs = (SCRATCH_STEPS / batches).max(recipe.training.epochs);
    let scratch = StudyContext {
        recipe: &recipe,
        ..*context
    };
    let seed = context.seed_for("network from scratch", task.number * FOLDS + fold.fold());
    let classifier = trained(&scratch, "network from scratch", &fold.train, seed)?;
    let embedding = embedded(&classifier, &fold.test)?;
    Ok(embedding
        .log_probabilities()
        .iter()
        .map(|row| argmax(row))
        .collect())
}

/// Few sweeps of new materials, embedded.
struct FewShots<'a> {
    knowledge: &'a Knowledge,
    recipe: &'a Recipe,
    support: &'a Embedding,
    materials: usize,
    shots: usize,
}

impl FewShots<'_> {
    /// The label that `method` gives to every query.
    fn answers(
        &self,
        method: TransferMethod,
        queries: &Embedding,
        seed: Seed,
    ) -> Result<Vec<usize>, Cancelled> {
        let Knowledge {
            prior,
            whitening,
            tuned,
            ..
        } = self.knowledge;
        let (support, labels) = (&self.support.hidden, &self.support.labels);
        let largest = |rows: Vec<Vec<f64>>| rows.iter().map(|row| argmax(row)).collect();
        let linear = |support: &Features,
                      queries: &Features,
                      prior: &WeightPrior|
         -> Result<Vec<usize>, Cancelled> {
            let head = LinearHead::fit(support, labels, self.materials, prior)?;
            Ok(largest(head.log_probabilities(queries)))
        };
        let width = support.width();
        Ok(match method {
            TransferMethod::Nk => unreachable!("is trained on sweeps, not on embeddings"),
            TransferMethod::Ol => {
                let prior = WeightPrior::weight_decay(width, self.recipe.training.l2, labels.len());
                linear(support, &queries.hidden, &prior)?
            }
            TransferMethod::OlMean => linear(support, &queries.hidden, prior)?,
            TransferMethod::TunedOl => {
                let prior = plain_prior(prior, tuned.plain(self.shots));
                linear(support, &queries.hidden, &prior)?
            }
            TransferMethod::WhitenedOl => {
                let prior = whitened_prior(width, tuned.whitened(self.shots));
                linear(
                    &whitening.apply(support),
                    &whitening.apply(&queries.hidden),
                    &prior,
                )?
            }
            TransferMethod::Lda => {
                let head = NearestMean::fit(&whitening.apply(support), labels, self.materials);
                largest(head.scores(&whitening.apply(&queries.hidden)))
            }
            TransferMethod::Simpleshot => {
                let head = SimpleShot::fit(
                    support,
                    labels,
                    self.materials,
                    self.knowledge.centre.clone(),
                );
                largest(head.scores(&queries.hidden))
            }
            TransferMethod::Nn => nearest(support, labels, &queries.hidden),
            TransferMethod::Siamese => {
                let layers = self
                    .knowledge
                    .siamese
                    .as_ref()
                    .unwrap_or_else(|| panic!("was trained before"));
                let mlp = tactnet_models::Mlp::from_layers(layers, &burn::tensor::Device::flex());
                let embed = |embedding: &Embedding| {
                    let mut out = mlp.apply(&embedding.convolution);
                    out.values_mut().iter_mut().for_each(|v| *v = v.max(0.0));
                    out
                };
                nearest(&embed(self.support), labels, &embed(queries))
            }
            TransferMethod::OlFcl => {
                let batch = self.recipe.training.batch;
                let training = MlpTraining {
                    epochs: FINE_TUNING_STEPS.div_ceil(labels.len().div_ceil(batch)),
                    batch,
                    learning_rate: 3e-4,
                    l2: self.recipe.training.l2,
                    keep: Some((0, self.recipe.network.keep_probability)),
                };
                let output = DenseWeights {
                    weight: vec![0.0; self.materials * width],
                    bias: vec![0.0; self.materials],
                };
                let layers = [self.knowledge.classifier.network()?.folded_hidden(), output];
                let mlp = fit_labels(&layers, &self.support.convolution, labels, training, seed)?;
                let scores = mlp.apply(&queries.convolution);
                scores
                    .rows()
                    .map(|row| argmax(&row.iter().map(|v| f64::from(*v)).collect::<Vec<_>>()))
                    .collect()
            }
        })
    }
}

/// Label of the nearest support sweep, Euclidean; the first among equals.
fn nearest(support: &Features, labels: &[usize], queries: &Features) -> Vec<usize> {
    queries
        .rows()
        .map(|query| {
            let distances: Vec<f64> = support
                .rows()
                .map(|row| -squared_distance(row, query))
                .collect();
            labels[argmax(&distances)]
        })
        .collect()
}

fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2))
        .sum()
}
