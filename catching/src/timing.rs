//! How long the parts of the stack take, in stepped time (thesis, figure 3.2).

use serde::{Deserialize, Serialize};

/// Pictures of a ball before there is a path.
const FIRST_PICTURES: f64 = 3.0;

/// Times of the way from a picture to a path, s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// From the exposure to the memory of the computer that sees.
    pub camera: f64,
    /// From there to the prediction.
    pub tracking: f64,
    /// To the planner and back.
    pub transfers: f64,
    /// Planning.
    pub planning: f64,
    /// From a joint command to its effect; known, so commands are given for that much later.
    pub drives: f64,
}

impl Timing {
    /// Returns the times of the thesis: 152 ms from exposure to path.
    pub fn thesis() -> Self {
        Self {
            camera: 0.040,
            tracking: 0.035,
            transfers: 0.017,
            planning: 0.060,
            drives: 0.003,
        }
    }

    /// Returns the times that are to be kept here: 70 ms with the same camera.
    pub fn ours() -> Self {
        Self {
            camera: 0.040,
            tracking: 0.015,
            transfers: 0.005,
            planning: 0.010,
            drives: 0.003,
        }
    }

    /// Returns the time from exposure to prediction, s.
    pub fn to_prediction(&self) -> f64 {
        self.camera + self.tracking
    }

    /// Returns the time from a ball's release to the begin of the first path, s: three pictures, then from exposure to path.
    ///
    /// - `rate`: pictures a second
    pub fn reaction(&self, rate: f64) -> f64 {
        FIRST_PICTURES / rate + self.to_prediction() + self.to_path()
    }

    /// Returns the time from a prediction to the path that follows from it, s.
    pub fn to_path(&self) -> f64 {
        self.transfers + self.planning
    }
}
