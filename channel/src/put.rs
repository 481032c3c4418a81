//! Port that puts packets into a channel.

use std::collections::VecDeque;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::ptr::NonNull;
use std::sync::Arc;

use iceoryx2::port::LoanError;
use iceoryx2::port::port_name::PortName;
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::BackpressureStrategy;
use parking_lot::Mutex;

use crate::bus::Opened;
use crate::connection::set_put;
use crate::create_port::{Places, client_put_ports, create_port, hub_name};
use crate::failed_connections::FailedConnections;
use crate::history::{Board, History};
use crate::kept_packets::{KeptPacket, KeptPackets, Parcel};
use crate::lanes::{LinkState, links_of};
use crate::memory_failure::{MemoryFailure, transport_error};
use crate::packet::{Block, blocks};
use crate::storage::last_segment;
use crate::transport::{AnyPublisher, Either, both};
use crate::wake_event::WakeEvent;
use crate::{Bus, ChannelConfig, ChannelError, ChannelId, Header, Loan, Packet, Priority, Start};

/// Puts packets of `T` into one channel. Its functions neither allocate nor start a thread.
///
/// ```
/// use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Start, Table};
///
/// let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(3));
/// let bus = Bus::open(Domain::Process, &table)?;
/// let get = bus.get_port::<f32>("force", Start::Now)?;
/// let put = bus.put_port::<f32>("force", Priority::Normal)?;
/// let mut packet = put.loan(2)?; // written in place, without a copy
/// packet.copy_from_slice(&[1.0, 2.0]);
/// assert_eq!(put.put(packet)?, 1); // one get-port has it
/// assert_eq!(get.try_get()?.unwrap()[..], [1.0, 2.0]);
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
#[derive(Debug)]
pub struct PutPort<T> {
    id: ChannelId,
    config: ChannelConfig,
    publisher: AnyPublisher,
    wake_event: Arc<WakeEvent>,
    crowd: Arc<WakeEvent>,
    kept: Arc<KeptPackets>,
    history: Arc<History>,
    /// List of the last packets, for channels with a history.
    board: Option<Arc<Board>>,
    /// Number of the port in the transport.
    number: u128,
    sender: u64,
    priority: Priority,
    /// Number of this port's items in one item of the channel.
    unit: usize,
    sent: Mutex<Sent>,
    /// Address and number of blocks of every slot that was zeroed; used in the process domain only.
    zeroed: Mutex<Vec<(usize, usize)>>,
    failed: FailedConnections,
    packet: PhantomData<fn(T)>,
}

/// Packets that a port has sent.
#[derive(Debug)]
struct Sent {
    /// Sequence number of the next packet.
    next: u64,
    /// The last packets, as many as a ring holds. Their memory is valid while a get-port has not taken them.
    last: VecDeque<(Header, NonNull<Block>)>,
}

// SAFETY: the packets are in memory of the port, which all threads can read.
unsafe impl Send for Sent {}

/// Packets of a put-port that one get-port has lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GetterLoss {
    /// Number of the get-port, as [`crate::GetPort::number`] returns it.
    pub getter: u64,
    /// Packets that were overwritten in its ring.
    pub packets: u64,
}

/// Owner of a put-port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Owner {
    Client,
    /// Only for packets of other hosts.
    #[cfg_attr(not(feature = "zenoh"), allow(dead_code))]
    Hub,
}

impl<T: Packet> PutPort<T> {
    pub(crate) fn open(
        opened: Opened,
        priority: Priority,
        owner: Owner,
    ) -> Result<Self, ChannelError> {
        let Opened {
            id,
            config,
            channel,
            wake_event,
            crowd,
            kept,
            history,
            folder,
            unit,
        } = opened;
        const {
            assert!(
                align_of::<T>() <= align_of::<Block>(),
                "packets are aligned to 64 bytes at most"
            )
        };
        let slots = config.slots();
        let failed = FailedConnections::default();
        let error = |error| match error {
            PublisherCreateError::ExceedsMaxSupportedPublishers => ChannelError::TooManyPorts {
                id,
                side: "put",
                most: config.put_ports,
            },
            error => transport_error(format!("channel `{id}`"), &folder, error),
        };
        let (places, name) = match owner {
            Owner::Client => (Places::Put(config.put_ports), PortName::new_empty()),
            Owner::Hub => (Places::Hub, hub_name()),
        };
        MemoryFailure::forget();
        macro_rules! publisher {
            ($channel:expr) => {{
                create_port($channel, places, is_full, || {
                    if owner == Owner::Client && client_put_ports($channel) >= config.put_ports {
                        return Err(PublisherCreateError::ExceedsMaxSupportedPublishers);
                    }
                    $channel
                        .publisher_builder()
                        .name(&name)
                        .initial_max_slice_len(blocks(config.packet_bytes()))
                        .max_loaned_samples(config.loaned)
                        .set_degradation_handler(failed.counter())
                        .backpressure_strategy(BackpressureStrategy::DiscardData)
                        .override_sample_preallocation(move |_| slots)
                        .create()
                })
                .map_err(error)?
            }};
        }
        let publisher = match channel {
            Either::Process(channel) => Either::Process(publisher!(&channel)),
            Either::Host(channel) => Either::Host(publisher!(&channel)),
        };
        let number = both!(&publisher, publisher => publisher.id().value());
        let board = (config.history > 0)
            .then(|| {
                let base = match &publisher {
                    Either::Process(_) => 0,
                    Either::Host(_) => last_segment(),
                };
                history.create(number, base, &config)
            })
            .transpose()?;
        Ok(Self {
            id,
            board,
            history,
            publisher,
            wake_event,
            crowd,
            kept,
            number,
            sender: short(number),
            priority,
            unit: unit / size_of::<T>().min(unit),
            sent: Mutex::new(Sent {
                next: 0,
                last: VecDeque::with_capacity(config.depth),
            }),
            zeroed: Mutex::new(Vec::with_capacity(slots)),
            failed,
            config,
            packet: PhantomData,
        })
    }

    /// Returns the id of the channel.
    pub fn id(&self) -> ChannelId {
        self.id
    }

    /// Returns the number of get-ports that this port could not connect to, because file descriptors or shared memory
    /// ran out.
    ///
    /// They do not receive its packets.
    pub fn failed_connections(&self) -> u64 {
        self.failed.count()
    }

    /// Retries the connections that failed.
    ///
    /// # Errors
    /// File descriptors are still short, or the channel has no place for one more get-port, which is needed for a
    /// moment.
    pub fn retry_connections(&self, bus: &Bus) -> Result<(), ChannelError> {
        // A new get-port makes every port of the channel check its connections.
        let passer_by = bus.get_port::<T>(self.id, Start::Now)?;
        self.failed.forget();
        drop(passer_by);
        self.update_connections()
    }

    /// Returns the shared memory of this port, in bytes.
    pub fn memory_bytes(&self) -> u64 {
        self.config.put_port_bytes()
    }

    /// Returns a free packet of `items` items to be written in place. Its content is undefined: usually an old packet.
    ///
    /// # Errors
    /// [`ChannelError::TooLarge`] for too many items; [`ChannelError::Held`] for too many loans at once.
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, ChannelError, Domain, Priority, Table};
    /// # let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(3));
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let put = bus.put_port::<f32>("force", Priority::Normal)?;
    /// assert!(matches!(put.loan(4), Err(ChannelError::TooLarge { .. })));
    /// # Ok::<_, ChannelError>(())
    /// ```
    pub fn loan(&self, items: usize) -> Result<Loan<T>, ChannelError> {
        if items > self.config.items {
            return Err(ChannelError::TooLarge {
                id: self.id,
                most: self.config.items / self.unit,
                found: items.div_ceil(self.unit),
            });
        }
        let failed = |error| match error {
            LoanError::ExceedsMaxLoans | LoanError::OutOfMemory => ChannelError::Held {
                id: self.id,
                state: "loaned",
                most: self.config.loaned,
            },
            error => ChannelError::transport(self.id, error),
        };
        let blocks = blocks(items * size_of::<T>());
        let sample = match &self.publisher {
            Either::Process(publisher) => {
                let mut sample = publisher.loan_slice_uninit(blocks).map_err(failed)?;
                self.zero_once(sample.payload_mut());
                // SAFETY: heap memory that was zeroed completely when the slot was first loaned with this many blocks.
                Either::Process(unsafe { sample.assume_init() })
            }
            Either::Host(publisher) => {
                let sample = publisher.loan_slice_uninit(blocks).map_err(failed)?;
                // SAFETY: the pages of a new file are zero, and every bit pattern is a valid block.
                Either::Host(unsafe { sample.assume_init() })
            }
        };
        Ok(Loan {
            sample,
            items,
            sender: self.sender,
            items_of: PhantomData,
        })
    }

    /// Sends a packet without a copy. Returns the number of get-ports that have it in their ring.
    ///
    /// # Errors
    /// The packet was loaned from another port; the transport has failed.
    pub fn put(&self, loan: Loan<T>) -> Result<usize, ChannelError> {
        // The lock keeps sequence numbers and packets in the same order for all threads.
        let mut sent = self.sent.lock();
        let header = Header {
            sender: self.sender,
            sequence: sent.next,
            put_ns: now_ns(),
            bytes: (loan.items * size_of::<T>()) as u64,
            priority: self.priority as u8,
            ..Header::default()
        };
        let getters = self.send(loan, header, &mut sent)?;
        sent.next += 1;
        Ok(getters)
    }

    /// Returns the get-ports that have lost packets of this port, because they took them too slowly.
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Start, Table};
    /// # let config = ChannelConfig { depth: 2, ..ChannelConfig::of::<f32>(1) };
    /// # let table = Table::new("lab").with("force", config);
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let put = bus.put_port::<f32>("force", Priority::Normal)?;
    /// let slow = bus.get_port::<f32>("force", Start::Now)?;
    /// for newtons in [1.0, 2.0, 3.0] {
    ///     put.put_copy(&[newtons])?;
    /// }
    /// let losses = put.losses();
    /// assert_eq!((losses[0].getter, losses[0].packets), (slow.number(), 1));
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
    pub fn losses(&self) -> Vec<GetterLoss> {
        links_of(self.number)
            .iter()
            .filter(|link| link.lost > 0)
            .map(|link| GetterLoss {
                getter: short(link.getter),
                packets: link.lost,
            })
            .collect()
    }

    /// Counts packets that were lost on their way to this port, at all its get-ports.
    #[cfg(feature = "zenoh")]
    pub(crate) fn add_missing(&self, packets: u64) {
        crate::lanes::add_missing(self.number, packets);
    }

    /// Zeroes a slot of heap memory before its first use.
    fn zero_once(&self, slot: &mut [MaybeUninit<Block>]) {
        let key = (slot.as_ptr() as usize, slot.len());
        let mut zeroed = self.zeroed.lock();
        match zeroed.binary_search_by_key(&key.0, |(address, _)| *address) {
            Ok(at) if zeroed[at].1 >= key.1 => return,
            Ok(at) => zeroed[at].1 = key.1,
            Err(at) => zeroed.insert(at, key),
        }
        slot.fill(MaybeUninit::zeroed());
    }

    /// Sends a packet with the header of another sender; the hub does so with packets of other hosts.
    #[cfg(feature = "zenoh")]
    pub(crate) fn put_as(&self, loan: Loan<T>, header: Header) -> Result<usize, ChannelError> {
        self.send(loan, header, &mut self.sent.lock())
    }

    fn send(
        &self,
        mut loan: Loan<T>,
        header: Header,
        sent: &mut Sent,
    ) -> Result<usize, ChannelError> {
        if loan.sender != self.sender {
            return Err(ChannelError::transport(
                self.id,
                "the packet was loaned from another port",
            ));
        }
        both!(&mut loan.sample, sample => *sample.user_header_mut() = header);
        let first = both!(&mut loan.sample, sample => NonNull::from(sample.payload_mut()).cast());
        if let Some(board) = &self.board {
            set_put(board.begin_put());
        }
        let outcome = both!(loan.sample, sample => sample.send());
        if let Some(board) = &self.board {
            board.end_put(outcome.is_ok().then_some((&header, first)));
        }
        let getters = outcome.map_err(|error| ChannelError::transport(self.id, error))?;
        if sent.last.len() == self.config.depth {
            sent.last.pop_front();
        }
        sent.last.push_back((header, first));
        self.wake_event.notify();
        self.crowd.notify_sleepers();
        Ok(getters)
    }

    /// Sends a copy of `items`.
    ///
    /// # Errors
    /// The same as [`PutPort::loan`] and [`PutPort::put`].
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Table};
    /// # let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(3));
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let put = bus.put_port::<f32>("force", Priority::Normal)?;
    /// assert_eq!(put.put_copy(&[1.0, 2.0, 3.0])?, 0); // no get-port yet
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
    pub fn put_copy(&self, items: &[T]) -> Result<usize, ChannelError> {
        let mut loan = self.loan(items.len())?;
        loan.copy_from_slice(items);
        self.put(loan)
    }

    /// Maps the memory of new get-ports now. Otherwise the next put does so, and allocates.
    ///
    /// Costs next to nothing without new get-ports.
    ///
    /// # Errors
    /// The transport has failed.
    pub fn update_connections(&self) -> Result<(), ChannelError> {
        both!(&self.publisher, publisher => publisher.update_connections())
            .map_err(|error| ChannelError::transport(self.id, error))
    }

    /// Connects to new get-ports now, and wakes all. Otherwise the next put does so.
    ///
    /// # Errors
    /// The transport has failed.
    pub fn send_history(&self) -> Result<(), ChannelError> {
        self.update_connections()?;
        self.wake_event.notify();
        self.crowd.notify_sleepers();
        Ok(())
    }
}

impl<T> PutPort<T> {
    /// Copies the packets that a get-port has not taken.
    fn unread(&mut self, link: &LinkState) -> Parcel {
        let last = &self.sent.get_mut().last;
        let unread = usize::try_from(link.sent).map_or(last.len(), |sent| sent.min(last.len()));
        let packets = last.iter().skip(last.len() - unread);
        Parcel {
            sender: self.number,
            getter: link.getter,
            lost: link.lost,
            packets: packets
                .map(|(header, first)| {
                    let blocks = blocks(header.bytes as usize);
                    // SAFETY: the get-port has not taken the packet, so its memory belongs to it and holds `bytes`
                    // bytes in whole blocks.
                    let data = unsafe { std::slice::from_raw_parts(first.as_ptr(), blocks) };
                    KeptPacket {
                        header: *header,
                        data: data.into(),
                    }
                })
                .collect(),
        }
    }
}

impl<T> Drop for PutPort<T> {
    fn drop(&mut self) {
        if let Some(board) = &self.board {
            self.history.remove(board);
        }
        let links = links_of(self.number);
        let mut unseen = links
            .iter()
            .filter(|link| !link.is_seen && link.sent > 0)
            .peekable();
        if unseen.peek().is_none() {
            return;
        }
        for link in unseen {
            let parcel = self.unread(link);
            // Without memory these packets are lost, as all those of a killed client.
            let _ = self.kept.keep(parcel, self.config.total_put_ports());
        }
        self.wake_event.note_kept();
        self.wake_event.notify();
        self.crowd.notify_sleepers();
    }
}

/// Returns the time of the host's monotonic clock, in nanoseconds.
pub fn now_ns() -> u64 {
    let mut time = MaybeUninit::<libc::timespec>::uninit();
    // SAFETY: the clock exists on every Linux and fills in the time.
    let time = unsafe {
        libc::clock_gettime(libc::CLOCK_MONOTONIC, time.as_mut_ptr());
        time.assume_init()
    };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Returns the number of a port in headers.
pub(crate) fn short(number: u128) -> u64 {
    (number ^ (number >> 64)) as u64
}

fn is_full(error: &PublisherCreateError) -> bool {
    *error == PublisherCreateError::ExceedsMaxSupportedPublishers
}
