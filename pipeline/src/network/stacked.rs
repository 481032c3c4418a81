//! Training of several networks at once on one GPU, with the same steps as [`Training`](crate::Training).
//!
//! Each network has its own training sweeps, normaliser, seed and number of epochs; all share architecture, batch size and method. Batches,
//! order, dropout and initial weights are those of a training alone. In every step each network trains on its own next batch, so networks with
//! fewer batches per epoch do not wait for others.

mod member;
mod packed;

use burn::tensor::Device;
use rayon::prelude::*;
use tactnet_models::{
    AdamStep, NetStack, Network, StackAttack, StackBatch, StackDigits, StackSettings, StackSweeps,
    StackedNet, dropout_bits,
};

use crate::network::adam::{BETA, corrected};
use crate::network::adam_state::{moments_of, optimizer_bytes};
use crate::network::batches::{BatchNumber, augment, batch_positions, fill_batch};
use crate::{
    AdversarialMask, AdversarialStatistics, BatchReport, PenalizedParameters, PipelineError,
    Position, TrainingMethod, TrainingState,
};

pub use member::StackMember;
use packed::PackedDigits;

/// Training progress of one network.
struct Standing {
    position: Position,
    /// True after a loss that is not finite; the network is then not trained further.
    failed: bool,
}

/// Batch whose loss has not been read from the GPU.
struct Unread {
    member: usize,
    epoch: usize,
    batch: usize,
    sweeps: usize,
}

/// Location of the sweeps of all networks.
enum Source {
    /// Digits on the GPU; for each member, the numbers of its training sweeps there by position.
    Digits(Vec<Vec<u32>>),
    /// The processor normalises them, batch by batch.
    Processor,
}

/// Batch of one network as prepared by the processor, padded to the full batch size.
struct Prepared {
    sweeps: usize,
    labels: Vec<u32>,
    masks: Vec<Vec<u32>>,
    chosen: Vec<u32>,
    values: Vec<f32>,
    rates: [f32; 2],
}

/// Several networks in training.
pub struct StackedTraining<'a> {
    members: Vec<StackMember<'a>>,
    standings: Vec<Standing>,
    stack: NetStack,
    source: Source,
    /// Maximum number of sweeps in a batch.
    batch: usize,
    /// Unread batches of each step since the last reading.
    unread: Vec<Vec<Unread>>,
}

impl<'a> StackedTraining<'a> {
    /// Starts networks with fresh weights or from saved states.
    ///
    /// - `states`: saved state of each network; `None`: fresh weights
    ///
    /// # Errors
    /// A device that is not a GPU; a state of another network.
    ///
    /// # Panics
    /// If `members` is empty, or two cannot share a stack, or sweeps differ in length or weight.
    pub fn start(
        members: Vec<StackMember<'a>>,
        states: Vec<Option<TrainingState>>,
        device: &Device,
    ) -> Result<Self, PipelineError> {
        assert!(
            members.len() == states.len() && members.iter().all(|member| member.fits(&members[0])),
            "networks of a stack are of one kind"
        );
        assert!(
            members
                .iter()
                .all(|member| member.train.dataset().lengths().is_none()),
            "a stack trains on sweeps of one length"
        );
        assert!(
            members
                .iter()
                .all(|member| member.train.weights().is_none()),
            "a stack trains on sweeps of equal weight"
        );
        let batch = members.iter().map(StackMember::batch).max().unwrap_or(0);
        let nets: Result<Vec<StackedNet>, PipelineError> = members
            .par_iter()
            .zip(&states)
            .map(|(member, state)| net_of(member, state.as_ref()))
            .collect();
        let settings = settings(&members, batch);
        let packed = PackedDigits::of(&members);
        let scaling: Vec<f32> = members
            .iter()
            .flat_map(|member| [member.normalizer.offset(), member.normalizer.gain()].concat())
            .collect();
        let digits = packed.as_ref().map(|packed| StackDigits {
            bits: packed.bits,
            words: &packed.words,
            scaling: &scaling,
        });
        let stack = NetStack::start(device, members[0].config, settings, &nets?, digits)?;
        let standings = states.into_iter().map(|state| Standing {
            position: state.map(|state| state.position).unwrap_or_default(),
            failed: false,
        });
        Ok(Self {
            standings: standings.collect(),
            members,
            stack,
            source: packed.map_or(Source::Processor, |packed| Source::Digits(packed.numbers)),
            batch,
            unread: Vec::new(),
        })
    }

    /// Returns the number of networks.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Returns true if the stack is empty.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Returns the training position of a network.
    pub fn position(&self, member: usize) -> &Position {
        &self.standings[member].position
    }

    /// Returns the number of batches in an epoch of a network.
    pub fn batches(&self, member: usize) -> usize {
        self.members[member].batches()
    }

    /// Returns true if every network has completed its epochs or has failed.
    pub fn has_ended(&self) -> bool {
        (0..self.members.len()).all(|member| !self.is_on_its_way(member))
    }

    fn is_on_its_way(&self, member: usize) -> bool {
        let standing = &self.standings[member];
        !standing.failed && standing.position.epoch < self.members[member].recipe.training.epochs
    }

    /// Trains every unfinished network on its next batch and returns the reports, `None` for finished ones.
    ///
    /// The GPU works asynchronously; the call waits for it only at the end of an epoch. A network whose loss is not finite ends with that error; the
    /// others continue.
    pub fn step(&mut self) -> Vec<Option<Result<BatchReport, PipelineError>>> {
        let on_their_way: Vec<bool> = (0..self.members.len())
            .map(|member| self.is_on_its_way(member))
            .collect();
        if !on_their_way.contains(&true) {
            return on_their_way.iter().map(|_| None).collect();
        }
        let prepared: Vec<Prepared> = on_their_way
            .par_iter()
            .enumerate()
            .map(|(member, goes)| self.prepare(member, *goes))
            .collect();
        self.launch(&prepared);

        let mut reports: Vec<_> = (0..self.members.len())
            .map(|member| on_their_way[member].then(|| Ok(self.report(member))))
            .collect();
        let unread = (0..self.members.len()).filter(|member| on_their_way[*member]);
        let unread = unread.map(|member| {
            let Position { epoch, batch, .. } = self.standings[member].position;
            Unread {
                member,
                epoch,
                batch,
                sweeps: prepared[member].sweeps,
            }
        });
        let unread = unread.collect();
        self.unread.push(unread);
        let ends = |report: &Option<Result<BatchReport, _>>| matches!(report, Some(Ok(report)) if report.ends_epoch());
        if reports.iter().any(ends) {
            for (member, error) in self.wait() {
                reports[member] = Some(Err(error));
            }
        }
        for (member, report) in reports.iter_mut().enumerate() {
            if let Some(Ok(report)) = report {
                self.advance(member, report);
            }
        }
        reports
    }

    /// Returns the report of a network's next batch, without measurements.
    fn report(&self, member: usize) -> BatchReport {
        let Position { epoch, batch, .. } = self.standings[member].position;
        let batches = self.batches(member);
        let recipe = self.members[member].recipe;
        BatchReport {
            epoch,
            batch,
            batches,
            epochs: recipe.training.epochs,
            mean_loss: None,
            accuracy: None,
            adversarial_accuracy: None,
            learning_rate: recipe.learning_rate(epoch, batch, batches),
        }
    }

    /// Moves a network to its next batch; at the end of an epoch, adds the measurements to the report.
    fn advance(&mut self, member: usize, report: &mut BatchReport) {
        let attacks = self.attacks(member);
        let position = &mut self.standings[member].position;
        position.batch += 1;
        if report.ends_epoch() {
            let mean = |sum: f64| Some(sum / position.sweeps as f64);
            report.mean_loss = mean(position.loss_sum);
            report.accuracy = mean(position.correct as f64);
            let attacked = mean(position.adversarial_correct as f64);
            report.adversarial_accuracy = attacked.filter(|_| attacks.is_some());
            *position = Position {
                epoch: report.epoch + 1,
                ..Position::default()
            };
        }
    }

    /// Submits the batches of all networks, in order, to the GPU.
    fn launch(&mut self, prepared: &[Prepared]) {
        let counts: Vec<u32> = prepared.iter().map(|of| of.sweeps as u32).collect();
        let rates: Vec<[f32; 2]> = prepared.iter().map(|of| of.rates).collect();
        let joined = |words: fn(&Prepared) -> &[u32]| -> Vec<u32> {
            prepared.iter().flat_map(words).copied().collect()
        };
        let labels = joined(|of| &of.labels);
        let chosen = joined(|of| &of.chosen);
        let passes = prepared.first().map_or(0, |of| of.masks.len());
        let masks: Vec<Vec<u32>> = (0..passes)
            .map(|pass| {
                let all = prepared.iter().flat_map(|of| &of.masks[pass]);
                all.copied().collect()
            })
            .collect();
        let masks: Vec<&[u32]> = masks.iter().map(Vec::as_slice).collect();
        let values: Vec<f32>;
        let sweeps = match self.source {
            Source::Digits(_) => StackSweeps::Chosen(&chosen),
            Source::Processor => {
                values = prepared.iter().flat_map(|of| &of.values).copied().collect();
                StackSweeps::Values(&values)
            }
        };
        self.stack.step(&StackBatch {
            counts: &counts,
            sweeps,
            labels: &labels,
            masks: &masks,
            rates: &rates,
        });
    }

    /// Prepares a network's next batch on the processor; an empty batch for a finished network.
    fn prepare(&self, member: usize, goes: bool) -> Prepared {
        let StackMember {
            recipe,
            train,
            normalizer,
            config,
            seed,
        } = &self.members[member];
        let Position { epoch, batch, .. } = self.standings[member].position;
        let batches = self.batches(member);
        let positions = if goes {
            batch_positions(train, batches, *seed, BatchNumber { epoch, batch })
        } else {
            Vec::new()
        };
        let filled = |mut words: Vec<u32>| {
            words.resize(self.batch, 0);
            words
        };
        let features = config.features();
        let words = features.div_ceil(u32::BITS as usize);
        let mask = |stream: &str| {
            let mut bits = vec![0; self.batch * words];
            let rng = &mut seed.rng((stream, epoch, batch));
            let keep = config.architecture().keep_probability;
            dropout_bits(&mut bits[..positions.len() * words], features, keep, rng);
            bits
        };
        let clean = mask("dropout");
        let masks = match self.attacks(member) {
            None => vec![clean],
            Some(AdversarialMask::Shared) => vec![clean.clone(), clean],
            Some(AdversarialMask::Own) => vec![clean, mask("adversarial dropout")],
        };
        let (mut chosen, mut values) = (Vec::new(), Vec::new());
        match &self.source {
            Source::Digits(numbers) => {
                let of = &numbers[member];
                chosen = filled(positions.iter().map(|&position| of[position]).collect());
            }
            Source::Processor => {
                let of_sweep = train.shape().values();
                values.resize(self.batch * of_sweep, 0.0);
                let target = &mut values[..positions.len() * of_sweep];
                let shape = train.shape();
                fill_batch(
                    target,
                    train,
                    &positions,
                    shape,
                    normalizer,
                    |position, sweep| {
                        let augmentation = recipe.training.augmentation;
                        augment(augmentation, normalizer, *seed, epoch, position, sweep);
                    },
                );
            }
        }
        let rate = recipe.learning_rate(epoch, batch, batches);
        Prepared {
            sweeps: positions.len(),
            labels: filled(positions.iter().map(|&p| train.label(p) as u32).collect()),
            masks,
            chosen,
            values,
            rates: corrected(rate, epoch * batches + batch + 1),
        }
    }

    /// Returns the mask of adversarial sweeps; `None` without adversarial training.
    fn attacks(&self, member: usize) -> Option<AdversarialMask> {
        match self.members[member].recipe.training.method {
            TrainingMethod::Base => None,
            TrainingMethod::Adversarial { mask, .. } => Some(mask),
        }
    }

    /// Waits for all batches so far and reads their losses. Returns the networks whose loss is not finite, which are not trained further.
    pub fn wait(&mut self) -> Vec<(usize, PipelineError)> {
        let mut failures = Vec::new();
        let unread = std::mem::take(&mut self.unread);
        for (step, measured) in unread.into_iter().zip(self.stack.measured()) {
            for Unread {
                member,
                epoch,
                batch,
                sweeps,
            } in step
            {
                let found = measured[member];
                let standing = &mut self.standings[member];
                if standing.failed {
                    continue;
                }
                let loss = match self.members[member].recipe.training.method {
                    TrainingMethod::Base => f64::from(found.loss[0]),
                    TrainingMethod::Adversarial { alpha, .. } => {
                        alpha * f64::from(found.loss[0]) + (1.0 - alpha) * f64::from(found.loss[1])
                    }
                };
                if !loss.is_finite() {
                    standing.failed = true;
                    let error = PipelineError::NotFinite {
                        what: "loss".into(),
                        epoch: epoch + 1,
                        batch: batch + 1,
                    };
                    failures.push((member, error));
                    continue;
                }
                let position = &mut standing.position;
                position.loss_sum += loss * sweeps as f64;
                position.correct += found.correct[0];
                position.adversarial_correct += found.correct[1];
                position.sweeps += sweeps;
            }
        }
        failures
    }

    /// Returns the restart state of each network, for a training alone or in a stack; waits for the GPU.
    ///
    /// # Errors
    /// For each network: a loss or weight that is not finite.
    pub fn states(&mut self) -> Vec<Result<TrainingState, PipelineError>> {
        let mut failures = self.wait();
        let nets = self.stack.nets();
        nets.into_par_iter()
            .enumerate()
            .map(|(member, net)| self.state_of(member, &net))
            .collect::<Vec<_>>()
            .into_iter()
            .enumerate()
            .map(|(member, state)| {
                let failed = failures.iter().position(|(of, _)| *of == member);
                match failed {
                    Some(at) => Err(failures.swap_remove(at).1),
                    None => state,
                }
            })
            .collect()
    }

    fn state_of(&self, member: usize, net: &StackedNet) -> Result<TrainingState, PipelineError> {
        let position = self.standings[member].position.clone();
        let steps = position.epoch * self.batches(member) + position.batch;
        for (name, tensor) in &net.weights.0 {
            if tensor.values.iter().any(|value| !value.is_finite()) {
                return Err(PipelineError::NotFinite {
                    what: format!("weight {name}"),
                    epoch: position.epoch + 1,
                    batch: position.batch + 1,
                });
            }
        }
        let config = self.members[member].config;
        let optimizer = match &net.moments {
            Some(moments) if steps > 0 => optimizer_bytes(config, &net.weights, moments, steps)?,
            _ => Vec::new(),
        };
        Ok(TrainingState {
            position,
            weights: net.weights.clone(),
            optimizer,
        })
    }
}

/// Returns a network with fresh weights, or from a saved state.
fn net_of(
    member: &StackMember<'_>,
    state: Option<&TrainingState>,
) -> Result<StackedNet, PipelineError> {
    let Some(state) = state else {
        let mut rng = member.seed.rng("initial weights");
        let net = Network::init(member.config, &Device::flex(), &mut rng);
        return Ok(StackedNet {
            weights: net.weights(),
            moments: None,
        });
    };
    let moments = if state.optimizer.is_empty() {
        None
    } else {
        Some(moments_of(member.config, &state.weights, &state.optimizer)?)
    };
    Ok(StackedNet {
        weights: state.weights.clone(),
        moments,
    })
}

fn settings(members: &[StackMember<'_>], batch: usize) -> StackSettings {
    let training = &members[0].recipe.training;
    let attack = match training.method {
        TrainingMethod::Base => None,
        TrainingMethod::Adversarial {
            alpha,
            epsilon,
            statistics,
            ..
        } => Some(StackAttack {
            alpha,
            epsilon: members
                .iter()
                .flat_map(|member| member.normalizer.scaled(epsilon))
                .collect(),
            follow_both: statistics == AdversarialStatistics::Both,
        }),
    };
    StackSettings {
        batch,
        adam: AdamStep {
            l2: training.l2 as f32,
            beta: BETA,
            rate: 0.0,
            epsilon: 0.0,
        },
        penalize_weights_only: training.l2_on == PenalizedParameters::Weights,
        attack,
    }
}
