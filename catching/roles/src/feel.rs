//! Tactile exploration on its channels.
//!
//! ```text
//! hand/state, catch/state ─> feel ─ sweep/command ─> skin, classifier ─ tactile/belief ─> feel ─ catch/felt ─> judge
//! ```

use bytemuck::Zeroable;
use tactnet_catching::feel::{Exploration, FeelInputs, Felt, FusedBelief, SweepOrder};
use tactnet_catching_packets::packets::{FeltMaterial, Text};
use tactnet_channel::{Priority, Start, now_ns};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{
    Command, Event, ModelNames, Stage, SweepCommand, TactileBelief, TactileStatus,
};

use crate::channels::{CATCH_FELT, CATCH_STATE, HAND_STATE};
use crate::latest_value::{LatestValue, NewPackets, at_most, send};
use crate::role::Shell;
use crate::{RoleError, RoleReport};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings) = (shell.bus, &shell.settings);
    let config = ServeConfig::of(bus.table())?;
    // The belief of this stage concludes a sweep.
    let last_stage = match config.mc_samples {
        0 => Stage::Plain as u32,
        _ => Stage::Dropout as u32,
    };
    let mut task = Exploration::new(settings.sure, settings.most_sweeps);
    let (mut hand, mut status) = (HAND_STATE.latest(bus)?, CATCH_STATE.latest(bus)?);
    let mut beliefs = NewPackets::new(bus.get_port(config.belief.as_str(), Start::Now)?);
    let mut events = NewPackets::new(bus.get_port(config.status.as_str(), Start::Now)?);
    let names = bus.get_port::<ModelNames>(config.model.as_str(), Start::History(1))?;
    let mut names = LatestValue::new(names);
    let commands = bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?;
    let results = CATCH_FELT.put(bus)?;
    let times = shell.repeat(1, |times| {
        let motion = task.motion();
        let is_of =
            |belief: &&TactileBelief| Some(belief.motion) == motion && belief.stage == last_stage;
        let is_rejected = |event: &TactileStatus| {
            Some(event.motion) == motion && event.event == Event::Rejected as u32
        };
        let inputs = FeelInputs {
            belief: beliefs
                .wait(at_most(10))?
                .iter()
                .rfind(is_of)
                .and_then(fused),
            hand: hand.look()?,
            status: status.look()?,
            rejected: events.look()?.iter().any(is_rejected),
        };
        let outputs = task.step(now_ns(), &inputs);
        send(&commands, outputs.orders.map(|order| order.map(command)))?;
        if let Some(felt) = outputs.felt {
            results.put_copy(&[material(&felt, names.look()?)])?;
            times.push(felt.duration_ns);
        }
        Ok(())
    })?;
    Ok(times.report(beliefs.lost() + events.lost()))
}

fn fused(belief: &TactileBelief) -> Option<FusedBelief> {
    let probability = belief.fused.get(belief.fused_label as usize)?;
    Some(FusedBelief {
        label: belief.fused_label,
        probability: *probability,
        sweeps: belief.fused_sweeps,
    })
}

fn command(order: SweepOrder) -> SweepCommand {
    let (kind, motion) = match order {
        SweepOrder::Reset(motion) => (Command::Reset, motion),
        SweepOrder::Start(motion) => (Command::Start, motion),
        SweepOrder::Stop(motion) => (Command::Stop, motion),
    };
    SweepCommand {
        kind: kind as u32,
        motion,
        ..SweepCommand::zeroed()
    }
}

/// Returns the packet of a result, with the name of the material.
fn material(felt: &Felt, names: Option<&ModelNames>) -> FeltMaterial {
    let name = |label: u32| {
        let known = names.filter(|names| label < names.materials)?;
        known.names.get(label as usize).copied()
    };
    let name = felt.belief.and_then(|belief| name(belief.label));
    FeltMaterial {
        grip: felt.grip,
        material: Text::new(name.as_ref().map_or("", |name| name.as_str())),
        posterior: felt.belief.map_or(0.0, |belief| belief.probability.into()),
        sweeps: felt.belief.map_or(0, |belief| belief.sweeps),
        reserved: 0,
    }
}
