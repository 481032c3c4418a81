//! State machine for a held ball, driven by the states of hands, coordinator and controller.
//!
//! ```text
//! Empty ── a hand holds a ball ─> Waiting ── robot is in its waiting pose: send path ─> Throwing ── ball has left ─>
//! Empty
//!                                    ^ └── tried too often, or no plan ─> Dropping ─> Empty       │
//!                                    └────────── refused, braked, the hand kept it ───────────────┘
//! ```

use tactnet_catching_packets::packets::{
    CatchPhase, ControllerMode, ControllerState, HandOpening, ThrowPath, ThrowPhase,
};

use super::ThrowInputs;

/// Timeout after which a silent process counts as lost, in ns.
const SILENT_NS: u64 = 300_000_000;
/// Standstill before a throw, in ns.
const STANDS_NS: u64 = 200_000_000;
/// Timeout after the request of a plan within which the controller must accept its path, in ns.
const TAKEN_NS: u64 = 600_000_000;
/// Time before the opening at which the hand receives its first command, in ns.
const TOLD_NS: u64 = 100_000_000;
/// Time before the opening from which a ball that leaves the hand is thrown, in ns. Fingers open with jitter.
const EARLY_NS: u64 = 10_000_000;
/// Timeout within which a hand must report that the ball has left, in ns.
const LEFT_NS: u64 = 150_000_000;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ThrowAction {
    Nothing,
    Plan {
        arm: usize,
        grip: u64,
    },
    /// Command the hand to open.
    Open(HandOpening),
}

#[derive(Debug, Clone, Copy, Default)]
enum ThrowState {
    #[default]
    Empty,
    Waiting,
    Throwing(SentThrow),
    Dropping(HandOpening),
}

/// Throw whose path was sent to the controller.
#[derive(Debug, Clone, Copy)]
struct SentThrow {
    opening: HandOpening,
    sent_ns: u64,
    /// True once the controller executes the path.
    begun: bool,
}

/// Follows one ball after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct ThrowDuty {
    state: ThrowState,
    tries: u32,
    grip: u64,
    tried: u32,
    /// Number of failed throws.
    pub failed: u64,
    /// Reason of the last failure.
    pub reason: String,
}

impl ThrowDuty {
    /// Creates the state machine.
    ///
    /// - `tries`: number of attempts per ball before it drops
    pub fn new(tries: u32) -> Self {
        Self {
            tries,
            ..Self::default()
        }
    }

    /// Returns the current grip and phase.
    pub fn phase(&self) -> (u64, ThrowPhase) {
        let phase = match self.state {
            ThrowState::Empty => ThrowPhase::Empty,
            ThrowState::Waiting => ThrowPhase::Waiting,
            ThrowState::Throwing(_) => ThrowPhase::Throwing,
            ThrowState::Dropping(_) => ThrowPhase::Dropping,
        };
        (self.grip, phase)
    }

    /// Updates the state and returns the next action.
    pub fn next_action(&mut self, now_ns: u64, seen: &ThrowInputs<'_>) -> ThrowAction {
        let fresh = |t_ns: u64| now_ns.saturating_sub(t_ns) < SILENT_NS;
        let held = seen
            .hand
            .filter(|hand| hand.holds == 1 && hand.arm < 2 && fresh(hand.t_ns));
        let controller = seen.controller.filter(|state| fresh(state.t_ns));
        match self.state {
            ThrowState::Empty | ThrowState::Waiting => {
                let Some(hand) = held else {
                    self.state = ThrowState::Empty;
                    return ThrowAction::Nothing;
                };
                if hand.grip != self.grip || matches!(self.state, ThrowState::Empty) {
                    (self.grip, self.tried) = (hand.grip, 0);
                }
                self.state = ThrowState::Waiting;
                let felt = seen.felt.is_none_or(|felt| felt == hand.grip);
                let waits = seen.status.is_some_and(|status| {
                    status.phase() == Some(CatchPhase::Armed)
                        && fresh(status.t_ns)
                        && now_ns.saturating_sub(status.since_ns) > STANDS_NS
                });
                let mode = controller.and_then(|state| state.mode());
                if !(felt && waits && mode == Some(ControllerMode::Ready)) {
                    return ThrowAction::Nothing;
                }
                let arm = hand.arm as usize;
                if self.tried < self.tries {
                    let grip = self.grip;
                    return ThrowAction::Plan { arm, grip };
                }
                self.state = ThrowState::Dropping(HandOpening {
                    arm: arm as u64,
                    open_ns: now_ns + TOLD_NS,
                });
                ThrowAction::Nothing
            }
            ThrowState::Throwing(throw) => self.follow(now_ns, held.is_some(), controller, throw),
            ThrowState::Dropping(opening) => {
                if now_ns < opening.open_ns {
                    return ThrowAction::Open(opening);
                }
                if held.is_none() || now_ns > opening.open_ns + LEFT_NS {
                    self.state = ThrowState::Empty;
                }
                ThrowAction::Nothing
            }
        }
    }

    fn follow(
        &mut self,
        now_ns: u64,
        holds: bool,
        controller: Option<&ControllerState>,
        throw: SentThrow,
    ) -> ThrowAction {
        let opening = throw.opening;
        if !holds {
            if now_ns + EARLY_NS < opening.open_ns {
                self.fail("the hand holds nothing any more");
            }
            // The ball is in the air.
            self.state = ThrowState::Empty;
            return ThrowAction::Nothing;
        }
        if now_ns > opening.open_ns + LEFT_NS {
            self.fail("the hand did not let go");
            return ThrowAction::Nothing;
        }
        let Some(controller) = controller else {
            self.fail("the controller is silent");
            return ThrowAction::Nothing;
        };
        let throws = controller.mode() == Some(ControllerMode::Throwing);
        if throws && !throw.begun {
            self.state = ThrowState::Throwing(SentThrow {
                begun: true,
                ..throw
            });
        }
        if !throws && throw.begun && now_ns < opening.open_ns {
            self.fail(controller.reason.as_str());
        } else if !throws && !throw.begun && now_ns > throw.sent_ns + TAKEN_NS {
            self.fail(&format!("not taken: {}", controller.reason.as_str()));
        } else if throws
            && (opening.open_ns.saturating_sub(TOLD_NS)..opening.open_ns).contains(&now_ns)
        {
            return ThrowAction::Open(opening);
        }
        ThrowAction::Nothing
    }

    /// Records that a path was sent.
    pub fn sent(&mut self, now_ns: u64, path: &ThrowPath) {
        self.tried += 1;
        self.state = ThrowState::Throwing(SentThrow {
            opening: HandOpening {
                arm: path.arm,
                open_ns: path.open_ns,
            },
            sent_ns: now_ns,
            begun: false,
        });
    }

    /// Records that no throw is possible. A repetition would have the same result, so the ball drops.
    pub fn no_plan(&mut self, why: &str) {
        self.fail(why);
        self.tried = self.tries;
    }

    fn fail(&mut self, why: &str) {
        self.failed += 1;
        self.reason = why.into();
        self.state = ThrowState::Waiting;
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::{CatchStatus, HandState, Text};

    use super::*;

    const MS: u64 = 1_000_000;

    /// Packets of all processes at one time.
    struct Seen {
        now_ns: u64,
        hand: HandState,
        status: CatchStatus,
        controller: Option<ControllerState>,
        felt: Option<u64>,
    }

    impl Seen {
        /// Returns the action after these packets.
        fn next(&self, duty: &mut ThrowDuty) -> ThrowAction {
            let inputs = ThrowInputs {
                hand: Some(&self.hand),
                status: Some(&self.status),
                controller: self.controller.as_ref(),
                felt: self.felt,
                ..ThrowInputs::default()
            };
            duty.next_action(self.now_ns, &inputs)
        }
    }

    fn seen(ms: u64, grip: Option<u64>, mode: ControllerMode) -> Seen {
        let t_ns = ms * MS;
        Seen {
            now_ns: t_ns,
            hand: HandState {
                t_ns,
                arm: 1,
                holds: u32::from(grip.is_some()),
                grip: grip.unwrap_or_default(),
            },
            status: CatchStatus {
                t_ns,
                phase: CatchPhase::Armed as u64,
                ..CatchStatus::zeroed()
            },
            controller: Some(ControllerState {
                t_ns,
                mode: mode as u64,
                reason: Text::new("trunk and forearm"),
                ..ControllerState::zeroed()
            }),
            felt: None,
        }
    }

    fn failures(duty: &ThrowDuty) -> (u64, &str) {
        (duty.failed, duty.reason.as_str())
    }

    fn path(open_ns: u64) -> ThrowPath {
        ThrowPath {
            arm: 1,
            open_ns,
            ..ThrowPath::zeroed()
        }
    }

    const PLAN: ThrowAction = ThrowAction::Plan { arm: 1, grip: 7 };

    /// Returns a duty that has sent a path with release at 5 s.
    fn sent() -> ThrowDuty {
        let mut duty = ThrowDuty::new(2);
        let ready = seen(1000, Some(7), ControllerMode::Ready);
        assert_eq!(ready.next(&mut duty), PLAN);
        duty.sent(1000 * MS, &path(5000 * MS));
        duty
    }

    #[test]
    fn a_held_ball_is_thrown_once_the_robot_stands_and_the_hand_is_told_in_time() {
        let mut duty = ThrowDuty::new(2);
        let empty = seen(1000, None, ControllerMode::Ready);
        assert_eq!(empty.next(&mut duty), ThrowAction::Nothing);
        let mut moves = seen(1000, Some(7), ControllerMode::Ready);
        moves.status.phase = CatchPhase::GoingBack as u64;
        assert_eq!(moves.next(&mut duty), ThrowAction::Nothing);
        assert_eq!(duty.phase(), (7, ThrowPhase::Waiting));
        let mut unfelt = seen(1000, Some(7), ControllerMode::Ready);
        unfelt.felt = Some(6);
        assert_eq!(unfelt.next(&mut duty), ThrowAction::Nothing);
        let mut duty = sent();
        let opening = HandOpening {
            arm: 1,
            open_ns: 5000 * MS,
        };
        for (ms, expected) in [
            (1100, ThrowAction::Nothing),
            (4899, ThrowAction::Nothing),
            (4900, ThrowAction::Open(opening)),
            (4999, ThrowAction::Open(opening)),
            (5000, ThrowAction::Nothing),
        ] {
            let throws = seen(ms, Some(7), ControllerMode::Throwing);
            assert_eq!(throws.next(&mut duty), expected, "{ms}");
        }
        let left = seen(5030, None, ControllerMode::Throwing);
        assert_eq!(left.next(&mut duty), ThrowAction::Nothing);
        assert_eq!(duty.phase().1, ThrowPhase::Empty);
        assert_eq!(duty.failed, 0);
    }

    #[test]
    fn a_throw_that_is_braked_keeps_its_ball_is_tried_again_and_dropped_in_the_end() {
        let mut duty = sent();
        seen(2000, Some(7), ControllerMode::Throwing).next(&mut duty);
        let brakes = seen(4950, Some(7), ControllerMode::Braking);
        assert_eq!(brakes.next(&mut duty), ThrowAction::Nothing);
        assert_eq!(failures(&duty), (1, "trunk and forearm"));
        // The robot still returns to its waiting pose.
        assert_eq!(brakes.next(&mut duty), ThrowAction::Nothing);
        let ready = seen(9000, Some(7), ControllerMode::Ready);
        assert_eq!(ready.next(&mut duty), PLAN);
        duty.sent(9000 * MS, &path(13_000 * MS));
        let refused = seen(9601, Some(7), ControllerMode::Ready);
        refused.next(&mut duty);
        assert_eq!(failures(&duty), (2, "not taken: trunk and forearm"));
        assert_eq!(refused.next(&mut duty), ThrowAction::Nothing);
        assert_eq!(duty.phase().1, ThrowPhase::Dropping);
        let later = seen(9602, Some(7), ControllerMode::Ready);
        let ThrowAction::Open(drop) = later.next(&mut duty) else {
            panic!("it drops");
        };
        assert_eq!((drop.arm, drop.open_ns), (1, 9701 * MS));
        seen(9730, None, ControllerMode::Ready).next(&mut duty);
        assert_eq!(duty.phase().1, ThrowPhase::Empty);
    }

    #[test]
    fn without_a_plan_a_ball_is_dropped_at_once() {
        let mut duty = ThrowDuty::new(2);
        let ready = seen(1000, Some(7), ControllerMode::Ready);
        ready.next(&mut duty);
        duty.no_plan("out of reach");
        assert_eq!(ready.next(&mut duty), ThrowAction::Nothing);
        assert_eq!(duty.phase().1, ThrowPhase::Dropping);
        assert_eq!(failures(&duty), (1, "out of reach"));
    }

    /// The world restarted, the packet of the hand was lost, or the controller was killed.
    #[test]
    fn a_ball_that_is_gone_a_hand_that_keeps_it_and_a_silent_controller_are_named() {
        let mut duty = sent();
        seen(3000, None, ControllerMode::Throwing).next(&mut duty);
        assert_eq!(duty.reason, "the hand holds nothing any more");
        assert_eq!(duty.phase().1, ThrowPhase::Empty);
        let mut duty = sent();
        seen(5151, Some(7), ControllerMode::Throwing).next(&mut duty);
        assert_eq!(duty.reason, "the hand did not let go");
        let mut duty = sent();
        let mut silent = seen(2000, Some(7), ControllerMode::Throwing);
        silent.controller = None;
        silent.next(&mut duty);
        assert_eq!(duty.reason, "the controller is silent");
        assert_eq!(duty.failed, 1);
    }
}
