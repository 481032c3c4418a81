//! Resources of one channel.

use serde::{Deserialize, Serialize};

use crate::packet::{Header, blocks};
use crate::{Packet, Priority};

fn ten_thousand() -> u32 {
    10_000
}

fn is_normal(priority: &Priority) -> bool {
    *priority == Priority::Normal
}

fn is_ten_thousand(value: &u32) -> bool {
    *value == ten_thousand()
}

/// Resources of one channel. All of them are static.
///
/// ```
/// use tactnet_channel::{ChannelConfig, Table};
///
/// let camera = ChannelConfig { depth: 2, distributed: true, ..ChannelConfig::of::<u8>(640 * 480) };
/// assert_eq!(camera.packet_bytes(), 307_200);
/// let table = Table::new("lab").with("camera/left", camera);
/// # assert!(Table::parse(&table.to_toml()).is_ok());
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelConfig {
    /// Name of the packet type, [`Packet::NAME`].
    pub packet: String,
    /// Version of the packet type, [`Packet::VERSION`].
    #[serde(default = "one_u32")]
    pub version: u32,
    /// Size of one item, in bytes.
    pub item_bytes: usize,
    /// Maximum number of items in a packet.
    #[serde(default = "one")]
    pub items: usize,
    /// Length of a get-port's ring for one put-port, in packets. The next packet replaces the oldest, which counts as
    /// lost.
    #[serde(default = "sixteen")]
    pub depth: usize,
    /// Maximum number of put-ports.
    #[serde(default = "one")]
    pub put_ports: usize,
    /// Maximum number of get-ports.
    #[serde(default = "eight")]
    pub get_ports: usize,
    /// Number of last packets of every put-port that a new get-port can request.
    #[serde(default)]
    pub history: usize,
    /// Maximum number of packets of one put-port that a get-port may hold at once.
    #[serde(default = "two")]
    pub held: usize,
    /// Maximum number of packets that a put-port may have on loan at once.
    #[serde(default = "one")]
    pub loaned: usize,
    /// True if other hosts receive its packets.
    #[serde(default)]
    pub distributed: bool,
    /// Policy if the network is slower than the putters.
    #[serde(default)]
    pub congestion: Congestion,
    /// Hosts whose packets are accepted, by the common names of their certificates. Empty: all hosts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub put_from: Vec<String>,
    /// Hosts that may receive its packets, by the common names of their certificates. Empty: all hosts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub get_from: Vec<String>,
    /// Priority of ports that name none.
    #[serde(default, skip_serializing_if = "is_normal")]
    pub priority: Priority,
    /// Maximum rate of packets from all other hosts together, per second. Further packets are dropped.
    #[serde(default = "ten_thousand", skip_serializing_if = "is_ten_thousand")]
    pub remote_rate: u32,
}

/// Policy if the network is slower than the putters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Congestion {
    /// Blocks the hub, which then falls behind: the oldest packets are lost at its get-port and counted. For control.
    Block,
    /// Drops packets that cannot be sent at once. For bulk data.
    #[default]
    Drop,
}

fn one() -> usize {
    1
}
fn one_u32() -> u32 {
    1
}
fn two() -> usize {
    2
}
fn eight() -> usize {
    8
}
fn sixteen() -> usize {
    16
}

impl ChannelConfig {
    /// Returns a channel for packets of at most `items` items, with one put-port and eight get-ports.
    pub fn of<T: Packet>(items: usize) -> Self {
        Self {
            packet: T::NAME.into(),
            version: T::VERSION,
            item_bytes: size_of::<T>(),
            items,
            depth: sixteen(),
            put_ports: one(),
            get_ports: eight(),
            history: 0,
            held: two(),
            loaned: one(),
            distributed: false,
            congestion: Congestion::default(),
            put_from: Vec::new(),
            get_from: Vec::new(),
            priority: Priority::Normal,
            remote_rate: ten_thousand(),
        }
    }

    /// Returns the maximum size of a packet, in bytes.
    pub fn packet_bytes(&self) -> usize {
        self.item_bytes * self.items
    }

    /// Returns the number of packets in the memory of one put-port: waiting and taken ones of every get-port, history
    /// and loans.
    pub fn slots(&self) -> usize {
        self.total_get_ports() * (self.depth + self.taken()) + self.history + self.loaned
    }

    fn slots_checked(&self) -> Option<usize> {
        let waiting = self.depth.checked_add(self.held)?.checked_add(1)?;
        self.get_ports
            .checked_add(1)?
            .checked_mul(waiting)?
            .checked_add(self.history)?
            .checked_add(self.loaned)
    }

    /// Returns the shared memory of one put-port, in bytes: all slots with their headers.
    pub fn put_port_bytes(&self) -> u64 {
        let headers = size_of::<Header>().next_multiple_of(64) + 64;
        (self.slots() * (64 * blocks(self.packet_bytes()) + headers)) as u64
    }

    /// Returns the number of get-ports, including the hub's for forwarding.
    pub(crate) fn total_get_ports(&self) -> usize {
        self.get_ports + usize::from(self.distributed)
    }

    /// Returns the number of put-ports, including the hub's for delivery, one for each priority.
    pub(crate) fn total_put_ports(&self) -> usize {
        self.put_ports + if self.distributed { 4 } else { 0 }
    }

    /// Returns true if a get-port may have to merge the packets of several put-ports.
    pub(crate) fn merges(&self) -> bool {
        self.total_put_ports() > 1
    }

    /// Returns the number of packets of one put-port that a get-port takes at most: those that it may hold, and the
    /// next one if it merges several put-ports.
    pub(crate) fn taken(&self) -> usize {
        self.held + usize::from(self.merges())
    }

    /// Checks that every value is in range.
    pub(crate) fn check(&self, id: &str) -> Result<(), String> {
        for (name, value) in [
            ("item_bytes", self.item_bytes),
            ("items", self.items),
            ("depth", self.depth),
            ("put_ports", self.put_ports),
            ("get_ports", self.get_ports),
            ("held", self.held),
            ("loaned", self.loaned),
        ] {
            if value == 0 {
                return Err(format!(
                    "channel `{id}`: {name}: expected at least 1, found 0"
                ));
            }
        }
        let most = self
            .item_bytes
            .checked_mul(self.items)
            .filter(|bytes| *bytes <= 1 << 40)
            .and_then(|_| self.slots_checked())
            .and_then(|slots| slots.checked_mul(self.packet_bytes() + 256))
            .filter(|bytes| *bytes <= 1 << 46);
        if most.is_none() {
            return Err(format!(
                "channel `{id}`: a put-port would need more than 64 TiB"
            ));
        }
        if self.history > self.depth {
            return Err(format!(
                "channel `{id}`: history: expected at most its depth, {}, found {}",
                self.depth, self.history
            ));
        }
        Ok(())
    }

    /// Returns a description of the packet type.
    pub(crate) fn describe(&self) -> String {
        describe(&self.packet, self.version, self.item_bytes)
    }
}

pub(crate) fn describe(name: &str, version: u32, item_bytes: usize) -> String {
    format!("`{name}` version {version} of {item_bytes} bytes")
}
