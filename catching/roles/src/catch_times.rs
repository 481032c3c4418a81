//! Age of the measurements that a catch was based on.

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{ArmPath, CatchOutcome};

/// Maximum time between the start of a path and its catch for the catch to count for that path, in ns.
const LATEST_NS: u64 = 2_000_000_000;

/// Latencies of paths and catches, computed from packets in the order in which they arrive.
#[derive(Debug, Clone, Default)]
pub struct CatchTimes {
    /// Time from the middle of an exposure to the first path that follows from it, in ms.
    pub exposure_to_path_ms: Vec<f64>,
    /// Time from the exposure behind the path of a caught ball to the catch, in ms.
    pub picture_age_ms: Vec<f64>,
    /// Time from the head pose behind the path of a caught ball to the catch, in ms.
    pub head_age_ms: Vec<f64>,
    /// Latest path of each arm.
    paths: [Option<ArmPath>; ARMS],
}

impl CatchTimes {
    /// Records a path.
    ///
    /// - `put_ns`: time at which the path was published, in ns
    pub fn path(&mut self, put_ns: u64, path: &ArmPath) {
        let Some(place) = self.paths.get_mut(path.arm as usize) else {
            return;
        };
        // A last correction uses a newer head pose, but the same picture, so it does not count again.
        if place.is_none_or(|before| before.exposure_ns != path.exposure_ns) {
            self.exposure_to_path_ms
                .push(milliseconds(put_ns.saturating_sub(path.exposure_ns)));
        }
        *place = Some(*path);
    }

    /// Records the outcome of a throw.
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
