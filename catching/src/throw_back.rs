//! Throwing a caught ball back, as a step function: waits, plans the throw, and opens the hand.
//!
//! ```text
//! hand/state, catch/state, controller/state ─> ThrowTask ─ throw/path ─> controller
//! ball/prediction, arm/path ──────────────────┘        └── hand/release ─> hand
//! ```

mod duty;
mod origins;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, CatchStatus, ControllerState, HandOpening, HandState, Text,
    ThrowPath, ThrowPhase, ThrowStatus,
};

use crate::robot::Robot;
use crate::throw::{Aim, NoThrow, ThrowPlan, ThrowPlanConfig, ThrowRequest, Thrower};
use duty::{ThrowAction, ThrowDuty};
use origins::Origins;

/// Time between the request of a plan and the start of its motion, in ns. It includes planning.
const AHEAD_NS: u64 = 300_000_000;
/// Period at which an unchanged phase is published, in ns.
const TELL_NS: u64 = 100_000_000;

tactnet_catching_packets::settings! {
    /// Targets of thrown balls. Missing fields have the values of `Default`.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct ThrowBack {
        /// Landing point in the inertial frame, in m; if absent, the ball returns to its origin.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub at: Option<[f64; 3]> = None,
        /// Offsets of the landing point for the left and the right hand, in m.
        pub beside: [[f64; 3]; ARMS] = [[0.0; 3]; ARMS],
        /// Maximum throwing distance from the robot's axis, in m. Beyond about 4.6 m no throw is within the limits of
        /// the robot as described.
        pub farthest: f64 = 4.4,
        /// Height of the landing point, in m.
        pub height: f64 = 1.2,
        /// Throws a ball only after its material is determined.
        pub after_feeling: bool = false,
        /// Maximum number of attempts per ball if the robot has to brake; then it drops the ball.
        pub tries: u32 = 2,
        /// Settings of the planner of throws.
        pub planner: ThrowPlanConfig = ThrowPlanConfig::live(),
    }
}

impl ThrowBack {
    /// Returns the target for a ball that was first seen at `seen`, in m; straight ahead if `seen` is `None`.
    fn target(&self, seen: Option<[f64; 3]>) -> [f64; 3] {
        self.at.unwrap_or_else(|| {
            let [x, y, _] = seen.unwrap_or([self.farthest, 0.0, 0.0]);
            let shorter = (self.farthest / x.hypot(y)).min(1.0);
            [x * shorter, y * shorter, self.height]
        })
    }
}

/// Inputs of one step.
#[derive(Debug, Clone, Copy, Default)]
pub struct ThrowInputs<'a> {
    /// Latest state of the hands.
    pub hand: Option<&'a HandState>,
    /// Latest phase of the coordinator.
    pub status: Option<&'a CatchStatus>,
    /// Latest state of the controller.
    pub controller: Option<&'a ControllerState>,
    /// Grip of the ball that was explored last; `None` if throws do not wait for the exploration.
    pub felt: Option<u64>,
    /// Predictions since the last step.
    pub predictions: &'a [BallPredictions],
    /// Paths of the arms since the last step.
    pub paths: &'a [ArmPath],
}

/// Packets that one step sends.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ThrowOutputs {
    /// Throw for the controller.
    pub path: Option<ThrowPath>,
    /// Opening command of a hand. It is repeated until the hand opens.
    pub release: Option<HandOpening>,
    /// Phase, when it changes and ten times per second.
    pub status: Option<ThrowStatus>,
}

/// Throws one held ball after the other.
#[derive(Debug, Clone)]
pub struct ThrowTask {
    /// Settings.
    pub settings: ThrowBack,
    /// Goal of all throws instead of the place of [`ThrowBack`].
    pub aim: Option<Aim>,
    thrower: Thrower,
    origins: Origins,
    duty: ThrowDuty,
    last: Option<Result<ThrowPlan, NoThrow>>,
    /// Phase, number of failures and time of the last status.
    told: Option<(ThrowPhase, u64, u64)>,
}

impl ThrowTask {
    /// Creates a task without a ball.
    ///
    /// - `existence`: probability from which a ball counts, from 0 to 1
    pub fn new(robot: &Robot, settings: ThrowBack, existence: f32) -> Self {
        Self {
            thrower: Thrower::new(robot, settings.planner),
            origins: Origins::new(existence),
            duty: ThrowDuty::new(settings.tries),
            settings,
            aim: None,
            last: None,
            told: None,
        }
    }

    /// Returns the last plan, or the reason of its absence.
    pub fn last(&self) -> Option<&Result<ThrowPlan, NoThrow>> {
        self.last.as_ref()
    }

    /// Returns the number of failed throws and the reason of the last one.
    pub fn failed(&self) -> (u64, &str) {
        (self.duty.failed, &self.duty.reason)
    }

    /// Takes the packets since the last step and returns those to send. Must be called at least every 4 ms. Planning
    /// takes tens of milliseconds; the planned motion starts later.
    pub fn step(&mut self, now_ns: u64, inputs: &ThrowInputs<'_>) -> ThrowOutputs {
        let origins = &mut self.origins;
        inputs
            .predictions
            .iter()
            .for_each(|seen| origins.seen(seen));
        inputs.paths.iter().for_each(|path| origins.reached(path));
        let mut outputs = ThrowOutputs::default();
        match self.duty.next_action(now_ns, inputs) {
            ThrowAction::Nothing => {}
            ThrowAction::Open(opening) => outputs.release = Some(opening),
            ThrowAction::Plan { arm, grip } => outputs.path = self.plan(now_ns, arm, grip),
        }
        let (grip, phase) = self.duty.phase();
        let same = self.told.is_some_and(|(told, failed, told_ns)| {
            told == phase && failed == self.duty.failed && now_ns <= told_ns + TELL_NS
        });
        if !same {
            self.told = Some((phase, self.duty.failed, now_ns));
            outputs.status = Some(ThrowStatus {
                t_ns: now_ns,
                phase: phase as u64,
                grip,
                failed: self.duty.failed,
                reason: Text::new(&self.duty.reason),
            });
        }
        outputs
    }

    fn plan(&mut self, now_ns: u64, arm: usize, grip: u64) -> Option<ThrowPath> {
        let target = self.settings.target(self.origins.of(arm));
        let there = Aim::At {
            target: target.into(),
        };
        let request = ThrowRequest::new(arm, self.aim.unwrap_or(there));
        let beside = Vector3::from(self.settings.beside[arm]);
        let plan = self.thrower.plan_beside(&request, &beside);
        self.last = Some(plan);
        match plan {
            Ok(plan) => {
                let target = match request.aim {
                    Aim::At { target } => target,
                    Aim::Farthest { .. } => plan.landing.p,
                };
                let path = plan.path(now_ns + AHEAD_NS, grip, target.into());
                self.duty.sent(now_ns, &path);
                Some(path)
            }
            Err(no_throw) => {
                self.duty.no_plan(why(no_throw));
                None
            }
        }
    }
}

/// Returns a short description of the reason.
fn why(no_throw: NoThrow) -> &'static str {
    match no_throw {
        NoThrow::NoBall => "no hand holds a ball",
        NoThrow::NotFinite => "a target that is no place",
        NoThrow::Setting(_) => "a setting out of range",
        NoThrow::OutOfReach { .. } => "out of reach",
        NoThrow::Obstructed { .. } => "the robot would touch itself",
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::{CatchPhase, ControllerMode};

    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn balls_go_back_to_where_they_came_from_as_far_as_they_can() {
        let throw = ThrowBack::default();
        assert_eq!(throw.target(Some([3.0, -0.4, 1.7])), [3.0, -0.4, 1.2]);
        let [x, y, z] = throw.target(Some([6.0, 0.6, 1.7]));
        assert!((x.hypot(y) - 4.4).abs() < 1e-12 && (y / x - 0.1).abs() < 1e-12 && z == 1.2);
        assert_eq!(throw.target(None), [4.4, 0.0, 1.2]);
        let at = Some([4.0, 0.1, 1.0]);
        let given = ThrowBack { at, ..throw };
        assert_eq!(Some(given.target(Some([3.0, -0.4, 1.7]))), at);
    }

    #[test]
    fn what_is_planned_is_sent_and_what_is_not_is_named() {
        let robot = Robot::nominal();
        let throw = |at: [f64; 3]| {
            let settings = ThrowBack {
                at: Some(at),
                ..ThrowBack::default()
            };
            let mut task = ThrowTask::new(&robot, settings, 0.95);
            let mut hand = HandState::zeroed();
            (hand.t_ns, hand.holds, hand.grip) = (1000 * MS, 1, 9);
            let mut status = CatchStatus::zeroed();
            (status.t_ns, status.phase) = (1000 * MS, CatchPhase::Armed as u64);
            let mut controller = ControllerState::zeroed();
            (controller.t_ns, controller.mode) = (1000 * MS, ControllerMode::Ready as u64);
            let inputs = ThrowInputs {
                hand: Some(&hand),
                status: Some(&status),
                controller: Some(&controller),
                ..ThrowInputs::default()
            };
            let first = task.step(1000 * MS, &inputs);
            (first, task.step(1001 * MS, &inputs).status)
        };
        let (sent, again) = throw([4.0, 0.0, 1.2]);
        let path = sent.path.unwrap();
        assert_eq!((path.arm, path.grip, path.target), (0, 9, [4.0, 0.0, 1.2]));
        assert!(path.open_ns > path.swing_ns && path.start_ns == 1000 * MS + AHEAD_NS);
        assert_eq!(sent.status.unwrap().phase(), Some(ThrowPhase::Throwing));
        assert_eq!(again, None, "unchanged");
        for (at, why) in [
            ([9.0, 0.0, 1.2], "out of reach"),
            ([f64::NAN, 0.0, 1.2], "a target that is no place"),
        ] {
            let (sent, next) = throw(at);
            assert_eq!((sent.path, sent.status.unwrap().failed), (None, 1));
            assert_eq!(sent.status.unwrap().reason.as_str(), why);
            assert_eq!(next.unwrap().phase(), Some(ThrowPhase::Dropping));
        }
    }
}
