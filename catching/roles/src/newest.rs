//! Get-ports of which only the newest packet counts.

use std::time::Duration;

use tactnet_channel::{Bus, ChannelError, GetPort, Packet, Received, Start, Wait};

/// How long a process sleeps at most before it looks whether it is to end.
pub(crate) const PATIENCE: Wait = Wait::Block {
    timeout: Duration::from_millis(50),
};

/// The newest packet of a channel.
pub(crate) struct Newest<T> {
    port: GetPort<T>,
    last: Option<T>,
    put_ns: u64,
}

impl<T: Packet + Copy> Newest<T> {
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

    /// Takes what has come, and returns true if there was something.
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

    /// Returns the newest so far.
    pub fn get(&self) -> Option<&T> {
        self.last.as_ref()
    }

    /// Returns when the newest was put, nanoseconds of the host's monotonic clock; 0: never.
    pub fn put_ns(&self) -> u64 {
        self.put_ns
    }
}
