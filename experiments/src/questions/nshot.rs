//! n-shot transfer: a network learns 30 materials well and six new ones from a few sweeps each (thesis, section 4.6.4).
//!
//! ```text
//! materials ─┬─ 30 known ─┬─ 80 % of their sweeps: train the network, covariance, prior
//!            │            └─ 20 %: choose what has to be chosen
//!            └─ 6 new ──── five folds: n sweeps of each material of 80 %, judged on 20 %
//! ```

mod efficiency;
mod method;
mod tuning;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tactnet_data::{Fold, MaterialSplit, Scheme, Seed, SweepView};
use tactnet_models::{
    DenseWeights, Features, LinearHead, NearestMean, SimpleShot, WeightPrior, Whitening, argmax,
};
use tactnet_pipeline::{
    Classifier, Device, Embedding, MlpTraining, Recipe, fit_embedding, fit_labels,
};

use super::{Ask, Compared, Figure, Published, check_counts, draws, one, six, within};
use crate::context::{Cancelled, StudyContext, embedded};
use crate::one_or_many::one_or_many;
use crate::pairs::random_pairs;
use crate::result::Answer;
use crate::summarise::FinishedTask;
use crate::tasks::ExperimentDir;
use crate::{ExperimentError, Measure, Measurement, Part, Row, Summary};
pub use efficiency::SampleEfficiency;
use efficiency::sample_efficiency;
pub use method::TransferMethod;
use tuning::{Tuned, plain_prior, tune, whitened_prior};

/// Folds of the new materials' sweeps.
const FOLDS: usize = 5;
/// Steps of the optimiser, about, when the dense layer is tuned to few sweeps.
const FINE_TUNING_STEPS: usize = 150;
/// Steps of the optimiser, about, when a whole network learns few sweeps; one epoch of a single batch is one step.
const SCRATCH_STEPS: usize = 300;
/// Pairs that the Siamese embedding is trained on.
const PAIRS: usize = 20_000;

/// How well does transfer learn new materials from few sweeps?
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nshot {
    /// Draws of the new materials.
    #[serde(default = "one")]
    pub splits: usize,
    /// Sweeps of every new material that are learnt from.
    #[serde(deserialize_with = "one_or_many")]
    pub shots: Vec<usize>,
    /// Methods of transfer; none named: all of them.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub methods: Vec<TransferMethod>,
    /// Materials that are new.
    #[serde(default = "six")]
    pub new_materials: usize,
    /// Of the five folds of the new materials' sweeps, in how many a whole network is trained from scratch.
    #[serde(default = "one")]
    pub scratch_folds: usize,
}

impl Nshot {
    fn methods(&self) -> &[TransferMethod] {
        if self.methods.is_empty() {
            &TransferMethod::ALL
        } else {
            &self.methods
        }
    }
}

impl Ask for Nshot {
    fn name(&self) -> &'static str {
        "nshot"
    }

    fn validate(&self) -> Result<(), String> {
        within("splits", self.splits, 1, usize::MAX)?;
        within("new_materials", self.new_materials, 2, usize::MAX)?;
        within("scratch_folds", self.scratch_folds, 1, FOLDS)?;
        if self.shots.is_empty() {
            return Err("`shots`: expected one or more numbers above 0, found none".into());
        }
        check_counts("shots", &self.shots)
    }

    fn parts(&self) -> Vec<Part> {
        draws(self.splits)
    }

    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        transfer(self, context)
    }

    fn test_share(&self) -> f64 {
        0.0
    }

    fn compared(&self, measure: Measure) -> Option<Compared> {
        (measure == Measure::Accuracy).then_some(Compared::With("ol-mean"))
    }

    /// Figure 4.12 and section 4.6.4 of the thesis.
    fn published(&self, row: &Row) -> Published {
        match (row.method.as_str(), row.shots) {
            ("ol-mean", Some(1)) => Published::robot(0.755),
            ("ol", Some(1)) => Published::robot(0.750),
            _ => Published::default(),
        }
    }

    fn complete(
        &self,
        _dir: &ExperimentDir,
        summary: &mut Summary,
        _finished: &[FinishedTask<'_>],
    ) -> Result<(), ExperimentError> {
        summary.sample_efficiency = Some(sample_efficiency(&summary.rows, Seed(summary.seed)));
        Ok(())
    }

    fn figures(&self) -> Vec<Figure> {
        vec![
            Figure::Shots {
                title: "Methods of the thesis",
                methods: &["nk", "ol", "ol-fcl", "ol-mean", "nn", "siamese"],
            },
            Figure::Shots {
                title: "Beyond the thesis",
                methods: &["ol-mean", "simpleshot", "lda", "tuned-ol", "whitened-ol"],
            },
        ]
    }

    fn terms(&self) -> &'static [(&'static str, &'static str)] {
        &TERMS
    }
}

/// Words of the report.
const TERMS: [(&str, &str); 5] = [
    (
        "OL, OL-FCL, OL-mean",
        "The network learnt on the known materials stays as it is but for its output layer; or its last two layers; or the output layer is drawn towards the known materials' weights (thesis, section 4.6). As a prior mean that all classes share changes no softmax, OL-mean differs from OL by the strength of the prior alone.",
    ),
    (
        "NK",
        "No pre-knowledge: a whole network learns the new materials alone. It is trained in one fold of every draw (or in as many as the recipe says), the other methods in all five.",
    ),
    (
        "SimpleShot, LDA, whitened OL, tuned OL",
        "Nearest class mean of centred, normalised features (Wang et al., 2019); nearest class mean, and an output layer, on features whitened with the known materials' covariance; an output layer on plain features. Strengths are chosen on known materials.",
    ),
    (
        "NN, Siamese",
        "Nearest neighbour in the embedding; the same after the dense layer (not, as in the thesis, the whole network) was trained on pairs of known sweeps, so that sweeps of one material come close (contrastive loss).",
    ),
    (
        "OL-FCL",
        "150 steps of Adam from the network's own dense layer; unlike the output layers alone, this has no end at which a gradient vanishes.",
    ),
];

/// What the knowledge set gives to every method.
struct Knowledge {
    classifier: Classifier,
    prior: WeightPrior,
    centre: Vec<f64>,
    whitening: Whitening,
    tuned: Tuned,
    siamese: Option<Vec<DenseWeights>>,
}

fn transfer(task: &Nshot, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let split = MaterialSplit::draw(
        context.dataset,
        task.new_materials,
        context.seed,
        context.part.stream(),
    )?;
    let knowledge = learn(task, context, &split)?;
    let everything = SweepView::all(&split.new);
    let whole = embedded(&knowledge.classifier, &everything)?;
    // Draws deal folds and shots of their own, which all methods share.
    let own = context.seed_for("folds of new materials", context.part.stream());
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
        for &method in task.methods() {
            context.say(&format!("{} with {shots} shots", method.name()))?;
            let own: &[Fold<'_>] = match method {
                // Another fold in every draw.
                TransferMethod::Nk => {
                    &rotated(&few, context.part.stream())[..task.scratch_folds.clamp(1, FOLDS)]
                }
                _ => &few,
            };
            let mut right = 0;
            let mut decisions = 0;
            let answers: Vec<Result<Vec<usize>, Cancelled>> = if method == TransferMethod::Nk {
                own.iter().map(|fold| from_scratch(context, fold)).collect()
            } else {
                let (recipe, device) = (context.recipe, context.device);
                let seeds: Vec<Seed> = (0..FOLDS)
                    .map(|fold| {
                        context.seed_for("fine-tuning", context.part.stream() * FOLDS + fold)
                    })
                    .collect();
                own.par_iter()
                    .map(|fold| {
                        let support = whole.part(&everything, &fold.train);
                        let queries = whole.part(&everything, &fold.test);
                        let few = FewShots {
                            knowledge: &knowledge,
                            recipe,
                            device,
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
            measurements.push(
                Measurement::new(Measure::Accuracy, method.name(), value, decisions).shots(shots),
            );
        }
    }
    let names: Vec<&str> = split.new.labels().names().collect();
    Ok(Answer {
        measurements,
        split: format!("new materials: {}", names.join(", ")),
        split_content: format!("{:?} {}", split.new_labels, folds[0].manifest().sha256),
        chosen: knowledge.tuned.chosen(),
        maps: Vec::new(),
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
    task: &Nshot,
    context: &StudyContext<'_>,
    split: &MaterialSplit,
) -> Result<Knowledge, Cancelled> {
    let fold = Fold::new(&split.known, Scheme::default(), context.seed, 0, 0)?;
    let seed = context.seed_for("knowledge network", context.part.stream());
    let classifier = context.trained("network of the known materials", &fold.train, seed)?;
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
    let siamese = if task.methods().contains(&TransferMethod::Siamese) {
        context.say("Siamese embedding")?;
        Some(siamese_layers(
            context,
            &classifier,
            &seen,
            context.part.stream(),
        )?)
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
    let mlp = fit_embedding(
        &layers,
        &seen.convolution,
        &pairs,
        margin,
        training,
        seed,
        context.device,
    )?;
    Ok(mlp.layers())
}

/// A network trained on the few sweeps alone: its answers to the test sweeps.
fn from_scratch(context: &StudyContext<'_>, fold: &Fold<'_>) -> Result<Vec<usize>, Cancelled> {
    let batches = fold.train.len().div_ceil(context.recipe.training.batch);
    let mut recipe: Recipe = context.recipe.clone();
    recipe.training.epochs = (SCRATCH_STEPS / batches).max(recipe.training.epochs);
    let scratch = StudyContext {
        recipe: &recipe,
        ..*context
    };
    let seed = context.seed_for(
        "network from scratch",
        context.part.stream() * FOLDS + fold.fold(),
    );
    let classifier = scratch.trained("network from scratch", &fold.train, seed)?;
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
    device: &'a Device,
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
                let mlp = tactnet_models::Mlp::from_layers(layers, self.device);
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
                let mlp = fit_labels(
                    &layers,
                    &self.support.convolution,
                    labels,
                    training,
                    seed,
                    self.device,
                )?;
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
