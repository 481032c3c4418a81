//! Settings of the coordinator.

use serde::{Deserialize, Serialize};

use crate::plan::Objective;

tactnet_catching_packets::settings! {
    /// Settings of the coordinator.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct CoordinatorConfig {
        /// Objective of the plans.
        pub objective: Objective = Objective::Soft,
        /// Minimum existence probability of a ball that triggers a motion.
        pub existence: f32 = 0.95,
        /// Minimum number of pictures, seen by both cameras, of a ball that triggers a motion.
        pub frames: u32 = 3,
        /// Time from a prediction to the start of the planned motion, including transfers and computing, in s.
        pub plan_delay: f64 = 0.015,
        /// If true, each prediction corrects the plan; otherwise the first plan is executed unchanged.
        pub replan: bool = true,
        /// If true, platform and torso move towards the ball.
        pub lower_body: bool = true,
        /// Minimum time between a correction and the catch, in s.
        pub last_correction: f64 = 0.03,
        /// Number of planners of each arm, at most 8. They share the search of a first plan, and correct it in turns.
        pub planners: u32 = 1,
    }
}

/// Maximum number of planners of an arm.
pub const MAX_PLANNERS: u32 = 8;

impl CoordinatorConfig {
    /// Returns the number of planners of each arm, from 1 to [`MAX_PLANNERS`].
    pub fn planners(&self) -> u32 {
        self.planners.clamp(1, MAX_PLANNERS)
    }
}

/// Margin of a path's way to the controller, in s: a cycle of the coordinator and one of the controller.
const PATH_MARGIN: f64 = 0.002;

/// Pose in which the robot waits for the next ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NextPose {
    /// The waiting pose. The robot retraces its path.
    #[default]
    Waiting,
    /// The pose of the last catch (thesis, figure 3.10).
    LastCatch,
}

/// Settings of the phases of the coordinator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseConfig {
    /// Delay of the drives, from a cycle of the controller to the time that its command applies to, in s.
    pub drives: f64,
    /// Time after a catch at which the robot prepares for the next ball, in s.
    pub after_catch: f64,
    /// Pose for the next ball.
    pub next: NextPose,
    /// True if the head looks at the hand after a catch, for the slip watch.
    pub looks_at_hand: bool,
}

impl PhaseConfig {
    /// Returns the time before its start at which a path is sent, in ns. Within it the path reaches the controller,
    /// whose commands run ahead by the delay of the drives.
    pub fn path_lead_ns(&self) -> u64 {
        ((self.drives + PATH_MARGIN) * 1e9).round() as u64
    }
}
