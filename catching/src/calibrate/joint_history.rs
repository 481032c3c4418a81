//! Recent joint states, interpolated between samples.

use std::collections::VecDeque;

use tactnet_catching_packets::packets::JointState;

use super::session::NeckMotion;

/// Half of the interval over which velocity differences give accelerations, in ns.
pub(crate) const AROUND_NS: u64 = 4_000_000;
/// Number of stored joint states.
const KEPT: usize = 400;

/// Ring buffer of joint states at 1 kHz.
#[derive(Debug, Clone)]
pub(crate) struct JointHistory {
    states: VecDeque<JointState>,
}

impl JointHistory {
    pub fn new() -> Self {
        Self {
            states: VecDeque::with_capacity(KEPT),
        }
    }

    /// Adds a joint state. A time stamp that goes back means a restart and clears the history.
    pub fn push(&mut self, state: &JointState) {
        let is_earlier = |last: &JointState| state.sensor_ns < last.sensor_ns;
        if self.last().is_some_and(is_earlier) {
            self.states.clear();
        }
        if self.states.len() == KEPT {
            self.states.pop_front();
        }
        self.states.push_back(*state);
    }

    /// Returns the latest state.
    pub fn last(&self) -> Option<&JointState> {
        self.states.back()
    }

    /// Returns the last state at or before a time stamp, if it is still stored.
    pub fn at(&self, stamp_ns: u64) -> Option<&JointState> {
        let place = self
            .states
            .partition_point(|state| state.sensor_ns <= stamp_ns);
        self.states.get(place.checked_sub(1)?)
    }

    /// Returns the neck motion at a time stamp, if the states around it are stored.
    pub fn neck(&self, stamp_ns: u64) -> Option<NeckMotion> {
        let (before, now, after) = (
            self.at(stamp_ns.saturating_sub(AROUND_NS))?,
            self.at(stamp_ns)?,
            self.at(stamp_ns + AROUND_NS)?,
        );
        let apart = after.sensor_ns.saturating_sub(before.sensor_ns) as f64 * 1e-9;
        if apart <= 0.0 {
            return None;
        }
        let since = (stamp_ns - now.sensor_ns) as f64 * 1e-9;
        let [from, to] = [before, after].map(|state| NeckMotion::of(&state.dq));
        let motion = NeckMotion {
            q: NeckMotion::of(&now.q),
            dq: NeckMotion::of(&now.dq),
            ddq: [0, 1].map(|i| (to[i] - from[i]) / apart),
        };
        Some(motion.before(-since))
    }
}
