//! Settings of the segmentation and of the checks that reject sweeps.

use serde::{Deserialize, Deserializer, Serialize};

/// Settings of the segmentation and of the checks that reject sweeps.
///
/// # Example
/// ```
/// use tactnet_skin::{Contact, Segmentation, SegmenterConfig};
///
/// let config = SegmenterConfig {
///     segmentation: Segmentation::Contact(Contact::default()),
///     skip: 0,
///     ..SegmenterConfig::default()
/// };
/// assert_eq!(config.longest_gap, 3);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SegmenterConfig {
    /// Source that starts and stops sweeps.
    pub segmentation: Segmentation,
    /// Number of frames skipped after the motion starts. At 750 Hz the middle 1000 of 1500 frames start after 250
    /// (thesis, section 4.3.2).
    pub skip: usize,
    /// Maximum number of consecutive lost frames that linear interpolation fills in.
    pub longest_gap: usize,
    /// Maximum number of interpolated frames in a window.
    pub most_filled_in: usize,
    /// Tolerance of the sensor's clock between two frames, in frame periods.
    pub clock_tolerance: f64,
    /// Tolerance of the sensor's clock over a whole sweep, in frame periods.
    pub clock_drift: f64,
    /// Number of consecutive frames with the same nonzero digit after which a taxel counts as stalled. A shorter window
    /// cannot tell a stalled taxel from light contact.
    pub stalled_frames: usize,
    /// Minimum and maximum value of a taxel, in digits; values outside reject the sweep. `None` derives the limits from
    /// the training sweeps of the serving network (`ValueRange::limits` of `tactnet-data`); without a network any value
    /// is accepted. `full_scale = X` of earlier tables is read as `[0, X]`.
    #[serde(
        alias = "full_scale",
        deserialize_with = "values",
        skip_serializing_if = "Option::is_none"
    )]
    pub values: Option<[f32; 2]>,
    /// Number of consecutive frames at the maximum value after which a taxel counts as saturated.
    pub saturated_frames: usize,
}

impl Default for SegmenterConfig {
    fn default() -> Self {
        Self {
            segmentation: Segmentation::Command,
            skip: 250,
            longest_gap: 3,
            most_filled_in: 20,
            clock_tolerance: 0.5,
            clock_drift: 5.0,
            stalled_frames: 1000,
            values: None,
            saturated_frames: 100,
        }
    }
}

/// Reads `[minimum, maximum]`, or the maximum alone.
fn values<'de, D: Deserializer<'de>>(from: D) -> Result<Option<[f32; 2]>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected `[least, greatest]`")]
    enum Values {
        Both([f32; 2]),
        Greatest(f32),
    }
    Ok(Some(match Values::deserialize(from)? {
        Values::Both(values) => values,
        Values::Greatest(greatest) => [0.0, greatest],
    }))
}

/// Source that starts and stops sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Segmentation {
    /// The motion controller, by commands.
    #[default]
    Command,
    /// The skin itself, by contact.
    Contact(Contact),
}

/// Contact detection by the mean digit of a frame, with hysteresis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Contact {
    /// Contact starts when the mean digit is at least this value.
    pub begins: f32,
    /// Contact ends when the mean digit is below this value.
    pub ends: f32,
    /// Number of consecutive frames that must agree before contact starts or ends.
    pub frames: usize,
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            begins: 10.0,
            ends: 5.0,
            frames: 8,
        }
    }
}
