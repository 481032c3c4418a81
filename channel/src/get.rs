//! Port that gets packets from a channel.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::ops::Deref;
use std::sync::Arc;
use std::time::{Duration, Instant};

use iceoryx2::port::ReceiveError;
use iceoryx2::port::subscriber::SubscriberCreateError;

use crate::bus::Opened;
use crate::create_port::{Side, create_port};
use crate::failed_connections::FailedConnections;
use crate::transport::{AnySample, AnySubscriber, Either, both};
use crate::wake_event::WakeEvent;
use crate::{ChannelConfig, ChannelError, ChannelId, Header, Packet};

/// First packet that a get-port receives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Starts with the next packet.
    Now,
    /// Starts with the last packets of every put-port, at most this many.
    ///
    /// They arrive with the put-port's next put or [`crate::PutPort::send_history`].
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
    senders: RefCell<Senders>,
    failed: FailedConnections,
    packet: PhantomData<fn() -> T>,
}

/// Part of a port that its sync groups share.
#[derive(Debug)]
pub struct GetInner {
    id: ChannelId,
    config: ChannelConfig,
    subscriber: AnySubscriber,
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
        macro_rules! subscriber {
            ($channel:expr) => {{
                let is_full = |error: &SubscriberCreateError| {
                    *error == SubscriberCreateError::ExceedsMaxSupportedSubscribers
                };
                create_port($channel, Side::Get, is_full, || {
                    $channel
                        .subscriber_builder()
                        .history_request(history)
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
                    error => ChannelError::transport(id, error),
                })?
            }};
        }
        let subscriber = match channel {
            Either::Process(channel) => Either::Process(subscriber!(&channel)),
            Either::Host(channel) => Either::Host(subscriber!(&channel)),
        };
        let senders = RefCell::new(Senders::new(2 * config.total_put_ports()));
        Ok(Self {
            inner: Arc::new(GetInner {
                id,
                config,
                subscriber,
                wake_event,
                crowd,
            }),
            senders,
            failed,
            packet: PhantomData,
        })
    }

    /// Returns the id of the channel.
    pub fn id(&self) -> ChannelId {
        self.inner.id
    }

    /// Returns the number of lost packets, counted from the first packet that arrived from each sender.
    ///
    /// Packets are lost if the ring is full or the network is too slow.
    pub fn lost(&self) -> u64 {
        self.senders.borrow().lost
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
        let failed = |error| match error {
            ReceiveError::ExceedsMaxBorrows => ChannelError::Held {
                id: inner.id,
                state: "held",
                most: inner.config.held,
            },
            error => ChannelError::transport(inner.id, error),
        };
        let sample = match &inner.subscriber {
            Either::Process(port) => port.receive().map_err(failed)?.map(Either::Process),
            Either::Host(port) => port.receive().map_err(failed)?.map(Either::Host),
        };
        let Some(sample) = sample else {
            return Ok(None);
        };
        let (header, room) =
            both!(&sample, sample => (*sample.user_header(), size_of_val(sample.payload())));
        self.senders.borrow_mut().count(&header);
        // Clamped: a faulty sender must not cause a read outside the packet.
        let bytes = (header.bytes as usize)
            .min(room)
            .min(inner.config.packet_bytes());
        Ok(Some(Received {
            sample,
            header,
            items: bytes / size_of::<T>(),
            packet: PhantomData,
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
    pub(crate) fn has_packets(&self) -> Result<bool, ChannelError> {
        both!(&self.subscriber, port => port.has_samples())
            .map_err(|error| ChannelError::transport(self.id, error))
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

/// A received packet: a slice of items in the sender's memory.
///
/// Drop it soon: a port may hold only [`ChannelConfig::held`] packets.
#[derive(Debug)]
pub struct Received<T> {
    sample: AnySample,
    header: Header,
    items: usize,
    packet: PhantomData<T>,
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
        let first = both!(&self.sample, sample => sample.payload().as_ptr());
        // SAFETY: the blocks hold at least `items` items, are aligned to 64 bytes, and every bit pattern is a `T`.
        unsafe { std::slice::from_raw_parts(first.cast::<T>(), self.items) }
    }
}

/// Counter of lost packets, from gaps in the sequence of every sender.
#[derive(Debug)]
struct Senders {
    /// Sender and its next sequence number; the longest silent sender comes first.
    next: Vec<(u64, u64)>,
    lost: u64,
}

impl Senders {
    fn new(most: usize) -> Self {
        Self {
            next: Vec::with_capacity(most),
            lost: 0,
        }
    }

    fn count(&mut self, header: &Header) {
        let after = header.sequence.wrapping_add(1);
        let known = self
            .next
            .iter()
            .position(|(sender, _)| *sender == header.sender);
        if let Some(at) = known {
            let (sender, expected) = self.next.remove(at);
            self.lost += header.sequence.saturating_sub(expected);
            self.next.push((sender, expected.max(after)));
            return;
        }
        if self.next.len() == self.next.capacity() {
            self.next.remove(0);
        }
        self.next.push((header.sender, after));
    }
}
