//! The network of the known materials, and everything that transfer methods derive from it.

use tactnet_data::{Fold, MaterialSplit, Scheme};
use tactnet_models::{DenseWeights, WeightPrior, Whitening};
use tactnet_pipeline::{Classifier, Embedding, MlpTraining, fit_embedding};

use super::tuning::{Tuned, tune};
use super::{Nshot, TransferMethod};
use crate::context::{Cancelled, StudyContext, embedded};
use crate::pairs::random_pairs;

/// Number of pairs for training the Siamese embedding.
const PAIRS: usize = 20_000;

/// The network of the known materials, and everything that methods derive from it.
pub(super) struct Knowledge {
    pub(super) classifier: Classifier,
    pub(super) prior: WeightPrior,
    pub(super) centre: Vec<f64>,
    pub(super) whitening: Whitening,
    pub(super) tuned: Tuned,
    pub(super) siamese: Option<Vec<DenseWeights>>,
    /// A network trained on pairs from the beginning.
    pub(super) siamese_full: Option<Classifier>,
}

/// Trains the network on the known materials and derives everything that the methods need.
pub(super) fn learn(
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
    let siamese_full = if task.methods().contains(&TransferMethod::SiameseFull) {
        let seed = context.seed_for("network trained on pairs", context.part.stream());
        Some(context.trained_on_pairs("network trained on pairs", &fold.train, seed)?)
    } else {
        None
    };
    Ok(Knowledge {
        siamese_full,
        prior,
        centre,
        whitening,
        tuned,
        siamese,
        classifier,
    })
}

/// Trains the dense layer further, so that sweeps of the same known material move together and others apart. The
/// margin is the mean distance between different materials before training.
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

/// Returns the squared Euclidean distance of two vectors.
pub(super) fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2))
        .sum()
}
