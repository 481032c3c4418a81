//! Summary of a received packet, for tools.

use serde::Serialize;

use crate::{GetPort, Received, now_ns};

/// Header and first bytes of a received packet.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReceivedSummary {
    /// Number of the sender, in hexadecimal.
    pub sender: String,
    /// Sequence number at that sender.
    pub sequence: u64,
    /// Time from put to now, in microseconds. Valid for packets of this host only.
    pub latency_us: f64,
    /// Priority, see [`crate::Priority`].
    pub priority: u8,
    /// True for a packet from another host.
    pub remote: bool,
    /// Length, in bytes.
    pub bytes: usize,
    /// First 24 bytes, in hexadecimal.
    pub begins: String,
    /// Packets of the channel that this port has lost so far.
    pub lost: u64,
}

impl ReceivedSummary {
    /// Returns the summary of a packet that `port` has received.
    pub fn new(packet: &Received<u8>, port: &GetPort<u8>) -> Self {
        let header = packet.header();
        Self {
            sender: format!("{:016x}", header.sender),
            sequence: header.sequence,
            latency_us: now_ns().saturating_sub(header.put_ns) as f64 / 1e3,
            priority: header.priority,
            remote: header.remote != 0,
            bytes: packet.len(),
            begins: packet.iter().take(24).map(|b| format!("{b:02x}")).collect(),
            lost: port.lost(),
        }
    }
}
