//! Packet type, channel id and packet header.

use std::fmt;

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};
use tactnet_packet::Packet;

use crate::ChannelError;

/// Packet type that is known only at run time; the same three values as in [`Packet`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PacketType<'a> {
    /// Name that both ends use.
    pub name: &'a str,
    /// Increased whenever layout or meaning changes.
    pub version: u32,
    /// Size of one item, in bytes.
    pub item_bytes: usize,
}

/// Name of a channel: 1 to 47 characters. It can be sent in packets, to tell a component which channel to use.
///
/// ```
/// use tactnet_channel::ChannelId;
///
/// let id = ChannelId::new("skin/right")?;
/// assert_eq!(id.as_str()?, "skin/right");
/// assert!(ChannelId::new("skin right").is_err());
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct ChannelId {
    /// Text, padded with zeros.
    text: [u8; 48],
}

impl ChannelId {
    /// Returns the id for a text like `skin/right`.
    ///
    /// # Errors
    /// Empty or too long text; characters other than letters, digits and `/_-.`.
    pub fn new(text: &str) -> Result<Self, ChannelError> {
        let allowed = |c: char| c.is_ascii_alphanumeric() || "/_-.".contains(c);
        if text.is_empty() || text.len() > 47 || !text.chars().all(allowed) {
            return Err(ChannelError::Id { found: text.into() });
        }
        let mut id = Self { text: [0; 48] };
        id.text[..text.len()].copy_from_slice(text.as_bytes());
        Ok(id)
    }

    /// Returns the text.
    ///
    /// # Errors
    /// Bytes that [`ChannelId::new`] did not create, from a faulty sender.
    pub fn as_str(&self) -> Result<&str, ChannelError> {
        let length = self.text.iter().position(|b| *b == 0).unwrap_or(48);
        match std::str::from_utf8(&self.text[..length]) {
            Ok(text) if Self::new(text).is_ok_and(|id| id == *self) => Ok(text),
            _ => Err(ChannelError::Id {
                found: String::from_utf8_lossy(&self.text).into_owned(),
            }),
        }
    }
}

impl fmt::Debug for ChannelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str().unwrap_or("(no channel)"))
    }
}

impl fmt::Display for ChannelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

impl Packet for ChannelId {
    const NAME: &'static str = "ChannelId";
    const VERSION: u32 = 1;
}

/// A name of a channel: text, or a [`ChannelId`] that was received in a packet.
pub trait AsChannelId {
    /// Returns the id.
    ///
    /// # Errors
    /// Text that is not a channel id.
    fn channel_id(self) -> Result<ChannelId, ChannelError>;
}

impl AsChannelId for &str {
    fn channel_id(self) -> Result<ChannelId, ChannelError> {
        ChannelId::new(self)
    }
}

impl AsChannelId for ChannelId {
    fn channel_id(self) -> Result<ChannelId, ChannelError> {
        Ok(self)
    }
}

/// Header that the channel layer adds to every packet.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable, ZeroCopySend)]
pub struct Header {
    /// Random number of the put-port; unchanged between hosts.
    pub sender: u64,
    /// Sequence number of the packet at its put-port, from 0.
    pub sequence: u64,
    /// Time of the put, in nanoseconds of the sending host's monotonic clock.
    pub put_ns: u64,
    /// Length of the data, in bytes.
    pub bytes: u64,
    /// Priority of the put-port, see [`Priority`].
    pub priority: u8,
    /// 1 if the packet came from another host, otherwise 0.
    pub remote: u8,
    pub(crate) reserved: [u8; 6],
}

/// Priority of a port, on a host as between hosts.
///
/// A get-port delivers waiting packets of put-ports of high priority first. A sync group names get-ports of high
/// priority first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u8)]
pub enum Priority {
    /// For images and recordings.
    Bulk = 0,
    /// For everything else.
    #[default]
    Normal = 1,
    /// For commands.
    High = 2,
    /// For control loops.
    RealTime = 3,
}

impl Priority {
    /// Returns the priority with this number; the highest for numbers above 3.
    ///
    /// ```
    /// use tactnet_channel::Priority;
    ///
    /// assert_eq!(Priority::from_number(Priority::High as u8), Priority::High);
    /// ```
    pub fn from_number(number: u8) -> Self {
        match number {
            0 => Self::Bulk,
            1 => Self::Normal,
            2 => Self::High,
            _ => Self::RealTime,
        }
    }
}

/// Unit of shared memory: one cache line, so packets start at cache lines.
#[repr(C)]
#[repr(align(64))]
#[derive(Debug, Clone, Copy, Pod, Zeroable, ZeroCopySend)]
pub(crate) struct Block([u8; 64]);

/// Returns the number of blocks for `bytes` bytes, at least one.
pub(crate) fn blocks(bytes: usize) -> usize {
    bytes.div_ceil(size_of::<Block>()).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_its_text() {
        let id = ChannelId::new("skin/right").unwrap();
        assert_eq!(id.as_str().unwrap(), "skin/right");
        assert_eq!(format!("{id}"), "skin/right");
        for wrong in ["", "a b", "ä", &"x".repeat(48)] {
            assert!(ChannelId::new(wrong).is_err(), "{wrong}");
        }
        let amok = ChannelId { text: [255; 48] };
        assert!(amok.as_str().is_err());
    }

    #[test]
    fn packets_start_at_cache_lines() {
        assert_eq!((size_of::<Block>(), align_of::<Block>()), (64, 64));
        assert_eq!((blocks(0), blocks(64), blocks(65)), (1, 1, 2));
        assert_eq!(size_of::<Header>(), 40);
    }
}
