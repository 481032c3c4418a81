//! Settings of throws in stepped time.

use tactnet_catching::calibrate::{Calibration, Corrections};
use tactnet_catching::coordinate::{CoordinatorConfig, NextPose};
use tactnet_catching::plan::{Objective, PlanConfig, Planner};
use tactnet_catching::{CatchSpace, ChainDelays, Robot};
use tactnet_catching_packets::ARMS;
use tactnet_catching_world::WorldConfig;

use crate::ablation::Ablation;

/// Use of a map by the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mapping {
    /// The robot does not look around, and plans without obstacles.
    #[default]
    Off,
    /// The robot makes the motions of looking around, but takes no pictures, and plans without obstacles. The
    /// baseline for the map.
    Blind,
    /// The robot builds a map from depth pictures and plans with it.
    Depth,
}

/// Settings of all throws of a series.
#[derive(Debug, Clone)]
pub struct ThrowConfig {
    /// Robot as described.
    pub robot: Robot,
    /// Calibration that the stack uses.
    pub calibration: Option<Calibration>,
    /// Settings of the world.
    pub world: WorldConfig,
    /// Delays.
    pub timing: ChainDelays,
    /// Disabled parts.
    pub without: Vec<Ablation>,
    /// Number of simultaneous balls.
    pub balls: usize,
    /// Takes the poses of head and balls from the true state instead of the sensors.
    pub perfect_perception: bool,
    /// Detects circles in rendered pictures; otherwise circles come straight from the true state, with noise, misses
    /// and clutter.
    pub pixels: bool,
    /// Makes the self-collision monitor only report, until the robot is back in its waiting pose.
    pub watch: bool,
    /// Objective of the planners.
    pub objective: Objective,
    /// Number of planners of each arm.
    pub planners: u32,
    /// Pose in which the robot waits for the next ball.
    pub next: NextPose,
    /// Time at rest after which the torso counts as still, in s; 0 for a simulation that begins at rest.
    pub still: f64,
    /// Use of a map of the obstacles.
    pub mapping: Mapping,
    /// Additional delay of the closing of the hands in s, to test the judge.
    pub closing_error: f64,
}

impl ThrowConfig {
    /// Returns the settings of throws of one ball to the whole stack, without calibration and map.
    pub fn new(robot: Robot, world: WorldConfig) -> Self {
        Self {
            robot,
            calibration: None,
            world,
            timing: ChainDelays::ours(),
            without: Vec::new(),
            balls: 1,
            perfect_perception: false,
            pixels: false,
            watch: false,
            objective: Objective::default(),
            planners: 1,
            next: NextPose::Waiting,
            still: 0.0,
            mapping: Mapping::Off,
            closing_error: 0.0,
        }
    }

    /// Returns true if the part is disabled.
    pub fn is_without(&self, ablation: Ablation) -> bool {
        self.without.contains(&ablation)
    }

    /// Returns true if platform and torso move. With two balls only the arms move, as in the thesis.
    pub fn moves_lower_body(&self) -> bool {
        self.balls == 1 && !self.is_without(Ablation::LowerBody)
    }

    /// Returns the catch space of the robot with knowledge of the true flight.
    pub(crate) fn oracle(&self) -> CatchSpace {
        CatchSpace::new(&self.robot, self.moves_lower_body())
    }

    /// Returns the corrections of measurements and commands by the calibration.
    pub(crate) fn corrections(&self) -> Corrections {
        Corrections::new(&self.robot, self.calibration.as_ref())
    }

    pub(crate) fn planners(&self, robot: &Robot) -> [Planner; ARMS] {
        let all = PlanConfig::default();
        let config = PlanConfig {
            starts: [all.starts, 1][usize::from(self.is_without(Ablation::Multistart))],
            ..all
        };
        std::array::from_fn(|arm| Planner::new(robot, arm, config))
    }

    /// Returns the settings of the coordinator.
    pub fn coordination(&self) -> CoordinatorConfig {
        CoordinatorConfig {
            plan_delay: self.timing.to_path(),
            replan: !self.is_without(Ablation::Replan),
            lower_body: self.moves_lower_body(),
            objective: self.objective,
            planners: self.planners,
            ..CoordinatorConfig::default()
        }
    }
}
