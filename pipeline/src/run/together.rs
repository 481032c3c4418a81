//! Training of several run directories: networks of one kind are trained at once on a GPU, all others one by one.

use crate::{PipelineError, Session, TrainEvent, TrainOutcome};

/// Outcome of a session.
pub type Ended = Result<TrainOutcome, PipelineError>;

/// Trains each session from its current state to its result, and returns their outcomes in order.
///
/// Networks with the same architecture, method and batch size are trained at once on a GPU; their weights do not depend on the other
/// networks of the stack. All others are trained by [`Session::train`]. Finished runs are kept; stopped or interrupted runs continue from
/// their last checkpoint, together or alone.
///
/// - `at_once`: number of networks trained at once; `None`: as many as fit into half of the GPU's memory, or into 4 GiB if its driver does not
///   report the size
/// - `on_event`: called at each step with the session's index
/// - `stop`: called after every step; true ends all sessions once they can be resumed
pub fn train_together(
    sessions: &[Session],
    at_once: Option<usize>,
    mut on_event: impl FnMut(usize, TrainEvent<'_>),
    stop: impl Fn() -> bool,
) -> Vec<Ended> {
    #[cfg(any(feature = "vulkan", feature = "cuda"))]
    let ended = stacks::train(sessions, at_once, &mut on_event, &stop);
    #[cfg(not(any(feature = "vulkan", feature = "cuda")))]
    let (ended, _) = (sessions.iter().map(|_| None::<Ended>), at_once);
    let others = sessions.iter().zip(ended).enumerate();
    others
        .map(|(index, (session, ended))| {
            ended.unwrap_or_else(|| session.train(|event| on_event(index, event), &stop))
        })
        .collect()
}

#[cfg(any(feature = "vulkan", feature = "cuda"))]
mod stacks {
    use std::time::{Duration, Instant};

    use burn::tensor::Device;
    use tactnet_models::{NetStack, NetworkConfig};

    use super::Ended;
    use crate::run::session::{Begun, Opened};
    use crate::run::training_record::{CHECKPOINT_EVERY, EPOCHS_EVERY, TrainingRecord};
    use crate::{
        ModelConfig, ModelRecipe, PipelineError, Session, StackMember, StackedTraining, TrainEvent,
        TrainOutcome, TrainingState, TrainingSteps, TrainingSummary,
    };

    /// Memory in bytes for networks trained at once, on a GPU that does not report its size.
    const BYTES: usize = 4 << 30;

    /// Network whose training is about to begin.
    struct Ready<'a> {
        index: usize,
        session: &'a Session,
        begun: Box<Begun<'a>>,
        network: NetworkConfig,
    }

    impl<'a> Ready<'a> {
        /// Returns `None` for a finished run, for sweeps of unequal length, and for a model that is not a network on a GPU.
        fn of(
            index: usize,
            session: &'a Session,
            on_event: &mut impl FnMut(usize, TrainEvent<'_>),
        ) -> Result<Option<Self>, PipelineError> {
            let config = session.run().config()?;
            let (ModelRecipe::Network(recipe), ModelConfig::Network(setup)) =
                (&config.recipe, &config.classifier.model)
            else {
                return Ok(None);
            };
            if recipe.training.teacher.is_some() {
                return Ok(None);
            }
            let on_gpu = config.spec.device != tactnet_models::Compute::Cpu;
            // A stack trains on batches of one length.
            let unequal = session.dataset().lengths().is_some();
            if !on_gpu || unequal || config.spec.watch_test || session.run().result()?.is_some() {
                return Ok(None);
            }
            let network = config.classifier.network_config(setup)?;
            let Opened::Begun(begun) = session.open(&mut |event| on_event(index, event))? else {
                return Ok(None);
            };
            Ok(Some(Self {
                index,
                session,
                begun,
                network,
            }))
        }

        fn member(&self) -> StackMember<'_> {
            let config = &self.begun.config;
            let (ModelRecipe::Network(recipe), ModelConfig::Network(setup)) =
                (&config.recipe, &config.classifier.model)
            else {
                panic!("networks alone are ready");
            };
            StackMember {
                recipe,
                train: &self.begun.fitted.train,
                normalizer: &setup.normalizer,
                config: &self.network,
                seed: config.spec.seed,
            }
        }

        fn fits(&self, other: &Self) -> bool {
            self.begun.config.spec.device == other.begun.config.spec.device
                && self.member().fits(&other.member())
        }

        /// Returns the number of networks of this kind that are trained at once.
        fn at_once(&self, device: &Device) -> usize {
            let batch = self.member().recipe.training.batch;
            NetStack::most(device, &self.network, batch, BYTES)
        }
    }

    /// Trains the sessions that can share a stack, and returns their outcomes; `None` for the others.
    pub(super) fn train(
        sessions: &[Session],
        at_once: Option<usize>,
        on_event: &mut impl FnMut(usize, TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Vec<Option<Ended>> {
        let mut ended: Vec<Option<Ended>> = sessions.iter().map(|_| None).collect();
        if at_once == Some(1) {
            return ended;
        }
        let mut ready = Vec::new();
        for (index, session) in sessions.iter().enumerate() {
            match Ready::of(index, session, on_event) {
                Ok(Some(network)) => ready.push(network),
                Ok(None) => {}
                Err(error) => ended[index] = Some(Err(error)),
            }
        }
        while !ready.is_empty() && !stop() {
            let first = ready.remove(0);
            let kind: (Vec<_>, Vec<_>) = ready.into_iter().partition(|other| first.fits(other));
            let (mut alike, others) = kind;
            ready = others;
            alike.insert(0, first);
            let device = match alike[0].session.device(&alike[0].begun.config) {
                Ok(device) => device,
                // `Session::train` then reports the error of each run.
                Err(_) => continue,
            };
            let most = at_once.unwrap_or_else(|| alike[0].at_once(device)).max(1);
            // Stacks of similar size, so that the last one is not a single network.
            let stacks = alike.len().div_ceil(most);
            for left in (1..=stacks).rev() {
                let rest = alike.split_off(alike.len().div_ceil(left));
                let stack = std::mem::replace(&mut alike, rest);
                if stack.len() > 1 {
                    train_stack(stack, device, &mut ended, on_event, stop);
                }
            }
        }
        ended
    }

    /// Trains one stack to its end, and stores the outcome of each network.
    fn train_stack(
        stack: Vec<Ready<'_>>,
        device: &Device,
        ended: &mut [Option<Ended>],
        on_event: &mut impl FnMut(usize, TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) {
        let mut networks = Vec::with_capacity(stack.len());
        let mut records = Vec::with_capacity(stack.len());
        let mut states = Vec::with_capacity(stack.len());
        for network in stack {
            match TrainingRecord::open(network.session.run()) {
                Ok((record, state)) => {
                    networks.push(network);
                    records.push(record);
                    states.push(state);
                }
                Err(error) => ended[network.index] = Some(Err(error)),
            }
        }
        let members: Vec<StackMember<'_>> = networks.iter().map(Ready::member).collect();
        if members.is_empty() {
            return;
        }
        let indices: Vec<usize> = networks.iter().map(|network| network.index).collect();
        let trained = StackedTraining::start(members, states, device).and_then(|mut training| {
            for (member, network) in networks.iter().enumerate() {
                let epochs = network.member().recipe.training.epochs;
                let batches = training.batches(member);
                let position = training.position(member);
                let before = position.epoch * batches + position.batch;
                let steps = TrainingSteps { epochs, batches };
                let mut tell = |event: TrainEvent<'_>| on_event(network.index, event);
                network.session.tell_begin(before, steps, &mut tell);
            }
            take_steps(&mut training, &networks, &mut records, on_event, stop)
        });
        let trained = match trained {
            Ok(trained) => trained,
            // The error concerns the whole stack. The first network reports it; the others are then trained alone.
            Err(error) => {
                ended[indices[0]] = Some(Err(error));
                return;
            }
        };
        for ((network, record), trained) in networks.into_iter().zip(records).zip(trained) {
            let index = network.index;
            ended[index] = Some(match trained {
                Ok(Some(state)) => network.finish(record, &state, on_event, stop),
                Ok(None) => Ok(TrainOutcome::Stopped),
                Err(error) => Err(error),
            });
        }
    }

    /// Last state of a network in a stack; `None` if stopped.
    type Trained = Result<Option<TrainingState>, PipelineError>;

    /// Trains until all networks have ended or `stop` returns true.
    fn take_steps(
        training: &mut StackedTraining<'_>,
        networks: &[Ready<'_>],
        records: &mut [TrainingRecord<'_>],
        on_event: &mut impl FnMut(usize, TrainEvent<'_>),
        stop: &impl Fn() -> bool,
    ) -> Result<Vec<Trained>, PipelineError> {
        let mut failed: Vec<Option<PipelineError>> = networks.iter().map(|_| None).collect();
        let (mut saved, mut noted) = (Instant::now(), Instant::now());
        let mut stopped = false;
        while !training.has_ended() && !stopped {
            let begun = Instant::now();
            let reports = training.step();
            // The networks share the time of a step.
            let sharing = reports.iter().flatten().count().max(1) as u32;
            let spent: Duration = begun.elapsed() / sharing;
            let mut ends_epoch = false;
            for (member, report) in reports.into_iter().enumerate() {
                match report {
                    None => {}
                    Some(Ok(batch)) => {
                        let epochs = networks[member].member().recipe.training.epochs;
                        records[member].note(&batch, spent);
                        ends_epoch |= batch.ends_epoch();
                        let event = TrainEvent::Batch {
                            batch: &batch,
                            epochs,
                        };
                        on_event(networks[member].index, event);
                    }
                    Some(Err(error)) => failed[member] = Some(error),
                }
            }
            stopped = stop();
            if ends_epoch && !stopped && saved.elapsed() >= CHECKPOINT_EVERY {
                write(training, records, &mut failed)?;
                saved = Instant::now();
            } else if ends_epoch && noted.elapsed() >= EPOCHS_EVERY {
                records.iter().try_for_each(TrainingRecord::write_metrics)?;
                noted = Instant::now();
            }
        }
        let states = write(training, records, &mut failed)?;
        let ends = states.into_iter().zip(failed).enumerate();
        Ok(ends
            .map(|(member, (state, failed))| match (failed, state) {
                (Some(error), _) => Err(error),
                (None, state) => {
                    let epochs = networks[member].member().recipe.training.epochs;
                    Ok(state.filter(|state| state.position.epoch >= epochs))
                }
            })
            .collect())
    }

    /// Writes a checkpoint of each network that has not failed; returns the states, `None` for failed ones.
    fn write(
        training: &mut StackedTraining<'_>,
        records: &mut [TrainingRecord<'_>],
        failed: &mut [Option<PipelineError>],
    ) -> Result<Vec<Option<TrainingState>>, PipelineError> {
        let mut states = Vec::with_capacity(records.len());
        let all = training.states().into_iter().zip(records).zip(failed);
        for ((state, record), failed) in all {
            states.push(match (state, &failed) {
                (Ok(state), None) => {
                    record.write(&state)?;
                    Some(state)
                }
                (Err(error), None) => {
                    *failed = Some(error);
                    None
                }
                (_, Some(_)) => None,
            });
        }
        Ok(states)
    }

    impl Ready<'_> {
        /// Writes and evaluates the weights.
        fn finish(
            self,
            record: TrainingRecord<'_>,
            state: &TrainingState,
            on_event: &mut impl FnMut(usize, TrainEvent<'_>),
            stop: &impl Fn() -> bool,
        ) -> Ended {
            self.session.run().write_weights(&state.weights)?;
            let summary = TrainingSummary {
                seconds: record.seconds(),
                sweeps: self.begun.fitted.train.len(),
                epochs: Some(self.member().recipe.training.epochs),
                ..TrainingSummary::default()
            };
            let index = self.index;
            let mut tell = |event: TrainEvent<'_>| on_event(index, event);
            self.session.finish(*self.begun, summary, &mut tell, stop)
        }
    }
}
