//! Channels of the classifier and the skin: names, packets and queue sizes.

use tactnet_channel::{ChannelConfig, Table};

use crate::ServeConfig;
use crate::packets::{ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus};
use crate::serve_config::SECTION;

impl ServeConfig {
    /// Returns a channel table of the bus `bus` with all channels of this service and its section.
    ///
    /// # Example
    /// ```
    /// use tactnet_skin::ServeConfig;
    ///
    /// let table = ServeConfig::default().table("robot");
    /// assert!(table.channels.contains_key("skin/right"));
    /// ```
    pub fn table(&self, bus: &str) -> Table {
        let frames = ChannelConfig {
            depth: 256,
            ..ChannelConfig::of::<SkinFrame>(1)
        };
        let mut table = Table::new(bus);
        for finger in &self.fingers {
            table = table.with(finger, frames.clone());
        }
        let mut table = table
            .with(
                &self.command,
                ChannelConfig {
                    put_ports: 4,
                    ..ChannelConfig::of::<SweepCommand>(1)
                },
            )
            .with(
                &self.belief,
                ChannelConfig {
                    depth: 64,
                    ..ChannelConfig::of::<TactileBelief>(1)
                },
            )
            .with(
                &self.status,
                ChannelConfig {
                    depth: 64,
                    ..ChannelConfig::of::<TactileStatus>(1)
                },
            )
            .with(
                &self.model,
                ChannelConfig {
                    history: 1,
                    ..ChannelConfig::of::<ModelNames>(1)
                },
            );
        let section = toml::Value::try_from(self)
            .unwrap_or_else(|error| panic!("settings are plain values: {error}"));
        table.components.insert(SECTION.into(), section);
        table
    }
}
