//! Reading of waiting packets: all of them, or only the latest.

use std::time::Duration;

use tactnet_channel::{Bus, ChannelError, GetPort, Packet, Received, Start, Wait};

/// Maximum sleep of a process, which bounds its reaction time to a stop request.
pub(crate) const PATIENCE: Wait = Wait::Block {
    timeout: Duration::from_millis(50),
};

/// Calls `take` for each element of all waiting packets.
///
/// # Errors
/// The same as [`GetPort::try_get`].
pub fn drain<T: Packet>(port: &GetPort<T>, mut take: impl FnMut(&T)) -> Result<(), ChannelError> {
    while let Some(packet) = port.try_get()? {
        packet.iter().for_each(&mut take);
    }
    Ok(())
}

/// Latest packet of a channel.
pub(crate) struct LatestValue<T> {
    port: GetPort<T>,
    last: Option<T>,
    put_ns: u64,
}

impl<T: Packet + Copy> LatestValue<T> {
    pub fn open(bus: &Bus, id: &str) -> Result<Self, ChannelError> {
        Self::open_from(bus, id, Start::Now)
    }

    pub fn open_from(bus: &Bus, id: &str, start: Start) -> Result<Self, ChannelError> {
        Ok(Self {
            port: bus.get_port(id, start)?,
            last: None,
            put_ns: 0,
        })
    }

    /// Takes all waiting packets and returns true if there was at least one.
    pub fn look(&mut self) -> Result<bool, ChannelError> {
        let mut came = false;
        while let Some(packet) = self.port.try_get()? {
            self.take(&packet);
            came = true;
        }
        Ok(came)
    }

    fn take(&mut self, packet: &Received<T>) {
        self.put_ns = packet.header().put_ns;
        self.last = packet.first().copied().or(self.last);
    }

    /// Returns the latest packet, if any has arrived.
    pub fn get(&self) -> Option<&T> {
        self.last.as_ref()
    }

    /// Returns the time at which the latest packet was published, in ns of the host's monotonic clock; 0 before the
    /// first.
    pub fn put_ns(&self) -> u64 {
        self.put_ns
    }
}
