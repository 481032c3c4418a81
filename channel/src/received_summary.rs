//! A packet that came, as people look at it.

use std::fmt;

use serde::Serialize;

use crate::{GetPort, Received, now_ns};

/// Header and first bytes of a packet that came.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReceivedSummary {
    /// Who put it, hexadecimal.
    pub sender: String,
    /// Its number among that sender's packets.
    pub sequence: u64,
    /// From put to now, microseconds; meaningful for packets of this host only.
    pub latency_us: f64,
    /// Communication priority.
    pub priority: u8,
    /// True for a packet of another host.
    pub remote: bool,
    /// Its length.
    pub bytes: usize,
    /// The first bytes, hexadecimal.
    pub begins: String,
    /// Packets of the channel that this port has missed so far.
    pub lost: u64,
}

impl ReceivedSummary {
    /// - `port`: where it came
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

impl fmt::Display for ReceivedSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} #{:<8} {:>8.1} us {:>10} bytes {} …",
            &self.sender[..8],
            self.sequence,
            self.latency_us,
            self.bytes,
            self.begins
        )?;
        match self.lost {
            0 => Ok(()),
            lost => write!(f, "  lost so far: {lost}"),
        }
    }
}
