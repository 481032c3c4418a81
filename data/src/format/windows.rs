//! Windows: sweeps of one length that are cut from continuous recordings.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::{DataError, Remedy};

/// Length of a window, or distance between windows.
///
/// ```
/// use tactnet_data::format::Span;
///
/// assert_eq!("128".parse::<Span>()?, Span::Steps(128));
/// assert_eq!("1.28s".parse::<Span>()?, Span::Seconds(1.28));
/// assert_eq!("640 ms".parse::<Span>()?, Span::Seconds(0.64));
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Span {
    /// Number of frames.
    Steps(usize),
    /// Time, in seconds.
    Seconds(f64),
}

impl FromStr for Span {
    type Err = DataError;

    /// Reads a number of frames (`128`) or a time (`1.28s`, `640ms`).
    fn from_str(text: &str) -> Result<Self, DataError> {
        let text = text.trim();
        let seconds = match (text.strip_suffix("ms"), text.strip_suffix('s')) {
            (Some(number), _) => Some((number, 1e-3)),
            (None, Some(number)) => Some((number, 1.0)),
            (None, None) => None,
        };
        let span = match seconds {
            None => text.parse().ok().map(Self::Steps),
            Some((number, unit)) => {
                let value = number.trim().parse::<f64>().ok();
                let value = value.map(|value| value * unit);
                value.filter(|value| value.is_finite()).map(Self::Seconds)
            }
        };
        let is_positive = |span: &Self| match *span {
            Self::Steps(steps) => steps > 0,
            Self::Seconds(seconds) => seconds > 0.0,
        };
        span.filter(is_positive).ok_or_else(|| {
            let expected = "a number of steps such as 128, or a time such as 1.28s or 640ms";
            DataError::inconsistent("window", expected, format!("`{text}`"))
        })
    }
}

impl Span {
    /// Returns the nearest number of frames, at least one.
    ///
    /// # Errors
    /// A time without a sample rate.
    pub(super) fn steps(self, path: &Path, rate_hz: Option<f64>) -> Result<usize, DataError> {
        match (self, rate_hz) {
            (Self::Steps(steps), _) => Ok(steps.max(1)),
            (Self::Seconds(seconds), Some(rate)) => Ok(((seconds * rate).round() as usize).max(1)),
            (Self::Seconds(_), None) => {
                let expected = "one, for windows in seconds";
                let error = DataError::format(path, "sample rate", expected, "none");
                Err(error.with_remedy(Remedy::NameRate))
            }
        }
    }
}

/// Windows that are cut from continuous recordings, within stretches of one label and without a gap.
///
/// ```
/// use tactnet_data::format::{Span, Windows};
///
/// // Windows of 1.28 s that overlap by half, without the frames labelled `none`.
/// let windows = Windows {
///     hop: Some(Span::Seconds(0.64)),
///     drop_labels: vec!["none".into()],
///     ..Windows::of(Span::Seconds(1.28))
/// };
/// assert_eq!(windows.intervals, None);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Windows {
    /// Length of a window.
    pub length: Span,
    /// Distance between the starts of windows; `None`: their length, so that they do not overlap.
    pub hop: Option<Span>,
    /// Table with columns `start`, `end` (times in the recording's clock), `label` and optionally `file`; `None`: the label
    /// is in a column of the recording, or the same in all frames.
    pub intervals: Option<PathBuf>,
    /// Labels whose frames are left out.
    pub drop_labels: Vec<String>,
}

impl Windows {
    /// Returns windows of this length that do not overlap, of all labels.
    pub fn of(length: Span) -> Self {
        Self {
            length,
            hop: None,
            intervals: None,
            drop_labels: Vec::new(),
        }
    }
}

/// Returns the first frames of the windows in a stretch.
///
/// - `frames`: length of the stretch
pub(super) fn starts(frames: usize, length: usize, hop: usize) -> impl Iterator<Item = usize> {
    let last = (frames + 1).saturating_sub(length);
    (0..last).step_by(hop.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn spans_are_positive() {
        for text in [
            "", "0", "-1", "1.5", "0s", "-1s", "nans", "infs", "1 m", "1h",
        ] {
            assert!(text.parse::<Span>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_time_needs_a_rate() {
        let path = Path::new("a.csv");
        assert_eq!(Span::Seconds(1.28).steps(path, Some(20.0)).unwrap(), 26);
        assert_eq!(Span::Steps(7).steps(path, None).unwrap(), 7);
        let error = Span::Seconds(1.0).steps(path, None).unwrap_err();
        assert_eq!(error.remedy(), Some(Remedy::NameRate));
    }

    proptest! {
        #[test]
        fn windows_fill_a_stretch(frames in 0usize..500, length in 1usize..100, hop in 1usize..100) {
            let starts: Vec<usize> = starts(frames, length, hop).collect();
            let expected = if frames < length { 0 } else { (frames - length) / hop + 1 };
            prop_assert_eq!(starts.len(), expected);
            prop_assert!(starts.iter().all(|start| start + length <= frames));
        }
    }
}
