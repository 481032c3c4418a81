//! The table of channels: every resource is known before the first packet.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::packet::{Header, blocks};
use crate::{ChannelError, ChannelId, Packet};

/// All channels of a bus, as every component and the hub read it from one TOML file.
///
/// ```
/// let table = tactnet_channel::Table::parse(r#"
///     bus = "justin"
///     [channels."skin/right"]
///     packet = "SkinFrame"
///     item_bytes = 80
///     depth = 64          # packets that wait at a get-port before the oldest is lost
///     get_ports = 8
/// "#)?;
/// assert_eq!(table.channel("skin/right")?.items, 1);
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Name of the bus; buses of different names never meet.
    pub bus: String,
    /// How this host meets others.
    #[serde(default)]
    pub network: Network,
    /// By id.
    pub channels: BTreeMap<String, ChannelConfig>,
    /// Settings of components, by their names; the bus itself does not read them.
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub components: toml::Table,
}

/// Endpoints of the hub, like `tcp/10.0.0.2:7447`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// Tells hosts apart that share one machine's memory, in tests; usually empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub host: String,
    /// Where the hub waits for others.
    #[serde(default)]
    pub listen: Vec<String>,
    /// Hubs to connect to. Hubs do not pass on what they get: each names, or is named by, all that it exchanges packets with.
    #[serde(default)]
    pub connect: Vec<String>,
    /// For `tls/` endpoints: file (PEM) with the certificate of who vouches for this robot's hosts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub authority: Option<PathBuf>,
    /// This host's certificate (PEM); its common name is what [`ChannelConfig::put_from`] and [`ChannelConfig::get_from`] of other hosts call
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certificate: Option<PathBuf>,
    /// The certificate's private key (PEM).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub private_key: Option<PathBuf>,
    /// Endpoints without TLS may be beyond this machine: whoever reaches them reads and puts what they like.
    #[serde(default, skip_serializing_if = "is_false")]
    pub plain_text: bool,
}

impl Network {
    /// Returns true if its endpoints are encrypted, and both sides show a certificate.
    pub(crate) fn has_tls(&self) -> bool {
        self.endpoints().any(|endpoint| endpoint.starts_with(TLS))
    }

    pub(crate) fn endpoints(&self) -> impl Iterator<Item = &String> {
        self.listen.iter().chain(&self.connect)
    }

    /// Checks that nothing beyond this machine is without TLS, unless that was asked for.
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
                    "network: `{endpoint}` is beyond this machine and neither encrypted nor restricted; use `{TLS}…` with `authority`, `certificate` \
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

/// How endpoints begin that are encrypted.
const TLS: &str = "tls/";

/// Returns true for `tcp/127.0.0.1:7447` and its like.
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

/// One channel's resources; all static.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelConfig {
    /// [`Packet::NAME`]
    pub packet: String,
    /// [`Packet::VERSION`]
    #[serde(default = "one_u32")]
    pub version: u32,
    /// Size of one item, bytes.
    pub item_bytes: usize,
    /// Most items of one packet.
    #[serde(default = "one")]
    pub items: usize,
    /// Packets of one put-port that wait at a get-port; when one more comes, the oldest is lost and counted.
    #[serde(default = "sixteen")]
    pub depth: usize,
    /// Most put-ports.
    #[serde(default = "one")]
    pub put_ports: usize,
    /// Most get-ports.
    #[serde(default = "eight")]
    pub get_ports: usize,
    /// Last packets of every put-port that a late joiner can have.
    #[serde(default)]
    pub history: usize,
    /// Packets of one put-port that a get-port may hold at once.
    #[serde(default = "two")]
    pub held: usize,
    /// Packets that a put-port may have on loan at once.
    #[serde(default = "one")]
    pub loaned: usize,
    /// Other hosts get its packets.
    #[serde(default)]
    pub distributed: bool,
    /// Policy when the network is slower than the putters.
    #[serde(default)]
    pub congestion: Congestion,
    /// Hosts whose packets are taken, by the common names of their certificates; none named: every host's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub put_from: Vec<String>,
    /// Hosts that may have its packets; none named: every host.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub get_from: Vec<String>,
    /// Most packets a second that are taken from all other hosts together; more are lost.
    #[serde(default = "ten_thousand", skip_serializing_if = "is_ten_thousand")]
    pub remote_rate: u32,
}

/// Policy when the network is slower than the putters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Congestion {
    /// Wait: the hub falls behind and the oldest packets of the channel are lost at its get-port, counted. For control.
    Block,
    /// Drop what cannot be sent at once. For bulk.
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
    /// A channel of packets of at most `items` items, one put-port and eight get-ports.
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

    /// Most data of a packet, bytes.
    pub fn packet_bytes(&self) -> usize {
        self.item_bytes * self.items
    }

    /// Packets that the memory of one put-port holds: what waits and is held at every get-port, history and loans.
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

    /// Shared memory of one put-port, bytes: slots, each with its headers.
    pub fn put_port_bytes(&self) -> u64 {
        let headers = size_of::<Header>().next_multiple_of(64) + 64;
        (self.slots() * (64 * blocks(self.packet_bytes()) + headers)) as u64
    }

    /// Get-ports of clients, and the hub's where it forwards.
    pub(crate) fn total_get_ports(&self) -> usize {
        self.get_ports + usize::from(self.distributed)
    }

    /// Put-ports of clients, and the hub's where it delivers.
    pub(crate) fn total_put_ports(&self) -> usize {
        self.put_ports + usize::from(self.distributed)
    }

    /// Returns its packet and length in words.
    pub(crate) fn describe(&self) -> String {
        describe(&self.packet, self.version, self.item_bytes)
    }
}

pub(crate) fn describe(name: &str, version: u32, item_bytes: usize) -> String {
    format!("`{name}` version {version} of {item_bytes} bytes")
}

impl Table {
    /// A bus without channels.
    pub fn new(bus: &str) -> Self {
        Self {
            bus: bus.into(),
            network: Network::default(),
            channels: BTreeMap::new(),
            components: toml::Table::new(),
        }
    }

    /// With one more channel.
    #[must_use]
    pub fn with(mut self, id: &str, channel: ChannelConfig) -> Self {
        self.channels.insert(id.into(), channel);
        self
    }

    /// Reads a table.
    ///
    /// # Errors
    /// A file that cannot be read, or what is wrong with it.
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
    /// A table that is no TOML, or has values out of range.
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

    /// Checks that every number is in range.
    pub(crate) fn check(&self) -> Result<(), String> {
        // Both become parts of file names.
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
                    "channel `{id}`: put_from, get_from: hosts are known by their certificates, so all endpoints must be `{TLS}…`"
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

    /// One channel.
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

    /// As TOML.
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
            (
                "connect = [\"tcp/10.0.0.2:7447\"]",
                "neither encrypted nor restricted",
            ),
            (
                "listen = [\"tcp/0.0.0.0:7447\"]",
                "neither encrypted nor restricted",
            ),
            (
                "listen = [\"udp/[::]:7447\"]",
                "neither encrypted nor restricted",
            ),
            (
                "connect = [\"tcp/localhost.evil.example:7447\"]",
                "neither encrypted nor restricted",
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
        assert!(found.contains("known by their certificates"), "{found}");
    }

    #[test]
    fn a_table_is_what_it_says() {
        let table = Table::new("lab").with("a/b", ChannelConfig::of::<f32>(3));
        assert_eq!(Table::parse(&table.to_toml()).unwrap(), table);
        assert_eq!(table.channel("a/b").unwrap().packet_bytes(), 12);
        let unknown = table.channel("a").unwrap_err().to_string();
        assert_eq!(unknown, "channel `a` is not in the table; it names a/b");
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
                "no channel id",
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
