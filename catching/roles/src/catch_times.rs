//! How old the last measurements are when balls are caught.

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{ArmPath, CatchOutcome};

/// A path that begins so long before its catch is the one that it was caught by, ns.
const LATEST_NS: u64 = 2_000_000_000;

/// Times of paths and catches, gathered from packets as they come.
#[derive(Debug, Clone, Default)]
pub struct CatchTimes {
    /// From the middle of an exposure to the first path that follows from it, ms.
    pub exposure_to_path_ms: Vec<f64>,
    /// From the exposure that a caught ball's path follows from to the catch, ms.
    pub picture_age_ms: Vec<f64>,
    /// From the head's pose that it follows from to the catch, ms.
    pub head_age_ms: Vec<f64>,
    /// The last paths of both arms.
    paths: [Option<ArmPath>; ARMS],
}

impl CatchTimes {
    /// Takes a path.
    ///
    /// - `put_ns`: when it was put
    pub fn path(&mut self, put_ns: u64, path: &ArmPath) {
        let Some(place) = self.paths.get_mut(path.arm as usize) else {
            return;
        };
        // A last correction follows from a newer pose of the head, not from a picture.
        if place.is_none_or(|before| before.exposure_ns != path.exposure_ns) {
            self.exposure_to_path_ms
                .push(milliseconds(put_ns.saturating_sub(path.exposure_ns)));
        }
        *place = Some(*path);
    }

    /// Takes what became of a throw.
    pub fn outcome(&mut self, outcome: &CatchOutcome) {
        let path = self.paths.get(outcome.arm as usize).copied().flatten();
        let Some(path) = path.filter(|path| {
            outcome.crossing_ns > path.start_ns && outcome.crossing_ns - path.start_ns < LATEST_NS
        }) else {
            return;
        };
        if outcome.caught == 1 {
            let since = |ns: u64| milliseconds(outcome.crossing_ns.saturating_sub(ns));
            self.picture_age_ms.push(since(path.exposure_ns));
            self.head_age_ms.push(since(path.head_ns));
        }
    }
}

fn milliseconds(ns: u64) -> f64 {
    ns as f64 * 1e-6
}
