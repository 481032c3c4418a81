//! A network trained on some sweeps, and what it makes of others.

use tactnet_data::{Seed, SweepView, TrainSplit};
use tactnet_pipeline::{Classifier, Embedding, train_network};

use super::{Bench, Ended};

/// Trains a network on `train`.
pub(crate) fn trained(
    bench: &Bench<'_>,
    what: &str,
    train: &TrainSplit<'_>,
    seed: Seed,
) -> Result<Classifier, Ended> {
    bench.say(what)?;
    let go_on = |batch: &tactnet_pipeline::BatchReport| (bench.go_on)(what, Some(batch));
    train_network(bench.recipe, train, seed, bench.device, go_on)?.ok_or(Ended::Stopped)
}

/// Every sweep of `view` as the network sees it.
pub(crate) fn embedded(classifier: &Classifier, view: &SweepView<'_>) -> Result<Embedding, Ended> {
    Ok(classifier.embed(view)?)
}
