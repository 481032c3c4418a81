//! Packets of skin and classifier for the tactile exploration.

use bytemuck::Zeroable;
use tactnet_catching::feel::{Felt, FusedBelief, SweepOrder};
use tactnet_catching_packets::packets::{FeltMaterial, Text};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{Command, ModelNames, Stage, SweepCommand, TactileBelief};

/// Returns the stage of the belief that concludes a sweep, which the fusion uses.
pub(crate) fn last_stage(config: &ServeConfig) -> u32 {
    match config.mc_samples {
        0 => Stage::Plain as u32,
        _ => Stage::Dropout as u32,
    }
}

/// Returns the fused belief of a packet.
pub(crate) fn fused(belief: &TactileBelief) -> Option<FusedBelief> {
    let probability = belief.fused.get(belief.fused_label as usize)?;
    Some(FusedBelief {
        label: belief.fused_label,
        probability: *probability,
        sweeps: belief.fused_sweeps,
    })
}

/// Returns the packet of an order.
pub(crate) fn command(order: SweepOrder) -> SweepCommand {
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
pub(crate) fn material(felt: &Felt, names: Option<&ModelNames>) -> FeltMaterial {
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
