//! The processes of the stack by name.

use std::str::FromStr;

use serde::{Deserialize, Serialize};
use tactnet_channel::Bus;

use crate::{
    RoleError, RoleReport, RoleSettings, controller, coordinator, eyes, feel, hand, planner, pose,
    safety, slip_watch, thrower, tracker,
};

/// A process of the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Pictures in, circles out.
    Eyes,
    /// Inertial samples in, poses of the head out.
    Pose,
    /// Circles in, predictions out.
    Tracker,
    /// Predictions in, paths out.
    Coordinator,
    /// Plans for the left arm.
    PlannerLeft,
    /// Plans for the right arm.
    PlannerRight,
    /// Paths in, joint commands out, 1 kHz.
    Controller,
    /// Joint commands in, the monitor's word out, 1 kHz.
    Safety,
    /// Closing times in, the hands' targets out.
    Hand,
    /// A caught ball in, what it is made of out.
    Feel,
    /// A caught ball in, the motion of a throw and the hand's release out.
    Thrower,
    /// Markers at the wrists in, whether the calibration still holds out.
    SlipWatch,
}

impl Role {
    /// All of them, in an order in which they may start.
    pub const ALL: [Self; 12] = [
        Self::Safety,
        Self::Hand,
        Self::PlannerLeft,
        Self::PlannerRight,
        Self::Pose,
        Self::Tracker,
        Self::Eyes,
        Self::Controller,
        Self::Coordinator,
        Self::Feel,
        Self::Thrower,
        Self::SlipWatch,
    ];

    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Eyes => "eyes",
            Self::Pose => "pose",
            Self::Tracker => "tracker",
            Self::Coordinator => "coordinator",
            Self::PlannerLeft => "planner-left",
            Self::PlannerRight => "planner-right",
            Self::Controller => "controller",
            Self::Safety => "safety",
            Self::Hand => "hand",
            Self::Feel => "feel",
            Self::Thrower => "thrower",
            Self::SlipWatch => "slip-watch",
        }
    }

    /// Returns true for the loops of 1 kHz.
    pub fn is_fast(self) -> bool {
        matches!(self, Self::Controller | Self::Safety)
    }

    /// Opens its ports, calls `ready`, works until `stopped` returns true, and says what it has done.
    ///
    /// # Errors
    /// Channels that are missing or break down; settings that make no sense.
    pub fn run(
        self,
        bus: &Bus,
        ready: &dyn Fn(),
        stopped: &(dyn Fn() -> bool + Sync),
    ) -> Result<RoleReport, RoleError> {
        let settings = RoleSettings::of(bus.table())?;
        match self {
            Self::Eyes => eyes::run(bus, &settings, ready, stopped),
            Self::Pose => pose::run(bus, &settings, ready, stopped),
            Self::Tracker => tracker::run(bus, &settings, ready, stopped),
            Self::Coordinator => coordinator::run(bus, &settings, ready, stopped),
            Self::PlannerLeft => planner::run(bus, &settings, 0, ready, stopped),
            Self::PlannerRight => planner::run(bus, &settings, 1, ready, stopped),
            Self::Controller => controller::run(bus, &settings, ready, stopped),
            Self::Safety => safety::run(bus, &settings, ready, stopped),
            Self::Hand => hand::run(bus, ready, stopped),
            Self::Feel => feel::run(bus, &settings, ready, stopped),
            Self::Thrower => thrower::run(bus, &settings, ready, stopped),
            Self::SlipWatch => slip_watch::run(bus, &settings, ready, stopped),
        }
    }
}

impl FromStr for Role {
    type Err = RoleError;

    fn from_str(name: &str) -> Result<Self, RoleError> {
        let found = Self::ALL.into_iter().find(|role| role.name() == name);
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
        let error = "world".parse::<Role>().unwrap_err();
        assert!(
            error.is_usage() && error.to_string().contains("planner-left"),
            "{error}"
        );
    }
}
