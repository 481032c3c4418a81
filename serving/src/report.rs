//! Counters at the end of a service, as `tactnet serve --json` prints them and other commands read them.

use std::fmt;

use serde::{Deserialize, Serialize};
use tactnet_skin::packets::Counters;

/// Counters of a service that has ended. Every field must be there when it is read, and no other.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ServeReport {
    /// 1.
    pub schema_version: u32,
    /// Frames that came.
    pub frames: u64,
    /// Frames that were put and never came.
    pub dropped_frames: u64,
    /// Beliefs that were put.
    pub beliefs: u64,
    /// Whole sweeps that were classified.
    pub sweeps: u64,
    /// Sweeps that were rejected.
    pub rejected: u64,
    /// Whole sweeps of unknown materials.
    pub unknown: u64,
    /// Predictions that took longer than promised.
    pub deadline_misses: u64,
    /// Longest time from a frame's put until the service had dealt with it, microseconds.
    pub worst_delay_us: f64,
    /// Allocations of the thread that processes frames.
    pub allocations: u64,
    /// First and last frame that came, by finger.
    pub sequences: Vec<Option<(u64, u64)>>,
}

impl ServeReport {
    /// - `sequences`: first and last frame that came, by finger
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

    /// Returns how many frames of a finger were put between the first and the last that came, both included.
    pub fn frames_sent(&self, finger: usize) -> u64 {
        match self.sequences.get(finger) {
            Some(Some((first, last))) => last - first + 1,
            _ => 0,
        }
    }
}

impl fmt::Display for ServeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {} lost; {} classified, {} rejected; {} missed (late, not wrong)",
            counted(self.frames, "frame"),
            self.dropped_frames,
            counted(self.sweeps, "sweep"),
            self.rejected,
            counted(self.deadline_misses, "deadline"),
        )
    }
}

/// Returns `1 sweep`, or `2 sweeps`.
fn counted(number: u64, what: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{number} {what}{plural}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again_and_a_missing_or_foreign_counter_is_an_error() {
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
