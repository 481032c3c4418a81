//! Table of channels. It fixes every resource before the first packet.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::packet::{Header, blocks};
use crate::{ChannelError, ChannelId, Packet};

/// All channels of a bus. Every component and the hub read the same TOML file.
///
/// ```
/// let table = tactnet_channel::Table::parse(r#"
///     bus = "justin"
///     [channels."skin/right"]
///     packet = "SkinFrame"
///     item_bytes = 80
///     depth = 64          # packets in a get-port's ring; the next one replaces the oldest
///     get_ports = 8
/// "#)?;
/// assert_eq!(table.channel("skin/right")?.items, 1);
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Name of the bus. Buses of different names are separate.
    pub bus: String,
    /// Connection to other hosts.
    #[serde(default)]
    pub network: Network,
    /// Channels by id.
    pub channels: BTreeMap<String, ChannelConfig>,
    /// Settings of components by name. The bus does not read them.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub components: toml::Table,
}

/// Endpoints of the hub, like `tcp/10.0.0.2:7447`, and its certificates.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// Suffix that separates several hosts on one machine, for tests; usually empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub host: String,
    /// Endpoints that the hub listens on.
    #[serde(default)]
    pub listen: Vec<String>,
    /// Endpoints of other hubs to connect to.
    ///
    /// Hubs do not forward received packets: every pair of hubs that exchanges packets needs a direct connection.
    #[serde(default)]
    pub connect: Vec<String>,
    /// For `tls/` endpoints: PEM file with the certificate authority of this robot's hosts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub authority: Option<PathBuf>,
    /// PEM file with this host's certificate. [`ChannelConfig::put_from`] and [`ChannelConfig::get_from`] of other
    /// hosts use its common name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certificate: Option<PathBuf>,
    /// PEM file with the private key of the certificate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub private_key: Option<PathBuf>,
    /// Allows endpoints without TLS beyond this machine. Every computer that reaches them can then read and put
    /// packets.
    #[serde(default, skip_serializing_if = "is_false")]
    pub plain_text: bool,
}

impl Network {
    /// Returns true if the endpoints are encrypted and both sides show a certificate.
    pub(crate) fn has_tls(&self) -> bool {
        self.endpoints().any(|endpoint| endpoint.starts_with(TLS))
    }

    pub(crate) fn endpoints(&self) -> impl Iterator<Item = &String> {
        self.listen.iter().chain(&self.connect)
    }

    /// Checks that endpoints beyond this machine use TLS, unless plain text is allowed.
    fn check(&self) -> Result<(), String> {
        let (mut tls, mut plain) = (None, None);
        for endpoint in self.endpoints() {
            if endpoint.starts_with(TLS) {
                tls = Some(endpoint);
            } else {
                plain = Some(endpoint);
            }
            if !(endpoint.starts_with(TLS) || self.plain_text || is_loopback(endpoint)) {
                return Err(format!(
                    "network: `{endpoint}` leaves this machine without encryption or access control; use `{TLS}…` with `authority`, `certificate` \
                     and `private_key`, or allow it by `plain_text = true`"
                ));
            }
        }
        if let (Some(tls), Some(plain)) = (tls, plain) {
            return Err(format!(
                "network: expected all endpoints with TLS or none, found `{tls}` and `{plain}`"
            ));
        }
        for (name, file) in [
            ("authority", &self.authority),
            ("certificate", &self.certificate),
            ("private_key", &self.private_key),
        ] {
            if let (Some(endpoint), None) = (tls, file) {
                return Err(format!("network: `{endpoint}` needs `{name}`, a PEM file"));
            }
        }
        Ok(())
    }
}

/// Prefix of encrypted endpoints.
const TLS: &str = "tls/";

/// Returns true for endpoints of this machine, like `tcp/127.0.0.1:7447`.
fn is_loopback(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map_or(endpoint, |(_, rest)| rest);
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost"
        || host
            .parse()
            .is_ok_and(|address: std::net::IpAddr| address.is_loopback())
}

fn is_false(value: &bool) -> bool {
    !value
}

fn ten_thousand() -> u32 {
    10_000
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
            remote_rate: ten_thousand(),
        }
    }

    /// Returns the maximum size of a packet, in bytes.
    pub fn packet_bytes(&self) -> usize {
        self.item_bytes * self.items
    }

    /// Returns the number of packets in the memory of one put-port: waiting and held ones of every get-port, history
    /// and loans.
    pub fn slots(&self) -> usize {
        self.total_get_ports() * (self.depth + self.held) + self.history + self.loaned
    }

    fn slots_checked(&self) -> Option<usize> {
        let waiting = self.depth.checked_add(self.held)?;
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

    /// Returns the number of put-ports, including the hub's for delivery.
    pub(crate) fn total_put_ports(&self) -> usize {
        self.put_ports + usize::from(self.distributed)
    }

    /// Returns a description of the packet type.
    pub(crate) fn describe(&self) -> String {
        describe(&self.packet, self.version, self.item_bytes)
    }
}

pub(crate) fn describe(name: &str, version: u32, item_bytes: usize) -> String {
    format!("`{name}` version {version} of {item_bytes} bytes")
}

impl Table {
    /// Creates a bus without channels.
    pub fn new(bus: &str) -> Self {
        Self {
            bus: bus.into(),
            network: Network::default(),
            channels: BTreeMap::new(),
            components: toml::Table::new(),
        }
    }

    /// Adds a channel.
    #[must_use]
    pub fn with(mut self, id: &str, channel: ChannelConfig) -> Self {
        self.channels.insert(id.into(), channel);
        self
    }

    /// Reads a table from a file.
    ///
    /// # Errors
    /// The file cannot be read, or the table is wrong.
    pub fn load(path: &Path) -> Result<Self, ChannelError> {
        let text = std::fs::read_to_string(path).map_err(|source| ChannelError::Io {
            path: path.into(),
            action: "read the table",
            source,
        })?;
        Self::from_toml(&text).map_err(|reason| ChannelError::Table {
            path: path.display().to_string(),
            reason,
        })
    }

    /// Reads a table from its text.
    ///
    /// # Errors
    /// Text that is not TOML; values out of range.
    ///
    /// ```
    /// let wrong = tactnet_channel::Table::parse("bus = \"a b\"\n[channels]");
    /// assert!(wrong.unwrap_err().to_string().contains("expected 1 to 24 letters"));
    /// ```
    pub fn parse(text: &str) -> Result<Self, ChannelError> {
        Self::from_toml(text).map_err(|reason| ChannelError::Table {
            path: "table".into(),
            reason,
        })
    }

    fn from_toml(text: &str) -> Result<Self, String> {
        let table: Self = toml::from_str(text).map_err(|error| {
            let line = error
                .span()
                .map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            format!("line {line}: {}", error.message())
        })?;
        table.check()?;
        Ok(table)
    }

    /// Checks that every value is in range.
    pub(crate) fn check(&self) -> Result<(), String> {
        // Both are parts of file names.
        for (item, least, name) in [
            ("bus", 1, &self.bus),
            ("network.host", 0, &self.network.host),
        ] {
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
            if !(least..=24).contains(&name.len()) || !name.chars().all(plain) {
                return Err(format!(
                    "{item}: expected {least} to 24 letters, digits or `-`, found `{}`",
                    name.escape_debug()
                ));
            }
        }
        self.network.check()?;
        for (id, channel) in &self.channels {
            ChannelId::new(id).map_err(|error| error.to_string())?;
            let is_restricted = !(channel.put_from.is_empty() && channel.get_from.is_empty());
            let is_open = self.network.endpoints().next().is_some() && !self.network.has_tls();
            if is_restricted && is_open {
                return Err(format!(
                    "channel `{id}`: put_from, get_from: hosts are identified by certificates, so all endpoints must be `{TLS}…`"
                ));
            }
            for (name, value) in [
                ("item_bytes", channel.item_bytes),
                ("items", channel.items),
                ("depth", channel.depth),
                ("put_ports", channel.put_ports),
                ("get_ports", channel.get_ports),
                ("held", channel.held),
                ("loaned", channel.loaned),
            ] {
                if value == 0 {
                    return Err(format!(
                        "channel `{id}`: {name}: expected at least 1, found 0"
                    ));
                }
            }
            let most = channel
                .item_bytes
                .checked_mul(channel.items)
                .filter(|bytes| *bytes <= 1 << 40)
                .and_then(|_| channel.slots_checked())
                .and_then(|slots| slots.checked_mul(channel.packet_bytes() + 256))
                .filter(|bytes| *bytes <= 1 << 46);
            if most.is_none() {
                return Err(format!(
                    "channel `{id}`: a put-port would need more than 64 TiB"
                ));
            }
            if channel.history > channel.depth {
                return Err(format!(
                    "channel `{id}`: history: expected at most its depth, {}, found {}",
                    channel.depth, channel.history
                ));
            }
        }
        Ok(())
    }

    /// Returns the prefix of its files on this host.
    pub(crate) fn local_name(&self) -> String {
        format!("{}{}", self.bus, self.network.host)
    }

    /// Returns one channel.
    ///
    /// # Errors
    /// The table has no such channel.
    pub fn channel(&self, id: &str) -> Result<&ChannelConfig, ChannelError> {
        self.channels
            .get(id)
            .ok_or_else(|| ChannelError::NoSuchChannel {
                id: id.into(),
                known: self
                    .channels
                    .keys()
                    .map(String::as_str)
                    .collect::<Vec<_>>()
                    .join(", "),
            })
    }

    /// Returns the table as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).unwrap_or_else(|error| panic!("a table is TOML: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_leaves_this_machine_in_plain_text_unless_that_was_asked_for() {
        let check = |network: &str, channel: &str| {
            Table::parse(&format!(
                "bus = \"a\"\n[network]\n{network}\n[channels.a]\npacket = \"u8\"\nitem_bytes = 1\n{channel}"
            ))
            .map_err(|error| error.to_string())
        };
        let keys = "authority = \"a\"\ncertificate = \"b\"\nprivate_key = \"c\"";
        for allowed in [
            "listen = [\"tcp/127.0.0.1:7447\", \"tcp/[::1]:7447\"]\nconnect = [\"tcp/localhost:1\"]".to_owned(),
            "listen = [\"tcp/10.0.0.2:7447\"]\nplain_text = true".into(),
            format!("listen = [\"tls/10.0.0.2:7447\"]\n{keys}"),
        ] {
            check(&allowed, "").unwrap();
        }
        for (refused, why) in [
            ("connect = [\"tcp/10.0.0.2:7447\"]", "without encryption"),
            ("listen = [\"tcp/0.0.0.0:7447\"]", "without encryption"),
            ("listen = [\"udp/[::]:7447\"]", "without encryption"),
            (
                "connect = [\"tcp/localhost.evil.example:7447\"]",
                "without encryption",
            ),
            (
                "listen = [\"tls/10.0.0.2:7447\"]\nauthority = \"a\"",
                "needs `certificate`",
            ),
            (
                &format!(
                    "listen = [\"tls/10.0.0.2:7447\"]\nconnect = [\"tcp/127.0.0.1:1\"]\n{keys}"
                ),
                "all endpoints with TLS or none",
            ),
        ] {
            let found = check(refused, "").unwrap_err();
            assert!(found.contains(why), "{refused}: {found}");
        }
        let open = "listen = [\"tcp/127.0.0.1:7447\"]";
        let found = check(open, "put_from = [\"arm\"]").unwrap_err();
        assert!(found.contains("identified by certificates"), "{found}");
    }

    #[test]
    fn a_table_is_what_it_says() {
        let table = Table::new("lab").with("a/b", ChannelConfig::of::<f32>(3));
        assert_eq!(Table::parse(&table.to_toml()).unwrap(), table);
        assert_eq!(table.channel("a/b").unwrap().packet_bytes(), 12);
        let unknown = table.channel("a").unwrap_err().to_string();
        assert_eq!(
            unknown,
            "channel `a` is not in the table; the table contains a/b"
        );
    }

    #[test]
    fn wrong_tables_are_refused_with_the_reason() {
        for (text, reason) in [
            ("bus = \"a b\"\n[channels]", "bus: expected"),
            (
                "bus = \"a\"\n[network]\nhost = \"../x\"\n[channels]",
                "network.host: expected 0 to 24",
            ),
            (
                "bus = \"a\"\n[channels.\"x y\"]\npacket=\"u8\"\nitem_bytes=1",
                "is not a channel id",
            ),
            (
                "bus = \"a\"\n[channels.x]\npacket=\"u8\"\nitem_bytes=0",
                "item_bytes: expected at least 1",
            ),
            (
                "bus = \"a\"\n[channels.x]\npacket=\"u8\"\nitem_bytes=1\nhistory=17",
                "at most its depth, 16",
            ),
            (
                "bus = \"a\"\n[channels.x]\npacket=\"u8\"\nitem_bytes=1\nsize=3",
                "line 5: unknown field `size`",
            ),
        ] {
            let error = Table::parse(text).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
    }

    #[test]
    fn the_memory_of_a_port_is_known_in_advance() {
        let huge = ChannelConfig {
            item_bytes: 16,
            items: 1 << 60,
            ..ChannelConfig::of::<u8>(1)
        };
        assert!(
            Table::new("a")
                .with("x", huge)
                .check()
                .unwrap_err()
                .contains("64 TiB")
        );
        let channel = ChannelConfig {
            get_ports: 2,
            depth: 3,
            held: 1,
            history: 1,
            ..ChannelConfig::of::<u8>(100)
        };
        assert_eq!(channel.slots(), 2 * 4 + 1 + 1);
        assert_eq!(channel.put_port_bytes(), 10 * (128 + 128));
    }
}
