//! The section `[components.tactnet]` of the table of channels: names of channels, how sweeps are found, how the classifier serves.

use serde::{Deserialize, Serialize};
use tactnet_channel::Table;

use crate::{Segmentation, SegmenterConfig, SkinError};

/// Most fingers of a service.
pub const MAX_FINGERS: usize = 16;

/// Name of the section, `[components.tactnet]`.
pub(crate) const SECTION: &str = "tactnet";

/// Names, rates and promises.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServeConfig {
    /// Channels of skin frames; a finger's number is its place here.
    pub fingers: Vec<String>,
    /// Channel of commands.
    pub command: String,
    /// Channel of beliefs.
    pub belief: String,
    /// Channel of events and counters.
    pub status: String,
    /// Channel of the model's names.
    pub model: String,
    /// Time between beliefs while a sweep goes on, milliseconds; 0: none.
    pub anytime_ms: f64,
    /// Monte Carlo dropout masks; 0: plain predictions only.
    #[serde(alias = "runs")]
    pub mc_samples: usize,
    /// Promised time from a sweep's last frame to its plain belief, milliseconds.
    pub plain_deadline_ms: f64,
    /// Promised time from a sweep's last frame to its Monte Carlo belief, milliseconds.
    pub dropout_deadline_ms: f64,
    /// How sweeps are found, and what spoils them.
    #[serde(alias = "follow")]
    pub segmenter: SegmenterConfig,
}

impl Default for ServeConfig {
    fn default() -> Self {
        Self {
            fingers: vec!["skin/right".into()],
            command: "sweep/command".into(),
            belief: "tactile/belief".into(),
            status: "tactile/status".into(),
            model: "tactile/model".into(),
            anytime_ms: 50.0,
            mc_samples: 100,
            plain_deadline_ms: 1.333,
            dropout_deadline_ms: 4.0,
            segmenter: SegmenterConfig::default(),
        }
    }
}

impl ServeConfig {
    /// The section of `table`, or the defaults where it has none.
    ///
    /// # Errors
    /// Unknown settings or values out of range.
    pub fn of(table: &Table) -> Result<Self, SkinError> {
        let config: Self = match table.components.get(SECTION) {
            Some(section) => section
                .clone()
                .try_into()
                .map_err(|error: toml::de::Error| {
                    SkinError::Section(error.to_string().trim_end().into())
                })?,
            None => Self::default(),
        };
        let wrong = |setting, reason| Err(SkinError::Setting { setting, reason });
        if config.fingers.is_empty() {
            return wrong("fingers", "names no channel of skin frames");
        }
        if !(config.anytime_ms.is_finite() && config.anytime_ms >= 0.0) {
            return wrong("anytime_ms", "expected a time, or 0");
        }
        for (setting, time) in [
            ("plain_deadline_ms", config.plain_deadline_ms),
            ("dropout_deadline_ms", config.dropout_deadline_ms),
            (
                "segmenter.clock_tolerance",
                config.segmenter.clock_tolerance,
            ),
            ("segmenter.clock_drift", config.segmenter.clock_drift),
            (
                "segmenter.full_scale",
                f64::from(config.segmenter.full_scale),
            ),
            (
                "segmenter.stalled_frames",
                config.segmenter.stalled_frames as f64,
            ),
            (
                "segmenter.saturated_frames",
                config.segmenter.saturated_frames as f64,
            ),
        ] {
            if !(time.is_finite() && time > 0.0) {
                return wrong(setting, "expected more than 0");
            }
        }
        if let Segmentation::Contact(contact) = config.segmenter.segmentation {
            let apart = contact.begins > contact.ends && contact.ends.is_finite();
            if !apart || contact.frames == 0 {
                return wrong(
                    "segmenter.segmentation",
                    "expected `begins` above `ends`, and at least one frame",
                );
            }
        }
        let mut fingers = config.fingers.clone();
        fingers.sort();
        fingers.dedup();
        if fingers.len() > MAX_FINGERS {
            return wrong("fingers", "more than 16");
        }
        if fingers.len() != config.fingers.len() {
            return wrong("fingers", "names a channel twice");
        }
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_keeps_the_section_and_wrong_settings_are_named() {
        let config = ServeConfig {
            fingers: vec!["skin/a".into(), "skin/b".into()],
            mc_samples: 0,
            ..ServeConfig::default()
        };
        let text = toml::to_string(&config.table("justin")).unwrap();
        let table = Table::parse(&text).unwrap();
        assert_eq!(ServeConfig::of(&table).unwrap(), config);
        assert_eq!(table.channels.len(), 6);
        assert_eq!(
            ServeConfig::of(&Table::new("empty")).unwrap(),
            ServeConfig::default()
        );
        let error = |section: &str| {
            let text = format!("bus = \"a\"\n[channels]\n[components.tactnet]\n{section}");
            let table = Table::parse(&text).unwrap();
            ServeConfig::of(&table).unwrap_err().to_string()
        };
        assert!(error("finger = 1").contains("finger"));
        assert!(error("fingers = []").contains("names no channel"));
        assert!(error("fingers = [\"a\", \"a\"]").contains("twice"));
        assert!(error("anytime_ms = -1.0").contains("anytime_ms"));
        // The section's former name, in tables and recordings that are there.
        for name in ["segmenter", "follow"] {
            let section = format!("[components.tactnet.{name}]\nclock_tolerance = 0.0");
            assert!(error(&section).contains("`segmenter.clock_tolerance`"));
        }
    }
}
