//! The section `[components.tactnet]` of the channel table: channel names, segmentation settings and deadlines of the
//! classifier.

use serde::{Deserialize, Serialize};
use tactnet_channel::Table;

use crate::packets::Stage;
use crate::{Segmentation, SegmenterConfig, SkinError};

/// Maximum number of fingers of a service.
pub const MAX_FINGERS: usize = 16;

/// Name of the section, `[components.tactnet]`.
pub(crate) const SECTION: &str = "tactnet";

/// Settings of the online classifier: channel names, rates and deadlines.
///
/// # Example
/// ```
/// use tactnet_channel::Table;
/// use tactnet_skin::ServeConfig;
///
/// let config = ServeConfig { mc_samples: 0, ..ServeConfig::default() };
/// let table: Table = config.table("robot");
/// assert_eq!(ServeConfig::of(&table), Ok(config));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServeConfig {
    /// Channels of skin frames; the index in this list is the finger's number.
    pub fingers: Vec<String>,
    /// Channel of commands.
    pub command: String,
    /// Channel of beliefs.
    pub belief: String,
    /// Channel of events and counters.
    pub status: String,
    /// Channel of the model's names.
    pub model: String,
    /// Time between beliefs during a sweep, in ms; 0 disables them.
    pub anytime_ms: f64,
    /// Number of Monte Carlo dropout masks; 0 gives plain predictions only.
    #[serde(alias = "runs")]
    pub mc_samples: usize,
    /// Dead taxels of every finger, counted from 0 row by row, which are masked from the start.
    pub dead: Vec<usize>,
    /// True if further taxels are masked that change in no sweep any more, but in the training sweeps.
    pub mask_dead: bool,
    /// Deadline from a sweep's last frame to its plain belief, in ms. `None`: one frame period of the network.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plain_deadline_ms: Option<f64>,
    /// Deadline from a sweep's last frame to its Monte Carlo belief, in ms. `None`: three frame periods of the network.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dropout_deadline_ms: Option<f64>,
    /// Settings of the segmentation.
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
            dead: Vec::new(),
            mask_dead: true,
            plain_deadline_ms: None,
            dropout_deadline_ms: None,
            segmenter: SegmenterConfig::default(),
        }
    }
}

impl ServeConfig {
    /// Reads the section of `table`, or returns the defaults if the table has none.
    ///
    /// # Errors
    /// Fails if a setting is unknown or out of range.
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
        config.check_fingers()?;
        config.check_times()?;
        config.check_segmenter()?;
        Ok(config)
    }

    fn check_fingers(&self) -> Result<(), SkinError> {
        let wrong = |reason| {
            Err(SkinError::Setting {
                setting: "fingers",
                reason,
            })
        };
        if self.fingers.is_empty() {
            return wrong("names no channel of skin frames");
        }
        let mut fingers = self.fingers.clone();
        fingers.sort();
        fingers.dedup();
        if fingers.len() > MAX_FINGERS {
            return wrong("more than 16");
        }
        if fingers.len() != self.fingers.len() {
            return wrong("names a channel twice");
        }
        Ok(())
    }

    fn check_times(&self) -> Result<(), SkinError> {
        let wrong = |setting, reason| Err(SkinError::Setting { setting, reason });
        if !(self.anytime_ms.is_finite() && self.anytime_ms >= 0.0) {
            return wrong("anytime_ms", "expected a time, or 0");
        }
        let segmenter = &self.segmenter;
        for (setting, value) in [
            ("plain_deadline_ms", self.plain_deadline_ms),
            ("dropout_deadline_ms", self.dropout_deadline_ms),
            ("segmenter.clock_tolerance", Some(segmenter.clock_tolerance)),
            ("segmenter.clock_drift", Some(segmenter.clock_drift)),
        ] {
            if value.is_some_and(|value| !(value.is_finite() && value > 0.0)) {
                return wrong(setting, "expected more than 0");
            }
        }
        for (setting, span) in [
            ("segmenter.stalled_frames", segmenter.stalled_frames),
            ("segmenter.saturated_frames", segmenter.saturated_frames),
        ] {
            if span.is_zero() {
                return wrong(setting, "expected more than 0");
            }
        }
        Ok(())
    }

    fn check_segmenter(&self) -> Result<(), SkinError> {
        let wrong = |setting, reason| Err(SkinError::Setting { setting, reason });
        if let Some([least, greatest]) = self.segmenter.values
            && !(least < greatest && least.is_finite() && greatest.is_finite())
        {
            return wrong(
                "segmenter.values",
                "expected `[least, greatest]`, least below greatest",
            );
        }
        if let Segmentation::Contact(contact) = self.segmenter.segmentation {
            let apart = contact.begins > contact.ends && contact.ends.is_finite();
            if !apart || contact.frames.is_zero() {
                return wrong(
                    "segmenter.segmentation",
                    "expected `begins` above `ends`, and at least one frame",
                );
            }
        }
        Ok(())
    }

    /// Returns the deadline from a sweep's last frame to its belief, in ms. The default is one frame period without
    /// dropout masks and three with them.
    ///
    /// - `rate_hz`: frames per second
    ///
    /// # Example
    /// ```
    /// use tactnet_skin::{ServeConfig, packets::Stage};
    ///
    /// assert_eq!(ServeConfig::default().deadline_ms(Stage::Plain, 250.0), 4.0);
    /// assert_eq!(ServeConfig::default().deadline_ms(Stage::Dropout, 250.0), 12.0);
    /// ```
    pub fn deadline_ms(&self, stage: Stage, rate_hz: f64) -> f64 {
        let frame_ms = 1e3 / rate_hz;
        match stage {
            Stage::Anytime | Stage::Plain => self.plain_deadline_ms.unwrap_or(frame_ms),
            Stage::Dropout => self.dropout_deadline_ms.unwrap_or(3.0 * frame_ms),
        }
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
        // Existing tables and recordings use the section's former name, `follow`.
        for name in ["segmenter", "follow"] {
            let section = format!("[components.tactnet.{name}]\nclock_tolerance = 0.0");
            assert!(error(&section).contains("`segmenter.clock_tolerance`"));
        }
        for values in ["[3.0, 3.0]", "[1.0, 0.0]", "-1.0", "[0.0, inf]"] {
            let section = format!("[components.tactnet.segmenter]\nvalues = {values}");
            assert!(error(&section).contains("`segmenter.values`"), "{values}");
        }
        let both = error("[components.tactnet.segmenter]\nvalues = \"wide\"");
        assert!(both.contains("[least, greatest]"), "{both}");
    }

    #[test]
    fn tables_of_earlier_versions_are_read() {
        let read = |section: &str| {
            let text = format!("bus = \"a\"\n[channels]\n[components.tactnet]\n{section}");
            ServeConfig::of(&Table::parse(&text).unwrap()).unwrap()
        };
        let old =
            read("plain_deadline_ms = 1.5\n[components.tactnet.segmenter]\nfull_scale = 1023.0");
        assert_eq!(old.segmenter.values, Some([0.0, 1023.0]));
        assert_eq!(old.deadline_ms(Stage::Plain, 250.0), 1.5);
        let new = read("[components.tactnet.segmenter]\nvalues = [-3, 9]");
        assert_eq!(new.segmenter.values, Some([-3.0, 9.0]));
        assert_eq!(read("").segmenter.values, None);
    }

    #[test]
    fn deadlines_follow_the_frame_rate_where_the_table_sets_none() {
        let config = ServeConfig::default();
        assert_eq!(config.deadline_ms(Stage::Plain, 250.0), 4.0);
        assert_eq!(config.deadline_ms(Stage::Dropout, 250.0), 12.0);
        assert_eq!(config.deadline_ms(Stage::Dropout, 750.0), 4.0);
    }
}
