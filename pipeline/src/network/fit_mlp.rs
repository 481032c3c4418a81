//! Small networks on precomputed features: fine-tuned layers, learnt distances.

use burn::optim::GradientsParams;
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use tactnet_data::{Seed, shuffle};
use tactnet_models::{
    DenseWeights, Features, Mlp, contrastive_loss, cross_entropy, distance, dropout_masks, matrix,
    probability_of_difference,
};

use crate::network::adam::FusedAdam;
use crate::{PenalizedParameters, PipelineError};

/// Settings for the training of a small network (Adam with beta 0.9 and 0.999).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MlpTraining {
    /// Passes over the training examples.
    pub epochs: usize,
    /// Maximum number of examples in a batch.
    pub batch: usize,
    /// Learning rate.
    pub learning_rate: f64,
    /// L2 penalty on every parameter.
    pub l2: f64,
    /// Layer with dropout on its inputs, and the probability to keep a unit, in `(0, 1]`.
    pub keep: Option<(usize, f64)>,
}

/// Pair of sweeps by row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SweepPair {
    /// Row of the first sweep.
    pub first: usize,
    /// Row of the second sweep.
    pub second: usize,
    /// True if their materials differ.
    pub different: bool,
}

/// Trains `layers` as a classifier with softmax cross entropy.
///
/// - `device`: device of the training and of the result, without autodiff
///
/// # Errors
/// A loss that is not finite.
pub fn fit_labels(
    layers: &[DenseWeights],
    features: &Features,
    labels: &[usize],
    training: MlpTraining,
    seed: Seed,
    device: &Device,
) -> Result<Mlp, PipelineError> {
    fit(
        layers,
        features.len(),
        training,
        seed,
        device,
        |mlp, rows, masks| {
            let device = mlp.device();
            let own: Vec<i64> = rows.iter().map(|&row| labels[row] as i64).collect();
            let own: Tensor<1, Int> =
                Tensor::from_data(TensorData::new(own, [rows.len()]), &device);
            let batch = matrix(&features.select(rows), &device);
            cross_entropy(mlp.forward_masked(batch, masks), own)
        },
    )
}

/// Trains `layers` with the contrastive loss on the Euclidean distance between their rectified outputs.
///
/// Sweeps of one material move close to each other; others keep a distance of `margin`.
///
/// - `device`: device of the training and of the result, without autodiff
///
/// # Errors
/// A loss that is not finite.
pub fn fit_embedding(
    layers: &[DenseWeights],
    features: &Features,
    pairs: &[SweepPair],
    margin: f64,
    training: MlpTraining,
    seed: Seed,
    device: &Device,
) -> Result<Mlp, PipelineError> {
    fit(
        layers,
        pairs.len(),
        training,
        seed,
        device,
        |mlp, rows, _| {
            let device = mlp.device();
            let side = |of: fn(&SweepPair) -> usize| {
                let own: Vec<usize> = rows.iter().map(|&row| of(&pairs[row])).collect();
                mlp.forward(matrix(&features.select(&own), &device))
                    .clamp_min(0.0)
            };
            let apart = distance(side(|pair| pair.first), side(|pair| pair.second));
            contrastive_loss(apart, different(pairs, rows, &device), margin)
        },
    )
}

/// Trains `layers` to predict from distances whether two sweeps are of different materials: contrastive loss on that probability.
///
/// - `distances`: `[pairs][inputs]`
/// - `device`: device of the training and of the result, without autodiff
///
/// # Errors
/// A loss that is not finite.
pub fn fit_difference(
    layers: &[DenseWeights],
    distances: &Features,
    pairs: &[SweepPair],
    training: MlpTraining,
    seed: Seed,
    device: &Device,
) -> Result<Mlp, PipelineError> {
    fit(
        layers,
        pairs.len(),
        training,
        seed,
        device,
        |mlp, rows, masks| {
            let device = mlp.device();
            let batch = matrix(&distances.select(rows), &device);
            let p = probability_of_difference(mlp, batch, masks);
            contrastive_loss(p, different(pairs, rows, &device), 1.0)
        },
    )
}

/// Returns the probability that the materials of each pair differ.
pub fn predict_difference(mlp: &Mlp, distances: &Features) -> Vec<f64> {
    let p = probability_of_difference(mlp, matrix(distances, &mlp.device()), |_, _| None);
    let values = p.into_data_as::<f32>().try_into_vec::<f32>();
    values
        .unwrap_or_else(|error| panic!("was converted to f32: {error:?}"))
        .into_iter()
        .map(f64::from)
        .collect()
}

/// Returns targets `[rows, 1]`: 1 if the materials differ, else 0.
fn different(pairs: &[SweepPair], rows: &[usize], device: &Device) -> Tensor<2> {
    let values: Vec<f32> = rows
        .iter()
        .map(|&row| f32::from(u8::from(pairs[row].different)))
        .collect();
    Tensor::from_data(TensorData::new(values, [rows.len(), 1]), device)
}

/// Returns the dropout mask of a layer, if it has one: see [`Mlp::forward_masked`].
type Masks<'a> = &'a mut dyn FnMut(usize, usize) -> Option<Tensor<2>>;

/// Shared training loop: a new order of the examples every epoch, batches whose sizes differ by at most one.
fn fit(
    layers: &[DenseWeights],
    examples: usize,
    training: MlpTraining,
    seed: Seed,
    device: &Device,
    loss: impl Fn(&Mlp, &[usize], Masks<'_>) -> Tensor<1>,
) -> Result<Mlp, PipelineError> {
    let autodiff = device.clone().autodiff();
    let mut mlp = Mlp::from_layers(layers, &autodiff);
    let mut optimizer = FusedAdam::for_module(training.l2, PenalizedParameters::All);
    let batches = examples.div_ceil(training.batch);
    for epoch in 0..training.epochs {
        let mut order: Vec<usize> = (0..examples).collect();
        shuffle(&mut order, &mut seed.rng(("small network, order", epoch)));
        for batch in 0..batches {
            let rows = &order[batch * examples / batches..(batch + 1) * examples / batches];
            let mut rng: ChaCha8Rng = seed.rng(("small network, dropout", epoch, batch));
            let mut masks = |layer: usize, width: usize| match training.keep {
                Some((at, keep)) if at == layer => {
                    Some(dropout_masks(rows.len(), width, keep, &autodiff, &mut rng))
                }
                _ => None,
            };
            let loss = loss(&mlp, rows, &mut masks);
            if !loss.clone().inner().into_scalar::<f32>().is_finite() {
                return Err(PipelineError::NotFinite {
                    what: "loss of a small network".into(),
                    epoch: epoch + 1,
                    batch: batch + 1,
                });
            }
            let mut gradients = loss.backward();
            let gradients = GradientsParams::from_module(&mut gradients, &mlp);
            mlp = optimizer.step(training.learning_rate, mlp, gradients);
        }
    }
    Ok(Mlp::from_layers(&mlp.layers(), device))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRAINING: MlpTraining = MlpTraining {
        epochs: 60,
        batch: 16,
        learning_rate: 1e-2,
        l2: 0.0,
        keep: None,
    };

    fn fresh(widths: &[usize]) -> Vec<DenseWeights> {
        Mlp::init(widths, &Device::flex(), &mut Seed(1).rng("weights")).layers()
    }

    /// Returns points on two rings, labelled by ring.
    fn rings() -> (Features, Vec<usize>) {
        let points: Vec<[f32; 2]> = (0..120)
            .map(|i| {
                let (angle, radius) = (i as f32 * 0.7, if i % 2 == 0 { 0.5 } else { 1.5 });
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        (
            Features::new(2, points.concat()),
            (0..120).map(|i| i % 2).collect(),
        )
    }

    #[test]
    fn a_hidden_layer_learns_rings() {
        let (features, labels) = rings();
        let training = MlpTraining {
            keep: Some((1, 0.9)),
            ..TRAINING
        };
        let fitted = |seed| {
            fit_labels(
                &fresh(&[2, 32, 2]),
                &features,
                &labels,
                training,
                Seed(seed),
                &Device::flex(),
            )
            .unwrap()
        };
        let mlp = fitted(3);
        let right = mlp
            .apply(&features)
            .rows()
            .zip(&labels)
            .filter(|(row, label)| usize::from(row[1] > row[0]) == **label)
            .count();
        assert!(right >= 115, "{right} of 120");
        assert_eq!(
            mlp.layers(),
            fitted(3).layers(),
            "equal seeds give equal weights"
        );
        assert_ne!(mlp.layers(), fitted(4).layers());
    }

    #[test]
    fn pairs_are_told_apart_by_distance_and_by_embedding() {
        let (features, labels) = rings();
        let pairs: Vec<SweepPair> = (0..400)
            .map(|i| {
                let (first, second) = (i * 7 % 120, (i * 13 + i / 3) % 120);
                SweepPair {
                    first,
                    second,
                    different: labels[first] != labels[second],
                }
            })
            .collect();
        let embedding = fit_embedding(
            &fresh(&[2, 32]),
            &features,
            &pairs,
            1.0,
            TRAINING,
            Seed(1),
            &Device::flex(),
        )
        .unwrap();
        let embedded: Vec<Vec<f32>> = embedding
            .apply(&features)
            .rows()
            .map(|row| row.iter().map(|v| v.max(0.0)).collect())
            .collect();
        let apart = |pair: &SweepPair| {
            let [a, b] = [pair.first, pair.second].map(|row| &embedded[row]);
            a.iter()
                .zip(b)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f32>()
                .sqrt()
        };
        let distances = Features::new(1, pairs.iter().map(apart).collect());
        let head = fit_difference(
            &fresh(&[1, 16, 16, 2]),
            &distances,
            &pairs,
            TRAINING,
            Seed(1),
            &Device::flex(),
        )
        .unwrap();
        let right = predict_difference(&head, &distances)
            .iter()
            .zip(&pairs)
            .filter(|(p, pair)| (**p > 0.5) == pair.different)
            .count();
        // In about half of the pairs the rings differ, so chance is 200.
        assert!(right > 320, "{right} of 400");
    }

    #[cfg(feature = "vulkan")]
    #[test]
    fn training_stays_on_the_device_that_was_asked_for() {
        let device = tactnet_models::Compute::Vulkan.open().unwrap();
        let (features, labels) = rings();
        let layers = fresh(&[2, 32, 2]);
        let fitted = |device| fit_labels(&layers, &features, &labels, TRAINING, Seed(3), device);
        let there = fitted(&device).unwrap();
        assert_eq!(there.device(), device);
        let here = fitted(&Device::flex()).unwrap();
        let apart = here
            .apply(&features)
            .values()
            .iter()
            .zip(there.apply(&features).values())
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        // Rounding differs between devices and accumulates over sixty epochs.
        assert!(apart < 0.1, "{apart}");
    }
}
