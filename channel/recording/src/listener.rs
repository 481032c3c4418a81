//! All channels of the classifier, followed by one thread.

use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use tactnet_channel::{Bus, GetPort, GetSide, Packet, Start, SyncGroup, Table, Wait, now_ns};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus};

use crate::messages::Recordable;
use crate::{RecordedPacket, RecordingError};

/// Maximum number of packets taken from a channel before the next channel has its turn.
const MAX_PACKETS: usize = 256;

/// Follows the channels of the classifier. If the caller is too slow, the rings keep the newest packets and count lost
/// ones.
pub struct Listener {
    group: SyncGroup,
    fingers: Vec<GetPort<SkinFrame>>,
    commands: GetPort<SweepCommand>,
    beliefs: GetPort<TactileBelief>,
    status: GetPort<TactileStatus>,
    model: GetPort<ModelNames>,
    channels: Vec<(Arc<str>, &'static str)>,
    /// Zero of the channels' clock, in nanoseconds since 1970.
    epoch_ns: u64,
}

/// A received packet.
#[derive(Debug, Clone)]
pub struct LivePacket {
    /// Index of its channel in [`Listener::channels`].
    pub channel: usize,
    /// Time of the put, in nanoseconds since 1970.
    pub put_ns: u64,
    /// The packet.
    pub packet: RecordedPacket,
}

impl Listener {
    /// Opens the channels.
    ///
    /// # Errors
    /// No hub runs; the table lacks a channel.
    pub fn open(bus: &Bus, table: &Table) -> Result<Self, RecordingError> {
        let config = ServeConfig::of(table)?;
        let fingers = config
            .fingers
            .iter()
            .map(|id| bus.get_port::<SkinFrame>(id.as_str(), Start::Now))
            .collect::<Result<Vec<_>, _>>()?;
        let commands = bus.get_port(config.command.as_str(), Start::Now)?;
        let beliefs = bus.get_port(config.belief.as_str(), Start::Now)?;
        let status = bus.get_port(config.status.as_str(), Start::Now)?;
        // The classifier puts it once, when it starts.
        let model = bus.get_port(config.model.as_str(), Start::History(1))?;
        let mut sides: Vec<&dyn GetSide> = fingers.iter().map(|f| f as &dyn GetSide).collect();
        sides.extend([&commands as &dyn GetSide, &beliefs, &status, &model]);
        let group = bus.sync_group(&sides)?;
        let skins = config
            .fingers
            .iter()
            .map(|id| (id.as_str().into(), SkinFrame::MESSAGE));
        let others = [
            (config.command.as_str().into(), SweepCommand::MESSAGE),
            (config.belief.as_str().into(), TactileBelief::MESSAGE),
            (config.status.as_str().into(), TactileStatus::MESSAGE),
            (config.model.as_str().into(), ModelNames::MESSAGE),
        ];
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        Ok(Self {
            group,
            channels: skins.chain(others).collect(),
            fingers,
            commands,
            beliefs,
            status,
            model,
            epoch_ns: since
                .map_or(0, |since| since.as_nanos() as u64)
                .saturating_sub(now_ns()),
        })
    }

    /// Returns the ids of the channels (fingers first) and the full names of their messages.
    pub fn channels(&self) -> &[(Arc<str>, &'static str)] {
        &self.channels
    }

    /// Returns the time of day by the channels' clock, in nanoseconds since 1970.
    pub fn now_ns(&self) -> u64 {
        self.epoch_ns + now_ns()
    }

    /// Waits for packets, at most for `patience`.
    ///
    /// # Errors
    /// The channels have failed.
    pub fn wait(&mut self, patience: Duration) -> Result<(), RecordingError> {
        Ok(self
            .group
            .wait(Wait::Block { timeout: patience })
            .map(drop)?)
    }

    /// Passes on received packets, a limited number of each channel, so that no channel waits long for the others.
    ///
    /// # Errors
    /// The channels have failed.
    pub fn follow(&self, mut each: impl FnMut(LivePacket)) -> Result<(), RecordingError> {
        let fingers = self.fingers.len();
        // Ordered by cause: names first, then commands, frames and beliefs.
        let model = |packet: ModelNames| RecordedPacket::Model(packet.into());
        self.take(fingers + 3, &self.model, model, &mut each)?;
        self.take(fingers, &self.commands, RecordedPacket::Command, &mut each)?;
        let frame = |packet: SkinFrame| RecordedPacket::Frame(packet.into());
        for (channel, port) in self.fingers.iter().enumerate() {
            self.take(channel, port, frame, &mut each)?;
        }
        let belief = |packet: TactileBelief| RecordedPacket::Belief(packet.into());
        self.take(fingers + 1, &self.beliefs, belief, &mut each)?;
        let status = |packet: TactileStatus| RecordedPacket::Status(packet.into());
        self.take(fingers + 2, &self.status, status, &mut each)
    }

    fn take<T: Packet + Copy>(
        &self,
        channel: usize,
        port: &GetPort<T>,
        of: impl Fn(T) -> RecordedPacket,
        each: &mut impl FnMut(LivePacket),
    ) -> Result<(), RecordingError> {
        for _ in 0..MAX_PACKETS {
            let Some(packets) = port.try_get()? else {
                break;
            };
            let header = *packets.header();
            // The clock of another host has another zero.
            let put_ns = if header.remote == 0 {
                header.put_ns
            } else {
                now_ns()
            };
            for packet in &*packets {
                each(LivePacket {
                    channel,
                    put_ns: self.epoch_ns + put_ns,
                    packet: of(*packet),
                });
            }
        }
        Ok(())
    }

    /// Returns the number of packets that were put and never arrived.
    pub fn lost(&self) -> u64 {
        self.fingers.iter().map(GetPort::lost).sum::<u64>()
            + self.commands.lost()
            + self.beliefs.lost()
            + self.status.lost()
            + self.model.lost()
    }
}
