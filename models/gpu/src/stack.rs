//! Training steps of several networks with one architecture: every kernel is launched once for all of them.
//!
//! Each network has its own weights, sweeps, dropout masks and batches. Smaller batches are padded with sweeps of zeros, which
//! statistics and loss exclude and whose gradient is zero. The order of summation depends on sizes only, so a network's results
//! do not depend on the other networks in the stack.

mod upload;

use std::fmt;
use std::ops::Range;

use cubecl::client::Client;
use cubecl::prelude::*;

use crate::blocks::{Blocks, Saved};
use crate::dense::DenseShape;
use crate::head::{Head, LossInputs, PassedDense};
use crate::networks::{LayerParameters, Place, Stacked, Statistics};
use crate::stack_adam::{AdamMethod, AdamState, StepInputs, adam, follow};
use crate::stack_data::{
    StackBatch, StackDigits, StackMeasured, StackMethod, StackState, StackSweeps,
};
use crate::stack_shape::StackShape;
use crate::sweeps::{Digits, perturbed};
use upload::OnDevice;

/// Networks that train together on a device.
pub struct Stack {
    client: Client,
    shape: StackShape,
    method: StackMethod,
    blocks: Vec<Blocks>,
    head: Head,
    digits: Option<Digits>,
    epsilon: Option<Stacked>,
    adam_state: AdamState,
    running: Stacked,
    /// For each statistic, the index of the step's number that corrects its bias.
    factors: Stacked,
    /// Measurements of each pass of each step since the last call of [`Stack::measured`].
    measured: Vec<Vec<Stacked>>,
}

impl fmt::Debug for Stack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Stack").field(&self.shape).finish()
    }
}

impl Stack {
    /// Uploads networks to a device.
    ///
    /// # Panics
    /// If `state` or `digits` do not match the shape.
    pub fn new(
        client: &Client,
        shape: StackShape,
        method: StackMethod,
        state: &StackState,
        digits: Option<StackDigits<'_>>,
    ) -> Self {
        let networks = shape.networks;
        let upload = |values: &[f32], len: usize| {
            assert_eq!(values.len(), networks * len, "numbers of each network");
            Stacked::each(
                &client.create_from_slice(f32::as_bytes(values)),
                networks,
                len,
            )
        };
        let [first, second] = &state.moments;
        let adam_state = AdamState {
            parameters: upload(&state.parameters, shape.parameters()),
            first: upload(first, shape.parameters()),
            second: upload(second, shape.parameters()),
        };
        let mut factors = vec![0_u32; shape.statistics()];
        for layer in 0..shape.layers() {
            // After rate and epsilon.
            factors[shape.variance(layer)].fill(2 + layer as u32);
        }
        let of_factors = client.create_from_slice(u32::as_bytes(&factors));
        let shapes = shape.block_shapes();
        let plan = |block| Blocks::plan(client, block, networks);
        Self {
            client: client.clone(),
            blocks: shapes.into_iter().map(plan).collect(),
            head: Head {
                batch: shape.batch,
                steps: shape.pooled_steps(),
                taxels: shape.taxels,
                maps: shape.last_maps(),
                words: shape.mask_words(),
                hidden: shape.hidden,
                materials: shape.materials,
                // The counts come first among a step's words.
                counts: Place::each(1),
            },
            digits: digits.map(|digits| Digits::upload(client, &shape, digits)),
            epsilon: method
                .attack
                .as_ref()
                .map(|attack| upload(&attack.epsilon, shape.taxels)),
            adam_state,
            running: upload(&state.running, shape.statistics()),
            factors: Stacked::single(&of_factors, factors.len()),
            measured: Vec::new(),
            shape,
            method,
        }
    }

    /// Returns the sizes of the networks.
    pub fn shape(&self) -> &StackShape {
        &self.shape
    }

    /// Queues one training step of every network whose batch has sweeps, without waiting for the device.
    ///
    /// # Panics
    /// If the batch does not match the shape, or selects from sweeps that were not uploaded.
    pub fn step(&mut self, batch: &StackBatch<'_>) {
        let device = self.upload(batch);
        let sweeps = self.sweeps(batch, &device);
        let Passes {
            gradients,
            measured,
            statistics,
        } = self.passes(&device, &sweeps);
        let networks = self.shape.networks;
        let inputs = StepInputs {
            of_step: &device.of_step,
            counts: &device.counts,
        };
        let method = AdamMethod {
            step: self.method.adam,
            penalized: self.method.penalized,
        };
        self.adam_state = adam(
            &self.client,
            networks,
            &self.adam_state,
            &gradients,
            inputs,
            method,
        );
        for batch in &statistics {
            self.running = follow(
                &self.client,
                networks,
                &self.running,
                batch,
                &self.factors,
                inputs,
            );
        }
        self.measured.push(measured);
    }

    /// Returns the normalised sweeps of a batch: the uploaded ones, or a choice of those on the device.
    fn sweeps(&self, batch: &StackBatch<'_>, device: &OnDevice) -> Stacked {
        match (&batch.sweeps, &device.chosen, &self.digits) {
            (StackSweeps::Values(values), _, _) => {
                let len = self.shape.batch * self.shape.values();
                assert_eq!(values.len(), self.shape.networks * len, "normalised sweeps");
                let handle = self.client.create_from_slice(f32::as_bytes(values));
                Stacked::each(&handle, self.shape.networks, len)
            }
            (_, Some(chosen), Some(digits)) => {
                digits.batch(&self.client, self.shape.networks, chosen, &device.counts)
            }
            _ => panic!("sweeps are chosen from those on the device"),
        }
    }

    /// Runs the pass on the sweeps and, if there is an attack, the one on perturbed sweeps.
    fn passes(&self, device: &OnDevice, sweeps: &Stacked) -> Passes {
        let Some(attack) = &self.method.attack else {
            let pass = self.pass(device, 0, sweeps, 1.0, false);
            return Passes {
                gradients: vec![pass.gradients],
                measured: vec![pass.measured],
                statistics: vec![pass.statistics],
            };
        };
        // The sign of dE/dx needs a clean loss even if its weight is zero.
        let weight = if attack.alpha > 0.0 {
            attack.alpha
        } else {
            1.0
        };
        let clean = self.pass(device, 0, sweeps, weight as f32, true);
        let moved = self.attacked(sweeps, &clean);
        let share = (1.0 - attack.alpha) as f32;
        let attacked = self.pass(device, 1, &moved, share, false);
        let mut passes = Passes {
            gradients: vec![attacked.gradients],
            measured: vec![clean.measured, attacked.measured],
            statistics: vec![clean.statistics],
        };
        if attack.alpha > 0.0 {
            passes.gradients.insert(0, clean.gradients);
        }
        if attack.follow_both {
            passes.statistics.push(attacked.statistics);
        }
        passes
    }

    fn attacked(&self, sweeps: &Stacked, clean: &Pass) -> Stacked {
        let (Some(gradient), Some(epsilon)) = (&clean.input, &self.epsilon) else {
            panic!("an attack has an epsilon, and a gradient of the sweeps");
        };
        perturbed(&self.client, &self.shape, sweeps, gradient, epsilon)
    }

    /// Runs forward and backward pass of all networks.
    ///
    /// - `number`: index of the pass, which selects its mask
    /// - `weight`: factor of the loss in its gradient
    /// - `need_input`: true if the gradient of the sweeps is needed
    fn pass(
        &self,
        device: &OnDevice,
        number: usize,
        sweeps: &Stacked,
        weight: f32,
        need_input: bool,
    ) -> Pass {
        let (client, networks) = (&self.client, self.shape.networks);
        let targets = Targets {
            statistics: Stacked::floats(client, networks, self.shape.statistics()),
            gradients: Stacked::floats(client, networks, self.shape.parameters()),
        };
        let mut maps = sweeps.clone();
        let mut saved = Vec::with_capacity(self.blocks.len());
        for (layer, block) in self.blocks.iter().enumerate() {
            let statistics = self.statistics(&targets.statistics, layer);
            let parameters = self.layer(&self.adam_state.parameters, layer);
            let (pooled, left) =
                block.forward_train(client, &device.counts, &maps, &parameters, &statistics);
            maps = pooled;
            saved.push(left);
        }
        let (of_maps, measured) = self.pass_head(device, number, &maps, weight, &targets);
        let input = self.backward_blocks(saved, of_maps, &targets, need_input);
        Pass {
            gradients: targets.gradients,
            statistics: targets.statistics,
            measured,
            input,
        }
    }

    /// Runs forward and backward pass of the head on the last block's `maps`; returns their gradient and the measurements.
    fn pass_head(
        &self,
        device: &OnDevice,
        number: usize,
        maps: &Stacked,
        weight: f32,
        targets: &Targets,
    ) -> (Stacked, Stacked) {
        let (client, shape, head) = (&self.client, &self.shape, &self.head);
        let (networks, last) = (shape.networks, self.blocks.len());
        let (counts, mask) = (&device.counts, &device.masks[number]);
        let parameters = &self.adam_state.parameters;
        let gradients = &targets.gradients;
        let [dense_shape, output_shape] = self.dense_shapes();
        let [dense_layer, into_dense] = [parameters, gradients].map(|of| self.layer(of, last));
        let [output, into_output] =
            [parameters, gradients].map(|of| part(of, &shape.weight(last + 1)));
        let [bias, into_bias] = [parameters, gradients].map(|of| part(of, &shape.bias()));
        let statistics = self.statistics(&targets.statistics, last);

        let dropped = head.drop_out(client, networks, maps, mask, self.method.kept);
        let dense = dense_shape.forward(client, networks, &dropped, &dense_layer.weight);
        let hidden = head.normalise(client, networks, &dense, counts, &dense_layer, &statistics);
        let logits = output_shape.forward(client, networks, &hidden, &output);
        let inputs = LossInputs {
            logits: &logits,
            bias: &bias,
            labels: &device.labels,
            counts,
        };
        let [of_logits, measured] = head.losses(client, networks, &inputs, weight);

        output_shape.weight_gradient(client, networks, &of_logits, &hidden, &into_output);
        head.bias_gradient(client, networks, &of_logits, &into_bias);
        let of_hidden = output_shape.input_gradient(client, networks, &of_logits, &output);
        let passed = PassedDense {
            dense: &dense,
            hidden: &hidden,
            gradient: &of_hidden,
            counts,
            gamma: &dense_layer.gamma,
            statistics: &statistics,
            of_gamma: &into_dense.gamma,
            of_beta: &into_dense.beta,
        };
        let of_dense = head.normalise_gradient(client, networks, &passed);
        dense_shape.weight_gradient(client, networks, &of_dense, &dropped, &into_dense.weight);
        let of_dropped =
            dense_shape.input_gradient(client, networks, &of_dense, &dense_layer.weight);
        let of_maps = head.drop_out_gradient(client, networks, &of_dropped, mask, self.method.kept);
        (of_maps, measured)
    }

    /// Returns the sizes of dense and output layer.
    fn dense_shapes(&self) -> [DenseShape; 2] {
        let shape = &self.shape;
        let layer = |inputs, outputs| DenseShape {
            rows: shape.batch,
            inputs,
            outputs,
        };
        [
            layer(shape.features(), shape.hidden),
            layer(shape.hidden, shape.materials),
        ]
    }

    /// Runs the backward pass of the blocks; returns the gradient of the sweeps if requested.
    fn backward_blocks(
        &self,
        saved: Vec<Saved>,
        of_maps: Stacked,
        targets: &Targets,
        need_input: bool,
    ) -> Option<Stacked> {
        let mut gradient = Some(of_maps);
        for (layer, (block, left)) in self.blocks.iter().zip(saved).enumerate().rev() {
            let into = self.layer(&targets.gradients, layer);
            gradient = gradient.and_then(|gradient| {
                block.backward(
                    &self.client,
                    left,
                    &gradient,
                    &into,
                    layer > 0 || need_input,
                )
            });
        }
        gradient
    }

    /// Returns a normalised layer's part of all statistics.
    fn statistics(&self, all: &Stacked, layer: usize) -> Statistics {
        Statistics {
            mean: part(all, &self.shape.mean(layer)),
            variance: part(all, &self.shape.variance(layer)),
        }
    }

    /// Returns a normalised layer's part of all parameters or of their gradients.
    fn layer(&self, all: &Stacked, layer: usize) -> LayerParameters {
        let shape = &self.shape;
        LayerParameters {
            weight: part(all, &shape.weight(layer)),
            gamma: part(all, &shape.gamma(layer)),
            beta: part(all, &shape.beta(layer)),
        }
    }

    /// Waits for the device and returns the measurements of every network at each step since the last call.
    pub fn measured(&mut self) -> Vec<Vec<StackMeasured>> {
        let steps = std::mem::take(&mut self.measured);
        let handles = steps.iter().flatten().map(|pass| pass.buffer.0.clone());
        let read = self.read_all(handles.collect());
        let mut read = read.into_iter();
        steps
            .iter()
            .map(|passes| {
                let of_passes: Vec<Vec<f32>> = read.by_ref().take(passes.len()).collect();
                (0..self.shape.networks)
                    .map(|network| {
                        let value = |pass: usize, which: usize| {
                            of_passes
                                .get(pass)
                                .map_or(0.0, |all| all[2 * network + which])
                        };
                        StackMeasured {
                            loss: [value(0, 0), value(1, 0)],
                            correct: [value(0, 1) as usize, value(1, 1) as usize],
                        }
                    })
                    .collect()
            })
            .collect()
    }

    /// Waits for the device and returns the current state of the networks.
    pub fn state(&self) -> StackState {
        let AdamState {
            parameters,
            first,
            second,
        } = &self.adam_state;
        let all = [parameters, first, second, &self.running];
        let handles = all.map(|stacked| stacked.buffer.0.clone());
        let mut read = self.read_all(handles.to_vec()).into_iter();
        let mut next = || read.next().unwrap_or_default();
        StackState {
            parameters: next(),
            moments: [next(), next()],
            running: next(),
        }
    }

    fn read_all(&self, handles: Vec<cubecl::server::Handle>) -> Vec<Vec<f32>> {
        if handles.is_empty() {
            return Vec::new();
        }
        let read = self
            .client
            .read(handles)
            .unwrap_or_else(|error| panic!("the device does not answer: {error:?}"));
        read.iter()
            .map(|bytes| f32::from_bytes(bytes).to_vec())
            .collect()
    }
}

/// Buffers that a pass fills.
struct Targets {
    statistics: Stacked,
    gradients: Stacked,
}

/// Results of a step's passes.
struct Passes {
    gradients: Vec<Stacked>,
    measured: Vec<Stacked>,
    statistics: Vec<Stacked>,
}

/// Results of a pass.
struct Pass {
    gradients: Stacked,
    statistics: Stacked,
    measured: Stacked,
    /// Gradient of the sweeps, if requested.
    input: Option<Stacked>,
}

/// Returns a range of each network's numbers.
fn part(all: &Stacked, range: &Range<usize>) -> Stacked {
    all.after(range.start)
}
