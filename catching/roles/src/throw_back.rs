//! Settings of throwing back.

use serde::{Deserialize, Serialize};
use tactnet_catching::throw::ThrowPlanConfig;
use tactnet_catching_packets::ARMS;

/// Targets of thrown balls. Missing fields have the values of `Default`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThrowBack {
    /// Landing point in the inertial frame, in m; if absent, the ball returns to its origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<[f64; 3]>,
    /// Offsets of the landing point for the left and the right hand, in m.
    pub beside: [[f64; 3]; ARMS],
    /// Maximum throwing distance from the robot's axis, in m. Beyond about 4.6 m no throw is within the limits of the
    /// robot as described.
    pub farthest: f64,
    /// Height of the landing point, in m.
    pub height: f64,
    /// Throws a ball only after its material is determined.
    pub after_feeling: bool,
    /// Maximum number of attempts per ball if the robot has to brake; then it drops the ball.
    pub tries: u32,
    /// Settings of the planner of throws.
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
    /// Returns the target for a ball that was first seen at `seen`, in m; straight ahead if `seen` is `None`.
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
