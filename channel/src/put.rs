//! Putting packets into a channel.

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
#[derive(Debug)]
pub struct PutPort<T> {
    id: ChannelId,
    config: ChannelConfig,
    publisher: AnyPublisher,
    wake_event: Arc<WakeEvent>,
    crowd: Arc<WakeEvent>,
    sender: u64,
    priority: Priority,
    /// Items of this port in one of the channel's.
    unit: usize,
    next: Mutex<u64>,
    /// Address and blocks of slots that were zeroed, in the process domain.
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
        let full = || ChannelError::TooManyPorts {
            id,
            side: "put",
            most: config.put_ports,
        };
        let slots = config.slots();
        let failed = FailedConnections::default();
        let no_memory = || {
            let free = files.as_ref().map_or(0, |(folder, _)| free_memory(folder));
            memory_error(id, &config, free)
        };
        macro_rules! publisher {
            ($channel:expr) => {{
                let is_full = |error: &PublisherCreateError| {
                    *error == PublisherCreateError::ExceedsMaxSupportedPublishers
                };
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
                .map_err(|error| match error {
                    PublisherCreateError::ExceedsMaxSupportedPublishers => full(),
                    PublisherCreateError::UnableToCreateDataSegment => no_memory(),
                    error => ChannelError::transport(id, error),
                })?
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

    /// The channel.
    pub fn id(&self) -> ChannelId {
        self.id
    }

    /// Returns how many get-ports could not be connected to, because descriptors or shared memory were short. Packets do not get there.
    pub fn failed_connections(&self) -> u64 {
        self.failed.count()
    }

    /// Tries again to connect to get-ports that could not be connected to.
    ///
    /// # Errors
    /// Descriptors are still short, or no further get-port fits: for a moment, one is needed.
    pub fn retry_connections(&self, bus: &Bus) -> Result<(), ChannelError> {
        // All sides of a channel are looked through when one comes or goes.
        let passer_by = bus.get_port::<T>(self.id, Start::Now)?;
        self.failed.forget();
        drop(passer_by);
        self.update_connections()
    }

    /// Shared memory that it takes, bytes.
    pub fn memory_bytes(&self) -> u64 {
        self.config.put_port_bytes()
    }

    /// A free packet of `items` items, to be written in place. Its content is what a former packet left.
    ///
    /// # Errors
    /// More items than the channel's packets hold; too many packets on loan.
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
                // SAFETY: the memory is from the heap; all of it was zeroed when this slot was loaned first with so many blocks.
                Either::Process(unsafe { sample.assume_init() })
            }
            Either::Host(publisher) => {
                let sample = publisher.loan_slice_uninit(blocks).map_err(failed)?;
                // SAFETY: the pages of a new file are zero, and every bit pattern is a block.
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

    /// Sends a packet: it is no longer the sender's, and getters see it where it is.
    ///
    /// Returns the number of get-ports that have it in their ring.
    ///
    /// # Errors
    /// A packet of another port; the transport has broken down.
    pub fn put(&self, loan: Loan<T>) -> Result<usize, ChannelError> {
        // Numbers and packets in one order, whatever thread puts them.
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

    /// Zeroes a slot of the process's heap before it is seen for the first time.
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

    /// Sends a packet with the header of another sender, as the hub does with those of other hosts.
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

    /// Sends a copy of `items`: a loan and a put.
    ///
    /// # Errors
    /// As [`PutPort::loan`] and [`PutPort::put`].
    pub fn put_copy(&self, items: &[T]) -> Result<usize, ChannelError> {
        let mut loan = self.loan(items.len())?;
        loan.copy_from_slice(items);
        self.put(loan)
    }

    /// Maps the memory of getters that came since the last packet, at a time of the caller's choice; else the next put does it, which then allocates.
    /// Without new getters it costs next to nothing.
    ///
    /// # Errors
    /// The transport has broken down.
    pub fn update_connections(&self) -> Result<(), ChannelError> {
        both!(&self.publisher, publisher => publisher.update_connections())
            .map_err(|error| ChannelError::transport(self.id, error))
    }

    /// Puts its history again for getters that came since the last packet, which a put does, too.
    ///
    /// # Errors
    /// The transport has broken down.
    pub fn send_history(&self) -> Result<(), ChannelError> {
        self.update_connections()?;
        self.wake_event.notify();
        self.crowd.notify_sleepers();
        Ok(())
    }
}

/// A packet that is being written: a slice of items in shared memory. Dropped, it goes back unsent.
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
        // SAFETY: as above; nobody else has the packet before it is put.
        unsafe { std::slice::from_raw_parts_mut(first.cast::<T>(), self.items) }
    }
}

/// Nanoseconds of the host's monotonic clock.
pub fn now_ns() -> u64 {
    let mut time = MaybeUninit::<libc::timespec>::uninit();
    // SAFETY: the clock exists on every Linux and fills in the time.
    let time = unsafe {
        libc::clock_gettime(libc::CLOCK_MONOTONIC, time.as_mut_ptr());
        time.assume_init()
    };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Fills the files of a new put-port with pages, so that full memory is an error now and no signal at some later packet.
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
        "its memory is not where it was expected",
    ))
}

fn memory_error(id: ChannelId, config: &ChannelConfig, free: u64) -> ChannelError {
    ChannelError::Memory {
        id,
        needed: config.put_port_bytes(),
        free,
    }
}
