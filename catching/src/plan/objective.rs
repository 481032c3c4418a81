//! Objectives of a plan (thesis, section 3.5.2).

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARM_JOINTS;
use tactnet_catching_packets::packets::PlanObjective;

use super::catch_motion::{CatchMotion, Point, UNKNOWNS};
use crate::ramp::LeastTime;

/// Objective of a plan, which is minimised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Objective {
    /// Smoothest motion: root mean square of the joints' accelerations, relative to their limits.
    #[default]
    Soft = PlanObjective::Soft as isize,
    /// Latest catch: `-t`.
    Latest = PlanObjective::Latest as isize,
    /// Early arrival: fourth-power mean of the joints' least times. The arm waits for the ball.
    Cool = PlanObjective::Cool as isize,
}

impl From<PlanObjective> for Objective {
    fn from(objective: PlanObjective) -> Self {
        match objective {
            PlanObjective::Soft => Self::Soft,
            PlanObjective::Latest => Self::Latest,
            PlanObjective::Cool => Self::Cool,
        }
    }
}

/// Relative acceleration below which [`Objective::Soft`] is smoothed. Its root has a kink at rest.
const STILL: f64 = 1e-3;

impl Objective {
    pub(crate) fn cost(self, motion: &CatchMotion, x: &Point) -> (f64, [f64; UNKNOWNS]) {
        let n = ARM_JOINTS as f64;
        let t = x[ARM_JOINTS];
        let mut gradient = [0.0; UNKNOWNS];
        match self {
            Self::Latest => {
                gradient[ARM_JOINTS] = -1.0;
                (-t, gradient)
            }
            Self::Soft => {
                let mut sum = STILL * STILL;
                for i in 0..ARM_JOINTS {
                    let joint = &motion.joints[i];
                    let shape = motion.acceleration(x, i);
                    let share = shape.a / joint.acceleration;
                    sum += share * share / n;
                    gradient[i] = share * shape.by_distance / joint.acceleration / n;
                    gradient[ARM_JOINTS] += share * shape.by_time / joint.acceleration / n;
                }
                let cost = sum.sqrt();
                (cost, gradient.map(|slope| slope / cost))
            }
            Self::Cool => {
                let mut sum = 0.0;
                for i in 0..ARM_JOINTS {
                    let least =
                        LeastTime::smooth(x[i] - motion.q0[i], motion.w0[i], &motion.joints[i]);
                    sum += least.t.powi(4) / n;
                    gradient[i] = least.t.powi(3) * least.by_distance / n;
                }
                let cost = sum.powf(0.25);
                (cost, gradient.map(|slope| slope / cost.powi(3)))
            }
        }
    }
}
