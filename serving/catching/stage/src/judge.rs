//! Says what became of a throw, and whether it could have been caught.

use std::sync::mpsc::Receiver;

use tactnet_catching::Robot;
use tactnet_catching_packets::packets::{CatchOutcome, FeltMaterial, Text};
use tactnet_catching_packets::{ARMS, JOINTS};
use tactnet_catching_trials::{Oracle, Timing};
use tactnet_catching_world::{FlightSample, Miss, Verdict};
use tactnet_channel::{Bus, Priority};

use crate::StageError;

/// A throw that is over.
pub(crate) struct Over {
    pub throw: u64,
    pub verdict: Verdict,
    /// As if nobody had caught it.
    pub flight: Vec<FlightSample>,
    /// Adds to the world's time to make it the host's.
    pub epoch_ns: u64,
    /// What a caught ball is made of, where somebody feels it.
    pub material: Option<String>,
    /// What it was felt to be.
    pub felt: Option<FeltMaterial>,
}

/// Judges until the other end is dropped.
pub(crate) fn judge(
    bus: &Bus,
    robot: &Robot,
    ready: &[f64; JOINTS],
    lower_body: bool,
    throws: &Receiver<Over>,
) -> Result<(), StageError> {
    let outcomes = bus.put_port::<CatchOutcome>("catch/outcome", Priority::Normal)?;
    let oracle = Oracle::new(robot, lower_body);
    // The catch space is that of stepped time, so that rates can be compared.
    let reaction = Timing::ours().reaction(robot.description().cameras.rate);
    for over in throws {
        let arms = oracle.arms_of(&over.flight, reaction, ready);
        outcomes.put_copy(&[outcome(&over, arms)])?;
    }
    Ok(())
}

fn outcome(over: &Over, arms: [bool; ARMS]) -> CatchOutcome {
    let verdict = &over.verdict;
    let crossing = verdict.crossing.as_ref();
    let felt = over.felt.as_ref();
    CatchOutcome {
        throw: over.throw,
        ball: verdict.ball,
        release_ns: over
            .flight
            .first()
            .map_or(0, |sample| sample.t_ns + over.epoch_ns),
        crossing_ns: crossing.map_or(0, |crossing| crossing.at_ns + over.epoch_ns),
        across: crossing.map_or(0.0, |crossing| crossing.across_m),
        along: crossing
            .and_then(|crossing| crossing.along_s)
            .unwrap_or(0.0),
        angle: crossing.map_or(0.0, |crossing| crossing.angle),
        caught: u32::from(verdict.caught()),
        cause: match verdict.miss {
            None => 0,
            Some(Miss::NeverCameNear) => 1,
            Some(Miss::NoCommand) => 2,
            Some(Miss::Across) => 3,
            Some(Miss::Angle) => 4,
            Some(Miss::Early) => 5,
            Some(Miss::Late) => 6,
        },
        arms: u32::from(arms[0]) + 2 * u32::from(arms[1]),
        arm: crossing.map_or(0, |crossing| crossing.arm as u32),
        material: Text::new(over.material.as_deref().unwrap_or_default()),
        felt: felt.map_or_else(Text::default, |felt| felt.material),
        posterior: felt.map_or(0.0, |felt| felt.posterior),
        sweeps: felt.map_or(0, |felt| felt.sweeps),
        reserved: 0,
    }
}
