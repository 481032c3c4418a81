//! Conversion of Adam's moments from and to Burn's bytes, so that checkpoints of single and stacked trainings are interchangeable.

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::{
    Adam, AdamState, AdaptiveMomentumState, GradientsParams, LearningRate, ModuleOptimizer,
    Optimizer,
};
use burn::tensor::{Bytes, Device, Tensor};
use tactnet_models::{Network, NetworkConfig, Weights};

use crate::PipelineError;

/// Optimiser that stores the given gradients as moments: first moment at the first step, second moment at the second.
#[derive(Clone)]
struct Planted {
    /// Number of steps taken.
    time: usize,
}

impl Optimizer for Planted {
    type State<const D: usize> = AdamState<D>;

    fn step<const D: usize>(
        &self,
        _learning_rate: LearningRate,
        tensor: Tensor<D>,
        given: Tensor<D>,
        state: Option<AdamState<D>>,
    ) -> (Tensor<D>, Option<AdamState<D>>) {
        let [first, second] = match state {
            None => [given.clone(), given.zeros_like()],
            Some(state) => [state.momentum.moment_1, given],
        };
        let momentum = AdaptiveMomentumState::new(self.time, first, second);
        (tensor, Some(AdamState::new(momentum)))
    }

    fn to_device<const D: usize>(state: AdamState<D>, device: &Device) -> AdamState<D> {
        Adam::to_device(state, device)
    }
}

/// Optimiser that replaces each parameter by one of its moments.
#[derive(Clone, Copy)]
enum Shown {
    First,
    Second,
}

impl Optimizer for Shown {
    type State<const D: usize> = AdamState<D>;

    fn step<const D: usize>(
        &self,
        _learning_rate: LearningRate,
        tensor: Tensor<D>,
        _given: Tensor<D>,
        state: Option<AdamState<D>>,
    ) -> (Tensor<D>, Option<AdamState<D>>) {
        let shown = match (self, &state) {
            (_, None) => tensor.zeros_like(),
            (Self::First, Some(state)) => state.momentum.moment_1.clone(),
            (Self::Second, Some(state)) => state.momentum.moment_2.clone(),
        };
        (shown, state)
    }

    fn to_device<const D: usize>(state: AdamState<D>, device: &Device) -> AdamState<D> {
        Adam::to_device(state, device)
    }
}

/// Returns the bytes of an optimiser after `time` steps.
///
/// - `moments`: moments under the names of the parameters
/// - `weights`: weights of the network, which supply the tensors that have no moments
///
/// # Errors
/// Moments of another network.
pub(crate) fn optimizer_bytes(
    config: &NetworkConfig,
    weights: &Weights,
    moments: &[Weights; 2],
    time: usize,
) -> Result<Vec<u8>, PipelineError> {
    let mut optimizer = ModuleOptimizer::from(Planted { time });
    let mut net = on_processor(config, weights)?;
    for moment in moments {
        let given = as_gradients(&on_processor(config, &filled(moment, weights))?);
        net = optimizer.step(0.0, net, given);
    }
    let bytes = optimizer
        .into_bytes()
        .map_err(|error| PipelineError::Optimizer(error.to_string()))?;
    Ok(bytes.to_vec())
}

/// Returns the moments in an optimiser's bytes, under the names of the parameters.
///
/// # Errors
/// Bytes that are not those of an optimiser.
pub(crate) fn moments_of(
    config: &NetworkConfig,
    weights: &Weights,
    bytes: &[u8],
) -> Result<[Weights; 2], PipelineError> {
    let shown = |which: Shown| -> Result<Weights, PipelineError> {
        let mut optimizer = ModuleOptimizer::from(which)
            .from_bytes(Bytes::from_bytes_vec(bytes.to_vec()))
            .map_err(|error| PipelineError::Optimizer(error.to_string()))?;
        let net = on_processor(config, weights)?;
        let any = as_gradients(&net);
        Ok(optimizer.step(0.0, net, any).weights())
    };
    Ok([shown(Shown::First)?, shown(Shown::Second)?])
}

fn on_processor(config: &NetworkConfig, weights: &Weights) -> Result<Network, PipelineError> {
    let device = Device::flex().autodiff();
    Ok(Network::from_weights(config, weights, &device)?)
}

/// Returns `weights` with missing tensors taken from `others`.
fn filled(weights: &Weights, others: &Weights) -> Weights {
    let mut all = others.clone();
    all.0.extend(weights.0.clone());
    all
}

/// Returns the parameters of a network in the form of gradients.
fn as_gradients(net: &Network) -> GradientsParams {
    struct Given(GradientsParams);
    impl ModuleVisitor for Given {
        fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
            let value = parameter.val().without_autodiff();
            self.0.register(parameter.id, value);
        }
    }
    let mut given = Given(GradientsParams::new());
    net.visit(&mut given);
    given.0
}
