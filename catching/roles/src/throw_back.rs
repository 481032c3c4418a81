//! Settings of throwing back.

use serde::{Deserialize, Serialize};
use tactnet_catching::throw::ThrowPlanConfig;
use tactnet_catching_packets::ARMS;

/// Where caught balls are thrown to; what is not given is as in `Default`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThrowBack {
    /// Where they are to come down, m, inertial frame; left out: where the ball came from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<[f64; 3]>,
    /// Throws of the left and of the right hand are aimed so far beside that, m.
    pub beside: [[f64; 3]; ARMS],
    /// A ball that came from farther away than this is thrown so far in its direction, m from the robot's axis: from about 4.6 m on no throw
    /// is within the limits of the robot as described.
    pub farthest: f64,
    /// It comes down at this height there, m.
    pub height: f64,
    /// A ball is thrown once it was felt.
    pub after_feeling: bool,
    /// A ball is thrown so often, where the robot has to brake; then it drops.
    pub tries: u32,
    /// The planner of throws.
    pub planner: ThrowPlanConfig,
}

impl Default for ThrowBack {
    fn default() -> Self {
        Self {
            at: None,
            beside: [[0.0; 3]; ARMS],
            farthest: 4.4,
            height: 1.2,
            after_feeling: false,
            tries: 2,
            planner: ThrowPlanConfig::live(),
        }
    }
}

impl ThrowBack {
    /// Returns where a ball is thrown to that was first seen at `seen`, m; without such a place, straight ahead.
    pub(crate) fn target(&self, seen: Option<[f64; 3]>) -> [f64; 3] {
        self.at.unwrap_or_else(|| {
            let [x, y, _] = seen.unwrap_or([self.farthest, 0.0, 0.0]);
            let shorter = (self.farthest / x.hypot(y)).min(1.0);
            [x * shorter, y * shorter, self.height]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balls_go_back_to_where_they_came_from_as_far_as_they_can() {
        let throw = ThrowBack::default();
        assert_eq!(throw.target(Some([3.0, -0.4, 1.7])), [3.0, -0.4, 1.2]);
        let [x, y, z] = throw.target(Some([6.0, 0.6, 1.7]));
        assert!((x.hypot(y) - 4.4).abs() < 1e-12 && (y / x - 0.1).abs() < 1e-12 && z == 1.2);
        assert_eq!(throw.target(None), [4.4, 0.0, 1.2]);
        let at = Some([4.0, 0.1, 1.0]);
        let given = ThrowBack { at, ..throw };
        assert_eq!(Some(given.target(Some([3.0, -0.4, 1.7]))), at);
    }
}
