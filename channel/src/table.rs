//! Table of channels. It fixes every resource before the first packet.

mod channel_config;
mod network;

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{ChannelError, ChannelId};

pub(crate) use channel_config::describe;
pub use channel_config::{ChannelConfig, Congestion};
pub use network::Network;
use network::TLS;

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
            self.check_restrictions(id, channel)?;
            channel.check(id)?;
        }
        Ok(())
    }

    /// Checks that lists of allowed hosts come with certificates, which identify hosts.
    fn check_restrictions(&self, id: &str, channel: &ChannelConfig) -> Result<(), String> {
        let is_restricted = !(channel.put_from.is_empty() && channel.get_from.is_empty());
        let is_open = self.network.endpoints().next().is_some() && !self.network.has_tls();
        if is_restricted && is_open {
            return Err(format!(
                "channel `{id}`: put_from, get_from: hosts are identified by certificates, so all endpoints must be `{TLS}…`"
            ));
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
mod tests;
