//! Reading of all waiting packets, or of the latest one.

use crate::{ChannelError, GetPort, Packet, Wait};

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

/// Latest element of a channel.
///
/// ```
/// use tactnet_channel::{Bus, ChannelConfig, Domain, LatestValue, Priority, Start, Table};
///
/// let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(1));
/// let bus = Bus::open(Domain::Process, &table)?;
/// let mut force = LatestValue::new(bus.get_port::<f32>("force", Start::Now)?);
/// assert_eq!(force.look()?, None);
/// let put = bus.put_port::<f32>("force", Priority::Normal)?;
/// put.put_copy(&[2.5])?;
/// assert_eq!(force.look()?, Some(&2.5));
/// assert_eq!(force.look()?, Some(&2.5));
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
pub struct LatestValue<T> {
    /// Port of the channel.
    pub port: GetPort<T>,
    last: Option<T>,
}

impl<T: Packet + Copy> LatestValue<T> {
    /// Returns the latest value of a port.
    pub fn new(port: GetPort<T>) -> Self {
        Self { port, last: None }
    }

    /// Takes all waiting packets and returns the latest element, if any has arrived.
    ///
    /// # Errors
    /// The same as [`GetPort::try_get`].
    pub fn look(&mut self) -> Result<Option<&T>, ChannelError> {
        drain(&self.port, |packet| self.last = Some(*packet))?;
        Ok(self.last.as_ref())
    }

    /// Waits for a packet, and takes all waiting ones.
    ///
    /// # Errors
    /// The same as [`GetPort::get`].
    pub fn wait(&mut self, wait: Wait) -> Result<Option<&T>, ChannelError> {
        if let Some(packet) = self.port.get(wait)? {
            self.last = packet.last().copied().or(self.last);
        }
        self.look()
    }
}

/// Elements of a channel since the last look.
///
/// ```
/// use tactnet_channel::{Bus, ChannelConfig, Domain, NewPackets, Priority, Start, Table};
///
/// let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(1));
/// let bus = Bus::open(Domain::Process, &table)?;
/// let mut forces = NewPackets::new(bus.get_port::<f32>("force", Start::Now)?);
/// let put = bus.put_port::<f32>("force", Priority::Normal)?;
/// put.put_copy(&[2.5])?;
/// put.put_copy(&[3.5])?;
/// assert_eq!(forces.look()?, [2.5, 3.5]);
/// assert!(forces.look()?.is_empty());
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
pub struct NewPackets<T> {
    /// Port of the channel.
    pub port: GetPort<T>,
    packets: Vec<T>,
}

impl<T: Packet + Copy> NewPackets<T> {
    /// Returns the new elements of a port.
    pub fn new(port: GetPort<T>) -> Self {
        Self {
            port,
            packets: Vec::with_capacity(NEW),
        }
    }

    /// Takes all waiting packets and returns their elements.
    ///
    /// # Errors
    /// The same as [`GetPort::try_get`].
    pub fn look(&mut self) -> Result<&[T], ChannelError> {
        self.packets.clear();
        self.look_on()
    }

    /// Waits for a packet, and takes all waiting ones.
    ///
    /// # Errors
    /// The same as [`GetPort::get`].
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
