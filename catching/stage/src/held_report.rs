//! State of the calibration during a run.

use serde::Serialize;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{CalibrationHold, CalibrationState};

/// Result of the calibration check.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldReport {
    /// Identifier of the calibration.
    pub identity: String,
    /// False if the calibration no longer holds, `null` if the markers were seen too rarely.
    pub holds: Option<bool>,
    /// Number of finished throws at the detection.
    pub noticed_after_throws: Option<u64>,
    /// Number of checked features of the left and of the right arm's marker.
    pub innovations: [u64; ARMS],
    /// Mean normalised squared innovation at the end, or at the detection: 2 if the calibration holds, `null` without
    /// features.
    pub mean_square: [Option<f64>; ARMS],
}

#[derive(Debug, Default)]
pub(crate) struct HeardHold {
    last: Option<CalibrationState>,
    /// First state that reports an invalid calibration, and the number of throws until then. A restarted watch no
    /// longer knows it.
    lost: Option<(CalibrationState, u64)>,
    /// Numbers of features that earlier watches checked.
    before: [u64; ARMS],
}

impl HeardHold {
    /// Records a state. Returns true if it is the first one that reports an invalid calibration.
    pub fn take(&mut self, state: &CalibrationState, throws: u64) -> bool {
        if let Some(last) = &self.last {
            for arm in 0..ARMS {
                if state.innovations[arm] < last.innovations[arm] {
                    self.before[arm] += last.innovations[arm];
                }
            }
        }
        self.last = Some(*state);
        let is_new = state.hold() == Some(CalibrationHold::Lost) && self.lost.is_none();
        if is_new {
            self.lost = Some((*state, throws));
        }
        is_new
    }

    /// Returns the result, or `None` without a watch.
    pub fn report(&self) -> Option<HeldReport> {
        let last = self.last.as_ref()?;
        let (judged, throws) = self
            .lost
            .as_ref()
            .map_or((last, None), |(lost, throws)| (lost, Some(*throws)));
        Some(HeldReport {
            identity: last.identity.as_str().into(),
            holds: match judged.hold() {
                Some(CalibrationHold::Holds) => Some(true),
                Some(CalibrationHold::Lost) => Some(false),
                Some(CalibrationHold::NotTold) | None => None,
            },
            noticed_after_throws: throws,
            innovations: std::array::from_fn(|arm| self.before[arm] + last.innovations[arm]),
            mean_square: judged.mean_square.map(|mean| (mean > 0.0).then_some(mean)),
        })
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::Text;

    use super::*;

    fn state(hold: CalibrationHold, innovations: [u64; 2], right: f64) -> CalibrationState {
        CalibrationState {
            hold: hold as u64,
            innovations,
            mean_square: [0.0, right],
            identity: Text::new("00000000000000ff"),
            ..CalibrationState::zeroed()
        }
    }

    #[test]
    fn what_was_noticed_stays_noticed_when_the_watch_begins_again() {
        let mut heard = HeardHold::default();
        assert_eq!(heard.report(), None);
        assert!(!heard.take(&state(CalibrationHold::NotTold, [0, 20], 2.1), 1));
        assert_eq!(heard.report().unwrap().holds, None);
        assert!(!heard.take(&state(CalibrationHold::Holds, [0, 50], 1.9), 3));
        assert_eq!(heard.report().unwrap().holds, Some(true));
        assert!(heard.take(&state(CalibrationHold::Lost, [0, 70], 11.0), 5));
        assert!(!heard.take(&state(CalibrationHold::Lost, [0, 80], 20.0), 6));
        // State of another watch.
        assert!(!heard.take(&state(CalibrationHold::NotTold, [0, 3], 25.0), 7));
        let expected = HeldReport {
            identity: "00000000000000ff".into(),
            holds: Some(false),
            noticed_after_throws: Some(5),
            innovations: [0, 83],
            mean_square: [None, Some(11.0)],
        };
        assert_eq!(heard.report(), Some(expected));
    }
}
