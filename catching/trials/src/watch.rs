//! Stops of the self-collision monitor during a throw, to the catch and back. The controller does not brake.

use serde::Serialize;
use tactnet_catching::safety::{MonitorConfig, SafetyWatch};
use tactnet_catching_packets::packets::{ControllerMode, JointCommand, SafetyState};

/// Phase of a throw's motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// Towards the balls.
    Out,
    /// Return to the waiting pose.
    Back,
}

/// A command at which the monitor would have braked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Braked {
    /// Phase of the motion.
    pub motion: Motion,
    /// Time after the throw, in s.
    pub since: f64,
    /// Bodies that the monitor considers too close.
    pub bodies: [&'static str; 2],
    /// True for a false stop: braking would have kept all distances above the margin.
    pub in_vain: bool,
    /// Minimum distance of all pairs of bodies until the end of the phase, checked every millisecond, in m.
    pub carried_on: f64,
}

impl Braked {
    /// Returns true if the brake was unnecessary: without it, all distances would have exceeded the margin.
    pub fn is_false(&self) -> bool {
        self.carried_on >= MonitorConfig::default().margin
    }
}

/// Records the first verdict that brakes, and how near the bodies come if the same motion carries on.
///
/// - `since`: time since the throw, in s
pub(crate) fn watch(
    braked: &mut Option<Braked>,
    safety: &SafetyWatch,
    command: &JointCommand,
    verdict: &SafetyState,
    mode: Option<ControllerMode>,
    since: f64,
) {
    let motion = match mode {
        Some(ControllerMode::GoingBack) => Motion::Back,
        _ => Motion::Out,
    };
    if verdict.go == 0 && braked.is_none() {
        let least = safety.least_while_braking(command);
        *braked = Some(Braked {
            motion,
            since,
            bodies: safety.bodies(verdict),
            in_vain: least >= MonitorConfig::default().margin,
            carried_on: f64::INFINITY,
        });
    }
    if let Some(braked) = braked.as_mut().filter(|one| one.motion == motion) {
        braked.carried_on = braked.carried_on.min(safety.least(command));
    }
}
