//! Tactile exploration as a step function: the free hand sweeps over a caught ball until the classifier is confident
//! of the material.

use tactnet_catching_packets::packets::{CatchPhase, CatchStatus, HandState};

/// Timeout after which a sweep without any packet is abandoned, in ns.
const LONGEST_SWEEP_NS: u64 = 5_000_000_000;
/// Factor between the number of a grip and the number of its first motion.
const MOTIONS: u64 = 100;

/// Belief of the classifier at the end of a sweep, fused over the sweeps of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FusedBelief {
    /// Label of the most probable material.
    pub label: u32,
    /// Its probability, from 0 to 1.
    pub probability: f32,
    /// Number of sweeps.
    pub sweeps: u32,
}

/// Inputs of one step.
#[derive(Debug, Clone, Copy, Default)]
pub struct FeelInputs<'a> {
    /// Latest state of the hands.
    pub hand: Option<&'a HandState>,
    /// Latest phase of the coordinator.
    pub status: Option<&'a CatchStatus>,
    /// Belief after the current motion, if one has arrived since the last step.
    pub belief: Option<FusedBelief>,
    /// True if the classifier has rejected the sweep of the current motion.
    pub rejected: bool,
}

/// Command to skin and classifier, with the number of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SweepOrder {
    /// Forget the last object.
    Reset(u64),
    /// Begin a sweep.
    Start(u64),
    /// End the sweep.
    Stop(u64),
}

/// Result of the exploration of one ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Felt {
    /// Number of the grip.
    pub grip: u64,
    /// Last belief; `None` without a usable sweep.
    pub belief: Option<FusedBelief>,
    /// Duration of the exploration, in ns.
    pub duration_ns: u64,
}

/// Packets that one step sends.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FeelOutputs {
    /// Commands, in their order.
    pub orders: [Option<SweepOrder>; 2],
    /// Result, once the exploration is over.
    pub felt: Option<Felt>,
}

/// A held ball during exploration.
#[derive(Debug, Clone, Copy)]
struct Grip {
    number: u64,
    /// Number of started sweeps.
    tried: u32,
    /// Time at which the latest sweep was requested.
    asked_ns: u64,
    begun_ns: u64,
    best: Option<FusedBelief>,
}

impl Grip {
    fn motion(&self) -> u64 {
        self.number * MOTIONS + u64::from(self.tried)
    }
}

/// Explores one ball after the other.
#[derive(Debug, Clone, Default)]
pub struct Exploration {
    sure: f64,
    most_sweeps: u32,
    /// Number of the last explored grip.
    felt: u64,
    grip: Option<Grip>,
}

impl Exploration {
    /// Creates an exploration without a ball.
    ///
    /// - `sure`: probability at which the exploration ends, from 0 to 1
    /// - `most_sweeps`: maximum number of sweeps per ball
    pub fn new(sure: f64, most_sweeps: u32) -> Self {
        Self {
            sure,
            most_sweeps,
            ..Self::default()
        }
    }

    /// Returns the number of the current motion.
    pub fn motion(&self) -> Option<u64> {
        self.grip.as_ref().map(Grip::motion)
    }

    /// Takes the packets since the last step and returns the commands.
    pub fn step(&mut self, now_ns: u64, inputs: &FeelInputs<'_>) -> FeelOutputs {
        let held = inputs.hand.filter(|hand| hand.holds == 1);
        let Some(mut grip) = self.grip else {
            let stands = inputs.status.and_then(CatchStatus::phase) == Some(CatchPhase::Armed);
            let new = held.filter(|hand| hand.grip > self.felt && stands);
            return new.map_or_else(FeelOutputs::default, |hand| self.begin(now_ns, hand.grip));
        };
        let stop = Some(SweepOrder::Stop(grip.motion()));
        let mut outputs = FeelOutputs {
            orders: [stop, None],
            felt: None,
        };
        if held.is_none_or(|hand| hand.grip != grip.number) {
            // The ball left the hand.
            self.grip = None;
            return outputs;
        }
        let waits = !inputs.rejected && now_ns - grip.asked_ns < LONGEST_SWEEP_NS;
        if inputs.belief.is_none() && waits {
            return FeelOutputs::default();
        }
        grip.best = inputs.belief.or(grip.best);
        let is_sure = |best: FusedBelief| f64::from(best.probability) >= self.sure;
        if grip.best.is_some_and(is_sure) || grip.tried >= self.most_sweeps {
            outputs.felt = Some(Felt {
                grip: grip.number,
                belief: grip.best,
                duration_ns: now_ns - grip.begun_ns,
            });
            self.felt = grip.number;
            self.grip = None;
        } else {
            grip.tried += 1;
            grip.asked_ns = now_ns;
            outputs.orders[1] = Some(SweepOrder::Start(grip.motion()));
            self.grip = Some(grip);
        }
        outputs
    }

    /// Starts the first sweep over the ball of a grip.
    fn begin(&mut self, now_ns: u64, number: u64) -> FeelOutputs {
        let grip = Grip {
            number,
            tried: 1,
            asked_ns: now_ns,
            begun_ns: now_ns,
            best: None,
        };
        self.grip = Some(grip);
        // The fused belief of the previous ball is kept until a new grip begins.
        let orders = [SweepOrder::Reset, SweepOrder::Start].map(|order| Some(order(grip.motion())));
        FeelOutputs { orders, felt: None }
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    const S: u64 = 1_000_000_000;

    /// Performs a step with a ball of grip 4 in the hand of a robot that waits.
    fn step(task: &mut Exploration, now_ns: u64, belief: Option<f32>) -> FeelOutputs {
        let hand = HandState {
            t_ns: now_ns,
            arm: 0,
            holds: 1,
            grip: 4,
        };
        let mut status = CatchStatus::zeroed();
        status.phase = CatchPhase::Armed as u64;
        let belief = belief.map(|probability| FusedBelief {
            label: 3,
            probability,
            sweeps: 1,
        });
        let inputs = FeelInputs {
            hand: Some(&hand),
            status: Some(&status),
            belief,
            rejected: false,
        };
        task.step(now_ns, &inputs)
    }

    #[test]
    fn a_ball_is_swept_until_the_belief_is_sure_and_only_once() {
        let mut task = Exploration::new(0.9, 3);
        let begin = step(&mut task, 0, None);
        let orders = [SweepOrder::Reset(401), SweepOrder::Start(401)];
        assert_eq!((begin.orders, begin.felt), (orders.map(Some), None));
        assert_eq!(step(&mut task, S, None), FeelOutputs::default());
        let again = step(&mut task, 2 * S, Some(0.5));
        let orders = [SweepOrder::Stop(401), SweepOrder::Start(402)];
        assert_eq!((again.orders, again.felt), (orders.map(Some), None));
        let end = step(&mut task, 3 * S, Some(0.95));
        assert_eq!(end.orders, [Some(SweepOrder::Stop(402)), None]);
        let felt = end.felt.unwrap();
        assert_eq!((felt.grip, felt.duration_ns), (4, 3 * S));
        assert_eq!(felt.belief.unwrap().label, 3);
        assert_eq!(step(&mut task, 4 * S, None), FeelOutputs::default());
    }

    #[test]
    fn sweeps_without_an_answer_are_repeated_and_given_up_and_a_ball_that_is_gone_stops_them() {
        let mut task = Exploration::new(0.9, 2);
        step(&mut task, 0, None);
        let second = step(&mut task, LONGEST_SWEEP_NS, None);
        assert_eq!(second.orders[1], Some(SweepOrder::Start(402)));
        let end = step(&mut task, 2 * LONGEST_SWEEP_NS, None);
        assert_eq!(end.felt.unwrap().belief, None);
        let mut task = Exploration::new(0.9, 2);
        step(&mut task, 0, None);
        let gone = task.step(S, &FeelInputs::default());
        assert_eq!(gone.orders, [Some(SweepOrder::Stop(401)), None]);
        assert_eq!((gone.felt, task.motion()), (None, None));
    }
}
