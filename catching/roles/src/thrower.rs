//! Thrower process: plans the throw of a held ball and commands the release of the hand.
//!
//! ```text
//! hand/state, catch/state ─> thrower ─ throw/path ─> controller, judge
//! ball/prediction, arm/path ───┘  └─── hand/release ─> hand ─ hand/open ─> hands
//! ```

use std::time::Duration;

use tactnet_catching::flight::DRAG;
use tactnet_catching::throw::{Aim, NoThrow, ThrowRequest, Thrower};
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, CatchStatus, ControllerState, FeltMaterial, HandOpening, HandState,
    Text, ThrowPath, ThrowStatus,
};
use tactnet_catching_packets::{ARMS, JOINTS};
use tactnet_channel::{Bus, GetPort, Priority, PutPort, Start, Wait, now_ns};

use crate::channels::{
    ARM_PATH, CATCH_FELT, CATCH_STATE, CONTROLLER_STATE, HAND_RELEASE, HAND_STATE, PREDICTION,
    THROW_PATH, THROW_STATE,
};
use crate::latest_value::{LatestValue, drain};
use crate::throw_back::ThrowBack;
use crate::throw_duty::{LatestPackets, ThrowAction, ThrowDuty};
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Maximum sleep, which is also the period of repeated commands to the hand.
const BEAT: Wait = Wait::Block {
    timeout: Duration::from_millis(4),
};
/// Time between planning a throw and its start, in ns.
const AHEAD_NS: u64 = 50_000_000;
/// Period at which an unchanged phase is published, in ns.
const TELL_NS: u64 = 100_000_000;
/// Number of balls whose first positions are kept.
const BALLS: usize = 8;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let corrections = settings.corrections()?;
    let throw = settings.throw;
    let thrower = Thrower::new(corrections.robot(), throw.planner);
    let mut ports = Ports::open(bus)?;
    let mut origins = Origins::new(settings.coordinator.existence);
    let mut duty = ThrowDuty::new(throw.tries);
    let mut times = Times::at(1);
    let mut told = (None, 0, 0);
    ready();
    while !stopped() {
        ports.look(&mut origins)?;
        let now = now_ns();
        match duty.next_action(now, &ports.latest(throw.after_feeling)) {
            ThrowAction::Nothing => {}
            ThrowAction::Open(opening) => {
                ports.releases.put_copy(&[opening])?;
            }
            ThrowAction::Plan { arm, grip } => {
                let target = throw.target(origins.of(arm));
                match plan(&thrower, corrections.waiting(), &throw, arm, grip, target) {
                    Ok(path) => {
                        ports.paths.put_copy(&[path])?;
                        duty.sent(now_ns(), &path);
                    }
                    Err(why) => duty.no_plan(why),
                }
                times.push(now_ns() - now);
            }
        }
        let (grip, phase) = duty.phase();
        if told.0 != Some(phase) || told.1 != duty.failed || now > told.2 + TELL_NS {
            told = (Some(phase), duty.failed, now);
            ports.states.put_copy(&[ThrowStatus {
                t_ns: now,
                phase: phase as u64,
                grip,
                failed: duty.failed,
                reason: Text::new(&duty.reason),
            }])?;
        }
    }
    Ok(RoleReport {
        lost: ports.predictions.lost() + ports.arms.lost(),
        ..times.report()
    })
}

/// Plans a throw that starts in the waiting pose.
fn plan(
    thrower: &Thrower,
    waiting: &[f64; JOINTS],
    settings: &ThrowBack,
    arm: usize,
    grip: u64,
    target: [f64; 3],
) -> Result<ThrowPath, &'static str> {
    let request = ThrowRequest {
        q: *waiting,
        holding: Some(arm),
        aim: Aim::At {
            target: target.into(),
        },
        drag: DRAG,
        last: None,
    };
    let beside = settings.beside[arm].into();
    let plan = thrower.plan_beside(&request, &beside).map_err(why)?;
    let path = plan.path(now_ns() + AHEAD_NS, grip, target);
    path.ok_or("no straight way to the swing")
}

/// Returns a short description of the reason.
fn why(no_throw: NoThrow) -> &'static str {
    match no_throw {
        NoThrow::NoBall => "no hand holds a ball",
        NoThrow::NotFinite => "a target that is no place",
        NoThrow::Setting { .. } => "a setting out of range",
        NoThrow::Range { .. } => "a joint out of range",
        NoThrow::OutOfReach { .. } => "out of reach",
        NoThrow::Obstructed { .. } => "the robot would touch itself",
    }
}

/// First positions of balls, and the ball that each arm reached for.
struct Origins {
    existence: f32,
    /// Number and first position of each ball; oldest first.
    first: Vec<(u64, [f64; 3])>,
    caught: [Option<u64>; ARMS],
}

impl Origins {
    fn new(existence: f32) -> Self {
        Self {
            existence,
            first: Vec::with_capacity(BALLS + 1),
            caught: [None; ARMS],
        }
    }

    fn seen(&mut self, predictions: &BallPredictions) {
        for ball in predictions.valid() {
            let known = self.first.iter().any(|(number, _)| *number == ball.ball);
            let place = ball.p.iter().all(|x| x.is_finite());
            if known || !place || ball.existence < self.existence {
                continue;
            }
            self.first.push((ball.ball, ball.p));
            if self.first.len() > BALLS {
                self.first.remove(0);
            }
        }
    }

    fn reached(&mut self, path: &ArmPath) {
        if let Some(ball) = self.caught.get_mut(path.arm as usize) {
            *ball = Some(path.ball);
        }
    }

    /// Returns the first position of the last ball that an arm reached for.
    fn of(&self, arm: usize) -> Option<[f64; 3]> {
        let ball = (*self.caught.get(arm)?)?;
        let first = self.first.iter().find(|(number, _)| *number == ball);
        first.map(|(_, place)| *place)
    }
}

struct Ports {
    hand: LatestValue<HandState>,
    status: LatestValue<CatchStatus>,
    controller: GetPort<ControllerState>,
    state: Option<ControllerState>,
    felt: LatestValue<FeltMaterial>,
    predictions: GetPort<BallPredictions>,
    arms: GetPort<ArmPath>,
    paths: PutPort<ThrowPath>,
    releases: PutPort<HandOpening>,
    states: PutPort<ThrowStatus>,
}

impl Ports {
    fn open(bus: &Bus) -> Result<Self, RoleError> {
        Ok(Self {
            hand: LatestValue::open(bus, HAND_STATE)?,
            status: LatestValue::open(bus, CATCH_STATE)?,
            controller: bus.get_port(CONTROLLER_STATE, Start::Now)?,
            state: None,
            felt: LatestValue::open_from(bus, CATCH_FELT, Start::History(1))?,
            predictions: bus.get_port(PREDICTION, Start::Now)?,
            arms: bus.get_port(ARM_PATH, Start::Now)?,
            paths: bus.put_port(THROW_PATH, Priority::High)?,
            releases: bus.put_port(HAND_RELEASE, Priority::RealTime)?,
            states: bus.put_port(THROW_STATE, Priority::Normal)?,
        })
    }

    /// Polls all channels, and waits at most [`BEAT`].
    fn look(&mut self, origins: &mut Origins) -> Result<(), RoleError> {
        let mut next = self.controller.get(BEAT)?;
        while let Some(packet) = next {
            self.state = packet.first().copied().or(self.state);
            next = self.controller.try_get()?;
        }
        self.hand.look()?;
        self.status.look()?;
        self.felt.look()?;
        drain(&self.predictions, |seen| origins.seen(seen))?;
        drain(&self.arms, |path| origins.reached(path))?;
        Ok(())
    }

    fn latest(&self, after_feeling: bool) -> LatestPackets {
        let felt = self.felt.get().map_or(0, |felt| felt.grip);
        LatestPackets {
            hand: self.hand.get().copied(),
            status: self.status.get().copied(),
            controller: self.state,
            felt: after_feeling.then_some(felt),
        }
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching::Robot;
    use tactnet_catching_packets::RobotDescription;
    use tactnet_catching_packets::packets::BallPrediction;

    use super::*;

    #[test]
    fn a_ball_comes_from_where_it_was_first_seen_and_the_arm_that_reached_for_it_has_it() {
        let mut origins = Origins::new(0.95);
        let see = |origins: &mut Origins, ball: u64, existence: f32, x: f64| {
            let mut seen = BallPredictions::zeroed();
            seen.count = 1;
            seen.balls[0] = BallPrediction {
                ball,
                existence,
                p: [x, 0.1, 1.5],
                ..BallPrediction::zeroed()
            };
            origins.seen(&seen);
        };
        see(&mut origins, 3, 0.5, 5.0);
        see(&mut origins, 3, 0.99, 4.8);
        see(&mut origins, 3, 0.99, 4.5);
        let reach = |ball: u64| ArmPath {
            arm: 1,
            ball,
            ..ArmPath::zeroed()
        };
        assert_eq!(origins.of(1), None);
        origins.reached(&reach(3));
        assert_eq!(origins.of(1), Some([4.8, 0.1, 1.5]));
        assert_eq!((origins.of(0), origins.of(2)), (None, None));
        for ball in 10..10 + BALLS as u64 {
            see(&mut origins, ball, 0.99, f64::NAN);
            see(&mut origins, ball, 0.99, 4.0);
        }
        assert_eq!(origins.of(1), None, "forgotten");
        assert_eq!(origins.first.len(), BALLS);
    }

    #[test]
    fn what_is_planned_is_sent_and_what_is_not_is_named() {
        let robot = Robot::new(RobotDescription::nominal());
        let settings = ThrowBack::default();
        let thrower = Thrower::new(&robot, settings.planner);
        let throw = |target| plan(&thrower, &robot.waiting(), &settings, 0, 9, target);
        let path = throw([4.0, 0.0, 1.2]).unwrap();
        assert_eq!((path.arm, path.grip, path.target), (0, 9, [4.0, 0.0, 1.2]));
        assert!(path.open_ns > path.swing_ns && path.swing_ns > path.start_ns);
        assert_eq!(throw([9.0, 0.0, 1.2]), Err("out of reach"));
        assert_eq!(
            throw([f64::NAN, 0.0, 1.2]),
            Err("a target that is no place")
        );
    }
}
