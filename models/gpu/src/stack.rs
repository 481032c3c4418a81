//! Training steps of several networks with one architecture: every kernel is launched once for all of them.
//!
//! Each network has its own weights, sweeps, dropout masks and batches. Smaller batches are padded with sweeps of zeros, which
//! statistics and loss exclude and whose gradient is zero. The order of summation depends on sizes only, so a network's results
//! do not depend on the other networks in the stack.

use std::fmt;
use std::ops::Range;

use cubecl::client::Client;
use cubecl::prelude::*;
use tactnet_conv::AdamStep;

use crate::blocks::{Blocks, Learnt};
use crate::head::{self, Head};
use crate::networks::{Place, Stacked};
use crate::stack_adam::{Learning, adam, follow};
use crate::stack_shape::StackShape;
use crate::sweeps::{Digits, perturbed};

/// Training method that all networks share.
#[derive(Debug, Clone, PartialEq)]
pub struct StackMethod {
    /// Factor of the features that dropout keeps.
    pub kept: f32,
    /// L2 penalty and betas of Adam; learning rate and epsilon come with each network's batch.
    pub adam: AdamStep,
    /// Number of leading parameters with an L2 penalty.
    pub penalized: usize,
    /// Adversarial perturbation of the sweeps, if any.
    pub attack: Option<StackAttack>,
}

/// Adversarial training: `alpha E(x) + (1 - alpha) E(x + r)` with `r = epsilon sign(dE/dx)`.
#[derive(Debug, Clone, PartialEq)]
pub struct StackAttack {
    /// Weight of the clean loss.
    pub alpha: f64,
    /// Perturbation of each taxel in the units of the sweeps: `[networks][taxels]`.
    pub epsilon: Vec<f32>,
    /// True if running statistics also follow the perturbed sweeps.
    pub follow_both: bool,
}

/// State of all networks, one after another.
#[derive(Debug, Clone, PartialEq)]
pub struct StackState {
    /// `[networks][parameters]`
    pub parameters: Vec<f32>,
    /// First and second moments of Adam, `[networks][parameters]` each.
    pub moments: [Vec<f32>; 2],
    /// `[networks][statistics]`: running means and variances.
    pub running: Vec<f32>,
}

/// Raw sweeps on the device, from which batches are selected.
#[derive(Debug, Clone, Copy)]
pub struct StackDigits<'a> {
    /// Bits per raw value: 8 or 16.
    pub bits: usize,
    /// `[sweeps][words]`: raw values of each sweep, the first in the lowest bits of a word.
    pub words: &'a [u32],
    /// `[networks][2][taxels]`: value to subtract from a raw value, then factor.
    pub scaling: &'a [f32],
}

/// Sweeps of a batch, `[networks][batch]`.
#[derive(Debug, Clone, Copy)]
pub enum StackSweeps<'a> {
    /// Indices of sweeps on the device.
    Chosen(&'a [u32]),
    /// `[networks][batch][steps][taxels]`, normalised.
    Values(&'a [f32]),
}

/// Batch of every network. Padding sweeps have no effect, but must be finite; use zeros.
#[derive(Debug, Clone, Copy)]
pub struct StackBatch<'a> {
    /// Number of sweeps in each network's batch; 0 leaves the network unchanged.
    pub counts: &'a [u32],
    /// Sweeps of all networks.
    pub sweeps: StackSweeps<'a>,
    /// `[networks][batch]`
    pub labels: &'a [u32],
    /// `[networks][batch][words]` for each pass (clean, perturbed): bit `f % 32` of word `f / 32` is set if feature `f` is kept.
    pub masks: &'a [&'a [u32]],
    /// Learning rate and epsilon of Adam for each network, with bias correction.
    pub rates: &'a [[f32; 2]],
}

/// Measurements of one network in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StackMeasured {
    /// Mean cross entropy in nats of the clean and of the perturbed sweeps.
    pub loss: [f32; 2],
    /// Number of correct predictions on the clean and on the perturbed sweeps; the latter is 0 without a perturbation.
    pub correct: [usize; 2],
}

/// Networks that train together on a device.
pub struct Stack {
    client: Client,
    shape: StackShape,
    method: StackMethod,
    blocks: Vec<Blocks>,
    head: Head,
    digits: Option<Digits>,
    epsilon: Option<Stacked>,
    learning: Learning,
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

/// Inputs of one step on the device.
struct OnDevice {
    counts: Stacked,
    labels: Stacked,
    masks: Vec<Stacked>,
    chosen: Option<Stacked>,
    /// `[rate, epsilon, correction of each layer's variance]`
    of_step: Stacked,
}

/// Buffer of words with several parts.
struct Words(Vec<u32>);

impl Words {
    /// Appends `[networks][len]` words and returns their location.
    fn add(&mut self, networks: usize, words: &[u32]) -> Place {
        assert_eq!(words.len() % networks, 0, "as many words for each network");
        let place = Place {
            offset: self.0.len(),
            stride: words.len() / networks,
        };
        self.0.extend_from_slice(words);
        place
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
        let learning = Learning {
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
            digits: digits.map(|digits| {
                let sizes = [shape.batch, shape.steps, shape.taxels];
                let StackDigits {
                    bits,
                    words,
                    scaling,
                } = digits;
                Digits::upload(client, networks, sizes, bits, words, scaling)
            }),
            epsilon: method
                .attack
                .as_ref()
                .map(|attack| upload(&attack.epsilon, shape.taxels)),
            learning,
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
        let sweeps = match (&batch.sweeps, &device.chosen, &self.digits) {
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
        };
        let mut gradients = Vec::new();
        let mut measured = Vec::new();
        let mut statistics = Vec::new();
        match self.method.attack.clone() {
            None => {
                let pass = self.pass(&device, 0, &sweeps, 1.0, false);
                gradients.push(pass.gradients);
                measured.push(pass.measured);
                statistics.push(pass.statistics);
            }
            Some(attack) => {
                // The sign of dE/dx needs a clean loss even if its weight is zero.
                let weight = if attack.alpha > 0.0 {
                    attack.alpha
                } else {
                    1.0
                };
                let clean = self.pass(&device, 0, &sweeps, weight as f32, true);
                let moved = self.attacked(&sweeps, &clean);
                let share = (1.0 - attack.alpha) as f32;
                let attacked = self.pass(&device, 1, &moved, share, false);
                if attack.alpha > 0.0 {
                    gradients.push(clean.gradients);
                }
                gradients.push(attacked.gradients);
                measured.extend([clean.measured, attacked.measured]);
                statistics.push(clean.statistics);
                if attack.follow_both {
                    statistics.push(attacked.statistics);
                }
            }
        }
        let networks = self.shape.networks;
        let own = [&device.of_step, &device.counts];
        self.learning = adam(
            &self.client,
            networks,
            &self.learning,
            &gradients,
            own,
            (self.method.adam, self.method.penalized),
        );
        for batch in &statistics {
            let towards = [&self.running, batch];
            self.running = follow(&self.client, networks, towards, &self.factors, own);
        }
        self.measured.push(measured);
    }

    fn attacked(&self, sweeps: &Stacked, clean: &Pass) -> Stacked {
        let (Some(gradient), Some(epsilon)) = (&clean.input, &self.epsilon) else {
            panic!("an attack has an epsilon, and a gradient of the sweeps");
        };
        let sizes = [self.shape.batch * self.shape.values(), self.shape.taxels];
        let of = [sweeps, gradient, epsilon];
        perturbed(&self.client, self.shape.networks, sizes, of)
    }

    fn upload(&self, batch: &StackBatch<'_>) -> OnDevice {
        let shape = &self.shape;
        let networks = shape.networks;
        let passes = 1 + usize::from(self.method.attack.is_some());
        let masks = networks * shape.batch * shape.mask_words();
        assert!(
            batch.counts.len() == networks
                && batch
                    .counts
                    .iter()
                    .all(|count| *count as usize <= shape.batch)
                && batch.rates.len() == networks
                && batch.labels.len() == networks * shape.batch
                && batch.masks.len() == passes
                && batch.masks.iter().all(|mask| mask.len() == masks),
            "a batch has the sizes of {shape:?}"
        );
        let mut words = Words(Vec::with_capacity(2 * batch.labels.len() + passes * masks));
        let counts = words.add(networks, batch.counts);
        let labels = words.add(networks, batch.labels);
        let masks: Vec<Place> = batch
            .masks
            .iter()
            .map(|mask| words.add(networks, mask))
            .collect();
        let chosen = match batch.sweeps {
            StackSweeps::Chosen(numbers) => Some(words.add(networks, numbers)),
            StackSweeps::Values(_) => None,
        };
        let handle = self.client.create_from_slice(u32::as_bytes(&words.0));
        let buffer = (handle, words.0.len());
        let part = |place| Stacked {
            buffer: buffer.clone(),
            place,
        };
        let mut of_step = Vec::with_capacity(networks * (2 + shape.layers()));
        for (rates, count) in batch.rates.iter().zip(batch.counts) {
            of_step.extend(rates);
            of_step.extend((0..shape.layers()).map(|layer| {
                let values = f64::from(*count) * shape.values_of_sweep(layer) as f64;
                let bessel = if values > 1.0 {
                    values / (values - 1.0)
                } else {
                    1.0
                };
                bessel as f32
            }));
        }
        let handle = self.client.create_from_slice(f32::as_bytes(&of_step));
        OnDevice {
            counts: part(counts),
            labels: part(labels),
            masks: masks.into_iter().map(part).collect(),
            chosen: chosen.map(part),
            of_step: Stacked::each(&handle, networks, 2 + shape.layers()),
        }
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
        let (client, shape, head) = (&self.client, &self.shape, &self.head);
        let networks = shape.networks;
        let (counts, mask) = (&device.counts, &device.masks[number]);
        let parameters = &self.learning.parameters;
        let statistics = Stacked::floats(client, networks, shape.statistics());
        let gradients = Stacked::floats(client, networks, shape.parameters());
        let of_layer = |layer: usize| {
            [shape.mean(layer), shape.variance(layer)].map(|range| part(&statistics, &range))
        };

        let mut maps = sweeps.clone();
        let mut saved = Vec::with_capacity(self.blocks.len());
        for (layer, block) in self.blocks.iter().enumerate() {
            let [mean, variance] = of_layer(layer);
            let learnt = self.learnt(parameters, layer);
            let (pooled, left) =
                block.forward_train(client, counts, &maps, &learnt, [&mean, &variance]);
            maps = pooled;
            saved.push(left);
        }
        let last = self.blocks.len();
        let dropped = head.drop_out(client, networks, &maps, mask, self.method.kept);
        let of_dense = self.learnt(parameters, last);
        let into_dense = self.learnt(&gradients, last);
        let dense_sizes = [shape.batch, shape.features(), shape.hidden];
        let input = [&dropped, &of_dense.weight];
        let dense = head::dense(client, networks, dense_sizes, input);
        let [mean, variance] = of_layer(last);
        let norm = [&of_dense.gamma, &of_dense.beta];
        let hidden = head.normalise(client, networks, &dense, counts, norm, [&mean, &variance]);
        let output_sizes = [shape.batch, shape.hidden, shape.materials];
        let [output, into_output] =
            [parameters, &gradients].map(|of| part(of, &shape.weight(last + 1)));
        let [bias, into_bias] = [parameters, &gradients].map(|of| part(of, &shape.bias()));
        let logits = head::dense(client, networks, output_sizes, [&hidden, &output]);
        let [of_logits, measured] = head.losses(
            client,
            networks,
            [&logits, &bias],
            [&device.labels, counts],
            weight,
        );

        let by_hidden = [&of_logits, &hidden];
        head::dense_weight_gradient(client, networks, output_sizes, by_hidden, &into_output);
        head.bias_gradient(client, networks, &of_logits, &into_bias);
        let of_hidden = head::dense_gradient(client, networks, output_sizes, [&of_logits, &output]);
        let of_dense_out = head.normalise_gradient(
            client,
            networks,
            [&dense, &hidden, &of_hidden],
            counts,
            [&of_dense.gamma, &mean, &variance],
            [&into_dense.gamma, &into_dense.beta],
        );
        let by_features = [&of_dense_out, &dropped];
        head::dense_weight_gradient(
            client,
            networks,
            dense_sizes,
            by_features,
            &into_dense.weight,
        );
        let weights = [&of_dense_out, &of_dense.weight];
        let of_dropped = head::dense_gradient(client, networks, dense_sizes, weights);
        let of_maps = head.drop_out_gradient(client, networks, &of_dropped, mask, self.method.kept);
        let mut gradient = Some(of_maps);
        for (layer, (block, left)) in self.blocks.iter().zip(saved).enumerate().rev() {
            let into = self.learnt(&gradients, layer);
            gradient = gradient.and_then(|gradient| {
                block.backward(client, left, &gradient, &into, layer > 0 || need_input)
            });
        }
        Pass {
            gradients,
            statistics,
            measured,
            input: gradient,
        }
    }

    /// Returns a normalised layer's part of all parameters or of their gradients.
    fn learnt(&self, all: &Stacked, layer: usize) -> Learnt {
        let shape = &self.shape;
        Learnt {
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
        let Learning {
            parameters,
            first,
            second,
        } = &self.learning;
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
