//! Objective of a Siamese network: sweeps of one material close to each other, others apart (Koch et al., 2015).

use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use tactnet_models::{Network, batch_contrastive_loss};

use super::measured::Measured;
use super::objective::Pass;

/// Minimum distance of sweeps of two materials, in units of the root mean square of a rectified, normalised unit.
const MARGIN: f64 = 1.0;

/// Runs a forward and backward pass of the contrastive loss of all pairs of a batch on the input of the output layer, which itself is not trained.
///
/// A sweep counts as correct if its nearest neighbour in the batch is of its material.
///
/// - `sweeps`: `[batch, 1, steps, taxels]` without autodiff
/// - `labels`: `[batch]`
/// - `mask`: dropout mask, `[batch, features]`
pub(crate) fn pairs_pass(
    net: &Network,
    sweeps: Tensor<4>,
    labels: &[usize],
    mask: Tensor<2>,
) -> Pass {
    let forward = net.forward_train(sweeps.autodiff(), mask);
    let (loss, distances) = batch_contrastive_loss(forward.hidden, labels, MARGIN);
    let mut gradients = loss.backward();
    let gradients = GradientsParams::from_module(&mut gradients, net);
    let (loss, distances) = (loss.without_autodiff(), distances.without_autodiff());
    Pass {
        gradients,
        statistics: forward.statistics,
        adversarial_statistics: None,
        measured: Measured::pairs(loss, distances, labels),
    }
}

/// Returns the number of sweeps whose nearest neighbour has the same label.
///
/// - `distances`: `[sweeps][sweeps]`
pub(super) fn near_their_own(distances: &[f32], labels: &[usize]) -> usize {
    let rows = distances.chunks_exact(labels.len()).enumerate();
    rows.filter(|(own, row)| {
        let others = (0..labels.len()).filter(|other| other != own);
        let nearest = others.min_by(|a, b| row[*a].total_cmp(&row[*b]));
        nearest.is_some_and(|nearest| labels[nearest] == labels[*own])
    })
    .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_is_right_where_its_nearest_neighbour_is_of_its_material() {
        let distances = [
            0.0, 1.0, 2.0, 9.0, //
            1.0, 0.0, 3.0, 9.0, //
            2.0, 3.0, 0.0, 9.0, //
            9.0, 9.0, 8.0, 0.0,
        ];
        assert_eq!(near_their_own(&distances, &[0, 0, 1, 1]), 3);
        assert_eq!(near_their_own(&[0.0], &[0]), 0);
    }
}
