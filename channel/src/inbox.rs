//! Merges the rings of a get-port's put-ports: urgent packets first, those of equal priority in the order of their puts.
//!
//! The port takes the oldest packet of every ring, and the transport holds the rest back. The oldest of these heads is
//! delivered if its put began before the last complete scan of the rings: a put that had ended before it began was
//! visible to that scan.

use std::cmp::Reverse;
use std::collections::VecDeque;
use std::sync::Arc;

use crate::get::GetInner;
use crate::kept_packets::KeptPacket;
use crate::lanes::Lane;
use crate::transport::{AnySample, both};
use crate::{ChannelError, Header, Priority, now_ns};

/// Packet that a port has taken from a ring, or found among the packets of a closed put-port.
#[derive(Debug)]
pub(crate) enum Packet {
    Sample(AnySample),
    Kept(KeptPacket),
}

impl Packet {
    pub(crate) fn header(&self) -> Header {
        match self {
            Self::Sample(sample) => both!(sample, sample => *sample.user_header()),
            Self::Kept(packet) => packet.header,
        }
    }
}

/// Position of a packet in the order of delivery; the least comes first.
type Order = (Reverse<Priority>, u64);

/// Oldest packet of a ring.
#[derive(Debug)]
struct Head {
    sample: AnySample,
    lane: Arc<Lane>,
    order: Order,
}

/// Packets that a get-port has taken and not delivered.
#[derive(Debug)]
pub(crate) struct Inbox {
    heads: Vec<Head>,
    /// Lanes that have delivered packets.
    lanes: Vec<Arc<Lane>>,
    /// Packets of closed put-ports, in the order of delivery.
    kept: VecDeque<(Order, KeptPacket)>,
    /// Time at which the last complete scan of the rings began.
    scanned_ns: u64,
}

impl Inbox {
    /// Creates an empty inbox.
    ///
    /// - `lanes`: maximum number of connected put-ports
    pub(crate) fn new(lanes: usize) -> Self {
        // Closed ports with packets that were not taken have a lane, too.
        let room = 2 * lanes + 8;
        Self {
            heads: Vec::with_capacity(room),
            lanes: Vec::with_capacity(room),
            kept: VecDeque::new(),
            scanned_ns: 0,
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.heads.is_empty() && self.kept.is_empty()
    }

    /// Takes the next packet in the order of delivery.
    pub(crate) fn next(&mut self, port: &GetInner) -> Result<Option<Packet>, ChannelError> {
        self.fetch_kept(port);
        if !port.merges {
            return match self.kept.pop_front() {
                Some((_, packet)) => Ok(Some(Packet::Kept(packet))),
                None => Ok(port.receive()?.map(Packet::Sample)),
            };
        }
        loop {
            let first = self.first();
            if let Some((order, place)) = first
                && order.1 < self.scanned_ns
            {
                return self.take(place, port).map(Some);
            }
            let begun = now_ns();
            while let Some(sample) = port.receive()? {
                self.stage(sample, port, begun);
            }
            self.scanned_ns = begun;
            if first.is_none() && self.first().is_none() {
                return Ok(None);
            }
        }
    }

    /// Adds the past packets of put-ports.
    pub(crate) fn add_history(&mut self, packets: impl Iterator<Item = KeptPacket>) {
        let now = now_ns();
        self.kept
            .extend(packets.map(|packet| (order(&packet.header, now), packet)));
        self.sort_kept();
    }

    fn sort_kept(&mut self) {
        self.kept.make_contiguous().sort_by_key(|(order, _)| *order);
    }

    /// Returns the order and the index of the head to deliver next; no index for a kept packet.
    fn first(&self) -> Option<(Order, Option<usize>)> {
        let heads = self.heads.iter().enumerate();
        let head = heads.map(|(at, head)| (head.order, Some(at))).min();
        let kept = self.kept.front().map(|(order, _)| (*order, None));
        match (head, kept) {
            (Some(head), Some(kept)) => Some(head.min(kept)),
            (head, kept) => head.or(kept),
        }
    }

    fn take(&mut self, place: Option<usize>, port: &GetInner) -> Result<Packet, ChannelError> {
        let Some(at) = place else {
            let packet = self.kept.pop_front();
            return packet
                .map(|(_, packet)| Packet::Kept(packet))
                .ok_or_else(|| ChannelError::transport(port.id, "no packet"));
        };
        // The head itself is one of the held packets.
        if self.heads[at].lane.held() > port.config.held {
            return Err(port.too_many_held());
        }
        let Head { sample, lane, .. } = self.heads.swap_remove(at);
        lane.stage(false);
        if lane.has_more() {
            // Its next packet may precede the other heads.
            self.scanned_ns = 0;
        }
        Ok(Packet::Sample(sample))
    }

    fn stage(&mut self, sample: AnySample, port: &GetInner, begun: u64) {
        let sender = both!(&sample, sample => sample.origin().value());
        let header = both!(&sample, sample => *sample.user_header());
        let lane = self.lane(sender, port);
        lane.stage(true);
        self.heads.push(Head {
            sample,
            lane,
            order: order(&header, begun),
        });
    }

    /// Returns the lane of a put-port.
    fn lane(&mut self, sender: u128, port: &GetInner) -> Arc<Lane> {
        if let Some(lane) = self.lanes.iter().find(|lane| lane.sender == sender) {
            return lane.clone();
        }
        let lane = port
            .lanes
            .of(sender)
            .unwrap_or_else(|| panic!("a packet comes from a connected put-port"));
        if self.lanes.len() == self.lanes.capacity() {
            // Lanes that only this list still knows are closed.
            self.lanes.retain(|lane| Arc::strong_count(lane) > 1);
        }
        self.lanes.push(lane.clone());
        lane
    }

    /// Reads packets of put-ports that closed before this port had connected to them.
    pub(crate) fn fetch_kept(&mut self, port: &GetInner) {
        if !port.has_new_kept() {
            return;
        }
        port.note_kept_read();
        let now = now_ns();
        for parcel in port.kept.take(port.number) {
            if port.lanes.knows(parcel.sender) {
                continue;
            }
            port.lanes.add_lost(parcel.lost);
            let packets = parcel.packets.into_iter();
            self.kept
                .extend(packets.map(|packet| (order(&packet.header, now), packet)));
        }
        self.sort_kept();
    }
}

/// Returns the position of a packet that was taken now, in the order of delivery.
fn order(header: &Header, now: u64) -> Order {
    let put_ns = match header.remote {
        // The clock is another one, and the ring keeps the order.
        1 => now.saturating_sub(1),
        // A faulty sender must not stop the others with a time in the future.
        _ if header.put_ns >= now => header.put_ns.min(now_ns()),
        _ => header.put_ns,
    };
    (Reverse(Priority::from_number(header.priority)), put_ns)
}
