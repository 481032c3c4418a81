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
        let Some(current) = &mut grip else {
            if let Some(hand) = held.filter(|hand| hand.grip > felt && ports.stands()) {
                grip = Some(ports.begin(hand.grip, now)?);
            }
            continue;
        };
        let motion = current.motion();
        if held.is_none_or(|hand| hand.grip != current.number) {
            // The ball left the hand.
            ports.command(Command::Stop, motion)?;
            grip = None;
            continue;
        }
        if let Some(belief) = belief {
            current.update(&belief);
        } else if !rejected && now - current.asked_ns < LONGEST_SWEEP_NS {
            continue;
        }
        ports.command(Command::Stop, motion)?;
        let sure = |(_, sure): (u32, f32)| f64::from(sure) >= settings.sure;
        if current.best.is_some_and(sure) || current.tried >= settings.most_sweeps {
            ports.answer(current)?;
            felt = current.number;
            times.push(now - current.begun_ns);
            grip = None;
        } else {
            current.tried += 1;
            current.asked_ns = now;
            ports.command(Command::Start, current.motion())?;
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

    /// Takes the belief on the ball after a sweep.
    fn update(&mut self, belief: &TactileBelief) {
        let probability = belief.fused.get(belief.fused_label as usize);
        self.best = probability.map(|sure| (belief.fused_label, *sure));
        self.sweeps = belief.fused_sweeps;
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

    /// Starts the first sweep over the ball of a grip.
    fn begin(&self, grip: u64, now_ns: u64) -> Result<Grip, RoleError> {
        let grip = Grip::begin(grip, now_ns);
        // The fused belief of the previous ball is kept until a new grip begins.
        self.command(Command::Reset, grip.motion())?;
        self.command(Command::Start, grip.motion())?;
        Ok(grip)
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
