//! Tactile exploration: the free hand sweeps over a caught ball until the classifier is confident of the material.
//!
//! ```text
//! hand/state (holds something), catch/state (stands) ─> feel ─ sweep/command ─> skin, classifier ─ tactile/belief ─> feel ─ catch/felt ─> judge
//! ```

use std::time::Duration;

use bytemuck::Zeroable;
use tactnet_catching_packets::packets::{CatchPhase, CatchStatus, FeltMaterial, HandState, Text};
use tactnet_channel::{Bus, GetPort, Priority, PutPort, Start, Wait, now_ns};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{
    Command, Event, ModelNames, Stage, SweepCommand, TactileBelief, TactileStatus,
};

use crate::channels::{CATCH_FELT, CATCH_STATE, HAND_STATE};
use crate::latest_value::LatestValue;
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Maximum sleep between two polls.
const LOOK: Wait = Wait::Block {
    timeout: Duration::from_millis(10),
};
/// Timeout after which a sweep without any packet is abandoned, in ns.
const LONGEST_SWEEP_NS: u64 = 5_000_000_000;
/// Factor between the number of a grip and the number of its first motion.
const MOTIONS: u64 = 100;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let config = ServeConfig::of(bus.table())?;
    let mut ports = Ports::open(bus, &config)?;
    // Stage of the belief that concludes a sweep, which the fusion uses.
    let last_stage = match config.mc_samples {
        0 => Stage::Plain,
        _ => Stage::Dropout,
    };
    let mut times = Times::at(1);
    let mut felt = 0;
    let mut grip: Option<Grip> = None;
    ready();
    while !stopped() {
        let motion = grip.as_ref().map(Grip::motion);
        let (belief, rejected) = ports.look(motion, last_stage)?;
        let now = now_ns();
        let held = ports.hand.get().filter(|hand| hand.holds == 1).copied();
        let Some(going_on) = &mut grip else {
            if let Some(hand) = held.filter(|hand| hand.grip > felt && ports.stands()) {
                let begins = Grip::begin(hand.grip, now);
                // The fused belief of the previous ball is kept until a new grip begins.
                ports.command(Command::Reset, begins.motion())?;
                ports.command(Command::Start, begins.motion())?;
                grip = Some(begins);
            }
            continue;
        };
        let motion = going_on.motion();
        if held.is_none_or(|hand| hand.grip != going_on.number) {
            // The ball left the hand.
            ports.command(Command::Stop, motion)?;
            grip = None;
            continue;
        }
        if let Some(belief) = belief {
            let probability = belief.fused.get(belief.fused_label as usize);
            going_on.best = probability.map(|sure| (belief.fused_label, *sure));
            going_on.sweeps = belief.fused_sweeps;
        } else if !rejected && now - going_on.asked_ns < LONGEST_SWEEP_NS {
            continue;
        }
        ports.command(Command::Stop, motion)?;
        let sure = |(_, sure): (u32, f32)| f64::from(sure) >= settings.sure;
        if going_on.best.is_some_and(sure) || going_on.tried >= settings.most_sweeps {
            ports.answer(going_on)?;
            felt = going_on.number;
            times.push(now - going_on.begun_ns);
            grip = None;
        } else {
            going_on.tried += 1;
            going_on.asked_ns = now;
            ports.command(Command::Start, going_on.motion())?;
        }
    }
    Ok(RoleReport {
        lost: ports.beliefs.lost() + ports.events.lost(),
        ..times.report()
    })
}

/// A held ball during exploration.
struct Grip {
    number: u64,
    /// Number of usable sweeps.
    sweeps: u32,
    /// Number of started sweeps.
    tried: u32,
    /// Time at which the latest sweep was requested.
    asked_ns: u64,
    begun_ns: u64,
    /// Most probable label and its probability.
    best: Option<(u32, f32)>,
}

impl Grip {
    fn begin(number: u64, now_ns: u64) -> Self {
        Self {
            number,
            sweeps: 0,
            tried: 1,
            asked_ns: now_ns,
            begun_ns: now_ns,
            best: None,
        }
    }

    /// Returns the number of the current motion.
    fn motion(&self) -> u64 {
        self.number * MOTIONS + u64::from(self.tried)
    }
}

struct Ports {
    hand: LatestValue<HandState>,
    status: LatestValue<CatchStatus>,
    beliefs: GetPort<TactileBelief>,
    events: GetPort<TactileStatus>,
    names: LatestValue<ModelNames>,
    commands: PutPort<SweepCommand>,
    felt: PutPort<FeltMaterial>,
}

impl Ports {
    fn open(bus: &Bus, config: &ServeConfig) -> Result<Self, RoleError> {
        Ok(Self {
            hand: LatestValue::open(bus, HAND_STATE)?,
            status: LatestValue::open(bus, CATCH_STATE)?,
            beliefs: bus.get_port(config.belief.as_str(), Start::Now)?,
            events: bus.get_port(config.status.as_str(), Start::Now)?,
            names: LatestValue::open_from(bus, &config.model, Start::History(1))?,
            commands: bus.put_port(config.command.as_str(), Priority::High)?,
            felt: bus.put_port(CATCH_FELT, Priority::Normal)?,
        })
    }

    /// Polls all channels, and waits at most [`LOOK`]. Returns the belief on the whole sweep of a motion, if there is
    /// one, and true if the sweep is unusable.
    fn look(
        &mut self,
        motion: Option<u64>,
        stage: Stage,
    ) -> Result<(Option<TactileBelief>, bool), RoleError> {
        let (mut belief, mut rejected) = (None, false);
        let mut packet = self.beliefs.get(LOOK)?;
        while let Some(got) = packet {
            let mine = |belief: &&TactileBelief| {
                Some(belief.motion) == motion && belief.stage == stage as u32
            };
            belief = got.iter().find(mine).copied().or(belief);
            packet = self.beliefs.try_get()?;
        }
        while let Some(events) = self.events.try_get()? {
            rejected |= events
                .iter()
                .any(|event| Some(event.motion) == motion && event.event == Event::Rejected as u32);
        }
        self.hand.look()?;
        self.status.look()?;
        self.names.look()?;
        Ok((belief, rejected))
    }

    /// Returns true while the robot is in its waiting pose.
    fn stands(&self) -> bool {
        let phase = self.status.get().and_then(CatchStatus::phase);
        phase == Some(CatchPhase::Armed)
    }

    fn command(&self, command: Command, motion: u64) -> Result<(), RoleError> {
        self.commands.put_copy(&[SweepCommand {
            kind: command as u32,
            motion,
            ..SweepCommand::zeroed()
        }])?;
        Ok(())
    }

    fn answer(&self, grip: &Grip) -> Result<(), RoleError> {
        let name = |label: u32| {
            let names = self.names.get()?;
            let known = label < names.materials;
            known.then(|| names.names.get(label as usize).copied())?
        };
        let (label, posterior) = grip.best.unzip();
        let material = label.and_then(name);
        self.felt.put_copy(&[FeltMaterial {
            grip: grip.number,
            material: Text::new(material.as_ref().map_or("", |name| name.as_str())),
            posterior: posterior.map_or(0.0, f64::from),
            sweeps: grip.sweeps,
            reserved: 0,
        }])?;
        Ok(())
    }
}
