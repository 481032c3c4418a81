//! A network trained on some sweeps, and what it makes of others.

use tactnet_data::{Seed, SweepView, TrainSplit};
use tactnet_pipeline::{Classifier, Embedding, train_network};

use super::{Cancelled, StudyContext};

/// Trains a network on `train`.
pub(crate) fn trained(
    context: &StudyContext<'_>,
    what: &str,
    train: &TrainSplit<'_>,
    seed: Seed,
) -> Result<Classifier, Cancelled> {
    context.say(what)?;
    let go_on = |batch: &tactnet_pipeline::BatchReport| (context.go_on)(what, Some(batch));
    train_network(context.recipe, train, seed, context.device, go_on)?.ok_or(Cancelled::Stopped)
}

/// Every sweep of `view` as the network sees it.
pub(crate) fn embedded(
    classifier: &Classifier,
    view: &SweepView<'_>,
) -> Result<Embedding, Cancelled> {
    Ok(classifier.embed(view)?)
}
