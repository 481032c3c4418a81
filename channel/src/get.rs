//! Getting packets from a channel.

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

/// Where a get-port begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// With the first packet put from now on.
    Now,
    /// With the last packets of every put-port, at most so many. They come with the put-port's next put or
    /// [`crate::PutPort::send_history`].
    History(usize),
}

/// How to wait for a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wait {
    /// Look again and again, on a core of one's own, for ever.
    Spin,
    /// Sleep until a packet comes, at most so long.
    Block {
        /// Longest sleep.
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
#[derive(Debug)]
pub struct GetPort<T> {
    inner: Arc<GetInner>,
    senders: RefCell<Senders>,
    failed: FailedConnections,
    packet: PhantomData<fn() -> T>,
}

/// The part of a port that its sync groups share.
#[derive(Debug)]
pub struct GetInner {
    id: ChannelId,
    config: ChannelConfig,
    subscriber: AnySubscriber,
    pub(crate) wake_event: Arc<WakeEvent>,
    /// The bus's, for groups that are too large for the kernel.
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
        let history = match start {
            Start::Now => 0,
            Start::History(packets) if packets > config.history => {
                return Err(ChannelError::History {
                    id,
                    most: config.history,
                    found: packets,
                });
            }
            Start::History(packets) => packets,
        };
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

    /// The channel.
    pub fn id(&self) -> ChannelId {
        self.inner.id
    }

    /// Packets that were put but never got here, because the ring was full or the network too slow, counted from the first one that came
    /// of every sender.
    pub fn lost(&self) -> u64 {
        self.senders.borrow().lost
    }

    /// Returns how many put-ports could not be connected to, because descriptors or shared memory were short. Their packets do not come here:
    /// a port that is opened anew tries again.
    pub fn failed_connections(&self) -> u64 {
        self.failed.count()
    }

    /// The next packet, where there is one.
    ///
    /// # Errors
    /// Too many packets are held; the transport has broken down.
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
        // A length from a sender that runs amok must not lead out of its memory.
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

    /// The next packet; `None` after the timeout.
    ///
    /// # Errors
    /// As [`GetPort::try_get`].
    pub fn get(&self, wait: Wait) -> Result<Option<Received<T>>, ChannelError> {
        let Some(deadline) = wait.deadline() else {
            // Without a look at the wake_event, whose memory the putter writes to.
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

/// A get-port of any packet type, to be waited for in a [`crate::SyncGroup`].
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

/// A packet that was got: a slice of items where the sender wrote them. Drop it soon, the port may hold only a few.
#[derive(Debug)]
pub struct Received<T> {
    sample: AnySample,
    header: Header,
    items: usize,
    packet: PhantomData<T>,
}

impl<T: Packet> Received<T> {
    /// Who sent it and when.
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

/// Counts what was lost, from the gaps in every sender's sequence.
#[derive(Debug)]
struct Senders {
    /// Sender and its next sequence number; the one that was silent longest is first.
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
