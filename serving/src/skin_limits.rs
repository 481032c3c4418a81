//! Value limits of the skin for a network, and the check that its sweeps can be segmented.

use std::path::Path;

use tactnet_data::ValueRange;
use tactnet_pipeline::{ClassifierConfig, ModelConfig, RunDir};
use tactnet_skin::{Segmentation, SegmenterConfig};

use crate::ServeError;

/// Returns the minimum and maximum value of a taxel from the network's training sweeps, in digits.
///
/// Runs of earlier versions did not store them. The result is then the raw 8-bit range if all taxel means lie within
/// it, else `None`.
pub(crate) fn limits(config: &ClassifierConfig) -> Option<[f32; 2]> {
    let [zero, full] = ValueRange::DIGITS;
    match (&config.values, &config.model) {
        (Some(values), _) => Some(values.limits()),
        (None, ModelConfig::Network(setup)) => {
            let mut means = setup.normalizer.offset().iter();
            means
                .all(|mean| (zero..=full).contains(mean))
                .then_some(ValueRange::DIGITS)
        }
        (None, ModelConfig::Baseline(_) | ModelConfig::Committee(_)) => Some(ValueRange::DIGITS),
    }
}

/// Returns the minimum and maximum value of a taxel from a run's training sweeps, in digits; `None` if the run did not
/// store them.
///
/// # Errors
/// Fails if `run` is not a run directory or holds a baseline.
pub fn accepted_values(run: &Path) -> Result<Option<[f32; 2]>, ServeError> {
    let config = RunDir::open(run)?.network("be served")?.config()?;
    Ok(limits(&config.classifier))
}

/// Returns the segmenter's settings for the network. Limits that the table does not set come from the training sweeps.
///
/// # Errors
/// Returns the reason why no sweep could be classified.
pub(crate) fn settle(
    segmenter: &SegmenterConfig,
    config: &ClassifierConfig,
) -> Result<SegmenterConfig, String> {
    let Some(values) = segmenter.values.or_else(|| limits(config)) else {
        return Err(
            "its run is of an earlier version without the value range of its training sweeps: train it again, or set \
             `values = [least, greatest]` in [components.tactnet.segmenter] of the table"
                .into(),
        );
    };
    if let (Segmentation::Contact(contact), Some(range)) = (segmenter.segmentation, &config.values)
        && contact.begins > range.greatest_mean
    {
        return Err(format!(
            "the table starts a contact at a mean of {} over all taxels, but no frame of its training sweeps exceeds {}: lower `begins` and \
             `ends` of [components.tactnet.segmenter.segmentation.contact], or set `segmentation = \"command\"`",
            contact.begins, range.greatest_mean
        ));
    }
    Ok(SegmenterConfig {
        values: Some(values),
        ..*segmenter
    })
}
