//! Are these two sweeps of one material? A distance between two embeddings, and what is learnt about it.
//!
//! Tulbure & Bäuml, Humanoids 2018, figure 4b, after Koch et al., 2015: two identical, frozen networks, the distance between their
//! outputs, and a small network from the distance to 'same' or 'different'.

use burn::tensor::Tensor;
use burn::tensor::activation::softmax;

use crate::Mlp;

/// Added under the square root of a distance, whose gradient at zero has no direction.
const FLOOR: f64 = 1e-12;
/// Index of 'different' among the two outputs; 'same' is 0.
const DIFFERENT: usize = 1;

/// Euclidean distance of corresponding rows: two `[pairs, width]` to `[pairs, 1]`.
pub fn distance(first: Tensor<2>, second: Tensor<2>) -> Tensor<2> {
    let difference = first - second;
    ((difference.clone() * difference).sum_dim(1) + FLOOR).sqrt()
}

/// Contrastive loss (Hadsell et al., 2006, equation 4), mean over pairs:
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

/// Probability that the two differ, given their distances: `[pairs, inputs] -> [pairs, 1]`.
///
/// As the last layer has two units and a softmax, this probability is the distance that the contrastive loss is applied to, with
/// margin 1.
///
/// - `head`: two outputs, 'same' and 'different'
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
    use burn::tensor::{Device, TensorData};

    /// `tests/golden/siamese_with_torch.py`
    struct Golden(Weights);

    impl Golden {
        fn read() -> Self {
            let path = concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../tests/golden/siamese.safetensors"
            );
            Self(Weights::from_safetensors(&std::fs::read(path).unwrap()).unwrap())
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
