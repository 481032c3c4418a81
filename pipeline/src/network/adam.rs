//! Adam in one pass over the parameters.
//!
//! Burn's Adam composes about ten tensor operations, each a pass over memory. With two million parameters that takes a tenth of a training
//! step. This implementation reads and writes gradient, parameter and moments once. State and record are Burn's.

use burn::optim::decay::WeightDecayConfig;
use burn::optim::{
    Adam, AdamConfig, AdamState, AdaptiveMomentumState, LearningRate, ModuleOptimizer, Optimizer,
};
use burn::tensor::{Device, Tensor};
use tactnet_models::{AdamStep, adam_update, is_fused};

use crate::PenalizedParameters;

pub(crate) const BETA: [f32; 2] = [0.9, 0.999];
const EPSILON: f32 = 1e-8;

/// Adam (Kingma & Ba, 2015; beta 0.9 and 0.999, epsilon 1e-8) with an L2 penalty added to the gradient.
#[derive(Clone)]
pub(crate) struct FusedAdam {
    l2: f32,
    l2_on: PenalizedParameters,
    /// Burn's Adam with and without the penalty, for devices without the fused kernel.
    composed: [Adam; 2],
}

impl FusedAdam {
    /// Returns an optimiser for a whole module.
    pub(crate) fn for_module(l2: f64, l2_on: PenalizedParameters) -> ModuleOptimizer {
        ModuleOptimizer::from(Self::new(l2 as f32, l2_on))
    }

    fn new(l2: f32, l2_on: PenalizedParameters) -> Self {
        let composed = [l2, 0.0].map(|l2| {
            AdamConfig::new()
                .with_beta_1(BETA[0])
                .with_beta_2(BETA[1])
                .with_epsilon(EPSILON)
                .with_weight_decay((l2 > 0.0).then(|| WeightDecayConfig::new(l2)))
                .build()
        });
        Self {
            l2,
            l2_on,
            composed,
        }
    }

    /// Returns true if parameters of `dimensions` dimensions are penalised. Biases and batch normalisation have one dimension.
    fn penalizes(&self, dimensions: usize) -> bool {
        self.l2_on == PenalizedParameters::All || dimensions > 1
    }
}

/// Returns learning rate and epsilon of step `time`, counted from 1, with bias correction of the moments.
pub(crate) fn corrected(learning_rate: LearningRate, time: usize) -> [f32; 2] {
    let power = i32::try_from(time).unwrap_or(i32::MAX);
    let correction = BETA.map(|beta| 1.0 - f64::from(beta).powi(power));
    let root = correction[1].sqrt();
    [
        (learning_rate * root / correction[0]) as f32,
        (f64::from(EPSILON) * root) as f32,
    ]
}

impl Optimizer for FusedAdam {
    type State<const D: usize> = AdamState<D>;

    fn step<const D: usize>(
        &self,
        learning_rate: LearningRate,
        tensor: Tensor<D>,
        gradient: Tensor<D>,
        state: Option<AdamState<D>>,
    ) -> (Tensor<D>, Option<AdamState<D>>) {
        if !is_fused(&tensor.device()) {
            let composed = &self.composed[usize::from(!self.penalizes(D))];
            return composed.step(learning_rate, tensor, gradient, state);
        }
        let (time, first, second) = match state.map(|state| state.momentum) {
            None => (1, tensor.zeros_like(), tensor.zeros_like()),
            Some(state) => (state.time + 1, state.moment_1, state.moment_2),
        };
        let [rate, epsilon] = corrected(learning_rate, time);
        let step = AdamStep {
            l2: if self.penalizes(D) { self.l2 } else { 0.0 },
            beta: BETA,
            rate,
            epsilon,
        };
        let [tensor, first, second] = adam_update(step, [tensor, gradient, first, second]);
        let momentum = AdaptiveMomentumState::new(time, first, second);
        (tensor, Some(AdamState::new(momentum)))
    }

    fn to_device<const D: usize>(state: AdamState<D>, device: &Device) -> AdamState<D> {
        Adam::to_device(state, device)
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;

    #[test]
    fn one_pass_does_what_the_composed_operations_do() {
        let device = Device::flex();
        let fused = FusedAdam::new(1e-2, PenalizedParameters::All);
        let values: Vec<f32> = (0..40_000).map(|i| ((i * 7919) % 1013) as f32).collect();
        let start: Tensor<2> = Tensor::from_data(TensorData::new(values, [200, 200]), &device);
        let start = (start - 500.0) / 500.0;
        let (mut ours, mut theirs) = ((start.clone(), None), (start.clone(), None));
        for step in 0..5 {
            let gradient = (start.clone() * 3.0 + step).sin();
            ours = fused.step(1e-2, ours.0, gradient.clone(), ours.1);
            theirs = fused.composed[0].step(1e-2, theirs.0, gradient, theirs.1);
        }
        let worst = (ours.0 - theirs.0).abs().max().into_scalar::<f32>();
        assert!(worst < 1e-6, "{worst}");
        let [ours, theirs] = [ours.1, theirs.1].map(|state| state.unwrap().momentum);
        assert_eq!(ours.time, theirs.time);
        let worst = (ours.moment_2 - theirs.moment_2).abs().max();
        assert!(worst.into_scalar::<f32>() < 1e-6);
    }

    /// A gradient of zero leaves only the penalty to move a parameter.
    #[test]
    fn biases_and_normalisation_can_be_left_without_penalty() {
        let device = Device::flex();
        fn moved<const D: usize>(l2_on: PenalizedParameters, one: Tensor<D>) -> f32 {
            let fused = FusedAdam::new(1e-2, l2_on);
            let (after, _) = fused.step(1e-2, one.clone(), one.zeros_like(), None);
            (after - one).abs().max().into_scalar::<f32>()
        }
        let (vector, matrix) = (
            Tensor::<1>::ones([4], &device),
            Tensor::<2>::ones([2, 2], &device),
        );
        assert!(moved(PenalizedParameters::All, vector.clone()) > 5e-3);
        assert!(moved(PenalizedParameters::Weights, matrix) > 5e-3);
        assert_eq!(moved(PenalizedParameters::Weights, vector), 0.0);
    }
}
