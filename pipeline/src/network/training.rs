//! Training of a network, one batch per call, so that the caller can show progress, stop and resume.

use burn::optim::ModuleOptimizer;
use burn::tensor::{Bytes, Device, Int, Tensor, TensorData};
use serde::{Deserialize, Serialize};
use tactnet_data::{Seed, SweepView, TrainSplit};
use tactnet_models::{Network, NetworkConfig, Weights, dropout_masks, is_cpu, spare_memory};

use crate::network::adam::FusedAdam;
use crate::network::batches::{BatchNumber, augment, batch_positions, batch_shape, fill_batch};
use crate::network::in_pool::in_pool;
use crate::network::measured::Measured;
use crate::network::objective::{Pass, Perturbation, Targets, adversarial_pass, base_pass};
use crate::network::pairs_pass::pairs_pass;
use crate::network::resident::ResidentSweeps;
use crate::network::soft_targets::SoftTargets;
use crate::{
    AdversarialMask, AdversarialStatistics, BatchReport, NetworkRecipe, Normalizer, PipelineError,
    TrainingMethod,
};

/// Training position: the next batch and the running sums of the current epoch.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    /// Epoch of the next batch, counted from 0.
    pub epoch: usize,
    /// Next batch, counted from 0.
    pub batch: usize,
    /// Sum of the loss over the sweeps of this epoch so far, in nats.
    pub loss_sum: f64,
    /// Number of sweeps of this epoch predicted correctly during training.
    pub correct: usize,
    /// Number of adversarial sweeps of this epoch predicted correctly.
    #[serde(default)]
    pub adversarial_correct: usize,
    /// Number of sweeps of this epoch so far.
    pub sweeps: usize,
}

/// State from which a restart continues exactly.
#[derive(Debug, Clone)]
pub struct TrainingState {
    /// Training position.
    pub position: Position,
    /// Parameters and running statistics.
    pub weights: Weights,
    /// Adam's moments in Burn's format.
    pub optimizer: Vec<u8>,
}

/// Accuracy on sweeps that are watched but not trained on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watched {
    /// Accuracy on clean sweeps.
    pub accuracy: f64,
    /// Accuracy on adversarial sweeps; `None` without adversarial training.
    pub adversarial_accuracy: Option<f64>,
}

/// Batch whose loss has not been read from the device.
struct Unread {
    batch: usize,
    sweeps: usize,
    measured: Measured,
}

/// Network in training. Every random choice is derived from epoch and batch, so interruptions do not change the result.
pub struct Training<'a> {
    recipe: &'a NetworkRecipe,
    train: &'a TrainSplit<'a>,
    normalizer: &'a Normalizer,
    config: NetworkConfig,
    seed: Seed,
    device: Device,
    /// Network; `None` only during the optimiser's step, which can then update it in place.
    net: Option<Network>,
    optimizer: ModuleOptimizer,
    /// Training sweeps in GPU memory, if they fit.
    resident: Option<ResidentSweeps>,
    position: Position,
    /// Batches of this epoch whose losses have not been read.
    unread: Vec<Unread>,
    /// Probabilities of the materials of the training sweeps, `[sweeps][materials]`; `None`: the labels are the targets.
    towards: Option<SoftTargets>,
    /// True for a Siamese network, which learns from pairs instead of materials.
    on_pairs: bool,
    /// Batch of the last step, for error messages.
    last: BatchNumber,
}

impl<'a> Training<'a> {
    /// Starts with fresh weights.
    ///
    /// # Errors
    /// A training set without sweeps.
    pub fn start(
        recipe: &'a NetworkRecipe,
        train: &'a TrainSplit<'a>,
        normalizer: &'a Normalizer,
        config: &NetworkConfig,
        seed: Seed,
        device: &Device,
    ) -> Result<Self, PipelineError> {
        if train.is_empty() {
            return Err(PipelineError::incompatible(
                "training sweeps",
                "at least one",
                "none",
            ));
        }
        let device = device.clone().autodiff();
        let net = Network::init(config, &device, &mut seed.rng("initial weights"));
        // Augmented sweeps differ in every epoch; sweeps of unequal length are cut differently.
        let differs =
            recipe.training.augmentation.changes(normalizer) || train.dataset().lengths().is_some();
        let resident = if is_cpu(&device) || differs {
            None
        } else {
            let plain = device.clone().without_autodiff();
            ResidentSweeps::new(train, normalizer, &plain)
        };
        Ok(Self {
            recipe,
            train,
            normalizer,
            config: config.clone(),
            seed,
            device,
            net: Some(net),
            optimizer: adam(recipe),
            resident,
            position: Position::default(),
            unread: Vec::new(),
            towards: None,
            on_pairs: false,
            last: BatchNumber { epoch: 0, batch: 0 },
        })
    }

    /// Returns the training with the objective of a Siamese network instead of the recipe's: sweeps of one material move close to each other,
    /// others apart. The output layer keeps its initial weights.
    pub(crate) fn on_pairs(self) -> Self {
        Self {
            on_pairs: true,
            ..self
        }
    }

    /// Returns the training with probabilities as targets.
    pub(crate) fn towards(self, targets: SoftTargets) -> Self {
        Self {
            towards: Some(targets),
            ..self
        }
    }

    /// Continues from `state`.
    ///
    /// # Errors
    /// A state that belongs to another network.
    pub fn resume(mut self, state: TrainingState) -> Result<Self, PipelineError> {
        let net = Network::from_weights(&self.config, &state.weights, &self.device)?;
        self.net = Some(net);
        if !state.optimizer.is_empty() {
            self.optimizer = adam(self.recipe)
                .from_bytes(Bytes::from_bytes_vec(state.optimizer))
                .map_err(|error| PipelineError::Optimizer(error.to_string()))?;
        }
        self.position = state.position;
        Ok(self)
    }

    /// Returns the restart state; waits for a GPU.
    ///
    /// # Errors
    /// A loss or weight that is not finite.
    pub fn state(&mut self) -> Result<TrainingState, PipelineError> {
        self.wait()?;
        let weights = self.net().weights();
        for (name, tensor) in &weights.0 {
            if tensor.values.iter().any(|v| !v.is_finite()) {
                return Err(self.not_finite(format!("weight {name}")));
            }
        }
        let optimizer = if self.position == Position::default() {
            Vec::new()
        } else {
            self.optimizer
                .into_bytes()
                .map_err(|error| PipelineError::Optimizer(error.to_string()))?
                .to_vec()
        };
        Ok(TrainingState {
            position: self.position.clone(),
            weights,
            optimizer,
        })
    }

    /// Returns the training position.
    pub fn position(&self) -> &Position {
        &self.position
    }

    /// Returns the number of batches in an epoch.
    pub fn batches(&self) -> usize {
        self.train.len().div_ceil(self.recipe.training.batch)
    }

    /// Trains on the next batch; returns `None` after the last epoch. On a GPU it waits only for the last batch of an epoch.
    ///
    /// # Errors
    /// A loss that is not finite, with its epoch and batch. On the processor the weights are then those before this batch.
    pub fn step(&mut self) -> Result<Option<BatchReport>, PipelineError> {
        let device = self.device.clone();
        in_pool(&device, || self.take_step())
    }

    fn take_step(&mut self) -> Result<Option<BatchReport>, PipelineError> {
        let Position { epoch, batch, .. } = self.position;
        if epoch >= self.recipe.training.epochs {
            return Ok(None);
        }
        let number = BatchNumber { epoch, batch };
        self.last = number;
        let positions = self.batch_positions(number);
        let sweeps = self.load(epoch, &positions);
        let pass = if self.on_pairs {
            let own: Vec<usize> = positions.iter().map(|p| self.train.label(*p)).collect();
            let mask = self.mask("dropout", number, positions.len());
            pairs_pass(self.net(), sweeps, &own, mask)
        } else {
            self.pass(sweeps, self.targets(&positions), |stream| {
                self.mask(stream, number, positions.len())
            })
        };
        self.unread.push(Unread {
            batch,
            sweeps: positions.len(),
            measured: pass.measured,
        });
        if is_cpu(&self.device) {
            self.wait()?;
        }
        let learning_rate = self.recipe.learning_rate(epoch, batch, self.batches());
        let net = self.net.take().unwrap_or_else(no_network);
        let mut net = self.optimizer.step(learning_rate, net, pass.gradients);
        net.update_running_stats(&pass.statistics);
        if let (Some(adversarial), true) = (&pass.adversarial_statistics, self.follows_both()) {
            net.update_running_stats(adversarial);
        }
        self.net = Some(net);

        if batch + 1 == self.batches() {
            self.wait()?;
        }
        Ok(Some(self.advance(
            learning_rate,
            pass.adversarial_statistics.is_some(),
        )))
    }

    /// Moves to the next batch; returns the report of the last one.
    ///
    /// - `is_adversarial`: true if the batch was also perturbed
    fn advance(&mut self, learning_rate: f64, is_adversarial: bool) -> BatchReport {
        let batches = self.batches();
        let position = &mut self.position;
        let is_read = self.unread.is_empty();
        let mean = |sum: f64| is_read.then(|| sum / position.sweeps as f64);
        let report = BatchReport {
            epoch: position.epoch,
            batch: position.batch,
            batches,
            epochs: self.recipe.training.epochs,
            mean_loss: mean(position.loss_sum),
            accuracy: mean(position.correct as f64),
            adversarial_accuracy: mean(position.adversarial_correct as f64)
                .filter(|_| is_adversarial),
            learning_rate,
        };
        position.batch += 1;
        if report.ends_epoch() {
            *position = Position {
                epoch: report.epoch + 1,
                ..Position::default()
            };
        }
        report
    }

    /// Waits for all batches so far and reads their losses.
    ///
    /// # Errors
    /// A loss that is not finite.
    pub fn wait(&mut self) -> Result<(), PipelineError> {
        let unread = std::mem::take(&mut self.unread);
        let (numbers, measured): (Vec<_>, Vec<_>) = unread
            .into_iter()
            .map(|unread| ((unread.batch, unread.sweeps), unread.measured))
            .unzip();
        for ((batch, sweeps), figures) in numbers.into_iter().zip(Measured::read_all(measured)) {
            if !figures.loss.is_finite() {
                self.last.batch = batch;
                return Err(self.not_finite("loss"));
            }
            let position = &mut self.position;
            position.loss_sum += figures.loss * sweeps as f64;
            position.correct += figures.correct;
            position.adversarial_correct += figures.adversarial_correct.unwrap_or_default();
            position.sweeps += sweeps;
        }
        Ok(())
    }

    /// Runs a forward and backward pass with the recipe's method.
    ///
    /// - `mask`: returns the dropout mask of the named random stream
    fn pass(
        &self,
        sweeps: Tensor<4>,
        targets: Targets,
        mask: impl Fn(&'static str) -> Tensor<2>,
    ) -> Pass {
        match self.recipe.training.method {
            TrainingMethod::Base => base_pass(self.net(), sweeps, targets, mask("dropout")),
            TrainingMethod::Adversarial {
                alpha,
                epsilon,
                mask: kind,
                attack,
                ..
            } => {
                let other = match kind {
                    AdversarialMask::Own => mask("adversarial dropout"),
                    AdversarialMask::Shared => mask("dropout"),
                };
                let perturbation = Perturbation {
                    alpha,
                    epsilon: self.normalizer.scaled(epsilon),
                    attack,
                };
                let masks = [mask("dropout"), other];
                adversarial_pass(self.net(), sweeps, targets, masks, &perturbation)
            }
        }
    }

    /// Measures the accuracy on `watched` sweeps under training conditions: batch statistics, dropout, and the recipe's perturbation. Weights and
    /// running statistics do not change.
    ///
    /// # Errors
    /// A loss that is not finite.
    pub fn watch(&self, watched: &SweepView<'_>) -> Result<Watched, PipelineError> {
        in_pool(&self.device, || {
            let (mut correct, mut adversarial) = (0, None);
            let batches = watched.len().div_ceil(self.recipe.training.batch).max(1);
            for batch in 0..batches {
                let positions = round_robin(watched.len(), batches, batch);
                let sweeps = self.loaded(watched, &positions, |_, _| {});
                let epoch = self.position.epoch;
                let targets = self.labels(watched, &positions).into();
                let pass = self.pass(sweeps, targets, |stream| {
                    let stream = format!("watched {stream}");
                    self.mask(&stream, BatchNumber { epoch, batch }, positions.len())
                });
                let figures = pass.measured.read();
                if !figures.loss.is_finite() {
                    return Err(self.not_finite("loss of watched sweeps"));
                }
                correct += figures.correct;
                if let Some(found) = figures.adversarial_correct {
                    *adversarial.get_or_insert(0) += found;
                }
            }
            let share = |correct: usize| correct as f64 / watched.len().max(1) as f64;
            Ok(Watched {
                accuracy: share(correct),
                adversarial_accuracy: adversarial.map(share),
            })
        })
    }

    /// Returns true if running statistics follow both the clean and the adversarial sweeps.
    fn follows_both(&self) -> bool {
        matches!(
            self.recipe.training.method,
            TrainingMethod::Adversarial {
                statistics: AdversarialStatistics::Both,
                ..
            }
        )
    }

    fn net(&self) -> &Network {
        self.net.as_ref().unwrap_or_else(no_network)
    }

    fn batch_positions(&self, number: BatchNumber) -> Vec<usize> {
        batch_positions(self.train, self.batches(), self.seed, number)
    }

    /// Returns training sweeps `[batch, 1, steps, taxels]`, augmented and normalised, on the device without autodiff.
    fn load(&self, epoch: usize, positions: &[usize]) -> Tensor<4> {
        if let Some(resident) = &self.resident {
            return resident.batch(positions);
        }
        let augmentation = self.recipe.training.augmentation;
        self.loaded(self.train, positions, |position, sweep| {
            augment(
                augmentation,
                self.normalizer,
                self.seed,
                epoch,
                position,
                sweep,
            );
        })
    }

    /// Returns sweeps `[batch, 1, steps, taxels]`, changed by `change` and normalised, on the device without autodiff.
    fn loaded(
        &self,
        from: &SweepView<'_>,
        positions: &[usize],
        change: impl Fn(usize, &mut [f32]) + Sync,
    ) -> Tensor<4> {
        // Watched sweeps may be longer than the training sweeps.
        let shape = batch_shape(from, positions, self.config.input().steps);
        let mut values = spare_memory(positions.len() * shape.values());
        fill_batch(&mut values, from, positions, shape, self.normalizer, change);
        let extents = [positions.len(), 1, shape.steps, shape.taxels()];
        Tensor::from_data(
            TensorData::new(values, extents),
            &self.device.clone().without_autodiff(),
        )
    }

    /// Returns the targets of training sweeps.
    fn targets(&self, positions: &[usize]) -> Targets {
        let weights = self.train.weights().map(|all| {
            let weights: Vec<f32> = positions.iter().map(|at| all[*at] as f32).collect();
            Tensor::from_data(TensorData::new(weights, [positions.len()]), &self.device)
        });
        let towards = self.towards.as_ref();
        Targets {
            labels: self.labels(self.train, positions),
            probabilities: towards.map(|targets| targets.batch(positions, &self.device)),
            weights,
        }
    }

    fn labels(&self, of: &SweepView<'_>, positions: &[usize]) -> Tensor<1, Int> {
        let labels: Vec<i64> = positions.iter().map(|p| of.label(*p) as i64).collect();
        let extent = [labels.len()];
        Tensor::from_data(TensorData::new(labels, extent), &self.device)
    }

    fn mask(&self, stream: &str, number: BatchNumber, rows: usize) -> Tensor<2> {
        dropout_masks(
            rows,
            self.config.features(),
            self.config.architecture().keep_probability,
            &self.device,
            &mut self.seed.rng((stream, number.epoch, number.batch)),
        )
    }

    fn not_finite(&self, what: impl Into<String>) -> PipelineError {
        PipelineError::NotFinite {
            what: what.into(),
            epoch: self.last.epoch + 1,
            batch: self.last.batch + 1,
        }
    }
}

/// Returns the positions of a batch, taken round-robin: sweeps may be sorted by material, and the batch statistics need many materials.
fn round_robin(sweeps: usize, batches: usize, batch: usize) -> Vec<usize> {
    (batch..sweeps).step_by(batches).collect()
}

fn no_network<T>() -> T {
    panic!("the optimiser gives the network back")
}

fn adam(recipe: &NetworkRecipe) -> ModuleOptimizer {
    FusedAdam::for_module(recipe.training.l2, recipe.training.l2_on)
}

#[cfg(test)]
mod tests;
