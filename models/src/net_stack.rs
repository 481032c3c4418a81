//! Several TactNet-II of one architecture on one GPU, trained at once: the stack of `tactnet-conv-gpu`, its tensors under the names of
//! [`Weights`].

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

/// A network of a stack at a moment.
#[derive(Debug, Clone, PartialEq)]
pub struct StackedNet {
    /// Parameters and running statistics.
    pub weights: Weights,
    /// Adam's moments, under the names of the parameters; absent before the first step.
    pub moments: Option<[Weights; 2]>,
}

/// How the networks of a stack learn, the same for all.
#[derive(Debug, Clone, PartialEq)]
pub struct StackSettings {
    /// Sweeps of a batch, at most.
    pub batch: usize,
    /// The L2 penalty and the betas of Adam; rate and epsilon are each network's own.
    pub adam: AdamStep,
    /// Whether the penalty is on weights alone, not on biases and batch normalisation.
    pub penalize_weights_only: bool,
    /// Whether sweeps are attacked.
    pub attack: Option<StackAttack>,
}

/// Networks on a GPU.
#[derive(Debug)]
pub struct NetStack {
    stack: Stack,
    /// Names and extents of all tensors.
    tensors: BTreeMap<String, Vec<usize>>,
}

/// Where a tensor lies among the numbers of a network.
enum Part {
    Parameter(Range<usize>),
    Statistic(Range<usize>),
}

impl NetStack {
    /// Returns the sizes of so many networks; `None` for networks that are none of TactNet-II's.
    ///
    /// - `batch`: sweeps of a batch, at most
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

    /// Returns how many networks fit onto the device of `device` at once: buffers of a size that it takes, and no more in all than half of its memory,
    /// or than `bytes` where its driver does not say how much it has; 0 on a device without stacks, or for networks without.
    pub fn most(device: &Device, config: &NetworkConfig, batch: usize, bytes: usize) -> usize {
        let (Some(client), Some(one)) = (client(device), Self::shape(config, 1, batch)) else {
            return 0;
        };
        let memory = &client.properties().memory;
        let bytes = memory.max_memory().map_or(bytes, |all| all as usize / 2);
        let largest = memory.max_page_size as usize;
        let by_buffer = largest / one.largest_buffer().max(1);
        // Cubes along the last axis of a grid, of which a window of a sweep takes one.
        let by_grid = 65_535 / (batch * one.steps.div_ceil(100)).max(256);
        (bytes / one.bytes().max(1)).min(by_buffer).min(by_grid)
    }

    /// Puts networks onto the device of `device`.
    ///
    /// # Errors
    /// A device that is no GPU; weights that are not those of `config`.
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

    /// One step of every network that has sweeps; asks the GPU for it and does not wait.
    ///
    /// # Panics
    /// If the batch is not of the networks' sizes.
    pub fn step(&mut self, batch: &StackBatch<'_>) {
        self.stack.step(batch);
    }

    /// Waits for the GPU, and returns what each step since the last reading measured of each network.
    pub fn measured(&mut self) -> Vec<Vec<StackMeasured>> {
        self.stack.measured()
    }

    /// Waits for the GPU, and returns the networks as they stand.
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

/// Every tensor by its name.
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

/// Writes named tensors to their places.
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

/// The queue of a GPU; `None` where `device` is none.
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
