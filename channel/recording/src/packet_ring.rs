//! Last packets of a channel, in memory that is reserved once.

use bytemuck::{Pod, Zeroable, bytes_of, pod_read_unaligned};

/// Time and sender of a packet in a ring.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(crate) struct PacketStamp {
    /// Time of the put, in nanoseconds since 1970.
    pub put_ns: u64,
    /// Random number of the put-port.
    pub sender: u64,
}

const STAMP: usize = size_of::<PacketStamp>();

/// Ring of packets of one size, each with its stamp. The next packet replaces the oldest.
pub(crate) struct PacketRing {
    slots: Box<[u8]>,
    /// Size of a slot: stamp and packet, in bytes.
    slot_bytes: usize,
    /// Number of packets since the start.
    written: u64,
    /// Time of the put of the last packet that was replaced; 0 before.
    replaced_ns: u64,
}

impl PacketRing {
    /// Reserves the memory: room for `most_packets`, but at most `most_bytes`, and at least one packet.
    pub fn new(packet_bytes: usize, most_packets: usize, most_bytes: usize) -> Self {
        let slot_bytes = STAMP + packet_bytes;
        let packets = most_packets.min(most_bytes / slot_bytes).max(1);
        // Other values than zero make the system provide the memory now.
        let slots = vec![1; packets * slot_bytes].into_boxed_slice();
        Self {
            slots,
            slot_bytes,
            written: 0,
            replaced_ns: 0,
        }
    }

    /// Returns the reserved memory, in bytes.
    pub fn bytes(&self) -> usize {
        self.slots.len()
    }

    fn slot(&self, number: u64) -> usize {
        let packets = (self.slots.len() / self.slot_bytes) as u64;
        (number % packets) as usize * self.slot_bytes
    }

    /// Adds a packet of the ring's size.
    pub fn push(&mut self, stamp: PacketStamp, packet: &[u8]) {
        if let Some((replaced, _)) = self.get(self.begin()).filter(|_| self.is_full()) {
            self.replaced_ns = replaced.put_ns;
        }
        let at = self.slot(self.written);
        let slot = &mut self.slots[at..at + self.slot_bytes];
        slot[..STAMP].copy_from_slice(bytes_of(&stamp));
        slot[STAMP..].copy_from_slice(packet);
        self.written += 1;
    }

    fn is_full(&self) -> bool {
        self.written - self.begin() == (self.slots.len() / self.slot_bytes) as u64
    }

    /// Returns the number of the oldest packet, from 0.
    pub fn begin(&self) -> u64 {
        let packets = (self.slots.len() / self.slot_bytes) as u64;
        self.written.saturating_sub(packets)
    }

    /// Returns the number of the next packet.
    pub fn end(&self) -> u64 {
        self.written
    }

    /// Returns a packet by its number; `None` if it is replaced or not there yet.
    pub fn get(&self, number: u64) -> Option<(PacketStamp, &[u8])> {
        if !(self.begin()..self.end()).contains(&number) {
            return None;
        }
        let at = self.slot(number);
        let slot = &self.slots[at..at + self.slot_bytes];
        Some((pod_read_unaligned(&slot[..STAMP]), &slot[STAMP..]))
    }

    /// Returns true if packets that were put at this time or later have been replaced.
    pub fn has_replaced_since(&self, time_ns: u64) -> bool {
        self.replaced_ns > 0 && self.replaced_ns >= time_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamp(put_ns: u64) -> PacketStamp {
        PacketStamp { put_ns, sender: 7 }
    }

    #[test]
    fn a_ring_keeps_the_newest_packets_and_knows_how_far_it_reaches() {
        let mut ring = PacketRing::new(4, 100, 3 * (STAMP + 4) + 1);
        assert_eq!((ring.bytes(), ring.get(0)), (3 * (STAMP + 4), None));
        for number in 1..=5_u32 {
            assert!(!ring.has_replaced_since(3), "{number}");
            ring.push(stamp(number.into()), &number.to_le_bytes());
        }
        assert_eq!((ring.begin(), ring.end()), (2, 5));
        assert_eq!(ring.get(1), None);
        assert_eq!(ring.get(2), Some((stamp(3), &3_u32.to_le_bytes()[..])));
        assert_eq!(ring.get(4), Some((stamp(5), &5_u32.to_le_bytes()[..])));
        assert!(ring.has_replaced_since(2) && !ring.has_replaced_since(3));
        // The number of packets is a limit, too.
        assert_eq!(PacketRing::new(4, 2, 1000).bytes(), 2 * (STAMP + 4));
        assert_eq!(PacketRing::new(4, 2, 0).bytes(), STAMP + 4);
    }
}
