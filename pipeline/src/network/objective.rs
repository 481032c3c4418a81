//! Loss and gradients: plain cross entropy, and the adversarial objective of the thesis.

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Gradients, Int, Tensor, TensorData};
use rayon::prelude::*;
use tactnet_models::{
    BatchStatistics, Network, cross_entropy, is_cpu, soft_cross_entropy, values,
    weighted_cross_entropy,
};

use super::measured::Measured;
use crate::AttackedLabel;

/// Number of values that a thread processes at once.
const RUN: usize = 1 << 14;

/// Result of one batch for the optimiser.
pub struct Pass {
    /// Gradient of the objective for every parameter.
    pub gradients: GradientsParams,
    /// Batch statistics of the clean sweeps.
    pub statistics: Vec<BatchStatistics>,
    /// Batch statistics of the adversarial sweeps; `None` without adversarial training.
    pub adversarial_statistics: Option<Vec<BatchStatistics>>,
    /// Loss and accuracy, not read yet.
    pub measured: Measured,
}

/// What a network is to predict for the sweeps of a batch.
#[derive(Debug, Clone)]
pub struct Targets {
    /// Labels, `[batch]`.
    pub labels: Tensor<1, Int>,
    /// Probabilities of the materials, `[batch, materials]`; `None`: 1 for the label.
    pub probabilities: Option<Tensor<2>>,
    /// Weights of the losses, `[batch]`, of mean 1 over the training set; `None`: all are equal.
    pub weights: Option<Tensor<1>>,
}

impl From<Tensor<1, Int>> for Targets {
    fn from(labels: Tensor<1, Int>) -> Self {
        Self {
            labels,
            probabilities: None,
            weights: None,
        }
    }
}

impl Targets {
    /// Returns the mean cross entropy in nats.
    fn loss(self, logits: Tensor<2>) -> Tensor<1> {
        match (self.probabilities, self.weights) {
            (None, None) => cross_entropy(logits, self.labels),
            (None, Some(weights)) => weighted_cross_entropy(logits, self.labels, weights),
            (Some(probabilities), None) => soft_cross_entropy(logits, probabilities),
            (Some(probabilities), Some(weights)) => {
                soft_cross_entropy(logits, probabilities * weights.unsqueeze_dim(1))
            }
        }
    }
}

/// Settings of the adversarial objective.
#[derive(Debug, Clone, PartialEq)]
pub struct Perturbation {
    /// Weight of the clean loss.
    pub alpha: f64,
    /// Step size along the sign of the input gradient for each taxel, `[taxels]`, in the units of `sweeps`.
    pub epsilon: Vec<f32>,
    /// Label whose loss the perturbation increases.
    pub attack: AttackedLabel,
}

/// Runs a forward and backward pass of `E(x)`, the cross entropy.
///
/// - `sweeps`: `[batch, 1, steps, taxels]` without autodiff
/// - `targets`: targets, or labels `[batch]`
/// - `mask`: dropout mask, `[batch, features]`
pub fn base_pass(
    net: &Network,
    sweeps: Tensor<4>,
    targets: impl Into<Targets>,
    mask: Tensor<2>,
) -> Pass {
    let (mut gradients, statistics, half) = pass(net, sweeps.autodiff(), targets.into(), mask, 1.0);
    let gradients = GradientsParams::from_module(&mut gradients, net);
    Pass {
        gradients,
        statistics,
        adversarial_statistics: None,
        measured: Measured::clean(half),
    }
}

/// Runs forward and backward passes of `alpha E(x) + (1 - alpha) E(x + r)` with `r = epsilon sign(dE/dx)`, thesis section 4.4.1.
///
/// One clean pass gives both the weight gradients and `dE/dx`. The perturbation is constant in the second pass (Goodfellow et al., 2014).
/// If the predicted label is attacked, `dE/dx` is that of the loss of the most probable label, which takes another pass with the clean mask.
///
/// - `targets`: targets, or labels `[batch]`
/// - `masks`: `[clean, adversarial]`
pub fn adversarial_pass(
    net: &Network,
    sweeps: Tensor<4>,
    targets: impl Into<Targets>,
    masks: [Tensor<2>; 2],
    Perturbation {
        alpha,
        epsilon,
        attack,
    }: &Perturbation,
) -> Pass {
    let (alpha, targets) = (*alpha, targets.into());
    let [clean_mask, adversarial_mask] = masks;
    let tracked = sweeps.clone().autodiff().require_grad();
    // The sign of dE/dx needs a clean loss even if that has no weight.
    let clean_weight = if alpha > 0.0 { alpha } else { 1.0 };
    let predicted = (*attack == AttackedLabel::Predicted).then(|| clean_mask.clone());
    let (mut clean, statistics, clean_half) = pass(
        net,
        tracked.clone(),
        targets.clone(),
        clean_mask,
        clean_weight,
    );
    let gradient = match predicted {
        None => tracked
            .grad_remove(&mut clean)
            .unwrap_or_else(|| panic!("the loss depends on the sweeps")),
        Some(mask) => gradient_of_predicted(net, sweeps.clone(), mask),
    };
    drop(tracked);
    let perturbed = perturbed(sweeps, gradient, epsilon).autodiff();
    let (mut adversarial, adversarial_statistics, adversarial_half) =
        pass(net, perturbed, targets, adversarial_mask, 1.0 - alpha);
    let mut gradients = GradientsParams::from_module(&mut adversarial, net);
    if alpha > 0.0 {
        gradients = sum(
            net,
            GradientsParams::from_module(&mut clean, net),
            gradients,
        );
    }
    Pass {
        gradients,
        statistics,
        adversarial_statistics: Some(adversarial_statistics),
        measured: Measured::adversarial([clean_half, adversarial_half], alpha),
    }
}

/// Returns `dE/dx` of the loss of the most probable label.
fn gradient_of_predicted(net: &Network, sweeps: Tensor<4>, mask: Tensor<2>) -> Tensor<4> {
    let tracked = sweeps.autodiff().require_grad();
    let logits = net.forward_train(tracked.clone(), mask).logits;
    let predicted = logits.clone().argmax(1).squeeze_dim::<1>(1);
    let gradients = cross_entropy(logits, predicted).backward();
    tracked
        .grad(&gradients)
        .unwrap_or_else(|| panic!("the loss depends on the sweeps"))
}

/// Returns `sweeps + epsilon sign(gradient)` with an epsilon for each taxel; on the processor in place, in one pass.
fn perturbed(sweeps: Tensor<4>, gradient: Tensor<4>, epsilon: &[f32]) -> Tensor<4> {
    let device = sweeps.device();
    let extents = sweeps.dims();
    let taxels = epsilon.len();
    assert_eq!(extents[3], taxels, "an epsilon for every taxel");
    if !is_cpu(&device) {
        let epsilon = TensorData::new(epsilon.to_vec(), [1, 1, 1, taxels]);
        return sweeps + gradient.sign() * Tensor::from_data(epsilon, &device);
    }
    let (mut digits, gradient) = (values(sweeps), values(gradient));
    let run = RUN.next_multiple_of(taxels);
    digits
        .par_chunks_mut(run)
        .zip(gradient.par_chunks(run))
        .for_each(|(digits, gradient)| {
            let frames = digits
                .chunks_exact_mut(taxels)
                .zip(gradient.chunks_exact(taxels));
            for (digits, gradient) in frames {
                for ((digit, gradient), epsilon) in digits.iter_mut().zip(gradient).zip(epsilon) {
                    // Rust's signum of zero is one.
                    let along = if *gradient == 0.0 {
                        0.0
                    } else {
                        gradient.signum()
                    };
                    *digit += epsilon * along;
                }
            }
        });
    Tensor::from_data(TensorData::new(digits, extents), &device)
}

/// Returns the gradients of `weight` times the loss, batch statistics, and `[2]`: loss and number of correct predictions.
fn pass(
    net: &Network,
    sweeps: Tensor<4>,
    targets: Targets,
    mask: Tensor<2>,
    weight: f64,
) -> (Gradients, Vec<BatchStatistics>, Tensor<1>) {
    let forward = net.forward_train(sweeps, mask);
    let recognised = forward
        .logits
        .clone()
        .argmax(1)
        .squeeze_dim::<1>(1)
        .equal(targets.labels.clone());
    let correct = recognised.float().sum();
    let loss = targets.loss(forward.logits);
    let gradients = loss.clone().mul_scalar(weight).backward();
    let half = Tensor::cat(vec![loss.without_autodiff(), correct.without_autodiff()], 0);
    (gradients, forward.statistics, half)
}

/// Returns `first + second`; on the processor with all threads.
fn added<const D: usize>(first: Tensor<D>, second: Tensor<D>) -> Tensor<D> {
    let device = first.device();
    if !is_cpu(&device) {
        return first + second;
    }
    let extents = first.dims();
    let (mut total, second) = (values(first), values(second));
    let runs = total.par_chunks_mut(RUN).zip(second.par_chunks(RUN));
    runs.for_each(|(total, second)| {
        total.iter_mut().zip(second).for_each(|(t, s)| *t += s);
    });
    Tensor::from_data(TensorData::new(total, extents), &device)
}

fn sum(net: &Network, first: GradientsParams, second: GradientsParams) -> GradientsParams {
    struct Sum {
        first: GradientsParams,
        second: GradientsParams,
        total: GradientsParams,
    }
    impl ModuleVisitor for Sum {
        fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
            let id = parameter.id;
            match (self.first.remove::<D>(id), self.second.remove::<D>(id)) {
                (Some(a), Some(b)) => self.total.register(id, added(a, b)),
                (Some(one), None) | (None, Some(one)) => self.total.register(id, one),
                (None, None) => {}
            }
        }
    }
    let mut sum = Sum {
        first,
        second,
        total: GradientsParams::new(),
    };
    net.visit(&mut sum);
    sum.total
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;
    use tactnet_data::Seed;
    use tactnet_models::{Architecture, InputShape, NetworkConfig, dropout_masks};

    const SHAPE: InputShape = InputShape {
        steps: 60,
        taxels: 4,
    };

    struct Batch {
        net: Network,
        sweeps: Tensor<4>,
        labels: Tensor<1, Int>,
        mask: Tensor<2>,
    }

    fn batch() -> Batch {
        let architecture = Architecture::tactnet2(&[3, 4], 8);
        let config = NetworkConfig::new(architecture, SHAPE, 3).unwrap();
        let device = Device::flex();
        let tracked = device.clone().autodiff();
        let net = Network::init(&config, &tracked, &mut Seed(1).rng("weights"));
        let count = 6 * SHAPE.steps * 4;
        let digits: Vec<f32> = (0..count)
            .map(|i| ((i * 7919) % 101) as f32 / 10.0)
            .collect();
        let labels = TensorData::new(vec![0_i64, 1, 2, 0, 1, 2], [6]);
        Batch {
            sweeps: Tensor::from_data(TensorData::new(digits, [6, 1, SHAPE.steps, 4]), &device),
            labels: Tensor::from_data(labels, &tracked),
            mask: dropout_masks(
                6,
                config.features(),
                1.0,
                &tracked,
                &mut Seed(1).rng("mask"),
            ),
            net,
        }
    }

    fn adversarial(batch: &Batch, alpha: f64, epsilon: f32) -> Pass {
        let Batch {
            net,
            sweeps,
            labels,
            mask,
        } = batch;
        let perturbation = Perturbation {
            alpha,
            epsilon: vec![epsilon; 4],
            attack: AttackedLabel::True,
        };
        let masks = [mask.clone(), mask.clone()];
        adversarial_pass(net, sweeps.clone(), labels.clone(), masks, &perturbation)
    }

    /// `alpha E(x) + (1 - alpha) E(x)` equals `E(x)`, and so do the gradients.
    #[test]
    fn without_a_perturbation_the_objective_is_the_plain_loss_whatever_alpha() {
        let batch = batch();
        let Batch {
            net,
            sweeps,
            labels,
            mask,
        } = &batch;
        let base = base_pass(net, sweeps.clone(), labels.clone(), mask.clone());
        let expected = net.gradients(&base.gradients);
        let base_loss = base.measured.read().loss;
        for alpha in [0.0, 0.1, 0.5, 1.0] {
            let pass = adversarial(&batch, alpha, 0.0);
            let found = net.gradients(&pass.gradients);
            let loss = pass.measured.read().loss;
            assert!((loss - base_loss).abs() < 1e-6, "{alpha}");
            for (name, expected) in &expected.0 {
                let largest = expected.values.iter().fold(1e-6_f32, |m, v| m.max(v.abs()));
                for (found, expected) in found.0[name].values.iter().zip(&expected.values) {
                    // The sum of two rounded parts.
                    assert!((found - expected).abs() < 1e-5 * largest, "{alpha} {name}");
                }
            }
        }
    }

    #[test]
    fn the_perturbation_raises_the_loss() {
        let batch = batch();
        let losses =
            [0.0, 0.01, 0.02].map(|epsilon| adversarial(&batch, 0.0, epsilon).measured.read().loss);
        assert!(losses.is_sorted_by(|a, b| a < b), "{losses:?}");
    }

    #[test]
    fn certain_probabilities_give_the_loss_and_gradients_of_labels() {
        let Batch {
            net,
            sweeps,
            labels,
            mask,
        } = batch();
        let one_hot = |share: f32| {
            let rows = [0, 1, 2, 0, 1, 2].map(|label| {
                let mut row = [(1.0 - share) / 2.0; 3];
                row[label] = share;
                row
            });
            let targets = TensorData::new(rows.concat(), [6, 3]);
            Targets {
                labels: labels.clone(),
                probabilities: Some(Tensor::from_data(targets, &labels.device())),
                weights: None,
            }
        };
        let of = |targets: Targets| base_pass(&net, sweeps.clone(), targets, mask.clone());
        let (hard, certain, unsure) = (
            of(labels.clone().into()),
            of(one_hot(1.0)),
            of(one_hot(0.5)),
        );
        let gradients = [&hard, &certain].map(|pass| net.gradients(&pass.gradients));
        for (name, expected) in &gradients[0].0 {
            let largest = expected.values.iter().fold(1e-6_f32, |m, v| m.max(v.abs()));
            for (found, expected) in gradients[1].0[name].values.iter().zip(&expected.values) {
                // The sums are in another order.
                assert!((found - expected).abs() < 1e-5 * largest, "{name}");
            }
        }
        let [hard, certain, unsure] = [hard, certain, unsure].map(|pass| pass.measured.read());
        assert!((hard.loss - certain.loss).abs() < 1e-6);
        assert!((hard.loss - unsure.loss).abs() > 1e-3);
        assert_eq!(hard.correct, unsure.correct);
    }
}
