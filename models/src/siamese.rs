//! Siamese network that decides if two sweeps are of the same material, from the distance between their embeddings.
//!
//! Tulbure & Bäuml, Humanoids 2018, figure 4b, after Koch et al., 2015: two identical networks with fixed weights, the distance between
//! their outputs, and a small network that maps the distance to 'same' or 'different'.

use burn::tensor::activation::softmax;
use burn::tensor::{Tensor, TensorData};

use crate::Mlp;

/// Added under the square root of a distance, because the gradient is undefined at zero.
const FLOOR: f64 = 1e-12;
/// Index of output 'different'; output 0 is 'same'.
const DIFFERENT: usize = 1;

/// Returns the Euclidean distance of corresponding rows: two `[pairs, width]` to `[pairs, 1]`.
pub fn distance(first: Tensor<2>, second: Tensor<2>) -> Tensor<2> {
    let difference = first - second;
    ((difference.clone() * difference).sum_dim(1) + FLOOR).sqrt()
}

/// Returns the contrastive loss (Hadsell et al., 2006, equation 4), averaged over pairs:
/// `(1 - y) d^2 / 2 + y max(0, margin - d)^2 / 2` with y = 1 where the pair differs.
///
/// - `distance`: `[pairs, 1]`, not negative
/// - `different`: `[pairs, 1]`, 0 or 1
pub fn contrastive_loss(distance: Tensor<2>, different: Tensor<2>, margin: f64) -> Tensor<1> {
    let near = distance.clone() * distance.clone();
    let short = (distance.neg() + margin).clamp_min(0.0);
    let far = short.clone() * short;
    let same = different.clone().neg() + 1.0;
    (same * near + different * far).mean().mul_scalar(0.5)
}

/// Returns the contrastive loss over all pairs of a batch, and the distances `[sweeps, sweeps]`.
///
/// Pairs of equal materials and pairs of different materials each contribute half, whatever their number. Distances are divided by the
/// square root of the width, so the margin is in root mean squares of one unit.
///
/// - `embeddings`: `[sweeps, width]`
/// - `labels`: `[sweeps]`
pub fn batch_contrastive_loss(
    embeddings: Tensor<2>,
    labels: &[usize],
    margin: f64,
) -> (Tensor<1>, Tensor<2>) {
    let [sweeps, width] = embeddings.dims();
    assert_eq!(sweeps, labels.len(), "a label for every sweep");
    let device = embeddings.device();
    let lengths = (embeddings.clone() * embeddings.clone()).sum_dim(1);
    let products = embeddings.clone().matmul(embeddings.transpose());
    let squares = lengths.clone() + lengths.transpose() - products.mul_scalar(2.0);
    let distances = (squares.div_scalar(width as f64).clamp_min(0.0) + FLOOR).sqrt();
    let share = |different: bool| {
        let takes = |i: usize, j: usize| i < j && (labels[i] != labels[j]) == different;
        let rows = 0..sweeps;
        let chosen = rows.flat_map(|i| (0..sweeps).map(move |j| f32::from(u8::from(takes(i, j)))));
        let chosen: Vec<f32> = chosen.collect();
        // Each kind of pair has half of the weight, and the loss itself has a factor of one half.
        let each = 0.25 / chosen.iter().sum::<f32>().max(1.0);
        let weights = chosen.into_iter().map(|one| one * each).collect::<Vec<_>>();
        Tensor::<2>::from_data(TensorData::new(weights, [sweeps, sweeps]), &device)
    };
    let near = distances.clone() * distances.clone();
    let short = (distances.clone().neg() + margin).clamp_min(0.0);
    let far = short.clone() * short;
    let loss = (share(false) * near + share(true) * far).sum();
    (loss, distances)
}

/// Returns the probability that two sweeps differ, from their distances: `[pairs, inputs] -> [pairs, 1]`.
///
/// The contrastive loss takes this probability as its distance, with margin 1.
///
/// - `head`: network with two outputs, 'same' and 'different'
pub fn probability_of_difference(
    head: &Mlp,
    distances: Tensor<2>,
    mask: impl FnMut(usize, usize) -> Option<Tensor<2>>,
) -> Tensor<2> {
    softmax(head.forward_masked(distances, mask), 1).narrow(1, DIFFERENT, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DenseWeights, Weights};
    use burn::optim::GradientsParams;
    use burn::tensor::Device;

    /// Tensors written by `tests/golden/siamese_with_torch.py`.
    struct Golden(Weights);

    impl Golden {
        fn read() -> Self {
            let file = include_bytes!("../../tests/golden/siamese.safetensors");
            Self(Weights::from_safetensors(file).unwrap())
        }

        fn values(&self, name: &str) -> &[f32] {
            &self.0.0[name].values
        }

        fn tensor(&self, name: &str) -> Tensor<2> {
            let shape = [self.0.0[name].shape[0], self.0.0[name].shape[1]];
            let values = self.values(name).to_vec();
            Tensor::from_data(TensorData::new(values, shape), &Device::flex())
        }

        #[track_caller]
        fn agrees<const D: usize>(&self, name: &str, found: Tensor<D>) {
            let found: Vec<f32> = found.into_data().try_into_vec().unwrap();
            let expected = self.values(name);
            assert_eq!(found.len(), expected.len(), "{name}");
            let scale = expected.iter().fold(1e-3_f32, |m, v| m.max(v.abs()));
            for (found, expected) in found.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 1e-5 * scale,
                    "{name}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn the_contrastive_loss_of_a_distance_has_pytorchs_gradient() {
        let golden = Golden::read();
        let [first, second] =
            ["first", "second"].map(|name| golden.tensor(name).autodiff().require_grad());
        let scaled = distance(first.clone(), second.clone()).mul_scalar(0.5);
        let loss = contrastive_loss(scaled, golden.tensor("different").autodiff(), 1.5);
        golden.agrees("direct.loss", loss.clone().inner());
        let gradients = loss.backward();
        golden.agrees("direct.d_first", first.grad(&gradients).unwrap());
        golden.agrees("direct.d_second", second.grad(&gradients).unwrap());
    }

    #[test]
    fn the_pair_network_has_pytorchs_loss_and_gradients() {
        let golden = Golden::read();
        let layers: Vec<DenseWeights> = (0..3)
            .map(|index| DenseWeights {
                weight: golden.values(&format!("weight{index}")).to_vec(),
                bias: golden.values(&format!("bias{index}")).to_vec(),
            })
            .collect();
        let head = Mlp::from_layers(&layers, &Device::flex().autodiff());
        let distances = distance(golden.tensor("first"), golden.tensor("second")).autodiff();
        let p = probability_of_difference(&head, distances, |layer, _| {
            (layer == 1).then(|| golden.tensor("mask").autodiff())
        });
        golden.agrees("p_different", p.clone().inner());
        let loss = contrastive_loss(p, golden.tensor("different").autodiff(), 1.0);
        golden.agrees("loss", loss.clone().inner());
        let mut gradients = loss.backward();
        let gradients = GradientsParams::from_module(&mut gradients, &head);
        for (index, layer) in head.layers.iter().enumerate() {
            let weight: Tensor<2> = gradients.get(layer.weight.id).unwrap();
            let bias: Tensor<1> = gradients.get(layer.bias.id).unwrap();
            golden.agrees(&format!("d_weight{index}"), weight);
            golden.agrees(&format!("d_bias{index}"), bias);
        }
    }

    #[test]
    fn the_loss_of_a_batch_is_that_of_its_pairs_by_kind_and_has_their_gradient() {
        let labels = [0, 1, 0, 2, 1];
        let (width, margin) = (4, 0.9);
        let rows: Vec<f32> = (0..20).map(|i| ((i * 37) % 17) as f32 / 9.0).collect();
        let sweeps = |rows: &[f32]| {
            let data = TensorData::new(rows.to_vec(), [rows.len() / width, width]);
            Tensor::<2>::from_data(data, &Device::flex())
                .autodiff()
                .require_grad()
        };
        let batch = sweeps(&rows);
        let (loss, distances) = batch_contrastive_loss(batch.clone(), &labels, margin);
        let found: Vec<f32> = batch
            .grad(&loss.backward())
            .unwrap()
            .into_data()
            .try_into_vec()
            .unwrap();

        let whole = sweeps(&rows);
        let row = |i: usize| whole.clone().narrow(0, i, 1);
        let means = [false, true].map(|different| {
            let pairs = (0..5).flat_map(|i| (i + 1..5).map(move |j| (i, j)));
            let pairs: Vec<(usize, usize)> = pairs
                .filter(|(i, j)| (labels[*i] != labels[*j]) == different)
                .collect();
            assert!(pairs.len() > 1);
            let losses = pairs.iter().map(|&(i, j)| {
                let apart = distance(row(i), row(j)).div_scalar((width as f64).sqrt());
                let kind =
                    Tensor::<2>::full([1, 1], f64::from(u8::from(different)), &whole.device());
                contrastive_loss(apart, kind, margin)
            });
            Tensor::cat(losses.collect(), 0).mean()
        });
        let expected = (means[0].clone() + means[1].clone()).mul_scalar(0.5);
        let apart = (expected.clone().inner() - loss.inner()).abs();
        assert!(apart.into_scalar::<f32>() < 1e-6);
        let gradient = whole.grad(&expected.backward()).unwrap();
        let expected: Vec<f32> = gradient.into_data().try_into_vec().unwrap();
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        assert_eq!(distances.dims(), [5, 5]);
    }

    #[test]
    fn a_batch_of_one_material_has_a_loss_that_is_a_number() {
        let rows = Tensor::<2>::ones([3, 2], &Device::flex());
        let (loss, _) = batch_contrastive_loss(rows, &[1, 1, 1], 1.0);
        assert!(loss.into_scalar::<f32>().abs() < 1e-6);
    }

    #[test]
    fn equal_sweeps_have_a_gradient_that_is_a_number() {
        let sweeps = Tensor::<2>::ones([2, 3], &Device::flex())
            .autodiff()
            .require_grad();
        let other = Tensor::<2>::ones([2, 3], &Device::flex()).autodiff();
        let different = Tensor::<2>::ones([2, 1], &Device::flex()).autodiff();
        let gradients =
            contrastive_loss(distance(sweeps.clone(), other), different, 1.0).backward();
        let gradient: Vec<f32> = sweeps
            .grad(&gradients)
            .unwrap()
            .into_data()
            .try_into_vec()
            .unwrap();
        assert!(gradient.iter().all(|g| g.is_finite()), "{gradient:?}");
    }
}
