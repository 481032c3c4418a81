//! Output layers fitted to a few labelled sweeps, with the old layer as prior.

use tactnet_data::SweepView;
use tactnet_models::{LinearHead, Weights};

use super::committee::fit_heads;
use crate::baseline::fitted::Baseline;
use crate::baseline::method::LinearMethod;
use crate::{Classifier, PipelineError};

/// Strength of the prior of a network's output layer.
const NETWORK_STRENGTH: f64 = 0.1;
/// Strength of the prior of a linear classifier on features.
const BASELINE_STRENGTH: f64 = 0.1;

/// Replaces the output layer of `weights` by one that is fitted to labelled sweeps, with the old layer as mean of the prior.
///
/// - `adapted`: classifier of `weights`
///
/// # Errors
/// A material that the classifier does not know; a classifier that is not linear; a fit that does not converge.
pub(super) fn fit_head(
    adapted: &Classifier,
    weights: &mut Weights,
    sweeps: &SweepView<'_>,
) -> Result<(), PipelineError> {
    if let Some(committee) = adapted.committee() {
        return fit_heads(committee, weights, sweeps);
    }
    let labels = adapted.own_labels(sweeps)?;
    let Some(baseline) = adapted.baseline() else {
        let head = adapted.network()?.output_layer();
        let hidden = adapted.embed(sweeps)?.hidden;
        let fitted = head.fit_from(&hidden, &labels, NETWORK_STRENGTH)?;
        for (name, row) in [
            ("output.weight", fitted.weights.concat()),
            ("output.bias", fitted.biases),
        ] {
            let tensor = weights
                .0
                .get_mut(name)
                .unwrap_or_else(|| panic!("a network has `{name}`"));
            tensor.values = row.iter().map(|value| *value as f32).collect();
        }
        return Ok(());
    };
    let linear = linear_of(adapted, baseline)?;
    let head = linear.head();
    refuse_untrained(adapted, &head)?;
    let fitted = head.fit_from(
        &baseline.scaled_features(sweeps),
        &labels,
        BASELINE_STRENGTH,
    )?;
    linear.save_head(&fitted, weights);
    Ok(())
}

/// Succeeds if the model has an output layer that labelled sweeps can adapt.
///
/// # Errors
/// A baseline that is not linear.
pub(super) fn check_head(classifier: &Classifier) -> Result<(), PipelineError> {
    match classifier.baseline() {
        Some(baseline) => linear_of(classifier, baseline).map(|_| ()),
        None => Ok(()),
    }
}

fn linear_of<'a>(
    classifier: &Classifier,
    baseline: &'a Baseline,
) -> Result<&'a dyn LinearMethod, PipelineError> {
    let linear = baseline.classifier.as_linear();
    linear.ok_or_else(|| PipelineError::AdaptHead {
        model: classifier.model_name(),
    })
}

/// Succeeds if every material had training sweeps; without, its score is minus infinity.
fn refuse_untrained(adapted: &Classifier, head: &LinearHead) -> Result<(), PipelineError> {
    let labels = &adapted.config().labels;
    match head.biases.iter().position(|bias| !bias.is_finite()) {
        None => Ok(()),
        Some(label) => Err(PipelineError::incompatible(
            "materials",
            "training sweeps of every material",
            format!("none of `{}` in its training data", labels.name(label)),
        )),
    }
}
