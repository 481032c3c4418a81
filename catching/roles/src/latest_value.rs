//! Reading and sending of packets: all waiting ones, or only the latest.

use std::time::Duration;

use tactnet_channel::{ChannelError, GetPort, Packet, PutPort, Wait};

/// Maximum sleep of a process, which bounds its reaction time to a stop request.
pub(crate) const PATIENCE: Wait = at_most(50);
/// Number of packets since the last look that are taken without allocation.
const NEW: usize = 16;

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

/// Packets of one output of a step, each of which may be missing.
pub(crate) trait Packets<T> {
    fn all(self) -> impl Iterator<Item = T>;
}

impl<T> Packets<T> for Option<T> {
    fn all(self) -> impl Iterator<Item = T> {
        self.into_iter()
    }
}

impl<T, const MOST: usize> Packets<T> for [Option<T>; MOST] {
    fn all(self) -> impl Iterator<Item = T> {
        self.into_iter().flatten()
    }
}

/// Sends those packets that there are.
pub(crate) fn send<T: Packet + Copy>(
    port: &PutPort<T>,
    packets: impl Packets<T>,
) -> Result<(), ChannelError> {
    packets
        .all()
        .try_for_each(|packet| port.put_copy(&[packet]).map(|_| ()))
}

/// Opens the channels of a step's outputs, and returns the function that sends the outputs on them.
macro_rules! sender {
    ($bus:expr, $outputs:ty { $($output:ident => $channel:ident),* $(,)? }) => {{
        $(let $output = $crate::channels::$channel.put($bus)?;)*
        move |outputs: $outputs| -> Result<(), $crate::RoleError> {
            $($crate::latest_value::send(&$output, outputs.$output)?;)*
            Ok(())
        }
    }};
}
pub(crate) use sender;

/// Waits for a packet and returns its first element; `None` if none arrives.
pub(crate) fn next<T: Packet + Copy>(port: &GetPort<T>) -> Result<Option<T>, ChannelError> {
    let packet = port.get(PATIENCE)?;
    Ok(packet.and_then(|packet| packet.first().copied()))
}

/// Returns a wait that ends after the given number of milliseconds.
pub(crate) const fn at_most(ms: u64) -> Wait {
    Wait::Block {
        timeout: Duration::from_millis(ms),
    }
}

/// Latest packet of a channel.
pub(crate) struct LatestValue<T> {
    pub port: GetPort<T>,
    last: Option<T>,
}

impl<T: Packet + Copy> LatestValue<T> {
    pub fn new(port: GetPort<T>) -> Self {
        Self { port, last: None }
    }

    /// Takes all waiting packets and returns the latest, if any has arrived.
    pub fn look(&mut self) -> Result<Option<&T>, ChannelError> {
        drain(&self.port, |packet| self.last = Some(*packet))?;
        Ok(self.last.as_ref())
    }

    /// Waits for a packet, and takes all waiting ones.
    pub fn wait(&mut self, wait: Wait) -> Result<Option<&T>, ChannelError> {
        if let Some(packet) = self.port.get(wait)? {
            self.last = packet.last().copied().or(self.last);
        }
        self.look()
    }
}

/// Packets of a channel since the last look.
pub(crate) struct NewPackets<T> {
    pub port: GetPort<T>,
    packets: Vec<T>,
}

impl<T: Packet + Copy> NewPackets<T> {
    pub fn new(port: GetPort<T>) -> Self {
        Self {
            port,
            packets: Vec::with_capacity(NEW),
        }
    }

    /// Takes all waiting packets and returns them.
    pub fn look(&mut self) -> Result<&[T], ChannelError> {
        self.packets.clear();
        self.look_on()
    }

    /// Waits for a packet, and takes all waiting ones.
    pub fn wait(&mut self, wait: Wait) -> Result<&[T], ChannelError> {
        self.packets.clear();
        if let Some(packet) = self.port.get(wait)? {
            self.packets.extend_from_slice(&packet);
        }
        self.look_on()
    }

    fn look_on(&mut self) -> Result<&[T], ChannelError> {
        drain(&self.port, |packet| self.packets.push(*packet))?;
        Ok(&self.packets)
    }

    /// Returns the number of lost packets.
    pub fn lost(&self) -> u64 {
        self.port.lost()
    }
}
