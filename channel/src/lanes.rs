//! State of connections that ports and the transport share within a process.
//!
//! A get-port has one lane for each put-port, a put-port one link to each get-port. The transport registers them by
//! the numbers of the ports when it connects.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

use parking_lot::Mutex;

use crate::connection::LossCounter;

/// Number of closed put-ports that a get-port remembers, to recognise their kept packets.
const REMEMBERED: usize = 64;

/// Connection of a get-port to one put-port.
#[derive(Debug)]
pub(crate) struct Lane {
    /// Number of the put-port.
    pub(crate) sender: u128,
    /// True while the get-port holds a packet of this lane that the user has not got; the transport then delivers no
    /// other.
    staged: AtomicBool,
    /// True if further packets waited at the last look.
    more: AtomicBool,
    /// Number of packets that the get-port holds.
    held: AtomicUsize,
    /// True once the get-port has looked for packets, so the connection was complete.
    is_used: AtomicBool,
}

impl Lane {
    pub(crate) fn new(sender: u128) -> Self {
        Self {
            sender,
            staged: AtomicBool::new(false),
            more: AtomicBool::new(false),
            held: AtomicUsize::new(0),
            is_used: AtomicBool::new(false),
        }
    }

    pub(crate) fn stage(&self, staged: bool) {
        self.staged.store(staged, Ordering::Relaxed);
    }

    pub(crate) fn is_staged(&self) -> bool {
        self.staged.load(Ordering::Relaxed)
    }

    pub(crate) fn set_more(&self, more: bool) {
        self.more.store(more, Ordering::Relaxed);
    }

    pub(crate) fn has_more(&self) -> bool {
        self.more.load(Ordering::Relaxed)
    }

    pub(crate) fn set_held(&self, held: usize) {
        self.held.store(held, Ordering::Relaxed);
    }

    /// Notes that the get-port has looked for packets. Returns true for the first time.
    pub(crate) fn begin_use(&self) -> bool {
        let is_first = !self.is_used.load(Ordering::Relaxed);
        if is_first {
            self.is_used.store(true, Ordering::Relaxed);
        }
        is_first
    }

    pub(crate) fn held(&self) -> usize {
        self.held.load(Ordering::Relaxed)
    }
}

/// All lanes of a get-port.
#[derive(Debug, Default)]
pub(crate) struct Lanes(Mutex<LaneList>);

#[derive(Debug)]
struct LaneList {
    open: Vec<(Arc<Lane>, LossCounter)>,
    /// Packets that were lost in lanes which are closed.
    lost: u64,
    /// Numbers of put-ports whose lanes are closed, oldest first.
    closed: VecDeque<u128>,
}

impl Default for LaneList {
    fn default() -> Self {
        Self {
            open: Vec::new(),
            lost: 0,
            // A closed lane must not allocate: put-ports end while frames are processed.
            closed: VecDeque::with_capacity(REMEMBERED),
        }
    }
}

impl Lanes {
    /// Returns the lane of a put-port.
    pub(crate) fn of(&self, sender: u128) -> Option<Arc<Lane>> {
        let list = self.0.lock();
        let mut lanes = list.open.iter().map(|(lane, _)| lane);
        lanes.find(|lane| lane.sender == sender).cloned()
    }

    /// Returns the number of packets that were overwritten before the get-port took them.
    pub(crate) fn lost(&self) -> u64 {
        let mut list = self.0.lock();
        let open: u64 = list
            .open
            .iter_mut()
            .map(|(_, counter)| counter.lost())
            .sum();
        list.lost + open
    }

    /// Adds packets that were lost with a put-port that has closed.
    pub(crate) fn add_lost(&self, packets: u64) {
        self.0.lock().lost += packets;
    }

    /// Returns the number of a put-port's first put in the ring, if there is one and the channel has a history.
    pub(crate) fn first_put(&self, sender: u128) -> Option<u64> {
        let list = self.0.lock();
        let mut lanes = list.open.iter();
        let (_, counter) = lanes.find(|(lane, _)| lane.sender == sender)?;
        counter.first_put()
    }

    /// Returns true if the get-port was connected to this put-port.
    pub(crate) fn knows(&self, sender: u128) -> bool {
        let list = self.0.lock();
        list.closed.contains(&sender) || list.open.iter().any(|(lane, _)| lane.sender == sender)
    }

    fn close(&self, lane: &Arc<Lane>) -> bool {
        let mut list = self.0.lock();
        if let Some(at) = list
            .open
            .iter()
            .position(|(open, _)| Arc::ptr_eq(open, lane))
        {
            let (lane, mut counter) = list.open.swap_remove(at);
            list.lost += counter.lost();
            if list.closed.len() == REMEMBERED {
                list.closed.pop_front();
            }
            // Otherwise its put-port closed while it was created, and its packets were kept.
            if lane.is_used.load(Ordering::Relaxed) {
                list.closed.push_back(lane.sender);
            }
        }
        list.open.is_empty()
    }
}

/// Lanes by the numbers of get-ports.
static LANES: Mutex<BTreeMap<u128, Arc<Lanes>>> = Mutex::new(BTreeMap::new());

/// Registers a lane, before it carries packets.
pub(crate) fn open_lane(getter: u128, lane: &Arc<Lane>, counter: LossCounter) -> Arc<Lanes> {
    let lanes = LANES.lock().entry(getter).or_default().clone();
    lanes.0.lock().open.push((lane.clone(), counter));
    lanes
}

/// Removes a lane, before its memory is unmapped.
pub(crate) fn close_lane(getter: u128, lanes: &Arc<Lanes>, lane: &Arc<Lane>) {
    let is_last = lanes.close(lane);
    let mut all = LANES.lock();
    // Nobody but the registry: the get-port could not be created.
    if is_last && Arc::strong_count(lanes) == 2 {
        all.remove(&getter);
    }
}

/// Returns the lanes of a get-port that has been created.
pub(crate) fn lanes_of(getter: u128) -> Arc<Lanes> {
    LANES.lock().entry(getter).or_default().clone()
}

/// Forgets the lanes of a get-port.
pub(crate) fn forget_lanes(getter: u128) {
    LANES.lock().remove(&getter);
}

/// Connection of a put-port to one get-port.
#[derive(Debug)]
pub(crate) struct Link {
    /// Number of the put-port.
    pub(crate) sender: u128,
    /// Number of the get-port.
    pub(crate) getter: u128,
    /// Number of packets that were sent.
    sent: AtomicU64,
}

impl Link {
    pub(crate) fn new(sender: u128, getter: u128) -> Self {
        Self {
            sender,
            getter,
            sent: AtomicU64::new(0),
        }
    }

    /// Counts a packet; called by one thread at a time. Returns the number of packets before it.
    pub(crate) fn count(&self) -> u64 {
        let sent = self.sent.load(Ordering::Relaxed);
        self.sent.store(sent + 1, Ordering::Relaxed);
        sent
    }
}

/// State of a link.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LinkState {
    pub(crate) getter: u128,
    /// Number of packets that were sent.
    pub(crate) sent: u64,
    /// Number of packets that were overwritten before the get-port took them.
    pub(crate) lost: u64,
    /// True if the get-port has mapped the connection.
    pub(crate) is_seen: bool,
}

static LINKS: Mutex<Vec<(Arc<Link>, LossCounter)>> = Mutex::new(Vec::new());

/// Registers a link, before it carries packets.
pub(crate) fn open_link(link: &Arc<Link>, counter: LossCounter) {
    LINKS.lock().push((link.clone(), counter));
}

/// Removes a link, before its memory is unmapped.
pub(crate) fn close_link(link: &Arc<Link>) {
    LINKS.lock().retain(|(open, _)| !Arc::ptr_eq(open, link));
}

/// Returns the state of all links of a put-port.
pub(crate) fn links_of(sender: u128) -> Vec<LinkState> {
    let mut links = LINKS.lock();
    let links = links.iter_mut().filter(|(link, _)| link.sender == sender);
    links
        .map(|(link, counter)| LinkState {
            getter: link.getter,
            sent: link.sent.load(Ordering::Relaxed),
            lost: counter.lost(),
            is_seen: counter.is_seen(),
        })
        .collect()
}

/// Counts packets that were lost before they reached a put-port, at all its get-ports.
#[cfg(feature = "zenoh")]
pub(crate) fn add_missing(sender: u128, packets: u64) {
    let links = LINKS.lock();
    for (_, counter) in links.iter().filter(|(link, _)| link.sender == sender) {
        counter.add(packets);
    }
}
