//! Lengths in frames or in time.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Length of a stretch of frames: a number of frames, or a time. A table writes `250`, `"333ms"` or `"0.3s"`.
///
/// ```
/// use tactnet_skin::FrameSpan;
///
/// let span: FrameSpan = "333ms".parse()?;
/// assert_eq!((span.frames(750.0), span.frames(20.0)), (250, 7));
/// assert_eq!(FrameSpan::Frames(3).frames(20.0), 3);
/// # Ok::<(), String>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FrameSpan {
    /// Number of frames.
    Frames(usize),
    /// Time, in ms.
    Millis(f64),
}

impl FrameSpan {
    /// Returns the nearest number of frames.
    ///
    /// - `rate_hz`: frames per second
    pub fn frames(self, rate_hz: f64) -> usize {
        match self {
            Self::Frames(frames) => frames,
            Self::Millis(ms) => (ms * rate_hz / 1e3).round() as usize,
        }
    }

    /// Returns true for no frames and no time.
    pub fn is_zero(self) -> bool {
        matches!(self, Self::Frames(0)) || self == Self::Millis(0.0)
    }
}

impl fmt::Display for FrameSpan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frames(frames) => frames.fmt(f),
            Self::Millis(ms) => write!(f, "{ms}ms"),
        }
    }
}

impl FromStr for FrameSpan {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refused = || {
            format!(
                "expected a number of frames or a time like \"333ms\" or \"0.3s\", found `{text}`"
            )
        };
        let number = text.trim();
        if let Ok(frames) = number.parse() {
            return Ok(Self::Frames(frames));
        }
        let (number, unit_ms) = match (number.strip_suffix("ms"), number.strip_suffix('s')) {
            (Some(number), _) => (number, 1.0),
            (None, Some(number)) => (number, 1e3),
            (None, None) => return Err(refused()),
        };
        let time: f64 = number.trim().parse().map_err(|_| refused())?;
        // A day: longer times would not fit the memory of a window.
        match time * unit_ms {
            ms if (0.0..=86_400_000.0).contains(&ms) => Ok(Self::Millis(ms)),
            _ => Err(refused()),
        }
    }
}

impl Serialize for FrameSpan {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Frames(frames) => to.serialize_u64(*frames as u64),
            Self::Millis(_) => to.collect_str(self),
        }
    }
}

impl<'de> Deserialize<'de> for FrameSpan {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(
            untagged,
            expecting = "expected a number of frames or a time like \"333ms\""
        )]
        enum Written {
            Frames(usize),
            Text(String),
        }
        match Written::deserialize(from)? {
            Written::Frames(frames) => Ok(Self::Frames(frames)),
            Written::Text(text) => text.parse().map_err(serde::de::Error::custom),
        }
    }
}

impl From<usize> for FrameSpan {
    fn from(frames: usize) -> Self {
        Self::Frames(frames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Section {
        skip: FrameSpan,
    }

    #[test]
    fn tables_hold_frames_or_times() {
        for (text, span) in [
            ("skip = 250\n", FrameSpan::Frames(250)),
            ("skip = \"333ms\"\n", FrameSpan::Millis(333.0)),
        ] {
            let section: Section = toml::from_str(text).unwrap();
            assert_eq!(section.skip, span);
            assert_eq!(toml::to_string(&section).unwrap(), text);
        }
        assert_eq!("0.25 s".parse(), Ok(FrameSpan::Millis(250.0)));
        for wrong in ["-1", "\"-1ms\"", "\"2h\"", "\"1e9s\"", "\"nan s\"", "0.5"] {
            let refused = toml::from_str::<Section>(&format!("skip = {wrong}"));
            assert!(refused.is_err(), "{wrong}");
        }
    }
}
