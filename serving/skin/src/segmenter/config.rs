//! How sweeps are found, and what spoils them.

use serde::{Deserialize, Deserializer, Serialize};

/// How sweeps are found, and what spoils them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SegmenterConfig {
    /// Who says when a sweep begins.
    pub segmentation: Segmentation,
    /// Frames skipped after the motion starts: at 750 Hz the middle 1000 of 1500 frames begin after 250 (thesis, section 4.3.2).
    pub skip: usize,
    /// Lost frames in a row that are filled in by linear interpolation.
    pub longest_gap: usize,
    /// Frames of a window that may be interpolated altogether.
    pub most_filled_in: usize,
    /// Share of a frame's period that the sensor's clock may be off between two frames.
    pub clock_tolerance: f64,
    /// Periods that it may be off over a sweep.
    pub clock_drift: f64,
    /// A taxel that shows the same digit, other than zero, for so many frames of a window in a row is stalled; a shorter window is too
    /// short to tell that from light contact.
    pub stalled_frames: usize,
    /// Least and greatest value that a taxel can show; others reject the sweep. `None`: by the training sweeps of the network that serves
    /// (`ValueRange::limits` of `tactnet-data`); any value where there is none. `full_scale = X` of earlier tables is read as `[0, X]`.
    #[serde(
        alias = "full_scale",
        deserialize_with = "values",
        skip_serializing_if = "Option::is_none"
    )]
    pub values: Option<[f32; 2]>,
    /// A taxel at the greatest value for so many frames of a window in a row is saturated.
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

/// Reads `[least, greatest]`, or the greatest alone.
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

/// Who says when a sweep begins.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Segmentation {
    /// The motion controller.
    #[default]
    Command,
    /// The skin itself.
    Contact(Contact),
}

/// A contact, by the mean digit of a frame, with hysteresis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Contact {
    /// It begins when the mean digit is at least this.
    pub begins: f32,
    /// It ends when the mean digit is below this.
    pub ends: f32,
    /// For so many frames in a row.
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
