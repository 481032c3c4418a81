//! Delays of the processing chain in stepped time (thesis, figure 3.2).

use serde::{Deserialize, Serialize};

/// Number of pictures of a ball before the first path.
const FIRST_PICTURES: f64 = 3.0;

/// Delays from a picture to a path, in s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChainDelays {
    /// Delay from the exposure to the memory of the vision computer, in s.
    pub camera: f64,
    /// Delay from there to the prediction, in s.
    pub tracking: f64,
    /// Total transfer time to the planner and back, in s.
    pub transfers: f64,
    /// Planning time, in s.
    pub planning: f64,
    /// Delay from a joint command to its effect, in s. The controller compensates it.
    pub drives: f64,
}

impl ChainDelays {
    /// Returns the delays of the thesis: 152 ms from exposure to path.
    pub fn thesis() -> Self {
        Self {
            camera: 0.040,
            tracking: 0.035,
            transfers: 0.017,
            planning: 0.060,
            drives: 0.003,
        }
    }

    /// Returns the target delays of this project: 70 ms with the same camera.
    pub fn ours() -> Self {
        Self {
            camera: 0.040,
            tracking: 0.015,
            transfers: 0.005,
            planning: 0.010,
            drives: 0.003,
        }
    }

    /// Returns the time from exposure to prediction, in s.
    pub fn to_prediction(&self) -> f64 {
        self.camera + self.tracking
    }

    /// Returns the time from a ball's release to the start of the first path, in s: three pictures, then the delay from
    /// exposure to path.
    ///
    /// - `rate`: frame rate, in Hz
    pub fn reaction(&self, rate: f64) -> f64 {
        FIRST_PICTURES / rate + self.to_prediction() + self.to_path()
    }

    /// Returns the time from a prediction to the path that follows from it, in s.
    pub fn to_path(&self) -> f64 {
        self.transfers + self.planning
    }
}
