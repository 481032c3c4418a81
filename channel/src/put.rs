//! Port that puts packets into a channel.

use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::ops::{Deref, DerefMut};
use std::path::Path;
use std::sync::Arc;

use iceoryx2::port::LoanError;
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::BackpressureStrategy;
use parking_lot::Mutex;

use crate::bus::Opened;
use crate::create_port::{Side, create_port};
use crate::failed_connections::FailedConnections;
use crate::memory_folder::free_memory;
use crate::packet::{Block, blocks};
use crate::transport::{AnyLoan, AnyPublisher, Either, both};
use crate::wake_event::{WakeEvent, reserve};
use crate::{Bus, ChannelConfig, ChannelError, ChannelId, Header, Packet, Priority, Start};

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
    sender: u64,
    priority: Priority,
    /// Number of this port's items in one item of the channel.
    unit: usize,
    next: Mutex<u64>,
    /// Address and number of blocks of every slot that was zeroed; used in the process domain only.
    zeroed: Mutex<Vec<(usize, usize)>>,
    failed: FailedConnections,
    packet: PhantomData<fn(T)>,
}

impl<T: Packet> PutPort<T> {
    pub(crate) fn open(opened: Opened, priority: Priority) -> Result<Self, ChannelError> {
        let Opened {
            id,
            config,
            channel,
            wake_event,
            crowd,
            files,
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
        let error = |error| {
            let free = || files.as_ref().map_or(0, |(folder, _)| free_memory(folder));
            creation_error(id, &config, error, free)
        };
        macro_rules! publisher {
            ($channel:expr) => {{
                create_port($channel, Side::Put, is_full, || {
                    $channel
                        .publisher_builder()
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
        if let Some((folder, prefix)) = &files {
            reserve_segment(folder, prefix, number, id, &config)?;
        }
        Ok(Self {
            id,
            publisher,
            wake_event,
            crowd,
            sender: (number ^ (number >> 64)) as u64,
            priority,
            unit: unit / size_of::<T>().min(unit),
            next: Mutex::new(0),
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
            packet: PhantomData,
        })
    }

    /// Sends a packet without a copy. Returns the number of get-ports that have it in their ring.
    ///
    /// # Errors
    /// The packet was loaned from another port; the transport has failed.
    pub fn put(&self, loan: Loan<T>) -> Result<usize, ChannelError> {
        // The lock keeps sequence numbers and packets in the same order for all threads.
        let mut next = self.next.lock();
        let header = Header {
            sender: self.sender,
            sequence: *next,
            put_ns: now_ns(),
            bytes: (loan.items * size_of::<T>()) as u64,
            priority: self.priority as u8,
            ..Header::default()
        };
        let getters = self.put_as(loan, header)?;
        *next += 1;
        Ok(getters)
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
    pub(crate) fn put_as(&self, mut loan: Loan<T>, header: Header) -> Result<usize, ChannelError> {
        if loan.sender != self.sender {
            return Err(ChannelError::transport(
                self.id,
                "the packet was loaned from another port",
            ));
        }
        both!(&mut loan.sample, sample => *sample.user_header_mut() = header);
        let getters = both!(loan.sample, sample => sample.send())
            .map_err(|error| ChannelError::transport(self.id, error))?;
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

    /// Sends the history to new get-ports now. Otherwise the next put does so.
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

/// A packet that is being written: a slice of items in shared memory. If dropped, it is not sent.
#[derive(Debug)]
pub struct Loan<T> {
    sample: AnyLoan,
    items: usize,
    sender: u64,
    packet: PhantomData<T>,
}

impl<T: Packet> Deref for Loan<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        let first = both!(&self.sample, sample => sample.payload().as_ptr());
        // SAFETY: the blocks hold at least `items` items, are aligned to 64 bytes, and every bit pattern is a `T`.
        unsafe { std::slice::from_raw_parts(first.cast::<T>(), self.items) }
    }
}

impl<T: Packet> DerefMut for Loan<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        let first = both!(&mut self.sample, sample => sample.payload_mut().as_mut_ptr());
        // SAFETY: as above; the packet has a single owner until it is put.
        unsafe { std::slice::from_raw_parts_mut(first.cast::<T>(), self.items) }
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

/// Allocates all pages of a new put-port's files, so that a lack of memory is an error now and not a signal later.
fn reserve_segment(
    folder: &Path,
    prefix: &str,
    number: u128,
    id: ChannelId,
    config: &ChannelConfig,
) -> Result<(), ChannelError> {
    let failed = |source| ChannelError::Io {
        path: folder.into(),
        action: "reserve memory",
        source,
    };
    let number = number.to_string();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        let name = name.to_string_lossy();
        if !name.starts_with(prefix) || !name.contains(&number) || !name.ends_with(".data") {
            continue;
        }
        let file = std::fs::OpenOptions::new()
            .read(true)
            .write(true)
            .open(folder.join(&*name))
            .map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        return match reserve(&file, length) {
            Err(error) if error.raw_os_error() == Some(libc::ENOSPC) => {
                Err(memory_error(id, config, free_memory(folder)))
            }
            outcome => outcome.map_err(failed),
        };
    }
    Err(ChannelError::transport(
        id,
        "no file with its memory in the folder of the bus",
    ))
}

fn is_full(error: &PublisherCreateError) -> bool {
    *error == PublisherCreateError::ExceedsMaxSupportedPublishers
}

fn creation_error(
    id: ChannelId,
    config: &ChannelConfig,
    error: PublisherCreateError,
    free: impl Fn() -> u64,
) -> ChannelError {
    match error {
        PublisherCreateError::ExceedsMaxSupportedPublishers => ChannelError::TooManyPorts {
            id,
            side: "put",
            most: config.put_ports,
        },
        PublisherCreateError::UnableToCreateDataSegment => memory_error(id, config, free()),
        error => ChannelError::transport(id, error),
    }
}

fn memory_error(id: ChannelId, config: &ChannelConfig, free: u64) -> ChannelError {
    ChannelError::Memory {
        id,
        needed: config.put_port_bytes(),
        free,
    }
}
