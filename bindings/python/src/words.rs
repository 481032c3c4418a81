//! Packets as JSON documents.

use bytemuck::{AnyBitPattern, NoUninit};
use serde_json::Value;
use tactnet_channel::Packet;
use tactnet_skin::packets::{ModelNames, TactileBelief};
use tactnet_skin::{ReadablePacket, material_names};

/// Returns a packet as JSON with names; `None` for unknown packets.
///
/// - `network`: names of the network that made the packet, if known
pub(crate) fn in_words<T: Packet + NoUninit + AnyBitPattern>(
    packet: &T,
    network: Option<&ModelNames>,
) -> Option<Value> {
    let words = ReadablePacket::new(T::NAME, T::VERSION, bytemuck::bytes_of(packet), network)?;
    serde_json::to_value(words).ok()
}

/// Returns a belief as JSON with names, complete posteriors and the materials in their order.
pub(crate) fn belief_in_words(
    belief: &TactileBelief,
    network: Option<&ModelNames>,
) -> Option<Value> {
    let mut words = in_words(belief, network)?;
    let names = network.map(material_names).unwrap_or_default();
    let materials = (belief.materials as usize).min(belief.posterior.len());
    let object = words.as_object_mut()?;
    object.insert("materials".into(), names.into());
    object.insert("posterior".into(), belief.posterior[..materials].into());
    object.insert("fused".into(), belief.fused[..materials].into());
    object.insert("entropy".into(), belief.entropy.into());
    object.insert("motion".into(), belief.motion.into());
    object.insert("model_version".into(), belief.model_version.into());
    Some(words)
}
