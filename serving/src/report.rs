//! Counters of a service that has ended, as a JSON document.

use serde::{Deserialize, Serialize};
use tactnet_skin::packets::Counters;

/// Counters of a service that has ended. Unknown and missing fields are errors.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ServeReport {
    /// Version of the document: 1.
    pub schema_version: u32,
    /// Number of received frames.
    pub frames: u64,
    /// Number of frames that were sent but not received.
    pub dropped_frames: u64,
    /// Number of beliefs sent.
    pub beliefs: u64,
    /// Number of complete sweeps classified.
    pub sweeps: u64,
    /// Number of rejected sweeps.
    pub rejected: u64,
    /// Number of complete sweeps of unknown materials.
    pub unknown: u64,
    /// Number of predictions that missed their deadline.
    pub deadline_misses: u64,
    /// Maximum time from the sending of a frame to the end of its processing, in µs.
    pub worst_delay_us: f64,
    /// Number of allocations of the thread that processes frames.
    pub allocations: u64,
    /// Sequence numbers of the first and last received frame, by finger.
    pub sequences: Vec<Option<(u64, u64)>>,
}

impl ServeReport {
    /// Creates the report.
    ///
    /// - `sequences`: sequence numbers of the first and last received frame, by finger
    pub fn new(counters: &Counters, sequences: Vec<Option<(u64, u64)>>) -> Self {
        Self {
            schema_version: 1,
            frames: counters.frames,
            dropped_frames: counters.dropped_frames,
            beliefs: counters.beliefs,
            sweeps: counters.sweeps,
            rejected: counters.rejected,
            unknown: counters.unknown,
            deadline_misses: counters.deadline_misses,
            worst_delay_us: counters.worst_delay_ns as f64 / 1e3,
            allocations: counters.allocations,
            sequences,
        }
    }

    /// Returns the number of frames that a finger sent between the first and the last received frame, both included.
    pub fn frames_sent(&self, finger: usize) -> u64 {
        match self.sequences.get(finger) {
            Some(Some((first, last))) => last - first + 1,
            _ => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_round_trip_and_missing_or_unknown_counters_are_errors() {
        let counters = Counters {
            frames: 9,
            dropped_frames: 2,
            worst_delay_ns: 1500,
            ..Counters::default()
        };
        let report = ServeReport::new(&counters, vec![Some((3, 13)), None]);
        let text = serde_json::to_string(&report).unwrap();
        assert_eq!(serde_json::from_str::<ServeReport>(&text).unwrap(), report);
        assert_eq!((report.frames_sent(0), report.frames_sent(1)), (11, 0));
        assert_eq!(report.frames_sent(2), 0);
        for name in [
            "frames",
            "dropped_frames",
            "beliefs",
            "sweeps",
            "rejected",
            "deadline_misses",
            "worst_delay_us",
            "allocations",
            "sequences",
        ] {
            let key = format!("\"{name}\"");
            let renamed = text.replace(&key, "\"other\"");
            assert_ne!(renamed, text);
            let error = serde_json::from_str::<ServeReport>(&renamed).unwrap_err();
            assert!(error.to_string().contains("other"), "{error}");
        }
        let without = text.replace("\"dropped_frames\":2,", "");
        let error = serde_json::from_str::<ServeReport>(&without).unwrap_err();
        assert!(error.to_string().contains("dropped_frames"), "{error}");
    }
}
