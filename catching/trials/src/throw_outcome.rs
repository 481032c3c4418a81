//! Results of throws in stepped time.

use tactnet_catching_packets::ARMS;
use tactnet_catching_world::{Cage, Contacts, Verdict};

use crate::bound::Bound;
use crate::look_ahead::LookAhead;
use crate::watch::Braked;

/// Result of one ball, and its predictions.
#[derive(Debug, Clone)]
pub struct BallOutcome {
    /// Verdict of the judge; `None` if the throw ended before.
    pub verdict: Option<Verdict>,
    /// Verdict of the second judge, which simulates the fingers; `None` if the throw ended before.
    pub cage: Option<Cage>,
    /// Arms that could have caught the ball.
    pub arms: [bool; ARMS],
    /// True if the tracker predicted the ball.
    pub tracked: bool,
    /// True if an arm moved towards the ball.
    pub planned: bool,
    /// All predictions of the ball, if it crossed a hand's plane.
    pub predictions: Vec<LookAhead>,
    /// Last prediction at least 200 ms before the crossing.
    pub ahead: Option<LookAhead>,
    /// Cramer-Rao bound for this flight with a head at rest and without spin.
    pub bound: Option<Bound>,
}

impl BallOutcome {
    /// Returns true if the ball was caught.
    pub fn caught(&self) -> bool {
        self.verdict.is_some_and(|verdict| verdict.caught())
    }
}

/// Result of a throw.
#[derive(Debug, Clone)]
pub struct ThrowOutcome {
    /// Number of the throw.
    pub number: u64,
    /// Balls, in the order of their release.
    pub balls: Vec<BallOutcome>,
    /// Number of plan requests without a solution.
    pub no_plans: u64,
    /// Contacts and mapping, if the robot looked around.
    pub obstacles: Option<AmongObstacles>,
    /// Number of stops by the safety monitor while the robot moved.
    pub stops: u64,
    /// First command at which the monitor would have braked.
    pub braked: Option<Braked>,
}

impl ThrowOutcome {
    /// Returns true if all balls were caught.
    pub(crate) fn all_caught(&self) -> bool {
        self.balls.iter().all(BallOutcome::caught)
    }

    /// Returns true if the robot touched anything.
    pub(crate) fn touched(&self) -> bool {
        self.obstacles.is_some_and(|among| among.contacts.ticks > 0)
    }
}

/// Result of a throw in which the robot looked around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AmongObstacles {
    /// Contacts of the robot.
    pub contacts: Contacts,
    /// Number of plans without a collision-free path.
    pub obstructed: u64,
    /// Number of arms that stayed up because their path down was not clear.
    pub arms_held_up: usize,
    /// Time from the last depth pictures to the map, in s.
    pub look_seconds: f64,
    /// Time of the first plans of both arms in s; `None` without a plan request.
    pub plan_seconds: Option<f64>,
}
