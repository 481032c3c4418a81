//! Scaling and running statistics of a network for new sweeps.

use burn::tensor::{Device, Tensor, TensorData};
use tactnet_data::SweepView;
use tactnet_models::{BatchStatistics, Network, Weights, values};

use super::shift::{Moment, Shift, believed};
use crate::network::in_pool::in_pool;
use crate::{Classifier, ClassifierConfig, ModelConfig, NetworkSetup, PipelineError};

/// Number of dropout masks that every sweep meets in front of the dense layer.
const MASKS: usize = 32;

/// Returns configuration and weights with the scaling and the running statistics of `sweeps`; trained weights stay the same.
///
/// Layers are adapted from the first to the last, each for the outputs of the adapted layers before it.
///
/// # Errors
/// Never for a network that has been built.
pub(super) fn adapt_network(
    classifier: &Classifier,
    setup: &NetworkSetup,
    sweeps: &SweepView<'_>,
) -> Result<(ClassifierConfig, Weights, Shift), PipelineError> {
    let (normalizer, scaling) = setup.normalizer.adapted(sweeps);
    let mut config = classifier.config().clone();
    config.model = ModelConfig::Network(NetworkSetup {
        normalizer,
        ..setup.clone()
    });
    let device = classifier.scorer()?.device();
    let scaled = Classifier::new(config.clone(), &classifier.network()?.weights(), device)?;
    let scorer = scaled.scorer()?;
    let mut net = scorer.net().clone();
    let shift = in_pool(device, || {
        let masks = scorer.masks(MASKS);
        let mut largest = scaling;
        for layer in 0..net.normalized_layers() {
            let of_sweep = |position: usize| {
                let sweep = scorer.load(sweeps, &[position]);
                moments(net.statistics_of(layer, sweep, masks.clone()))
            };
            let found: Vec<Vec<Moment>> = (0..sweeps.len()).map(of_sweep).collect();
            let known = moments(net.running_statistics(layer));
            let (new, shift) = believed(&known, &found);
            set(&mut net, layer, &new, device);
            // Raw digits have no scaling, so the first layer shows the shift.
            if largest.is_none() {
                largest = Some(shift);
            }
        }
        largest
    });
    let still = Shift {
        level: 0.0,
        spread: 0.0,
    };
    Ok((config, net.weights(), shift.unwrap_or(still)))
}

fn moments(statistics: BatchStatistics) -> Vec<Moment> {
    let (means, variances) = (values(statistics.mean), values(statistics.variance));
    let both = means.into_iter().zip(variances);
    both.map(|(mean, variance)| Moment {
        mean: f64::from(mean),
        variance: f64::from(variance),
    })
    .collect()
}

fn set(net: &mut Network, layer: usize, moments: &[Moment], device: &Device) {
    let tensor = |of: fn(&Moment) -> f64| {
        let values: Vec<f32> = moments.iter().map(|moment| of(moment) as f32).collect();
        let count = values.len();
        Tensor::from_data(TensorData::new(values, [count]), device)
    };
    let statistics = BatchStatistics {
        mean: tensor(|of| of.mean),
        variance: tensor(|of| of.variance),
    };
    net.set_running_statistics(layer, statistics);
}
