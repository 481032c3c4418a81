//! Several TactNet-II networks of one architecture that train at once on one GPU, with tensors named as in [`Weights`].

use std::collections::BTreeMap;
use std::ops::Range;

use burn::backend::DispatchDevice;
use burn::tensor::Device;
use cubecl::client::Client;
use tactnet_conv::AdamStep;
use tactnet_conv_gpu::{
    Stack, StackAttack, StackBatch, StackDigits, StackMeasured, StackMethod, StackShape, StackState,
};

use crate::config::TrunkShape;
use crate::{ModelError, NamedTensor, NetworkConfig, Weights};

/// Training state of one network in a stack.
#[derive(Debug, Clone, PartialEq)]
pub struct StackedNet {
    /// Parameters and running statistics.
    pub weights: Weights,
    /// Adam's first and second moments under the names of the parameters; `None` before the first step.
    pub moments: Option<[Weights; 2]>,
}

/// Training settings that all networks of a stack share.
#[derive(Debug, Clone, PartialEq)]
pub struct StackSettings {
    /// Maximum number of sweeps in a batch.
    pub batch: usize,
    /// L2 penalty and betas of Adam; learning rate and epsilon come with each network's batch.
    pub adam: AdamStep,
    /// True if the L2 penalty applies to weights only, not to biases and batch normalisation.
    pub penalize_weights_only: bool,
    /// Adversarial perturbation of the sweeps, if any.
    pub attack: Option<StackAttack>,
}

/// Networks that train together on a GPU.
#[derive(Debug)]
pub struct NetStack {
    stack: Stack,
    /// Name and shape of every tensor.
    tensors: BTreeMap<String, Vec<usize>>,
}

/// Range of a tensor within the parameters or the statistics of a network.
enum Part {
    Parameter(Range<usize>),
    Statistic(Range<usize>),
}

impl NetStack {
    /// Returns the sizes of a stack of `networks` networks; `None` unless they have convolution blocks.
    ///
    /// - `batch`: maximum number of sweeps in a batch
    pub fn shape(config: &NetworkConfig, networks: usize, batch: usize) -> Option<StackShape> {
        let TrunkShape::Convolutions(trunk) = config.trunk() else {
            return None;
        };
        let blocks = trunk.maps.iter().zip(&trunk.pools);
        Some(StackShape {
            networks,
            batch,
            steps: trunk.input.steps,
            taxels: trunk.input.taxels,
            blocks: blocks.map(|(maps, pool)| [*maps, *pool]).collect(),
            kernel: trunk.kernel,
            hidden: config.architecture().hidden,
            materials: config.materials(),
        })
    }

    /// Returns the maximum number of networks in a stack on `device`; 0 if the device or the network does not support stacks.
    ///
    /// No buffer may exceed the device's limit, and the total may not exceed half of its memory.
    /// `bytes` replaces that half if the driver does not report the memory size.
    pub fn most(device: &Device, config: &NetworkConfig, batch: usize, bytes: usize) -> usize {
        let (Some(client), Some(one)) = (client(device), Self::shape(config, 1, batch)) else {
            return 0;
        };
        let memory = &client.properties().memory;
        let bytes = memory.max_memory().map_or(bytes, |all| all as usize / 2);
        let largest = memory.max_page_size as usize;
        let by_buffer = largest / one.largest_buffer().max(1);
        // A grid has at most 65 535 cubes along its last axis, and each window of a sweep takes one.
        let by_grid = 65_535 / (batch * one.steps.div_ceil(100)).max(256);
        (bytes / one.bytes().max(1)).min(by_buffer).min(by_grid)
    }

    /// Uploads networks to `device`.
    ///
    /// # Errors
    /// The device is not a GPU; the network has no convolution blocks; weights do not match `config`.
    pub fn start(
        device: &Device,
        config: &NetworkConfig,
        settings: StackSettings,
        nets: &[StackedNet],
        digits: Option<StackDigits<'_>>,
    ) -> Result<Self, ModelError> {
        let unfit = |reason: &str| ModelError::Compute {
            device: "gpu",
            reason: reason.into(),
        };
        let client = client(device).ok_or_else(|| unfit("networks are stacked on GPUs alone"))?;
        let shape = Self::shape(config, nets.len(), settings.batch)
            .ok_or_else(|| unfit("of networks only TactNet-II are stacked"))?;
        let tensors: BTreeMap<String, Vec<usize>> =
            nets.first().map_or_else(BTreeMap::new, |net| {
                let all = net.weights.0.iter();
                all.map(|(name, tensor)| (name.clone(), tensor.shape.clone()))
                    .collect()
            });
        let mut state = StackState {
            parameters: Vec::new(),
            moments: [Vec::new(), Vec::new()],
            running: Vec::new(),
        };
        for net in nets {
            let mut parameters = vec![0.0; shape.parameters()];
            let mut running = vec![0.0; shape.statistics()];
            put(&shape, &net.weights, &mut parameters, Some(&mut running))?;
            state.parameters.append(&mut parameters);
            state.running.append(&mut running);
            for (which, all) in state.moments.iter_mut().enumerate() {
                let mut moment = vec![0.0; shape.parameters()];
                if let Some(moments) = &net.moments {
                    put(&shape, &moments[which], &mut moment, None)?;
                }
                all.append(&mut moment);
            }
        }
        let penalized = if settings.penalize_weights_only {
            shape.weights()
        } else {
            shape.parameters()
        };
        let method = StackMethod {
            kept: (1.0 / config.architecture().keep_probability) as f32,
            adam: settings.adam,
            penalized,
            attack: settings.attack,
        };
        Ok(Self {
            stack: Stack::new(&client, shape, method, &state, digits),
            tensors,
        })
    }

    /// Queues one training step of every network whose batch has sweeps, without waiting for the GPU.
    ///
    /// # Panics
    /// If the batch does not match the sizes of the stack.
    pub fn step(&mut self, batch: &StackBatch<'_>) {
        self.stack.step(batch);
    }

    /// Waits for the GPU and returns the measurements of every network at each step since the last call.
    pub fn measured(&mut self) -> Vec<Vec<StackMeasured>> {
        self.stack.measured()
    }

    /// Waits for the GPU and returns the current state of the networks.
    pub fn nets(&self) -> Vec<StackedNet> {
        let shape = self.stack.shape();
        let state = self.stack.state();
        let [first, second] = &state.moments;
        let of = |all: &'_ [f32], network: usize, len: usize| all[network * len..][..len].to_vec();
        (0..shape.networks)
            .map(|network| {
                let parameters = of(&state.parameters, network, shape.parameters());
                let running = of(&state.running, network, shape.statistics());
                let moments = [first, second].map(|moment| {
                    let moment = of(moment, network, shape.parameters());
                    self.named(&moment, None)
                });
                StackedNet {
                    weights: self.named(&parameters, Some(&running)),
                    moments: Some(moments),
                }
            })
            .collect()
    }

    fn named(&self, parameters: &[f32], running: Option<&[f32]>) -> Weights {
        let mut named = Weights::default();
        for (name, part) in parts(self.stack.shape()) {
            let values = match (part, running) {
                (Part::Parameter(range), _) => &parameters[range],
                (Part::Statistic(range), Some(running)) => &running[range],
                (Part::Statistic(_), None) => continue,
            };
            let shape = self.tensors.get(&name).cloned();
            let tensor = NamedTensor {
                shape: shape.unwrap_or_else(|| vec![values.len()]),
                values: values.to_vec(),
            };
            named.0.insert(name, tensor);
        }
        named
    }
}

/// Returns the range of every tensor with its name.
fn parts(shape: &StackShape) -> Vec<(String, Part)> {
    let mut parts = Vec::new();
    for layer in 0..shape.layers() {
        let name = if layer + 1 < shape.layers() {
            format!("conv{}", layer + 1)
        } else {
            "hidden".to_owned()
        };
        parts.extend([
            (
                format!("{name}.weight"),
                Part::Parameter(shape.weight(layer)),
            ),
            (format!("{name}.gamma"), Part::Parameter(shape.gamma(layer))),
            (format!("{name}.beta"), Part::Parameter(shape.beta(layer))),
            (
                format!("{name}.running_mean"),
                Part::Statistic(shape.mean(layer)),
            ),
            (
                format!("{name}.running_variance"),
                Part::Statistic(shape.variance(layer)),
            ),
        ]);
    }
    let output = shape.weight(shape.layers());
    parts.push(("output.weight".to_owned(), Part::Parameter(output)));
    parts.push(("output.bias".to_owned(), Part::Parameter(shape.bias())));
    parts
}

/// Copies named tensors to their ranges.
fn put(
    shape: &StackShape,
    weights: &Weights,
    parameters: &mut [f32],
    mut running: Option<&mut [f32]>,
) -> Result<(), ModelError> {
    for (name, part) in parts(shape) {
        let target = match (part, &mut running) {
            (Part::Parameter(range), _) => &mut parameters[range],
            (Part::Statistic(range), Some(running)) => &mut running[range],
            (Part::Statistic(_), None) => continue,
        };
        let found = weights.0.get(&name).map(|tensor| &tensor.values);
        match found {
            Some(values) if values.len() == target.len() => target.copy_from_slice(values),
            found => {
                return Err(ModelError::Weights {
                    tensor: name,
                    expected: format!("{} numbers", target.len()),
                    found: found.map_or("no such tensor".into(), |values| values.len().to_string()),
                });
            }
        }
    }
    Ok(())
}

/// Returns the command queue of a GPU; `None` for other devices.
fn client(device: &Device) -> Option<Client> {
    fn of(device: &DispatchDevice) -> Option<Client> {
        match device {
            DispatchDevice::Cube(device) => Some(device.client()),
            _ => None,
        }
    }
    match device.as_dispatch() {
        DispatchDevice::Autodiff(device) => of(device),
        device => of(device),
    }
}
