//! Adam in one pass over the parameters.
//!
//! Burn's own Adam composes about ten tensor operations, each a pass over memory; with two million parameters that costs a tenth of
//! a training step. On the processor this one reads gradient, parameter and moments once and writes them once. State and record are
//! Burn's.

use burn::optim::decay::WeightDecayConfig;
use burn::optim::{
    Adam, AdamConfig, AdamState, AdaptiveMomentumState, LearningRate, ModuleOptimizer, Optimizer,
};
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;

const BETA: [f32; 2] = [0.9, 0.999];
const EPSILON: f32 = 1e-8;
/// Values that a thread takes at once.
const RUN: usize = 1 << 14;

/// Adam (Kingma & Ba, 2015; beta 0.9 and 0.999, epsilon 1e-8) with an L2 penalty added to the gradient.
#[derive(Clone)]
pub(crate) struct FusedAdam {
    l2: f32,
    composed: Adam,
}

impl FusedAdam {
    /// An optimiser for a whole module.
    pub(crate) fn for_module(l2: f64) -> ModuleOptimizer {
        let l2 = l2 as f32;
        let composed = AdamConfig::new()
            .with_beta_1(BETA[0])
            .with_beta_2(BETA[1])
            .with_epsilon(EPSILON)
            .with_weight_decay((l2 > 0.0).then(|| WeightDecayConfig::new(l2)))
            .build();
        ModuleOptimizer::from(Self { l2, composed })
    }
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
        let device = tensor.device();
        if !tactnet_models::is_processor(&device) {
            return self.composed.step(learning_rate, tensor, gradient, state);
        }
        let dims = tensor.dims();
        let len = dims.iter().product();
        let (time, moments) = match state.map(|state| state.momentum) {
            None => (1, [vec![0.0; len], vec![0.0; len]]),
            Some(state) => (
                state.time + 1,
                [values(state.moment_1), values(state.moment_2)],
            ),
        };
        let [mut first, mut second] = moments;
        let (mut parameter, gradient) = (values(tensor), values(gradient));
        let power = i32::try_from(time).unwrap_or(i32::MAX);
        let correction = BETA.map(|beta| 1.0 - f64::from(beta).powi(power));
        let root = correction[1].sqrt();
        let rate = (learning_rate * root / correction[0]) as f32;
        let epsilon = (f64::from(EPSILON) * root) as f32;
        parameter
            .par_chunks_mut(RUN)
            .zip(gradient.par_chunks(RUN))
            .zip(first.par_chunks_mut(RUN))
            .zip(second.par_chunks_mut(RUN))
            .for_each(|(((parameter, gradient), first), second)| {
                let moments = first.iter_mut().zip(second);
                for ((parameter, &gradient), (m, v)) in
                    parameter.iter_mut().zip(gradient).zip(moments)
                {
                    let gradient = gradient + self.l2 * *parameter;
                    *m = BETA[0] * *m + (1.0 - BETA[0]) * gradient;
                    *v = BETA[1] * *v + (1.0 - BETA[1]) * gradient * gradient;
                    *parameter -= rate * *m / (v.sqrt() + epsilon);
                }
            });
        let back = |values| Tensor::from_data(TensorData::new(values, dims), &device);
        let momentum = AdaptiveMomentumState::new(time, back(first), back(second));
        (back(parameter), Some(AdamState::new(momentum)))
    }

    fn to_device<const D: usize>(state: AdamState<D>, device: &Device) -> AdamState<D> {
        Adam::to_device(state, device)
    }
}

/// The tensor's values, without a copy where nobody else holds them.
fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor
        .into_data()
        .try_into_vec()
        .unwrap_or_else(|error| panic!("parameters are f32: {error:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pass_does_what_the_composed_operations_do() {
        let device = Device::flex();
        let fused = FusedAdam {
            l2: 1e-2,
            composed: AdamConfig::new()
                .with_epsilon(EPSILON)
                .with_weight_decay(Some(WeightDecayConfig::new(1e-2)))
                .build(),
        };
        let values: Vec<f32> = (0..40_000).map(|i| ((i * 7919) % 1013) as f32).collect();
        let start: Tensor<2> = Tensor::from_data(TensorData::new(values, [200, 200]), &device);
        let start = (start - 500.0) / 500.0;
        let (mut ours, mut theirs) = ((start.clone(), None), (start.clone(), None));
        for step in 0..5 {
            let gradient = (start.clone() * 3.0 + step).sin();
            ours = fused.step(1e-2, ours.0, gradient.clone(), ours.1);
            theirs = fused.composed.step(1e-2, theirs.0, gradient, theirs.1);
        }
        let worst = (ours.0 - theirs.0).abs().max().into_scalar::<f32>();
        assert!(worst < 1e-6, "{worst}");
        let [ours, theirs] = [ours.1, theirs.1].map(|state| state.unwrap().momentum);
        assert_eq!(ours.time, theirs.time);
        let worst = (ours.moment_2 - theirs.moment_2).abs().max();
        assert!(worst.into_scalar::<f32>() < 1e-6);
    }
}
