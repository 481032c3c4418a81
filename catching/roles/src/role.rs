//! Processes of the stack by name.

use std::str::FromStr;

use tactnet_catching::coordinate::MAX_PLANNERS;
use tactnet_channel::Bus;

use crate::{
    RoleError, RoleReport, RoleSettings, Times, controller, coordinator, eyes, feel, hand, planner,
    pose, safety, slip_watch, thrower, tracker,
};

/// A process of the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Detects circles in pictures.
    Eyes,
    /// Estimates head poses from inertial samples.
    Pose,
    /// Predicts balls from circles.
    Tracker,
    /// Chooses paths for predicted balls.
    Coordinator,
    /// Plans motions of an arm.
    Planner {
        /// Arm: 0 left, 1 right.
        arm: usize,
        /// Number among the planners of the arm, from 0.
        number: u32,
    },
    /// Turns paths into joint commands at 1 kHz.
    Controller,
    /// Checks joint commands for self-collisions at 1 kHz.
    Safety,
    /// Forwards closing times to the hands.
    Hand,
    /// Determines the material of a caught ball.
    Feel,
    /// Throws a caught ball back: plans the motion and the release of the hand.
    Thrower,
    /// Checks the calibration with the markers on the wrists.
    SlipWatch,
}

impl Role {
    /// All roles, in a valid start order, with one planner for each arm.
    pub const ALL: [Self; 12] = [
        Self::Safety,
        Self::Hand,
        Self::Planner { arm: 0, number: 0 },
        Self::Planner { arm: 1, number: 0 },
        Self::Pose,
        Self::Tracker,
        Self::Eyes,
        Self::Controller,
        Self::Coordinator,
        Self::Feel,
        Self::Thrower,
        Self::SlipWatch,
    ];

    /// Returns the name of the role, such as `tracker`, `planner-left` or, for the second one, `planner-left-2`.
    pub fn name(self) -> String {
        let name = match self {
            Self::Planner { arm, number } => {
                let side = if arm == 0 { "left" } else { "right" };
                return match number {
                    0 => format!("planner-{side}"),
                    _ => format!("planner-{side}-{}", number + 1),
                };
            }
            Self::Eyes => "eyes",
            Self::Pose => "pose",
            Self::Tracker => "tracker",
            Self::Coordinator => "coordinator",
            Self::Controller => "controller",
            Self::Safety => "safety",
            Self::Hand => "hand",
            Self::Feel => "feel",
            Self::Thrower => "thrower",
            Self::SlipWatch => "slip-watch",
        };
        name.into()
    }

    /// Returns true for the loops at 1 kHz.
    pub fn is_fast(self) -> bool {
        matches!(self, Self::Controller | Self::Safety)
    }

    /// Opens the ports, calls `ready`, works until `stopped` returns true, and returns statistics.
    ///
    /// # Errors
    /// Missing or broken channels, and invalid settings.
    pub fn run(
        self,
        bus: &Bus,
        ready: &dyn Fn(),
        stopped: &(dyn Fn() -> bool + Sync),
    ) -> Result<RoleReport, RoleError> {
        let shell = &Shell {
            bus,
            settings: RoleSettings::of(bus.table())?,
            ready,
            stopped,
        };
        match self {
            Self::Eyes => eyes::run(shell),
            Self::Pose => pose::run(shell),
            Self::Tracker => tracker::run(shell),
            Self::Coordinator => coordinator::run(shell),
            Self::Planner { arm, number } => planner::run(shell, arm, number),
            Self::Controller => controller::run(shell),
            Self::Safety => safety::run(shell),
            Self::Hand => hand::run(shell),
            Self::Feel => feel::run(shell),
            Self::Thrower => thrower::run(shell),
            Self::SlipWatch => slip_watch::run(shell),
        }
    }
}

/// Surroundings of a running process.
pub(crate) struct Shell<'a> {
    pub bus: &'a Bus,
    pub settings: RoleSettings,
    /// Called once, when all channels are open.
    pub ready: &'a dyn Fn(),
    /// Returns true once the process has to end.
    pub stopped: &'a (dyn Fn() -> bool + Sync),
}

impl Shell<'_> {
    /// Reports that all channels are open, and repeats `work` until the process has to end. Returns its times.
    ///
    /// - `rate_hz`: number of times per second for which memory is reserved
    pub fn repeat(
        &self,
        rate_hz: usize,
        mut work: impl FnMut(&mut Times) -> Result<(), RoleError>,
    ) -> Result<Times, RoleError> {
        let mut times = Times::at(rate_hz);
        (self.ready)();
        while !(self.stopped)() {
            work(&mut times)?;
        }
        Ok(times)
    }
}

impl FromStr for Role {
    type Err = RoleError;

    fn from_str(name: &str) -> Result<Self, RoleError> {
        let planners =
            (1..MAX_PLANNERS).flat_map(|number| [0, 1].map(|arm| Self::Planner { arm, number }));
        let mut roles = Self::ALL.into_iter().chain(planners);
        let found = roles.find(|role| role.name() == name);
        found.ok_or_else(|| RoleError::NoRole {
            name: name.into(),
            known: Self::ALL.map(Self::name).join(", "),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_are_found_by_their_names() {
        for role in Role::ALL {
            assert_eq!(role.name().parse::<Role>().unwrap(), role);
        }
        let third = Role::Planner { arm: 1, number: 2 };
        assert_eq!(third.name(), "planner-right-3");
        assert_eq!("planner-right-3".parse::<Role>().unwrap(), third);
        let error = "world".parse::<Role>().unwrap_err();
        assert!(error.is_usage());
        assert!(error.to_string().contains("planner-left"), "{error}");
    }
}
