//! Parts of the stack that an ablation experiment disables.

use serde::{Deserialize, Serialize};

/// A disabled part of the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ablation {
    /// Inertial unit: the head pose follows from the joints alone.
    Imu,
    /// Drag: the tracker assumes parabolic flights.
    Drag,
    /// Replanning: the robot executes the first plan.
    Replan,
    /// Multiple starts: the planner uses only the best candidate.
    Multistart,
    /// Lower body: platform and torso do not move.
    LowerBody,
    /// Near misses: without an exact catch, the arm continues its current path.
    NearMiss,
}
