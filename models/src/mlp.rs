//! Multilayer perceptron on feature vectors.

use burn::module::{Module, Param};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;

use crate::Features;
use crate::initial::{constant_parameter, parameter, uniform_parameter};
use crate::values::values;

/// Weights of one layer: `y = weight x + bias`.
#[derive(Debug, Clone, PartialEq)]
pub struct DenseWeights {
    /// `[outputs][inputs]`, row-major.
    pub weight: Vec<f32>,
    /// `[outputs]`
    pub bias: Vec<f32>,
}

/// Trainable layer without activation.
#[derive(Module, Debug)]
pub(crate) struct Dense {
    /// `[outputs, inputs]`
    pub(crate) weight: Param<Tensor<2>>,
    /// `[outputs]`
    pub(crate) bias: Param<Tensor<1>>,
}

/// Multilayer perceptron with ReLU after every layer except the last.
#[derive(Module, Debug)]
pub struct Mlp {
    pub(crate) layers: Vec<Dense>,
}

impl Mlp {
    /// Creates a network with random weights.
    ///
    /// - `widths`: number of inputs, of units in each hidden layer, of outputs
    ///
    /// # Panics
    /// If there are fewer than two widths.
    pub fn init(widths: &[usize], device: &Device, rng: &mut impl Rng) -> Self {
        assert!(widths.len() > 1, "an input and an output");
        let layers = widths
            .windows(2)
            .zip((1..).step_by(2))
            .map(|(ends, id)| Dense {
                weight: uniform_parameter(id, [ends[1], ends[0]], ends[0], device, rng),
                bias: constant_parameter(id + 1, 0.0, [ends[1]], device),
            })
            .collect();
        Self { layers }
    }

    /// Creates a network from given weights.
    ///
    /// # Panics
    /// If the weights of a layer are not whole rows.
    pub fn from_layers(layers: &[DenseWeights], device: &Device) -> Self {
        let layers = layers
            .iter()
            .zip((1..).step_by(2))
            .map(|(layer, id)| {
                let outputs = layer.bias.len();
                assert_eq!(layer.weight.len() % outputs, 0, "whole rows");
                let shape = [outputs, layer.weight.len() / outputs];
                let weight = TensorData::new(layer.weight.clone(), shape);
                let bias = TensorData::new(layer.bias.clone(), [outputs]);
                Dense {
                    weight: parameter(id, Tensor::from_data(weight, device)),
                    bias: parameter(id + 1, Tensor::from_data(bias, device)),
                }
            })
            .collect();
        Self { layers }
    }

    /// Returns the outputs: `[rows, inputs] -> [rows, outputs]`.
    pub fn forward(&self, rows: Tensor<2>) -> Tensor<2> {
        self.forward_masked(rows, |_, _| None)
    }

    /// Returns the outputs with dropout: `mask(layer, width)` gives the mask `[rows, width]` for the inputs of a layer.
    pub fn forward_masked(
        &self,
        rows: Tensor<2>,
        mut mask: impl FnMut(usize, usize) -> Option<Tensor<2>>,
    ) -> Tensor<2> {
        let last = self.layers.len() - 1;
        let mut values = rows;
        for (index, layer) in self.layers.iter().enumerate() {
            if let Some(mask) = mask(index, values.dims()[1]) {
                values = values * mask;
            }
            values = values.matmul(layer.weight.val().transpose()) + layer.bias.val().unsqueeze();
            if index < last {
                values = relu(values);
            }
        }
        values
    }

    /// Returns the outputs of all rows at once, without autodiff.
    pub fn apply(&self, features: &Features) -> Features {
        let rows = matrix(features, &self.device());
        let out = self.forward(rows);
        let width = out.dims()[1];
        Features::new(width, values(out))
    }

    /// Returns the device of the weights.
    pub fn device(&self) -> Device {
        self.layers[0].weight.val().device()
    }

    /// Returns the weights of all layers.
    pub fn layers(&self) -> Vec<DenseWeights> {
        self.layers
            .iter()
            .map(|layer| DenseWeights {
                weight: values(layer.weight.val()),
                bias: values(layer.bias.val()),
            })
            .collect()
    }
}

/// Converts feature vectors to a tensor `[sweeps, width]`.
pub fn matrix(features: &Features, device: &Device) -> Tensor<2> {
    let shape = [features.len(), features.width()];
    Tensor::from_data(TensorData::new(features.values().to_vec(), shape), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_and_relu_and_masks_do_what_they_say() {
        let device = Device::flex();
        let layers = [
            DenseWeights {
                weight: vec![1.0, 2.0, -1.0, 0.0],
                bias: vec![0.5, 0.0],
            },
            DenseWeights {
                weight: vec![1.0, 3.0],
                bias: vec![-1.0],
            },
        ];
        let mlp = Mlp::from_layers(&layers, &device);
        assert_eq!(mlp.layers(), layers);
        let features = Features::new(2, vec![1.0, 1.0, -2.0, 0.0]);
        // relu(3.5, -1) = (3.5, 0); relu(-1.5, 2) = (0, 2).
        assert_eq!(mlp.apply(&features).values(), [2.5, 5.0]);
        let masked = mlp.forward_masked(matrix(&features, &device), |layer, width| {
            (layer == 1).then(|| Tensor::full([2, width], 2.0, &device))
        });
        assert_eq!(values(masked), [6.0, 11.0]);
    }
}
