//! The channels of a bus as people look at them.

use std::fmt;

use serde::Serialize;

use crate::{Bus, ChannelError, Table};

/// A channel of the table, and who is connected to it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ListedChannel {
    /// Its id.
    pub id: String,
    /// Name of its packets.
    pub packet: String,
    /// Largest packet, bytes.
    pub packet_bytes: usize,
    /// Put-ports that are connected, the hub's own included.
    pub put_ports: usize,
    /// Most put-ports.
    #[serde(rename = "put_ports_most")]
    pub max_put_ports: usize,
    /// Get-ports that are connected, the hub's own included.
    pub get_ports: usize,
    /// Most get-ports.
    #[serde(rename = "get_ports_most")]
    pub max_get_ports: usize,
    /// Shared memory of a put-port, bytes.
    pub put_port_bytes: u64,
    /// True for a channel between hosts.
    pub distributed: bool,
}

impl ListedChannel {
    /// Returns the line of names above channels that are printed with [`fmt::Display`].
    pub fn heading() -> String {
        format!(
            "{:<24} {:<16} {:>12} {:>8} {:>8} {:>16}",
            "channel", "packet", "bytes", "putting", "getting", "memory of a put"
        )
    }
}

impl fmt::Display for ListedChannel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:<24} {:<16} {:>12} {:>8} {:>8} {:>16}{}",
            self.id,
            self.packet,
            self.packet_bytes,
            format!("{}/{}", self.put_ports, self.max_put_ports),
            format!("{}/{}", self.get_ports, self.max_get_ports),
            format!("{:.1} KiB", self.put_port_bytes as f64 / 1024.0),
            if self.distributed {
                "  other hosts"
            } else {
                ""
            },
        )
    }
}

/// Returns the channels of `table`, in its order.
///
/// # Errors
/// As [`Bus::states`].
pub fn list_channels(bus: &Bus, table: &Table) -> Result<Vec<ListedChannel>, ChannelError> {
    let states = bus.states()?;
    let channels = table.channels.iter().zip(&states);
    Ok(channels
        .map(|((id, channel), state)| ListedChannel {
            id: id.clone(),
            packet: channel.packet.clone(),
            packet_bytes: channel.packet_bytes(),
            put_ports: state.put_ports,
            max_put_ports: channel.put_ports,
            get_ports: state.get_ports,
            max_get_ports: channel.get_ports,
            put_port_bytes: channel.put_port_bytes(),
            distributed: channel.distributed,
        })
        .collect())
}
