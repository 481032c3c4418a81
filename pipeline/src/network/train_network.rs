//! The training loop of networks.

use std::time::Instant;

use burn::tensor::Device;
use tactnet_data::{Seed, TrainSplit};

use crate::run::training_record::TrainingRecord;
use crate::{
    BatchReport, Classifier, ClassifierConfig, ModelConfig, PipelineError, Recipe, TactNetSetup,
    Training,
};

/// Trains batch by batch to the last epoch. Returns false if `go_on` said no before; a record then has a checkpoint of that moment.
///
/// - `record`: where metrics and checkpoints are kept, if anywhere
/// - `go_on`: called after every batch; false stops the training
pub(crate) fn train_batches(
    training: &mut Training<'_>,
    mut record: Option<&mut TrainingRecord<'_>>,
    mut go_on: impl FnMut(&BatchReport) -> bool,
) -> Result<bool, PipelineError> {
    loop {
        let begun = Instant::now();
        let Some(batch) = training.step()? else {
            return Ok(true);
        };
        let spent = begun.elapsed();
        let wanted = go_on(&batch);
        if let Some(record) = &mut record {
            record.note(&batch, spent)?;
            if record.is_due(&batch) || !wanted {
                record.save(training)?;
            }
        }
        if !wanted {
            return Ok(false);
        }
    }
}

/// Trains a network to its end in one call, for experiments whose unit of work is more than one training. `None` when `go_on` said no.
///
/// - `go_on`: called after every batch; false stops the training, whose work is then lost
///
/// # Errors
/// A training set without sweeps, a setting out of range, a loss that is not finite.
pub fn train_network(
    recipe: &Recipe,
    train: &TrainSplit<'_>,
    seed: Seed,
    device: &Device,
    go_on: impl FnMut(&BatchReport) -> bool,
) -> Result<Option<Classifier>, PipelineError> {
    let setup = TactNetSetup::fit(recipe, train);
    let model = ModelConfig::TactNet2(setup.clone());
    let config = ClassifierConfig::new(model, train, seed);
    let network = config.network_config(&setup)?;
    let mut training = Training::start(recipe, train, &setup.normalizer, &network, seed, device)?;
    if !train_batches(&mut training, None, go_on)? {
        return Ok(None);
    }
    let weights = training.state()?.weights;
    Classifier::new(config, &weights, device).map(Some)
}
