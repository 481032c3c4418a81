//! Why a sweep cannot be used.

use crate::WindowError;

/// Why a sweep cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Reject {
    /// Lost, repeated or foreign frames, values that are no number.
    #[error(transparent)]
    Window(#[from] WindowError),
    /// The sensor's clock does not go with its frames.
    #[error("frame {sequence}: {found_ns} ns after an earlier frame, expected {expected_ns}")]
    Clock {
        /// The frame.
        sequence: u64,
        /// By the sensor's clock.
        found_ns: i64,
        /// By the rate and the frames' numbers.
        expected_ns: i64,
    },
    /// Too many frames lost, here and there.
    #[error("{found} frames lost, at most {allowed} can be filled in")]
    Losses {
        /// Frames of the window that were interpolated.
        found: usize,
        /// Most frames that are forgiven.
        allowed: usize,
    },
    /// A value that the sensor cannot give.
    #[error(
        "frame {sequence}: taxel {taxel} shows {digit}, expected {least} to {greatest}; `values` in the table widens that"
    )]
    Range {
        /// The frame.
        sequence: u64,
        /// The taxel.
        taxel: usize,
        /// Its digit.
        digit: f32,
        /// The least value.
        least: f32,
        /// The greatest value.
        greatest: f32,
    },
    /// A taxel that does not change.
    #[error("taxel {taxel} shows {digit} for {frames} frames")]
    Stalled {
        /// The taxel.
        taxel: usize,
        /// Its digit.
        digit: f32,
        /// For how long.
        frames: usize,
    },
    /// A taxel at its limit.
    #[error("taxel {taxel} is saturated for {frames} frames")]
    Saturated {
        /// The taxel.
        taxel: usize,
        /// For how long.
        frames: usize,
    },
    /// The motion ended before the window was whole.
    #[error("it ended after {found} of {expected} frames")]
    Short {
        /// Frames of the window that came.
        found: usize,
        /// Frames of a window.
        expected: usize,
    },
    /// Another sweep was started before this one was whole.
    #[error("another sweep was started after {found} of {expected} frames")]
    SecondStart {
        /// Frames of the window that came.
        found: usize,
        /// Frames of a window.
        expected: usize,
    },
}
