//! Parts of the stack that an experiment switches off.

use serde::{Deserialize, Serialize};

/// A part of the stack that is switched off to measure its effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ablation {
    /// The head's pose follows from the joints alone.
    Imu,
    /// The tracker takes the ball's flight for a parabola.
    Drag,
    /// The first plan is carried out.
    Replan,
    /// Plans begin with the best candidate alone.
    Multistart,
    /// Platform and torso stand still.
    LowerBody,
    /// Where no exact catch is left, the arm carries on as it was.
    NearMiss,
}

impl Ablation {
    /// Returns its name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Imu => "imu",
            Self::Drag => "drag",
            Self::Replan => "replan",
            Self::Multistart => "multistart",
            Self::LowerBody => "lower-body",
            Self::NearMiss => "near-miss",
        }
    }
}
