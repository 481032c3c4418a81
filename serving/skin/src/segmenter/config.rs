//! Settings of the segmentation and of the checks that reject sweeps.

use serde::{Deserialize, Deserializer, Serialize};

use crate::FrameSpan;

/// Settings of the segmentation and of the checks that reject sweeps.
///
/// # Example
/// ```
/// use tactnet_skin::{Contact, FrameSpan, Segmentation, SegmenterConfig};
///
/// let config = SegmenterConfig {
///     segmentation: Segmentation::Contact(Contact::default()),
///     skip: FrameSpan::Frames(0),
///     ..SegmenterConfig::default()
/// };
/// assert_eq!(config.longest_gap.frames(750.0), 3);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SegmenterConfig {
    /// Source that starts and stops sweeps.
    pub segmentation: Segmentation,
    /// Part of the motion that is skipped at its start. At 750 Hz the middle 1000 of 1500 frames start after 250
    /// (thesis, section 4.3.2).
    pub skip: FrameSpan,
    /// Longest window. A sweep that is longer than all training sweeps is then classified when it ends, as the mean over windows of their
    /// length. `None` closes the window at the length of the longest training sweep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub longest: Option<FrameSpan>,
    /// Longest run of lost frames that linear interpolation fills in.
    pub longest_gap: FrameSpan,
    /// Maximum of interpolated frames in a window.
    pub most_filled_in: FrameSpan,
    /// Tolerance of the sensor's clock between two frames, in frame periods.
    pub clock_tolerance: f64,
    /// Tolerance of the sensor's clock over a whole sweep, in frame periods.
    pub clock_drift: f64,
    /// Length of a run of frames with the same nonzero digit after which a taxel counts as stalled. A shorter window
    /// cannot tell a stalled taxel from light contact.
    pub stalled_frames: FrameSpan,
    /// Minimum and maximum value of a taxel, in digits; values outside reject the sweep. `None` derives the limits from
    /// the training sweeps of the serving network (`ValueRange::limits` of `tactnet-data`); without a network any value
    /// is accepted. `full_scale = X` of earlier tables is read as `[0, X]`.
    #[serde(
        alias = "full_scale",
        deserialize_with = "values",
        skip_serializing_if = "Option::is_none"
    )]
    pub values: Option<[f32; 2]>,
    /// Length of a run of frames at the maximum value after which a taxel counts as saturated.
    pub saturated_frames: FrameSpan,
}

impl Default for SegmenterConfig {
    fn default() -> Self {
        Self {
            segmentation: Segmentation::Command,
            // 250 frames at 750 Hz.
            skip: FrameSpan::Millis(333.0),
            longest: None,
            longest_gap: FrameSpan::Frames(3),
            most_filled_in: FrameSpan::Frames(20),
            clock_tolerance: 0.5,
            clock_drift: 5.0,
            stalled_frames: FrameSpan::Frames(1000),
            values: None,
            saturated_frames: FrameSpan::Frames(100),
        }
    }
}

/// Lengths of a segmenter's settings at one rate, in frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FrameCounts {
    pub(super) skip: usize,
    pub(super) longest_gap: usize,
    pub(super) most_filled_in: usize,
    pub(super) stalled: usize,
    pub(super) saturated: usize,
    /// Frames that must agree before contact starts or ends.
    pub(super) contact: usize,
}

impl SegmenterConfig {
    /// Returns the lengths for windows of `steps` frames.
    pub(super) fn at_rate(&self, steps: usize, rate_hz: f64) -> FrameCounts {
        let contact = match self.segmentation {
            Segmentation::Command => 1,
            Segmentation::Contact(contact) => contact.frames.frames(rate_hz).max(1),
        };
        FrameCounts {
            skip: self.skip.frames(rate_hz),
            longest_gap: self.longest_gap.frames(rate_hz),
            most_filled_in: self.most_filled_in.frames(rate_hz),
            stalled: self.stalled_frames.frames(rate_hz).max(2),
            saturated: self.saturated_frames.frames(rate_hz).clamp(1, steps.max(1)),
            contact,
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
    /// Length of a run of frames that must agree before contact starts or ends.
    pub frames: FrameSpan,
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            begins: 10.0,
            ends: 5.0,
            frames: FrameSpan::Frames(8),
        }
    }
}
