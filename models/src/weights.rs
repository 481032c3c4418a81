//! Network weights as named tensors and as a safetensors file.

use std::collections::BTreeMap;

use burn::module::Param;
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use safetensors::tensor::{Dtype, TensorView};

use crate::initial::parameter;
use crate::network::{Network, TrunkNet};
use crate::safetensors_bytes::safetensors_bytes;
use crate::values::values;
use crate::{ModelError, NetworkConfig};

/// Shape and values of one tensor.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedTensor {
    /// Extents of the axes.
    pub shape: Vec<usize>,
    /// `f32` values, row-major.
    pub values: Vec<f32>,
}

/// Named tensors in name order: `conv1.weight`, `conv1.gamma`, `conv1.beta`, `conv1.running_mean`,
/// `conv1.running_variance`, …, `hidden.*`, `output.weight`, `output.bias`.
///
/// Networks on spectra have `taxel.*` and `window.*` in place of `conv*`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weights(pub BTreeMap<String, NamedTensor>);

impl Weights {
    /// Returns the bytes of a safetensors file with `metadata` in its header; equal content gives equal bytes.
    ///
    /// # Errors
    /// A shape does not match the number of values.
    pub fn to_safetensors(
        &self,
        metadata: BTreeMap<String, String>,
    ) -> Result<Vec<u8>, ModelError> {
        let bytes: BTreeMap<&String, Vec<u8>> = self
            .0
            .iter()
            .map(|(name, tensor)| {
                (
                    name,
                    tensor.values.iter().flat_map(|v| v.to_le_bytes()).collect(),
                )
            })
            .collect();
        let mut views = Vec::with_capacity(self.0.len());
        for (name, tensor) in &self.0 {
            views.push((
                name,
                TensorView::new(Dtype::F32, tensor.shape.clone(), &bytes[name])?,
            ));
        }
        Ok(safetensors_bytes(views, metadata)?)
    }

    /// Reads the `f32` tensors of a safetensors file and ignores tensors of other types.
    ///
    /// # Errors
    /// `bytes` is not a safetensors file.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self, ModelError> {
        let file = safetensors::SafeTensors::deserialize(bytes)?;
        let mut tensors = BTreeMap::new();
        for (name, view) in file.tensors() {
            if view.dtype() == Dtype::F32 {
                let values = view
                    .data()
                    .chunks_exact(4)
                    .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                    .collect();
                tensors.insert(
                    name,
                    NamedTensor {
                        shape: view.shape().to_vec(),
                        values,
                    },
                );
            }
        }
        Ok(Self(tensors))
    }

    /// Returns an error unless all values are finite.
    ///
    /// # Errors
    /// Names the first tensor with a value that is not finite.
    pub fn check_finite(&self) -> Result<(), ModelError> {
        for (name, tensor) in &self.0 {
            if let Some(value) = tensor.values.iter().find(|value| !value.is_finite()) {
                return Err(ModelError::Weights {
                    tensor: name.clone(),
                    expected: "finite numbers".into(),
                    found: value.to_string(),
                });
            }
        }
        Ok(())
    }

    fn put<const D: usize>(&mut self, name: String, tensor: Tensor<D>) {
        let shape = tensor.dims().to_vec();
        let values = values(tensor);
        self.0.insert(name, NamedTensor { shape, values });
    }

    fn get<const D: usize>(
        &self,
        name: &str,
        shape: [usize; D],
        device: &Device,
    ) -> Result<Tensor<D>, ModelError> {
        let wrong = |found: String| ModelError::Weights {
            tensor: name.into(),
            expected: format!("shape {shape:?}"),
            found,
        };
        let tensor = self
            .0
            .get(name)
            .ok_or_else(|| wrong("no such tensor".into()))?;
        if tensor.shape != shape {
            return Err(wrong(format!("shape {:?}", tensor.shape)));
        }
        Ok(Tensor::from_data(
            TensorData::new(tensor.values.clone(), shape),
            device,
        ))
    }
}

fn gradient_of<const D: usize>(
    gradients: &GradientsParams,
    parameter: &Param<Tensor<D>>,
) -> Option<Tensor<D>> {
    gradients.get(parameter.id)
}

/// Visits the tensors of one layer with batch normalisation.
macro_rules! normalized_layer {
    ($layer:expr, $from:expr, $parameter:ident, $statistic:ident) => {
        let layer = $layer;
        $parameter!(format!("{layer}.weight"), $from.weight);
        $parameter!(format!("{layer}.gamma"), $from.gamma);
        $parameter!(format!("{layer}.beta"), $from.beta);
        $statistic!(format!("{layer}.running_mean"), $from.running_mean);
        $statistic!(format!("{layer}.running_variance"), $from.running_variance);
    };
}

/// Visits every tensor of the network with its name. This is the only list of names.
macro_rules! for_each_tensor {
    ($net:expr, $parameter:ident, $statistic:ident) => {
        match &mut $net.trunk {
            TrunkNet::Convolutions(trunk) => {
                for (index, block) in trunk.blocks.iter_mut().enumerate() {
                    normalized_layer!(format!("conv{}", index + 1), block, $parameter, $statistic);
                }
            }
            TrunkNet::Spectra(trunk) => {
                for (layer, dense) in trunk.layers_mut() {
                    normalized_layer!(layer, dense, $parameter, $statistic);
                }
            }
        }
        normalized_layer!("hidden", $net.hidden, $parameter, $statistic);
        $parameter!("output.weight".to_string(), $net.output_weight);
        $parameter!("output.bias".to_string(), $net.output_bias);
    };
}

impl Network {
    /// Returns all weights and running statistics.
    pub fn weights(&self) -> Weights {
        let mut weights = Weights::default();
        let mut net = self.clone();
        macro_rules! parameter {
            ($name:expr, $field:expr) => {
                weights.put($name, $field.val())
            };
        }
        macro_rules! statistic {
            ($name:expr, $field:expr) => {
                weights.put($name, $field.clone())
            };
        }
        for_each_tensor!(net, parameter, statistic);
        weights
    }

    /// Returns the gradient of every parameter under the parameter's name; omits parameters that do not affect the loss.
    pub fn gradients(&self, gradients: &GradientsParams) -> Weights {
        let mut named = Weights::default();
        let mut net = self.clone();
        macro_rules! parameter {
            ($name:expr, $field:expr) => {
                if let Some(gradient) = gradient_of(gradients, &$field) {
                    named.put($name, gradient)
                }
            };
        }
        macro_rules! statistic {
            ($name:expr, $field:expr) => {};
        }
        for_each_tensor!(net, parameter, statistic);
        named
    }

    /// Creates a network from `weights` on `device`.
    ///
    /// # Errors
    /// A tensor is missing or its shape does not match `config`.
    pub fn from_weights(
        config: &NetworkConfig,
        weights: &Weights,
        device: &Device,
    ) -> Result<Self, ModelError> {
        // Prevents the allocation of a network far larger than the file. Smaller differences are reported by tensor below.
        let numbers: usize = weights.0.values().map(|tensor| tensor.values.len()).sum();
        let expected = config.parameters().unwrap_or(u64::MAX);
        if expected > (16 * numbers as u64).max(1 << 20) {
            return Err(ModelError::Weights {
                tensor: "*".into(),
                expected: format!("{expected} numbers in total, by the configuration"),
                found: numbers.to_string(),
            });
        }
        let mut net = Self::init(config, device, &mut ChaCha8Rng::seed_from_u64(0));
        macro_rules! parameter {
            ($name:expr, $field:expr) => {
                let value = weights.get(&$name, $field.dims(), device)?;
                $field = parameter($field.id.val(), value);
            };
        }
        macro_rules! statistic {
            ($name:expr, $field:expr) => {
                $field = weights.get(&$name, $field.dims(), device)?;
            };
        }
        for_each_tensor!(net, parameter, statistic);
        Ok(net)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Architecture, InputShape};

    #[test]
    fn safetensors_round_trip_restores_every_number() {
        let architecture = Architecture::tactnet2(&[2, 3], 4);
        let input = InputShape {
            steps: 50,
            taxels: 2,
        };
        let config = NetworkConfig::new(architecture, input, 3).unwrap();
        let net = Network::init(&config, &Device::flex(), &mut ChaCha8Rng::seed_from_u64(5));
        let weights = net.weights();
        assert_eq!(weights.0.len(), 2 * 5 + 5 + 2);
        let bytes = weights.to_safetensors(BTreeMap::new()).unwrap();
        let read = Weights::from_safetensors(&bytes).unwrap();
        assert_eq!(read, weights);
        let rebuilt = Network::from_weights(&config, &read, &Device::flex()).unwrap();
        assert_eq!(rebuilt.weights(), weights);
    }

    #[test]
    fn foreign_weights_are_refused_by_name() {
        let input = InputShape {
            steps: 50,
            taxels: 2,
        };
        let small = Architecture::tactnet2(&[2], 4);
        let large = Architecture::tactnet2(&[2], 5);
        let device = Device::flex();
        let config = NetworkConfig::new(small, input, 3).unwrap();
        let other = NetworkConfig::new(large, input, 3).unwrap();
        let weights = Network::init(&config, &device, &mut ChaCha8Rng::seed_from_u64(5)).weights();
        let message = Network::from_weights(&other, &weights, &device)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("hidden.weight") && message.contains("[5,"),
            "{message}"
        );
        assert!(Weights::from_safetensors(b"not a file").is_err());
    }
}
