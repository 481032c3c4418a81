//! What the skin may show while a network serves, and whether its sweeps can be found.

use tactnet_pipeline::{ClassifierConfig, ModelConfig};
use tactnet_skin::{Segmentation, SegmenterConfig};

/// Values of a raw 8-bit skin, which all runs that do not say were trained on.
const DIGITS: [f32; 2] = [0.0, 255.0];

/// Returns the least and the greatest value of a taxel by the network's training sweeps.
///
/// A run of an earlier version does not say: `None` where the mean of a taxel is none that a raw 8-bit skin could have.
pub(crate) fn limits(config: &ClassifierConfig) -> Option<[f32; 2]> {
    let [zero, full] = DIGITS;
    match (&config.values, &config.model) {
        (Some(values), _) => Some(values.limits()),
        (None, ModelConfig::TactNet2(setup)) => {
            let mut means = setup.normalizer.offset().iter();
            means
                .all(|mean| (zero..=full).contains(mean))
                .then_some(DIGITS)
        }
        (None, ModelConfig::Baseline(_)) => Some(DIGITS),
    }
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
