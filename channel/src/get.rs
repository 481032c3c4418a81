//! Port that gets packets from a channel.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use std::time::{Duration, Instant};

use iceoryx2::port::ReceiveError;
use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::prelude::{CallbackProgression, PortFactory};

use crate::bus::Opened;
use crate::create_port::{Places, create_port};
use crate::failed_connections::FailedConnections;
use crate::inbox::{self, Inbox};
use crate::kept_packets::KeptPackets;
use crate::lanes::{Lanes, forget_lanes, lanes_of};
use crate::memory_failure::{MemoryFailure, transport_error};
use crate::put::short;
use crate::transport::{AnySample, AnySubscriber, Either, both};
use crate::wake_event::WakeEvent;
use crate::{ChannelConfig, ChannelError, ChannelId, Header, Packet, Priority};

/// First packet that a get-port receives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Starts with the next packet.
    Now,
    /// Starts with the last packets of every put-port, at most this many.
    ///
    /// They are there at once, if the put-port is on this host.
    History(usize),
}

impl Start {
    /// Returns the number of earlier packets to get.
    fn history(self, id: ChannelId, config: &ChannelConfig) -> Result<usize, ChannelError> {
        match self {
            Self::Now => Ok(0),
            Self::History(packets) if packets > config.history => Err(ChannelError::History {
                id,
                most: config.history,
                found: packets,
            }),
            Self::History(packets) => Ok(packets),
        }
    }
}

/// Strategy for waiting for a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wait {
    /// Polls without a pause and without a timeout; occupies one core.
    Spin,
    /// Sleeps until a packet arrives or the timeout has passed.
    Block {
        /// Maximum sleep.
        timeout: Duration,
    },
}

impl Wait {
    pub(crate) fn deadline(self) -> Option<Instant> {
        match self {
            Self::Spin => None,
            Self::Block { timeout } => Some(
                Instant::now()
                    .checked_add(timeout)
                    .unwrap_or_else(|| Instant::now() + Duration::from_secs(1 << 30)),
            ),
        }
    }
}

/// Gets packets of `T` from one channel. Its functions neither allocate nor start a thread.
///
/// ```
/// use std::time::Duration;
/// use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Start, Table, Wait};
///
/// let table = Table::new("lab").with("force", ChannelConfig { depth: 2, ..ChannelConfig::of::<f32>(1) });
/// let bus = Bus::open(Domain::Process, &table)?;
/// let get = bus.get_port::<f32>("force", Start::Now)?;
/// let put = bus.put_port::<f32>("force", Priority::Normal)?;
/// put.put_copy(&[1.0])?;
/// assert_eq!(get.try_get()?.unwrap()[0], 1.0);
/// // The ring holds two packets; the oldest of these three is lost.
/// for newtons in [2.0, 3.0, 4.0] {
///     put.put_copy(&[newtons])?;
/// }
/// let wait = Wait::Block { timeout: Duration::from_millis(10) };
/// assert_eq!(get.get(wait)?.unwrap()[0], 3.0);
/// assert_eq!(get.lost(), 1);
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
#[derive(Debug)]
pub struct GetPort<T> {
    inner: Arc<GetInner>,
    inbox: RefCell<Inbox>,
    failed: FailedConnections,
    packet: PhantomData<fn() -> T>,
}

/// Part of a port that its sync groups share.
#[derive(Debug)]
pub struct GetInner {
    pub(crate) id: ChannelId,
    pub(crate) config: ChannelConfig,
    subscriber: AnySubscriber,
    /// Number of the port in the transport.
    pub(crate) number: u128,
    pub(crate) lanes: Arc<Lanes>,
    pub(crate) kept: Arc<KeptPackets>,
    /// Version of the kept packets that were read.
    kept_read: AtomicU32,
    /// True if packets of several put-ports must be merged.
    pub(crate) merges: bool,
    /// True if the inbox has packets.
    has_taken: AtomicBool,
    priority: AtomicU8,
    pub(crate) wake_event: Arc<WakeEvent>,
    /// Wake event of the bus for groups that are too large for one kernel call.
    pub(crate) crowd: Arc<WakeEvent>,
}

impl<T: Packet> GetPort<T> {
    pub(crate) fn open(opened: Opened, start: Start) -> Result<Self, ChannelError> {
        let Opened {
            id,
            config,
            channel,
            wake_event,
            crowd,
            kept,
            history: past,
            folder,
            ..
        } = opened;
        const {
            assert!(
                align_of::<T>() <= 64,
                "packets are aligned to 64 bytes at most"
            )
        };
        let history = start.history(id, &config)?;
        let failed = FailedConnections::default();
        let kept_read = AtomicU32::new(wake_event.kept_version());
        MemoryFailure::forget();
        macro_rules! subscriber {
            ($channel:expr) => {{
                let is_full = |error: &SubscriberCreateError| {
                    *error == SubscriberCreateError::ExceedsMaxSupportedSubscribers
                };
                create_port($channel, Places::Get, is_full, || {
                    $channel
                        .subscriber_builder()
                        .history_request(0)
                        .set_degradation_handler(failed.counter())
                        .create()
                })
                .map_err(|error| match error {
                    SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
                        ChannelError::TooManyPorts {
                            id,
                            side: "get",
                            most: config.get_ports,
                        }
                    }
                    error => transport_error(format!("channel `{id}`"), &folder, error),
                })?
            }};
        }
        let subscriber = match &channel {
            Either::Process(channel) => Either::Process(subscriber!(channel)),
            Either::Host(channel) => Either::Host(subscriber!(channel)),
        };
        let number = both!(&subscriber, subscriber => subscriber.id().value());
        let lanes = lanes_of(number);
        let mut inbox = Inbox::new(config.total_put_ports());
        if history > 0 {
            let mut senders = Vec::new();
            both!(&channel, channel => channel.dynamic_config().list_publishers(|port| {
                senders.push(port.publisher_id.value());
                CallbackProgression::Continue
            }));
            let packets = senders
                .into_iter()
                .flat_map(|sender| past.read(sender, history, &config, || lanes.first_put(sender)));
            inbox.add_history(packets);
        }
        Ok(Self {
            inner: Arc::new(GetInner {
                id,
                number,
                lanes,
                kept,
                kept_read,
                merges: config.merges(),
                has_taken: AtomicBool::new(!inbox.is_empty()),
                priority: AtomicU8::new(config.priority as u8),
                config,
                subscriber,
                wake_event,
                crowd,
            }),
            inbox: RefCell::new(inbox),
            failed,
            packet: PhantomData,
        })
    }

    /// Returns the id of the channel.
    pub fn id(&self) -> ChannelId {
        self.inner.id
    }

    /// Returns the number of lost packets since the port opened.
    ///
    /// Packets are lost if the ring is full or the network is too slow.
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Start, Table};
    /// # let config = ChannelConfig { depth: 2, ..ChannelConfig::of::<f32>(1) };
    /// # let table = Table::new("lab").with("force", config);
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let get = bus.get_port::<f32>("force", Start::Now)?;
    /// let put = bus.put_port::<f32>("force", Priority::Normal)?;
    /// for newtons in [1.0, 2.0, 3.0] {
    ///     put.put_copy(&[newtons])?;
    /// }
    /// assert_eq!(get.lost(), 1); // the ring holds two
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
    pub fn lost(&self) -> u64 {
        // Connects to new put-ports. If that fails, `failed_connections` counts it.
        let _ = self.inner.has_packets();
        self.inbox.borrow_mut().fetch_kept(&self.inner);
        self.inner.lanes.lost()
    }

    /// Sets the priority of this port in its sync groups. At first it is the one of the table.
    pub fn set_priority(&self, priority: Priority) {
        self.inner.priority.store(priority as u8, Ordering::Relaxed);
    }

    /// Returns the random number of the port, for [`crate::PutPort::losses`].
    pub fn number(&self) -> u64 {
        short(self.inner.number)
    }

    /// Returns the number of put-ports that this port could not connect to, because file descriptors or shared memory
    /// ran out.
    ///
    /// Their packets do not arrive. Open a new port to retry.
    pub fn failed_connections(&self) -> u64 {
        self.failed.count()
    }

    /// Returns the next packet, or `None` if there is none.
    ///
    /// # Errors
    /// [`ChannelError::Held`] if too many packets are held; [`ChannelError::Transport`] if the transport has failed.
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Start, Table};
    /// # let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(1));
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let get = bus.get_port::<f32>("force", Start::Now)?;
    /// assert!(get.try_get()?.is_none());
    /// let put = bus.put_port::<f32>("force", Priority::Normal)?;
    /// put.put_copy(&[2.5])?;
    /// assert_eq!(get.try_get()?.unwrap()[0], 2.5);
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
    pub fn try_get(&self) -> Result<Option<Received<T>>, ChannelError> {
        let inner = &*self.inner;
        let mut inbox = self.inbox.borrow_mut();
        let taken = inbox.next(inner);
        inner.has_taken.store(!inbox.is_empty(), Ordering::Relaxed);
        let Some(packet) = taken? else {
            return Ok(None);
        };
        let header = packet.header();
        let room = match &packet {
            inbox::Packet::Sample(sample) => {
                both!(sample, sample => size_of_val(sample.payload()))
            }
            inbox::Packet::Kept(packet) => size_of_val(&*packet.data),
        };
        // Clamped: a faulty sender must not cause a read outside the packet.
        let bytes = (header.bytes as usize)
            .min(room)
            .min(inner.config.packet_bytes());
        Ok(Some(Received {
            packet,
            header,
            items: bytes / size_of::<T>(),
            items_of: PhantomData,
        }))
    }

    /// Waits for the next packet; returns `None` after the timeout.
    ///
    /// # Errors
    /// The same as [`GetPort::try_get`].
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, Domain, Start, Table, Wait};
    /// # let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(1));
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let get = bus.get_port::<f32>("force", Start::Now)?;
    /// let timeout = std::time::Duration::from_millis(1);
    /// assert!(get.get(Wait::Block { timeout })?.is_none());
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
    pub fn get(&self, wait: Wait) -> Result<Option<Received<T>>, ChannelError> {
        let Some(deadline) = wait.deadline() else {
            // Spinning does not read the wake event, whose cache line the putter writes.
            loop {
                if let Some(packet) = self.try_get()? {
                    return Ok(Some(packet));
                }
                std::hint::spin_loop();
            }
        };
        loop {
            let notifications = self.inner.wake_event.notifications();
            if let Some(packet) = self.try_get()? {
                return Ok(Some(packet));
            }
            if Instant::now() >= deadline {
                return Ok(None);
            }
            self.inner.wake_event.sleep(notifications, deadline);
        }
    }
}

impl GetInner {
    /// Returns true if a packet waits, taken or not.
    pub(crate) fn has_packets(&self) -> Result<bool, ChannelError> {
        let waits = both!(&self.subscriber, port => port.has_samples())
            .map_err(|error| transport_error(self.id, Path::new(""), error))?;
        Ok(waits || self.has_taken.load(Ordering::Relaxed) || self.has_new_kept())
    }

    /// Takes a packet from the transport.
    pub(crate) fn receive(&self) -> Result<Option<AnySample>, ChannelError> {
        let failed = |error| match error {
            ReceiveError::ExceedsMaxBorrows => self.too_many_held(),
            error => transport_error(self.id, Path::new(""), error),
        };
        Ok(match &self.subscriber {
            Either::Process(port) => port.receive().map_err(failed)?.map(Either::Process),
            Either::Host(port) => port.receive().map_err(failed)?.map(Either::Host),
        })
    }

    pub(crate) fn too_many_held(&self) -> ChannelError {
        ChannelError::Held {
            id: self.id,
            state: "held",
            most: self.config.held,
        }
    }

    /// Returns true if packets of a closed put-port were kept since [`GetInner::note_kept_read`].
    pub(crate) fn has_new_kept(&self) -> bool {
        self.wake_event.kept_version() != self.kept_read.load(Ordering::Relaxed)
    }

    pub(crate) fn note_kept_read(&self) {
        let version = self.wake_event.kept_version();
        self.kept_read.store(version, Ordering::Relaxed);
    }

    pub(crate) fn priority(&self) -> Priority {
        Priority::from_number(self.priority.load(Ordering::Relaxed))
    }
}

impl Drop for GetInner {
    fn drop(&mut self) {
        forget_lanes(self.number);
        if self.has_new_kept() {
            self.kept.take(self.number);
        }
    }
}

/// A get-port of any packet type, as a member of a [`crate::SyncGroup`].
pub trait GetSide: sealed::Sealed {}
impl<T: Packet> GetSide for GetPort<T> {}

pub(crate) mod sealed {
    use std::sync::Arc;

    use super::{GetInner, GetPort};

    pub trait Sealed {
        fn inner(&self) -> Arc<GetInner>;
    }

    impl<T> Sealed for GetPort<T> {
        fn inner(&self) -> Arc<GetInner> {
            self.inner.clone()
        }
    }
}

/// A received packet: a slice of items in the sender's memory, or in a copy if the sender had closed its port before.
///
/// Drop it soon: a port may hold only [`ChannelConfig::held`] packets.
#[derive(Debug)]
pub struct Received<T> {
    packet: inbox::Packet,
    header: Header,
    items: usize,
    items_of: PhantomData<T>,
}

impl<T: Packet> Received<T> {
    /// Returns the header with sender, sequence number and time.
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Start, Table, now_ns};
    /// # let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(1));
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let get = bus.get_port::<f32>("force", Start::Now)?;
    /// let put = bus.put_port::<f32>("force", Priority::Normal)?;
    /// put.put_copy(&[2.5])?;
    /// let packet = get.try_get()?.unwrap();
    /// assert_eq!(packet.header().sequence, 0);
    /// assert!(packet.header().put_ns <= now_ns());
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
    pub fn header(&self) -> &Header {
        &self.header
    }
}

impl<T: Packet> Deref for Received<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        let first = match &self.packet {
            inbox::Packet::Sample(sample) => both!(sample, sample => sample.payload().as_ptr()),
            inbox::Packet::Kept(packet) => packet.data.as_ptr(),
        };
        // SAFETY: the blocks hold at least `items` items, are aligned to 64 bytes, and every bit pattern is a `T`.
        unsafe { std::slice::from_raw_parts(first.cast::<T>(), self.items) }
    }
}
