//! Reasons why a sweep is rejected.

use crate::WindowError;

/// Reason why a sweep is rejected.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Reject {
    /// Lost, repeated or mismatched frames, or values that are not finite.
    #[error(transparent)]
    Window(#[from] WindowError),
    /// The sensor's clock disagrees with the frame numbers.
    #[error("frame {sequence}: {found_ns} ns after an earlier frame, expected {expected_ns}")]
    Clock {
        /// Sequence number of the frame.
        sequence: u64,
        /// Time since the earlier frame by the sensor's clock, in ns.
        found_ns: i64,
        /// Time since the earlier frame by the sample rate, in ns.
        expected_ns: i64,
    },
    /// Too many frames of the window were lost.
    #[error("{found} frames lost, at most {allowed} can be interpolated")]
    Losses {
        /// Number of interpolated frames in the window.
        found: usize,
        /// Maximum number of interpolated frames.
        allowed: usize,
    },
    /// A value is outside the range of the sensor.
    #[error(
        "frame {sequence}: taxel {taxel} has the value {digit}, expected {least} to {greatest}; the setting `values` widens the range"
    )]
    Range {
        /// Sequence number of the frame.
        sequence: u64,
        /// Index of the taxel.
        taxel: usize,
        /// Value of the taxel, in digits.
        digit: f32,
        /// Minimum value, in digits.
        least: f32,
        /// Maximum value, in digits.
        greatest: f32,
    },
    /// A taxel does not change.
    #[error("taxel {taxel} is stalled: value {digit} for {frames} frames")]
    Stalled {
        /// Index of the taxel.
        taxel: usize,
        /// Value of the taxel, in digits.
        digit: f32,
        /// Number of consecutive frames with this value.
        frames: usize,
    },
    /// A taxel is at the maximum value.
    #[error("taxel {taxel} is saturated for {frames} frames")]
    Saturated {
        /// Index of the taxel.
        taxel: usize,
        /// Number of consecutive frames at the maximum value.
        frames: usize,
    },
    /// The motion ended before the window had enough frames.
    #[error("the sweep ended after {found} of {expected} frames")]
    Short {
        /// Number of frames in the window so far.
        found: usize,
        /// Minimum number of frames.
        expected: usize,
    },
    /// Another sweep was started before this one had ended.
    #[error("another sweep was started after {found} of {expected} frames")]
    SecondStart {
        /// Number of frames in the window so far.
        found: usize,
        /// Number of frames in a full window.
        expected: usize,
    },
}
