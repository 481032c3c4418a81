//! List of the channels of a bus, for tools.

use serde::Serialize;

use crate::{Bus, ChannelError, Table};

/// A channel of the table with the number of its connected ports.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ListedChannel {
    /// Id of the channel.
    pub id: String,
    /// Name of the packet type.
    pub packet: String,
    /// Size of the largest packet, in bytes.
    pub packet_bytes: usize,
    /// Connected put-ports, including the hub's.
    pub put_ports: usize,
    /// Maximum number of put-ports.
    #[serde(rename = "put_ports_most")]
    pub max_put_ports: usize,
    /// Connected get-ports, including the hub's.
    pub get_ports: usize,
    /// Maximum number of get-ports.
    #[serde(rename = "get_ports_most")]
    pub max_get_ports: usize,
    /// Shared memory of one put-port, in bytes.
    pub put_port_bytes: u64,
    /// True for a channel that is shared with other hosts.
    pub distributed: bool,
}

/// Returns the channels of `table`, in its order.
///
/// # Errors
/// The same as [`Bus::states`].
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
