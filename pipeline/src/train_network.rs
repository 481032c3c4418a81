//! From training sweeps to a network in one call, for experiments whose unit of work is more than one training.

use burn::tensor::Device;
use tactnet_data::{Seed, TrainSplit};

use crate::{
    BatchReport, Classifier, ClassifierConfig, ModelConfig, PipelineError, Recipe, TactNetSetup,
    Training,
};

/// Trains a network to its end. `None` when `go_on` said no.
///
/// - `go_on`: told of every batch; false stops the training, whose work is then lost
///
/// # Errors
/// A training set without sweeps, a setting out of range, a loss that is not finite.
pub fn train_network(
    recipe: &Recipe,
    train: &TrainSplit<'_>,
    seed: Seed,
    device: &Device,
    mut go_on: impl FnMut(&BatchReport) -> bool,
) -> Result<Option<Classifier>, PipelineError> {
    let setup = TactNetSetup::fit(recipe, train);
    let model = ModelConfig::TactNet2(setup.clone());
    let config = ClassifierConfig::new(model, train, seed);
    let network = config.network_config(&setup)?;
    let mut training = Training::start(recipe, train, &setup.normalizer, &network, seed, device)?;
    while let Some(batch) = training.step()? {
        if !go_on(&batch) {
            return Ok(None);
        }
    }
    let weights = training.state()?.weights;
    Classifier::new(config, &weights, device).map(Some)
}
