//! What travels beside a packet: its type, its channel's name, its header.

use std::fmt;

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;
use tactnet_packet::Packet;

use crate::ChannelError;

/// What [`Packet`] says of a type, where there is no type: in other languages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PacketType<'a> {
    /// Name that both ends know it by.
    pub name: &'a str,
    /// Raised whenever layout or meaning changes.
    pub version: u32,
    /// Size of one item.
    pub item_bytes: usize,
}

/// Name of a channel: at most 47 bytes of text. It is a packet itself, so that a component can be told where to listen.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct ChannelId {
    /// Text, filled up with zeros.
    text: [u8; 48],
}

impl ChannelId {
    /// From its text, like `skin/right`.
    ///
    /// # Errors
    /// Empty or too long text; other characters than letters, digits and `/_-.`.
    pub fn new(text: &str) -> Result<Self, ChannelError> {
        let allowed = |c: char| c.is_ascii_alphanumeric() || "/_-.".contains(c);
        if text.is_empty() || text.len() > 47 || !text.chars().all(allowed) {
            return Err(ChannelError::Id { found: text.into() });
        }
        let mut id = Self { text: [0; 48] };
        id.text[..text.len()].copy_from_slice(text.as_bytes());
        Ok(id)
    }

    /// Its text.
    ///
    /// # Errors
    /// Bytes that [`ChannelId::new`] did not make, from a sender that runs amok.
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

/// The header that the layer itself puts before a packet.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable, ZeroCopySend)]
pub struct Header {
    /// Random number of the put-port; stays with the packet between hosts.
    pub sender: u64,
    /// Counts the packets of that put-port from 0.
    pub sequence: u64,
    /// When it was put, nanoseconds of the putting host's monotonic clock.
    pub put_ns: u64,
    /// Length of the data, bytes.
    pub bytes: u64,
    /// Communication priority of the put-port.
    pub priority: u8,
    /// 1 if it came from another host.
    pub remote: u8,
    pub(crate) reserved: [u8; 6],
}

/// How urgent a put-port's packets are. Between hosts they overtake less urgent ones; on a host the thread's own priority decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[repr(u8)]
pub enum Priority {
    /// Pictures, recordings.
    Bulk = 0,
    /// Everything else.
    #[default]
    Normal = 1,
    /// Commands.
    High = 2,
    /// Control loops.
    RealTime = 3,
}

/// Unit of shared memory: packets start at cache lines.
#[repr(C)]
#[repr(align(64))]
#[derive(Debug, Clone, Copy, Pod, Zeroable, ZeroCopySend)]
pub(crate) struct Block([u8; 64]);

/// Blocks for `bytes` bytes, at least one.
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
