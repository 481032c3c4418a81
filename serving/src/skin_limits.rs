//! What the skin may show while a network serves, and whether its sweeps can be found.

use std::path::Path;

use tactnet_data::ValueRange;
use tactnet_pipeline::{ClassifierConfig, ModelConfig, RunDir};
use tactnet_skin::{Segmentation, SegmenterConfig};

use crate::ServeError;

/// Returns the least and the greatest value of a taxel by the network's training sweeps.
///
/// A run of an earlier version does not say: `None` where the mean of a taxel is none that a raw 8-bit skin could have.
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
        (None, ModelConfig::Baseline(_)) => Some(ValueRange::DIGITS),
    }
}

/// Returns the least and the greatest value that a taxel may show by a run's training sweeps; `None` where the run does not say.
///
/// # Errors
/// No run; a baseline.
pub fn accepted_values(run: &Path) -> Result<Option<[f32; 2]>, ServeError> {
    let config = RunDir::open(run)?.config()?;
    config.require_network(run, "be served")?;
    Ok(limits(&config.classifier))
}

/// Returns the segmenter's settings for the network, with its limits where the table sets none.
///
/// # Errors
/// Says why no sweep could be judged.
pub(crate) fn settle(
    segmenter: &SegmenterConfig,
    config: &ClassifierConfig,
) -> Result<SegmenterConfig, String> {
    let Some(values) = segmenter.values.or_else(|| limits(config)) else {
        return Err(
            "its run is of an earlier version and does not say which values its training sweeps have: train it again, or set \
             `values = [least, greatest]` in [components.tactnet.segmenter] of the table"
                .into(),
        );
    };
    if let (Segmentation::Contact(contact), Some(range)) = (segmenter.segmentation, &config.values)
        && contact.begins > range.greatest_mean
    {
        return Err(format!(
            "the table lets a contact begin at a mean of {} over all taxels, and no frame of its training sweeps has more than {}: set `begins` and \
             `ends` of [components.tactnet.segmenter.segmentation.contact] lower, or `segmentation = \"command\"`",
            contact.begins, range.greatest_mean
        ));
    }
    Ok(SegmenterConfig {
        values: Some(values),
        ..*segmenter
    })
}
